"""Tables on rectangular grids: linear between breakpoints and held outside them, unless another
interpolation or extrapolation is given for an axis.

Multilinear interpolation is linear in the node values, ``C = A @ values``, with the sparse matrix A
of interpolation weights (`basis`). A is the regressor matrix for increments on the table's own
breakpoints, and its column sums (`coverage`) show which nodes the samples touch.
"""

import itertools
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from aerodb.errors import InputError, UnknownNameError, nearest
from aerodb.support import Array, Mask
from aerodb.tables.expression import check_identifier
from aerodb.tables.uncertainty import Uncertainty, check_bounds

if TYPE_CHECKING:
    from scipy.sparse import csr_array


MAX_DIMENSIONS = 12

#: Between two breakpoints: linear; or the value at the nearer one (midway: the upper), at the
#: lower, at the upper.
INTERPOLATIONS: Final = ("linear", "discrete", "floor", "ceiling")
#: The ends of an axis where it is extrapolated linearly from the last cell instead of held.
EXTRAPOLATIONS: Final = ("neither", "min", "max", "both")


class Lookup(NamedTuple):
    """Interpolated values (n,), which points lie outside the breakpoints (n,), and whether any
    lies outside."""

    values: Array
    outside: Mask
    beyond: bool


class _Cell(NamedTuple):
    """Cells of points along one axis: lower node, upper node, weight of the upper node, and its
    derivative [1/argument]; each (n,)."""

    low: NDArray[np.int64]
    high: NDArray[np.int64]
    weight: Array
    slope: Array


