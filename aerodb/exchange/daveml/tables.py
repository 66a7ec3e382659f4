"""Read DAVE-ML tables: breakpoints, gridded and ungridded tables, point lists, uncertainties."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from aerodb.errors import InputError
from aerodb.exchange.xml_elements import (
    children,
    choice,
    find,
    number,
    numbers,
    own_text,
    plain,
    required,
    tag,
    unsupported,
)
from aerodb.support import Array
from aerodb.tables import EFFECTS, EXTRAPOLATIONS, Bound, Call, Expression, Uncertainty
from aerodb.tables import number as constant

#: Elements that say something about a table or a variable and change no value; the confidence bound
#: of DAVE-ML 1 is one of them.
METADATA: Final = ("description", "provenance", "provenanceRef", "confidenceBound")
_INTERPOLATIONS: Final = ("linear", "discrete", "floor", "ceiling")
_SPLINES: Final = ("quadraticSpline", "cubicSpline")


@dataclass(frozen=True, eq=False)
class Grid:
    """A gridded table: breakpoints per argument, and values with the last argument fastest."""

    breakpoints: tuple[Array, ...]
    values: Array
    uncertainty: Uncertainty | None = None
    note: str = ""


@dataclass(frozen=True, eq=False)
class UngriddedTable:
    """An ungridded table: points (m, N) and values (m,)."""

    points: Array
    values: Array
    uncertainty: Uncertainty | None = None
    note: str = ""


@dataclass(frozen=True)
class Argument:
    """One input of a function: its interpolation, extrapolation and limits."""

    identity: str
    interpolation: str = "linear"
    extrapolation: str = "neither"
    low: float = -math.inf
    high: float = math.inf

    def limited(self, value: Expression, first: float, last: float) -> Expression:
        """Return the input within its stated limits.

        A limit is dropped where the table already holds its value at `first` or `last`, its ends.

        All are in the unit of the file.
        """
        low = self.low if self.low > first or self.extrapolation in ("min", "both") else -math.inf
        high = self.high if self.high < last or self.extrapolation in ("max", "both") else math.inf
        return limited(value, low, high)


def limited(value: Expression, low: float, high: float) -> Expression:
    """Return `value` limited to `low` and `high`, either of which may be infinite; scalars in the
    unit of `value`."""
    if math.isfinite(low) and math.isfinite(high):
        return Call("clip", (value, constant(low), constant(high)))
    if math.isfinite(low):
        return Call("max", (value, constant(low)))
    return Call("min", (value, constant(high))) if math.isfinite(high) else value


def read_argument(element: Any, where: str) -> Argument:
    """Return the argument of an ``independentVarRef`` or ``independentVarPts``.

    Raises InputError for splines.
    """
    interpolation = (element.get("interpolate") or "linear").strip()
    if interpolation in _SPLINES:
        raise InputError(
            f"unsupported interpolate='{interpolation}'",
            where,
            "the standard does not define a spline's end conditions",
        )
    limits = [element.get(name) for name in ("min", "max")]
    low, high = (
        number(text, where) if text else end
        for text, end in zip(limits, (-math.inf, math.inf), strict=True)
    )
    if low > high:
        raise InputError(f"min {low:g} exceeds max {high:g}", where)
    words = (
        choice(element, "interpolate", _INTERPOLATIONS, where),
        choice(element, "extrapolate", EXTRAPOLATIONS, where),
    )
    return Argument(required(element, "varID", where), *words, low, high)


def read_breakpoints(element: Any, where: str) -> Array:
    """Return the values of a ``breakpointDef``.

    Returns (n,), in the unit of the file. Raises InputError unless there is one ``bpVals``.
    """
    inner = [child for child in children(element) if tag(child) not in METADATA]
    if len(inner) != 1 or tag(inner[0]) != "bpVals":
        raise InputError("<breakpointDef> without one <bpVals>", where)
    return numbers(inner[0], where)


class TableReader:
    """Reader of the tables of one file.

    breakpoints : by id. refer : returns the name of a variable by its id. declare_inner : adds a
    variableDef and returns its name.
    """

    def __init__(
        self,
        breakpoints: dict[str, Array],
        refer: Callable[[str], str],
        declare_inner: Callable[[Any], str],
    ) -> None:
        self._breakpoints, self._refer, self._declare_inner = breakpoints, refer, declare_inner

    def gridded(self, element: Any, where: str) -> Grid:
        """Return the table of a ``griddedTableDef`` or ``griddedTable``.

        Raises InputError for an unknown element, and without breakpoints or data.
        """
        inner = {tag(child): child for child in children(element)}
        for name, child in inner.items():
            if name not in (*METADATA, "breakpointRefs", "uncertainty", "dataTable"):
                raise unsupported(child, f"<{tag(element)}>", where)
        if "breakpointRefs" not in inner or "dataTable" not in inner:
            raise InputError("a gridded table without <breakpointRefs> or <dataTable>", where)
        axes = []
        for reference in children(inner["breakpointRefs"]):
            name = required(reference, "bpID", where)
            if name not in self._breakpoints:
                raise InputError(f"no breakpointDef '{name}'", where)
            axes.append(self._breakpoints[name])
        values = numbers(inner["dataTable"], where)
        shape = tuple(axis.size for axis in axes)
        if values.size != math.prod(shape):
            raise InputError(
                f"{values.size} numbers in <dataTable>, the breakpoints need {math.prod(shape)}",
                where,
            )
        return Grid(
            tuple(axes),
            values.reshape(shape),
            self.uncertainty(inner.get("uncertainty"), where),
            plain(find(element, *METADATA)),
        )

    def ungridded(self, element: Any, where: str) -> UngriddedTable:
        """Return the table of an ``ungriddedTableDef`` or ``ungriddedTable``.

        Each data point is its coordinates, then the value: points (n, k), values (n,). Raises
        InputError for points of different lengths.
        """
        rows = []
        for child in children(element):
            if tag(child) == "dataPoint":
                rows.append(numbers(child, where))
            elif tag(child) not in (*METADATA, "uncertainty"):
                raise unsupported(child, f"<{tag(element)}>", where)
        if not rows or len({row.size for row in rows}) != 1 or rows[0].size < 2:
            raise InputError("no data points, or data points of different lengths", where)
        table = np.stack(rows)
        uncertainty = self.uncertainty(find(element, "uncertainty"), where)
        return UngriddedTable(
            table[:, :-1], table[:, -1], uncertainty, plain(find(element, *METADATA))
        )

    def uncertainty(self, element: Any, where: str) -> Uncertainty | None:
        """Return the uncertainty of an ``uncertainty`` element; None for no element.

        Raises InputError unless it holds one distribution.
        """
        if element is None:
            return None
        inner = [child for child in children(element) if tag(child) not in METADATA]
        if len(inner) != 1 or tag(inner[0]) not in ("normalPDF", "uniformPDF"):
            raise InputError("<uncertainty> without one of <normalPDF>, <uniformPDF>", where)
        distribution = inner[0]
        bounds: list[Bound] = []
        dependents: list[str] = []
        correlations: list[tuple[str, float]] = []
        for child in children(distribution):
            if tag(child) == "bounds":
                bounds.append(self._bound(child, where))
            elif tag(child) == "correlatesWith":
                dependents.append(self._refer(required(child, "varID", where)))
            elif tag(child) == "correlation":
                coefficient = number(required(child, "corrCoef", where), where)
                correlations.append((self._refer(required(child, "varID", where)), coefficient))
            else:
                raise unsupported(child, f"<{tag(distribution)}>", where)
        normal = tag(distribution) == "normalPDF"
        sigmas = number(distribution.get("numSigmas") or "1", where) if normal else 1.0
        effect = choice(element, "effect", EFFECTS, where)
        if (
            not normal
            and choice(distribution, "symmetric", ("yes", "no"), where) == "no"
            and len(bounds) == 1
        ):
            raise InputError("an asymmetric <uniformPDF> with one bound", where)
        try:
            kind = "normal" if normal else "uniform"
            return Uncertainty(
                effect, kind, tuple(bounds), sigmas, tuple(dependents), tuple(correlations)
            )
        except InputError as error:
            raise InputError(error.what, where, error.remedy) from None

    def _bound(self, element: Any, where: str) -> Bound:
        inner = next(children(element), None)
        if inner is None:
            return number(own_text(element), where)
        if tag(inner) == "variableRef":
            return self._refer(required(inner, "varID", where))
        if tag(inner) == "variableDef":
            return self._declare_inner(inner)
        if tag(inner) == "dataTable":
            return tuple(numbers(inner, where).tolist())
        raise unsupported(inner, "<bounds>", where)


@dataclass(frozen=True)
class PointLists:
    """A function of point lists: arguments, table, and the id of the variable that it defines."""

    arguments: list[Argument]
    table: Grid
    dependent: str


def read_point_lists(element: Any, where: str) -> PointLists:
    """Read a function that is written as lists of points: axes (n,) each, values in their product's
    shape. Raises InputError where the numbers do not fit."""
    arguments, axes = [], []
    dependent = None
    for child in children(element):
        if tag(child) == "independentVarPts":
            arguments.append(read_argument(child, where))
            axes.append(numbers(child, where))
        elif tag(child) == "dependentVarPts" and dependent is None:
            dependent = child
        elif tag(child) not in METADATA:
            raise unsupported(child, "<function> of point lists", where)
    if dependent is None or not axes:
        raise InputError("point lists need both independentVarPts and dependentVarPts", where)
    values = numbers(dependent, where)
    shape = tuple(axis.size for axis in axes)
    if values.size != math.prod(shape):
        raise InputError(
            f"{values.size} numbers in <dependentVarPts>, the breakpoints need {math.prod(shape)}",
            where,
        )
    table = Grid(tuple(axes), values.reshape(shape))
    return PointLists(arguments, table, required(dependent, "varID", where))
