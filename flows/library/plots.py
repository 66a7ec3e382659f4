"""Results drawn into matplotlib's axes."""

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from aerodb.errors import UnknownNameError, nearest
from aerodb.flows.library.views import Data, Values
from aerodb.report import for_people
from aerodb.support import half_interval

#: Quantities of a coefficient axis that are drawn, those that there are.
_ON_AXES = ("measured", "predicted", "coefficient")


def draw(data: Data, title: str, names: Sequence[str], ax: Axes | None) -> Axes:
    """Draw quantities (n,) of a result, in display units; see `Result.plot`."""
    panel = plt.subplots()[1] if ax is None else ax
    index = data.coordinates[data.index]
    if index.values.dtype == object:
        _estimates(panel, data, names)
    else:
        _lines(panel, data, index, names)
    if not panel.get_title():
        panel.set_title(title)
    return panel


def _lines(panel: Axes, data: Data, index: Values, names: Sequence[str]) -> None:
    axes = list(data.coordinates["axis"].values) if "axis" in data.coordinates else []
    over = [name for name, each in data.quantities.items() if each.dims == (data.index,)]
    known = [*axes, *over]
    factor, unit = for_people(index.unit)
    units = []
    for name in names or known[:1]:
        if name not in known:
            raise UnknownNameError(f"no '{name}' to plot", data.index, nearest(name, known))
        if name in axes:
            row = axes.index(name)
            shown = {
                f"{name} {quantity}": data.quantities[quantity].values[row]
                for quantity in _ON_AXES
                if quantity in data.quantities
            }
            scale, label = 1.0, "-"
        else:
            scale, label = for_people(data.quantities[name].unit)
            shown = {name: data.quantities[name].values}
        units.append(label)
        for text, values in shown.items():
            panel.plot(factor * index.values, scale * np.asarray(values, float), label=text)
    panel.set_xlabel(f"{data.index} [{unit}]")
    panel.set_ylabel(f"[{', '.join(dict.fromkeys(units))}]")
    panel.legend()


def _estimates(panel: Axes, data: Data, names: Sequence[str]) -> None:
    """Values with their 95 % intervals, one below the other."""
    labels = [str(label) for label in data.coordinates[data.index].values]
    for name in names:
        if name not in labels:
            raise UnknownNameError(f"no '{name}' to plot", data.index, nearest(name, labels))
    chosen = [labels.index(name) for name in names] if names else list(range(len(labels)))
    shown = "value" if "value" in data.quantities else "rms_error"
    value = _numbers(data, shown)[chosen]
    low = high = value
    if "low" in data.quantities:
        low, high = _numbers(data, "low")[chosen], _numbers(data, "high")[chosen]
    elif "standard_error" in data.quantities:
        half = half_interval(_numbers(data, "standard_error")[chosen])
        low, high = value - half, value + half
    place = np.arange(len(chosen))
    panel.errorbar(value, place, xerr=np.abs([value - low, high - value]), fmt="o", capsize=3)
    units = [str(data.quantities["unit"].values[k]) for k in chosen]
    panel.set_yticks(
        place.tolist(), [f"{labels[k]} [{unit}]" for k, unit in zip(chosen, units, strict=True)]
    )
    panel.invert_yaxis()
    panel.axvline(0.0, color="0.6", lw=0.8)
    panel.set_xlabel("value and 95 % interval" if shown == "value" else "rms error")


def _numbers(data: Data, name: str) -> NDArray[np.float64]:
    return np.asarray(data.quantities[name].values, dtype=np.float64)