@dataclass(frozen=True, eq=False)
class Table:
    """An N-dimensional table on a rectangular grid, 1 <= N <= 12.

    Parameters
    ----------
    arguments : labels of the axes.
    breakpoints : one strictly increasing array per axis, in the unit of that argument. An axis of
        one breakpoint is constant.
    values : as many axes as `breakpoints`, the last varying fastest.
    interpolation, extrapolation : one word per axis from `INTERPOLATIONS` and `EXTRAPOLATIONS`;
        empty: all linear, all held.
    uncertainty : declared by the source; None where there is none.
    extent : per axis (low, high) beyond which a point is outside, None for an axis without limits;
        empty where that is the range of the breakpoints. A table into which increments were folded
        has breakpoints beyond its own data.

    Raises InputError for breakpoints that do not increase, shapes that do not match, and numbers
    that are not finite.
    """

    name: str
    arguments: tuple[str, ...]
    breakpoints: tuple[Array, ...]
    values: Array
    interpolation: tuple[str, ...] = ()
    extrapolation: tuple[str, ...] = ()
    uncertainty: Uncertainty | None = None
    extent: tuple[tuple[float, float] | None, ...] = ()

    def __post_init__(self) -> None:
        check_identifier(self.name)
        where = f"table {self.name}"
        # Adding zero turns -0 into 0. Canonical JSON does not distinguish them, so that hashes
        # would differ after storing.
        axes = tuple(np.array(axis, dtype=np.float64) + 0.0 for axis in self.breakpoints)
        values = np.array(self.values, dtype=np.float64, order="C") + 0.0
        if not 1 <= len(axes) <= MAX_DIMENSIONS or len(axes) != len(self.arguments):
            raise InputError(
                f"{len(self.arguments)} arguments for {len(axes)} breakpoint lists", where
            )
        for label, axis in zip(self.arguments, axes, strict=True):
            if axis.ndim != 1 or axis.size == 0 or not np.all(np.isfinite(axis)):
                raise InputError(f"breakpoints of {label} are not a list of finite numbers", where)
            falls = np.flatnonzero(np.diff(axis) <= 0)
            if falls.size:
                pair = f"{axis[falls[0]]:g} is followed by {axis[falls[0] + 1]:g}"
                raise InputError(
                    f"breakpoints of {label} do not increase: {pair}",
                    where,
                    "sort them, remove repetitions",
                )
        shape = tuple(axis.size for axis in axes)
        if values.shape != shape:
            raise InputError(f"values have shape {values.shape}, the breakpoints {shape}", where)
        if not np.all(np.isfinite(values)):
            raise InputError("values are not finite", where)
        for array in (*axes, values):
            array.flags.writeable = False
        object.__setattr__(self, "arguments", tuple(self.arguments))
        object.__setattr__(self, "breakpoints", axes)
        object.__setattr__(self, "values", values)
        if self.extent and len(self.extent) != len(axes):
            raise InputError(f"extent of {len(self.extent)} axes, the table has {len(axes)}", where)
        extent = tuple(
            None if bounds is None else (float(bounds[0]), float(bounds[1]))
            for bounds in self.extent
        )
        object.__setattr__(self, "extent", extent)
        check_bounds(self.uncertainty, values.size)
        for attribute, known in (
            ("interpolation", INTERPOLATIONS),
            ("extrapolation", EXTRAPOLATIONS),
        ):
            object.__setattr__(
                self, attribute, _words(getattr(self, attribute), known, len(axes), where)
            )
        for way, beyond in zip(self.interpolation, self.extrapolation, strict=False):
            if way != "linear" and beyond != "neither":
                raise InputError(
                    f"extrapolation of an axis that is {way}",
                    where,
                    "only a linear axis has a slope",
                )

    @cached_property
    def axes_packed(self) -> tuple[Array, NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
        """The axes in the form of the compiled loop: breakpoints, their starts, strides in nodes,
        modes.

        Breakpoints are (b,), in the units of the arguments; starts (N + 1,), strides and modes
        (N,).
        """
        starts = np.cumsum([0, *self.values.shape], dtype=np.int64)
        strides = np.array(self.values.strides, dtype=np.int64) // self.values.itemsize
        return np.concatenate(self.breakpoints), starts, strides, self.modes

    @cached_property
    def modes(self) -> NDArray[np.int64]:
        """Code (N,) of each axis for the compiled loop (`execute`): index of its interpolation plus
        4 times the index of its extrapolation."""
        modes = np.zeros(len(self.breakpoints), dtype=np.int64)
        for words, known, factor in (
            (self.interpolation, INTERPOLATIONS, 1),
            (self.extrapolation, EXTRAPOLATIONS, 4),
        ):
            for k, word in enumerate(words):
                modes[k] += factor * known.index(word)
        return modes

    def stacked(self, arguments: tuple[Any, ...]) -> Array:
        """Arguments, each (n,) or a number, as (N, n).

        Raises InputError unless there is one for each axis.
        """
        return stacked_arguments(self.name, len(self.breakpoints), arguments)

    def lookup(self, *arguments: Array | float) -> Lookup:
        """Values, and which points lie outside the breakpoints; arguments as in `evaluate`.

        Values are (n,).
        """
        from aerodb.tables import kernel  # imported here because it loads the compiler

        interpolate: Any = kernel.interpolate
        points = self.stacked(arguments)
        n = points.shape[1]
        values, outside = np.empty(n), np.empty(n, dtype=np.bool_)
        beyond = interpolate(*self.axes_packed, self._flat, points, values, outside) > 0
        if self.extent:
            outside = self._beyond_extent(points)
            beyond = bool(outside.any())
        return Lookup(values, outside, beyond)

    @cached_property
    def _flat(self) -> Array:
        return self.values.ravel()

    def _beyond_extent(self, points: Array) -> Mask:
        outside: Mask = np.asarray(np.isnan(points).any(axis=0), dtype=np.bool_)
        for bounds, x in zip(self.extent, points, strict=True):
            if bounds is not None:
                outside |= (x < bounds[0]) | (x > bounds[1])
        return outside

    def evaluate(self, *arguments: Array | float) -> Array:
        """Interpolated values (n,).

        arguments : one per axis, each (n,) or a number, in the unit of the breakpoints.
        """
        return self.lookup(*arguments).values

    def outside(self, *arguments: Array | float) -> Mask:
        """(n,) true where any argument lies outside its breakpoints or is NaN.

        Arguments are in the units of the breakpoints.
        """
        return self.lookup(*arguments).outside

    def basis(self, *arguments: Array | float) -> "csr_array[Any]":
        """Sparse interpolation weights A (n, values.size): ``evaluate(...) == A @ values.ravel()``.

        Raises InputError for arguments that are not finite.
        """
        return self._combine(self._cells(self.stacked(arguments)), None)

    def slope(self, argument: str, *arguments: Array | float) -> Array:
        """Exact derivative (n,) along the axis labelled `argument`; at a breakpoint that of the
        cell above, 0 outside.

        Raises UnknownNameError for an unknown label.
        """
        if argument not in self.arguments:
            raise UnknownNameError(
                f"no argument '{argument}'", f"table {self.name}", nearest(argument, self.arguments)
            )
        cells = self._cells(self.stacked(arguments))
        derivative = self._combine(cells, self.arguments.index(argument)) @ self.values.ravel()
        return np.asarray(derivative, dtype=np.float64)

    def _cells(self, points: Array) -> list[_Cell]:
        if not np.all(np.isfinite(points)):
            raise InputError(
                "arguments are not finite", f"table {self.name}", "leave out flagged samples"
            )
        return [
            _cell(axis, x, mode)
            for axis, x, mode in zip(self.breakpoints, points, self.modes.tolist(), strict=True)
        ]

    def _combine(self, cells: list[_Cell], derivative: int | None) -> "csr_array[Any]":
        """Products of the weights along every axis; along axis `derivative`, their derivatives."""
        # Imported here because it loads slowly and only regression needs it.
        from scipy.sparse import csr_array

        n = cells[0].low.size
        columns, data = [], []
        for corner in itertools.product((0, 1), repeat=len(cells)):
            index, product = np.zeros(n, dtype=np.int64), np.ones(n)
            for k, (upper, cell) in enumerate(zip(corner, cells, strict=True)):
                index = index * self.values.shape[k] + (cell.high if upper else cell.low)
                weight = cell.slope if k == derivative else cell.weight
                product = product * (
                    weight if upper else (0.0 if k == derivative else 1.0) - weight
                )
            columns.append(index)
            data.append(product)
        rows = np.arange(0, n * len(columns) + 1, len(columns))
        parts = (np.stack(data, axis=1).ravel(), np.stack(columns, axis=1).ravel(), rows)
        matrix = csr_array(parts, shape=(n, self.values.size))
        matrix.sum_duplicates()
        matrix.eliminate_zeros()
        return matrix


def _cell(axis: Array, x: Array, mode: int) -> _Cell:
    if axis.size == 1:
        nothing = np.zeros(x.size, dtype=np.int64)
        return _Cell(nothing, nothing, np.zeros(x.size), np.zeros(x.size))
    interpolation, extrapolation = INTERPOLATIONS[mode % 4], mode // 4
    low = np.clip(np.searchsorted(axis, x, side="right") - 1, 0, axis.size - 2)
    width = axis[low + 1] - axis[low]
    first = -np.inf if extrapolation & 1 else axis[0]
    last = np.inf if extrapolation & 2 else axis[-1]
    weight = (np.clip(x, first, last) - axis[low]) / width
    if interpolation == "linear":
        return _Cell(low, low + 1, weight, np.where((x >= first) & (x <= last), 1.0 / width, 0.0))
    upper = {"discrete": weight >= 0.5, "floor": weight >= 1.0, "ceiling": weight > 0.0}[
        interpolation
    ]
    return _Cell(low, low + 1, upper.astype(np.float64), np.zeros(x.size))


def _words(
    words: tuple[str, ...], known: tuple[str, ...], axes: int, where: str
) -> tuple[str, ...]:
    """Check one known word per axis; empty where all are the first of `known`, the default."""
    words = tuple(words)
    for word in words:
        if word not in known:
            raise InputError(f"'{word}'", where, nearest(word, known))
    if words and len(words) != axes:
        raise InputError(f"{len(words)} words ({', '.join(words)}) for {axes} axes", where)
    return words if any(word != known[0] for word in words) else ()


@dataclass(frozen=True, eq=False)
class TableGroup:
    """Tables with the same breakpoints and modes, interpolated together, so that each point is
    located once."""

    tables: tuple[Table, ...]

    @cached_property
    def _side_by_side(self) -> Array:
        return np.ascontiguousarray(
            np.stack([table.values.ravel() for table in self.tables], axis=1)
        )

    def lookup(self, *arguments: Array | float) -> Lookup:
        """Values and outside points as `Table.lookup`, with values (tables, n).

        Arguments are in the units of the breakpoints, each (n,) or a number.
        """
        from aerodb.tables import kernel

        interpolate: Any = kernel.interpolate_together
        first = self.tables[0]
        points = first.stacked(arguments)
        n = points.shape[1]
        values, outside = np.empty((len(self.tables), n)), np.empty(n, dtype=np.bool_)
        return Lookup(
            values,
            outside,
            interpolate(*first.axes_packed, self._side_by_side, points, values, outside) > 0,
        )


def stacked_arguments(name: str, wanted: int, arguments: tuple[Any, ...]) -> Array:
    """Stack arguments, each (n,) or a number, as (N, n); InputError unless there are `wanted` of
    them."""
    if len(arguments) != wanted:
        raise InputError(f"{len(arguments)} arguments, the table has {wanted}", f"table {name}")
    n = max(
        [
            argument.size
            for argument in arguments
            if isinstance(argument, np.ndarray) and argument.ndim
        ],
        default=1,
    )
    points = np.empty((wanted, n))
    for k, argument in enumerate(arguments):
        points[k] = argument
    return points
