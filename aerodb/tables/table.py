"""A table: values on a rectangular grid, linear between breakpoints along each axis and held outside them.

Multilinear interpolation is linear in the node values, ``C = A @ values`` with the sparse hat basis A: `basis` is
the regressor for increments on the table's own breakpoints, and its column sums (`coverage`) say where a flight speaks.
"""

import itertools
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from aerodb.errors import InputError, UnknownNameError, nearest
from aerodb.tables.expression import check_identifier

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

MAX_DIMENSIONS = 12


class Lookup(NamedTuple):
    """Interpolated values (n,), which points lie outside the breakpoints (n,), and whether any does."""

    values: Array
    outside: Bools
    beyond: bool


class _Cell(NamedTuple):
    """Where points lie along one axis: lower node, upper node, weight of the upper, and its slope in 1/argument."""

    low: NDArray[np.int64]
    high: NDArray[np.int64]
    weight: Array
    slope: Array


@dataclass(frozen=True, eq=False)
class Table:
    """An N-D table, 1 <= N <= 12.

    arguments : labels of the axes. breakpoints : one strictly increasing array per axis, in the unit of that argument.
    values : as many axes as `breakpoints`, the last varying fastest. An axis of one breakpoint is constant.

    Raises InputError for breakpoints that do not increase, shapes that do not fit, and numbers that are not finite.
    """

    name: str
    arguments: tuple[str, ...]
    breakpoints: tuple[Array, ...]
    values: Array

    def __post_init__(self) -> None:
        check_identifier(self.name)
        where = f"table {self.name}"
        # Adding zero turns -0 into 0, which canonical JSON cannot tell apart: hashes would differ after storing.
        axes = tuple(np.array(axis, dtype=np.float64) + 0.0 for axis in self.breakpoints)
        values = np.array(self.values, dtype=np.float64, order="C") + 0.0
        if not 1 <= len(axes) <= MAX_DIMENSIONS or len(axes) != len(self.arguments):
            raise InputError(f"{len(self.arguments)} arguments for {len(axes)} breakpoint lists", where)
        for label, axis in zip(self.arguments, axes, strict=True):
            if axis.ndim != 1 or axis.size == 0 or not np.all(np.isfinite(axis)):
                raise InputError(f"breakpoints of {label} are not a list of finite numbers", where)
            falls = np.flatnonzero(np.diff(axis) <= 0)
            if falls.size:
                pair = f"{axis[falls[0]]:g} is followed by {axis[falls[0] + 1]:g}"
                raise InputError(f"breakpoints of {label} do not increase: {pair}", where, "sort them, remove repetitions")
        shape = tuple(axis.size for axis in axes)
        if values.shape != shape:
            raise InputError(f"values have shape {values.shape}, the breakpoints {shape}", where)
        if not np.all(np.isfinite(values)):
            raise InputError("values that are not finite", where)
        for array in (*axes, values):
            array.flags.writeable = False
        object.__setattr__(self, "arguments", tuple(self.arguments))
        object.__setattr__(self, "breakpoints", axes)
        object.__setattr__(self, "values", values)

    @cached_property
    def _packed(self) -> tuple[Array, NDArray[np.int64], NDArray[np.int64], Array]:
        starts = np.cumsum([0, *self.values.shape], dtype=np.int64)
        strides = np.array(self.values.strides, dtype=np.int64) // self.values.itemsize
        return np.concatenate(self.breakpoints), starts, strides, self.values.ravel()

    def _points(self, arguments: tuple[Any, ...]) -> Array:
        """Arguments, each (n,) or a number, as (N, n)."""
        if len(arguments) != len(self.breakpoints):
            raise InputError(f"{len(arguments)} arguments, the table has {len(self.breakpoints)}", f"table {self.name}")
        n = max([argument.size for argument in arguments if isinstance(argument, np.ndarray) and argument.ndim], default=1)
        points = np.empty((len(arguments), n))
        for k, argument in enumerate(arguments):
            points[k] = argument
        return points

    def lookup(self, *arguments: Array | float) -> Lookup:
        """Values and which points lie outside the breakpoints; arguments as in `evaluate`."""
        from aerodb.tables.kernel import interpolate  # loads the compiler: not before a table is needed

        points = self._points(arguments)
        n = points.shape[1]
        values, outside = np.empty(n), np.empty(n, dtype=np.bool_)
        return Lookup(values, outside, interpolate(*self._packed, points, values, outside) > 0)

    def evaluate(self, *arguments: Array | float) -> Array:
        """(n,) values at arguments, each (n,) or a number, in the units of the breakpoints; held outside them."""
        return self.lookup(*arguments).values

    def outside(self, *arguments: Array | float) -> Bools:
        """(n,) true where any argument lies outside its breakpoints (or is NaN)."""
        return self.lookup(*arguments).outside

    def basis(self, *arguments: Array | float) -> "csr_array[Any]":
        """(n, values.size) hat basis A: ``evaluate(...) == A @ values.ravel()``. Arguments must be finite."""
        return self._combine(self._cells(self._points(arguments)), None)

    def coverage(self, *arguments: Array | float) -> Array:
        """Sum of the hat basis over the points, in the shape of `values`: zero where no point touches a node."""
        return np.asarray(self.basis(*arguments).sum(axis=0), dtype=np.float64).reshape(self.values.shape)

    def slope(self, argument: str, *arguments: Array | float) -> Array:
        """(n,) exact derivative along the axis labelled `argument`: of the cell to the right of a breakpoint, 0 outside."""
        if argument not in self.arguments:
            raise UnknownNameError(f"no argument '{argument}'", f"table {self.name}", nearest(argument, self.arguments))
        cells = self._cells(self._points(arguments))
        derivative = self._combine(cells, self.arguments.index(argument)) @ self.values.ravel()
        return np.asarray(derivative, dtype=np.float64)

    def _cells(self, points: Array) -> list[_Cell]:
        if not np.all(np.isfinite(points)):
            raise InputError("arguments that are not finite", f"table {self.name}", "leave flagged samples out")
        return [_cell(axis, x) for axis, x in zip(self.breakpoints, points, strict=True)]

    def _combine(self, cells: list[_Cell], derivative: int | None) -> "csr_array[Any]":
        """Products of the hats along every axis; along `derivative` their slopes instead."""
        from scipy.sparse import csr_array  # takes longer to load than a query may: only regression needs it

        n = cells[0].low.size
        columns, data = [], []
        for corner in itertools.product((0, 1), repeat=len(cells)):
            index, product = np.zeros(n, dtype=np.int64), np.ones(n)
            for k, (upper, cell) in enumerate(zip(corner, cells, strict=True)):
                index = index * self.values.shape[k] + (cell.high if upper else cell.low)
                weight = cell.slope if k == derivative else cell.weight
                product = product * (weight if upper else (0.0 if k == derivative else 1.0) - weight)
            columns.append(index)
            data.append(product)
        rows = np.arange(0, n * len(columns) + 1, len(columns))
        parts = (np.stack(data, axis=1).ravel(), np.stack(columns, axis=1).ravel(), rows)
        matrix = csr_array(parts, shape=(n, self.values.size))
        matrix.sum_duplicates()
        matrix.eliminate_zeros()
        return matrix


def _cell(axis: Array, x: Array) -> _Cell:
    if axis.size == 1:
        nothing = np.zeros(x.size, dtype=np.int64)
        return _Cell(nothing, nothing, np.zeros(x.size), np.zeros(x.size))
    low = np.clip(np.searchsorted(axis, x, side="right") - 1, 0, axis.size - 2)
    width = axis[low + 1] - axis[low]
    inside = (x >= axis[0]) & (x <= axis[-1])
    return _Cell(low, low + 1, np.clip((x - axis[low]) / width, 0.0, 1.0), np.where(inside, 1.0 / width, 0.0))
