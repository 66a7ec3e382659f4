"""Results as text, as HTML in a notebook, and as pandas and xarray objects."""

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from aerodb.errors import InputError
from aerodb.nomenclature import axis_description, channel

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr
    from matplotlib.axes import Axes


#: Most facts of a verdict.
_FACTS = 4


@dataclass(frozen=True)
class Summary:
    """What a result says of itself: facts (name, text), one table, and remarks of one sentence."""

    title: str
    facts: Sequence[tuple[str, str]] = ()
    header: Sequence[str] = ()
    rows: Sequence[Sequence[str]] = ()
    remarks: Sequence[str] = ()


@dataclass(frozen=True)
class Values:
    """One quantity of a result: `values` over `dims`, its unit and its meaning."""

    dims: tuple[str, ...]
    values: NDArray[Any]
    unit: str = "1"
    description: str = ""


@dataclass(frozen=True)
class Data:
    """The quantities of a result by name, over coordinates by name; `index` is the dimension that
    pandas takes as its rows."""

    index: str
    coordinates: Mapping[str, Values]
    quantities: Mapping[str, Values]
    attributes: Mapping[str, Any] = field(default_factory=dict)


class Result:
    """What all results share: `headlines` (what ``print`` shows), `report`, `plot`, `save`,
    `to_pandas`, `to_xarray`, and how a notebook shows them."""

    @abstractmethod
    def summary(self) -> Summary:
        """Return what the result says of itself."""

    @abstractmethod
    def data(self) -> Data:
        """Return its quantities, arrays (n,) or over two axes, with their units."""

    def report(self) -> str:
        """Return the result as text, with its numbers and what to know of them."""
        said = self.summary()
        lines = [f"[[{said.title}]]"]
        width = max((len(name) for name, _ in said.facts), default=0)
        lines += [f"    {name:<{width}}  {text}" for name, text in said.facts]
        if said.rows:
            table = [tuple(said.header), *map(tuple, said.rows)]
            widths = [max(len(row[k]) for row in table) for k in range(len(said.header))]
            lines += [
                "    " + "  ".join(f"{c:<{w}}" for c, w in zip(row, widths, strict=True)).rstrip()
                for row in table
            ]
        return "\n".join([*lines, *(f"    - {_line(remark)}" for remark in said.remarks)])

    def headlines(self) -> list[str]:
        """Return what to decide on, in a few lines; `report` has the rest, with units."""
        said = self.summary()
        width = max((len(name) for name, _ in said.facts), default=0)
        return [said.title, *(f"  {name:<{width}}  {text}" for name, text in said.facts[:_FACTS])]

    def __str__(self) -> str:
        lines = self.headlines()
        return "\n".join([*map(_line, lines), "  all of it: report(), plot(), to_pandas()"])

    def plot(self, *names: str, ax: "Axes | None" = None) -> "Axes":
        """Draw quantities into matplotlib's axes, and return them, in display units (degrees for
        radians).

        Over time or an input: `names` are channels or coefficient axes (``"CZ"``), the first one
        where none is named. Of estimates: those named, or all, each with its 95 % interval. ax :
        the axes; None: new ones of pyplot. UnknownNameError for a name that is not there.
        """
        from aerodb.flows.library.plots import draw  # imports matplotlib, which is slow

        return draw(self.data(), self.summary().title, names, ax)

    def save(self, path: str | Path) -> Path:
        """Write what the result says and its arrays to a file that `load_result` reads, and a
        candidate database with them; returns its path.

        Units are kept. Raises StoreError where the file cannot be written.
        """
        from aerodb.flows.library.saving import save_result

        return save_result(self, Path(path))

    def _repr_html_(self) -> str:
        """Return the result as a notebook shows it."""
        return html_of(self.summary())

    def to_pandas(self) -> "pd.DataFrame":
        """Return a DataFrame (n rows): one column (n,) per quantity, or per axis and quantity where
        a quantity is given on axes. Units are in ``attrs["units"]``."""
        import pandas as pd  # slow to import

        data = self.data()
        columns: dict[Any, NDArray[Any]] = {}
        wide = any(len(each.dims) > 1 for each in data.quantities.values())
        for name, each in data.quantities.items():
            if len(each.dims) == 1:
                columns[("", name) if wide else name] = each.values
                continue
            over = next(dim for dim in each.dims if dim != data.index)
            rows = np.moveaxis(each.values, each.dims.index(over), 0)
            for label, row in zip(data.coordinates[over].values, rows, strict=True):
                columns[(str(label), name)] = row
        index = pd.Index(data.coordinates[data.index].values, name=data.index)
        frame = pd.DataFrame(columns, index=index)
        if wide:
            frame.columns = pd.MultiIndex.from_tuples(list(columns), names=["axis", "quantity"])
        for name, each in data.coordinates.items():
            if name != data.index and each.dims == (data.index,):
                frame.insert(0, ("", name) if wide else name, each.values)
        for name, value in data.attributes.items():
            frame.attrs[name] = value
        frame.attrs["units"] = {name: each.unit for name, each in data.quantities.items()}
        return frame

    def to_xarray(self) -> "xr.Dataset":
        """Return a Dataset whose variables carry ``units`` and ``long_name``.

        Raises InputError where xarray is not installed.
        """
        try:
            import xarray as xr
        except ImportError as error:
            raise InputError(
                "xarray is not installed", "to_xarray", "pip install aerodb[xarray]"
            ) from error
        data = self.data()

        def variable(each: Values) -> tuple[Any, ...]:
            named = {"long_name": each.description} if each.description else {}
            return each.dims, each.values, {"units": each.unit, **named}

        return xr.Dataset(
            {name: variable(each) for name, each in data.quantities.items()},
            {name: variable(each) for name, each in data.coordinates.items()},
            dict(data.attributes),
        )


