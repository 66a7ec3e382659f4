"""Elements of JSBSim's XML that exports consist of, including tables.

JSBSim's own tables are linear between breakpoints and hold their end values. They look up
properties, and have at least two breakpoints per axis and at most three dimensions (a fourth came
only with version 1.3). Everything else is composed of them exactly: further dimensions are nested
interpolations, a step in an argument is a sum of comparisons, and extrapolation adds the slope of
the last cell times the distance beyond it.
"""

import re
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from lxml import etree

from aerodb.exchange.jsbsim.table import LOOKUPS
from aerodb.support import Array

Element = Any  # lxml has no public name for its element type
_DIMENSIONS: Final = 3
_UNWRITABLE: Final = re.compile("[^\\t\\n\\x20-\\ud7ff\\ue000-\\ufffd\\U00010000-\\U0010ffff]")


def node(tag: str, *children: Element, text: str = "", **attributes: str) -> Element:
    """Return an element with children, text and attributes."""
    element = etree.Element(tag, **attributes)
    element.text = clean(text) or None
    element.extend(children)
    return element


def value(x: float) -> Element:
    """Return a ``<value>`` that reads back as exactly the scalar `x`, in JSBSim's unit."""
    return node("value", text=repr(float(x)))


def prop(path: str) -> Element:
    """Return a ``<property>``."""
    return node("property", text=path)


def function(name: str, operation: Element, description: str) -> Element:
    """Return a ``<function>`` of one operation."""
    parts = [node("description", text=description)] if description else []
    return node("function", *parts, operation, name=name)


def total(parts: list[Element]) -> Element:
    """Return the sum of any number of elements; JSBSim warns about a sum of one."""
    if len(parts) < 2:
        return parts[0] if parts else value(0.0)
    return node("sum", *parts)


def clean(text: str) -> str:
    """Return `text` with a question mark for every character that XML cannot hold."""
    return _UNWRITABLE.sub("?", text)


@dataclass(frozen=True)
class Axis:
    """One axis of a table.

    path : property looked up. breakpoints : (n,). interpolation, extrapolation : as in `Table`.
    """

    path: str
    breakpoints: Array
    interpolation: str = "linear"
    extrapolation: str = "neither"


def snapped_argument(axis: Axis) -> Element:
    """Return the breakpoint that represents an argument on an axis (n,) that is not linear:
    ``discrete``, ``floor`` or ``ceiling``; KeyError for another."""
    points = axis.breakpoints
    test, thresholds = {
        "discrete": ("ge", (points[:-1] + points[1:]) / 2),
        "floor": ("ge", points[1:]),
        "ceiling": ("gt", points[:-1]),
    }[axis.interpolation]
    steps = [
        node("product", value(width), node(test, prop(axis.path), value(threshold)))
        for width, threshold in zip(np.diff(points), thresholds, strict=True)
    ]
    return node("sum", value(points[0]), *steps)


def table(axes: list[Axis], values: Array) -> Element:
    """Return a table over `axes`, all linear and with two or more breakpoints each. values : in the
    axes' shape, dimensionless or in JSBSim's units."""
    for k, axis in enumerate(axes):
        if axis.extrapolation != "neither":
            held = [*axes[:k], replace(axis, extrapolation="neither"), *axes[k + 1 :]]
            rest = axes[:k] + axes[k + 1 :]
            beyond = [
                node(
                    "product",
                    _distance(axis, side),
                    table(rest, _slope(axis.breakpoints, values, k, side)),
                )
                for side in ("min", "max")
                if axis.extrapolation in (side, "both")
            ]
            return node("sum", table(held, values), *beyond)
    if not axes:
        return value(float(values))
    if len(axes) <= _DIMENSIONS:
        return _inline(axes, values)
    pairs: list[Element] = []
    for k, level in enumerate(axes[-1].breakpoints):
        pairs += [value(level), table(axes[:-1], values[..., k])]
    return node("interpolate1d", prop(axes[-1].path), *pairs)


def _distance(axis: Axis, side: str) -> Element:
    """Distance of the argument beyond one end of an axis; zero inside."""
    end = value(axis.breakpoints[0 if side == "min" else -1])
    return node(
        "difference",
        node(side, prop(axis.path), end),
        value(axis.breakpoints[0 if side == "min" else -1]),
    )


def _slope(points: Array, values: Array, k: int, side: str) -> Array:
    """Slope along axis `k` in the first or the last cell."""
    low, high = (0, 1) if side == "min" else (-2, -1)
    rise = np.take(values, high, axis=k) - np.take(values, low, axis=k)
    return np.asarray(rise / (points[high] - points[low]), dtype=np.float64)


def _inline(axes: list[Axis], values: Array) -> Element:
    lookups = [
        node("independentVar", text=axis.path, lookup=lookup)
        for axis, lookup in zip(axes, LOOKUPS, strict=False)
    ]
    points = [axis.breakpoints for axis in axes]
    if len(axes) == 1:
        data = [node("tableData", text=_lines(np.column_stack([points[0], values])))]
    elif len(axes) == 2:
        data = [node("tableData", text=_plane(points, values))]
    else:
        planes = [_plane(points, values[..., k]) for k in range(points[2].size)]
        data = [
            node("tableData", text=plane, breakPoint=repr(float(x)))
            for x, plane in zip(points[2], planes, strict=True)
        ]
    return node("table", *lookups, *data)


def _plane(points: list[Array], values: Array) -> str:
    header = " ".join(repr(float(x)) for x in points[1])
    return f"\n {header}{_lines(np.column_stack([points[0], values]))}"


def _lines(rows: Array) -> str:
    return "\n" + "\n".join(" ".join(repr(x) for x in row) for row in rows.tolist()) + "\n"