def html_of(said: Summary) -> str:
    """Return a summary as HTML; whatever a log or a file names is escaped."""
    parts = [f"<strong>{escape(said.title)}</strong>"]
    if said.facts:
        cells = "".join(
            f"<tr><th scope='row' style='text-align:left;vertical-align:top'>{escape(name)}"
            f"</th><td style='text-align:left;overflow-wrap:anywhere'>{escape(text)}</td></tr>"
            for name, text in said.facts
        )
        parts.append(f"<table>{cells}</table>")
    if said.rows:
        right = [_are_numbers(column) for column in zip(*said.rows, strict=True)]
        head = "".join(map(_head, said.header, right))
        body = "".join("<tr>" + "".join(map(_cell, row, right)) + "</tr>" for row in said.rows)
        parts.append(f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>")
    if said.remarks:
        items = "".join(f"<li>{escape(_line(each))}</li>" for each in said.remarks)
        parts.append(f"<ul>{items}</ul>")
    return "\n".join(parts)


def _head(text: str, right: bool) -> str:
    side = "right" if right else "left"
    return f"<th scope='col' style='text-align:{side};vertical-align:bottom'>{escape(text)}</th>"


def _cell(text: str, right: bool) -> str:
    """Return a cell; numbers are in one piece and end below one another."""
    style = "text-align:right;white-space:nowrap" if right else "text-align:left"
    return f"<td style='{style}'>{escape(text)}</td>"


def _line(text: str) -> str:
    """Return an error of several lines, which a remark quotes, as one."""
    return "; ".join(text.splitlines())


def _are_numbers(column: Sequence[str]) -> bool:
    try:
        return [float(text) for text in column if text != "-"] != []
    except ValueError:
        return False


def channel_values(names: Mapping[str, NDArray[Any]], prefix: str = "") -> dict[str, Values]:
    """Return canonical channels over time, with units and meanings of `aerodb.nomenclature`."""
    found = {}
    for name, values in names.items():
        known = channel(name)
        what = f"standard error of {known.description}" if prefix else known.description
        found[f"{prefix}{name}"] = Values(("time",), values, known.unit, what)
    return found


def over_axes(axes: Sequence[str], index: str, parts: Mapping[str, Any]) -> dict[str, Values]:
    """Return quantities over axis and `index`, of mappings axis -> (n,)."""
    return {
        name: Values(("axis", index), np.array([values[axis] for axis in axes]))
        for name, values in parts.items()
    }


def axis_coordinate(axes: Sequence[str]) -> Values:
    """Return the coordinate ``axis``."""
    meaning = "; ".join(f"{axis}: {axis_description(axis)}" for axis in axes)
    return Values(("axis",), np.array(axes, dtype=object), "", meaning)


def time_coordinate(time: NDArray[Any]) -> Values:
    """Return the coordinate ``time`` [s], on the log's clock."""
    return Values(("time",), time, "s", channel("time").description)


def shown_unit(unit: str) -> str:
    """Return a unit for people; a dash without dimension.

    >>> shown_unit("m/s^2"), shown_unit("1")
    ('m/s²', '-')
    """
    return "-" if unit in ("", "1") else unit.replace("^2", "²").replace("^3", "³")


def span(values: NDArray[Any]) -> tuple[str, str]:
    """Return the least and the greatest of finite values (n,), in their own unit, for people;
    dashes where there are none.

    >>> span(np.array([1.0, np.nan, 2.5]))
    ('1', '2.5')
    """
    finite = values[np.isfinite(values)]
    ends = (float(finite.min()), float(finite.max())) if finite.size else (None, None)
    return number(ends[0]), number(ends[1])


def number(value: float | None, digits: int = 4) -> str:
    """Return a number for people; a dash where there is none.

    >>> number(0.123456), number(None), number(float("nan"))
    ('0.1235', '-', '-')
    """
    return "-" if value is None or not np.isfinite(value) else f"{value:.{digits}g}"
