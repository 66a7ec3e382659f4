"""Cross-products of all flights on one order of columns, intercepts projected out, and scaled.

Those of the hypotheses are computed at once; those of shape-misfit terms only where they are used.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from aerodb.support import Array
from aerodb.tracing.evidence import FlightNormalEquations

#: Part of a column's sum of squares below which what varies about its level is no excitation.
_VARIES = 1e-8

Indices = NDArray[np.intp]


@dataclass(frozen=True)
class Products:
    """Cross-products of g flights. Columns: k hypotheses, shape-misfit terms, residual; c in all.

    matrices : each flight's matrix, in its own order; positions : (c,) where a column is in it, for
    each order that occurs; order (g,) : which of them a flight has. intercepts (g, axes, c) : a
    column regressed on an axis' constant, whose weight (g, axes) is its product with itself; varies
    (g, c) : 0 for columns that a flight lacks or that do not vary, else 1. base (c,) : the column
    whose shape a shape-misfit term changes, itself for others; base_share (g, c) : the regression
    of a shape-misfit term on its base, which is subtracted, so that the base keeps its meaning, the
    effect at the alpha of this flight. factor (c,) : columns are multiplied by it. offsets :
    hypothesis that is an axis' own constant -> that axis.
    """

    hypotheses: int
    matrices: tuple[Array, ...]
    positions: tuple[Indices, ...]
    order: tuple[int, ...]
    intercepts: Array
    weight: Array
    varies: Array
    base: Indices
    base_share: Array
    factor: Array
    offsets: Mapping[int, int]

    @property
    def core(self) -> Indices:
        """Numbers (k + 1,) of the columns of k hypotheses and of the residual: a scalar parameter
        each."""
        return np.r_[np.arange(self.hypotheses), len(self.base) - 1]

    @cached_property
    def matrix(self) -> Array:
        """Products (g, k + 1, k + 1) of the hypotheses, residual last; scaled to be
        dimensionless."""
        return self.block(self.core, self.core)

    def constants(self) -> tuple[Array, Array]:
        """Return the product (g, o) of each offset's intercept with itself, and its products with
        all columns (g, o, c) divided by that; scaled to be dimensionless.
        """
        indices, axes = list(self.offsets), list(self.offsets.values())
        of_intercepts = self.intercepts[:, axes] * self.varies[:, None]
        of_intercepts -= of_intercepts[:, :, self.base] * self.base_share[:, None]
        scale = 1.0 / self.factor[indices]
        return self.weight[:, axes] / scale**2, of_intercepts * np.outer(scale, self.factor)

    def block(self, rows: Indices, columns: Indices) -> Array:
        """Products (g, rows, columns) of any of the columns, as one matrix per flight; scaled to be
        dimensionless."""
        moved, beside = (
            np.flatnonzero(self.base[rows] != rows),
            np.flatnonzero(self.base[columns] != columns),
        )
        products = self._straight(
            np.r_[rows, self.base[rows[moved]]], np.r_[columns, self.base[columns[beside]]]
        )
        products[:, moved] -= self.base_share[:, rows[moved], None] * products[:, len(rows) :]
        products = products[:, : len(rows)]
        products[:, :, beside] -= (
            self.base_share[:, None, columns[beside]] * products[:, :, len(columns) :]
        )
        return products[:, :, : len(columns)] * np.outer(self.factor[rows], self.factor[columns])

    def _straight(self, rows: Indices, columns: Indices) -> Array:
        """As `block`, nothing subtracted from shape-misfit terms and not scaled."""
        products = np.empty((len(self.matrices), len(rows), len(columns)))
        self._gather(products, rows[:, None], columns)
        products -= (self.intercepts[:, :, rows] * self.weight[:, :, None]).transpose(
            0, 2, 1
        ) @ self.intercepts[:, :, columns]
        products *= self.varies[:, rows, None]
        products *= self.varies[:, None, columns]
        return products

    def _gather(self, target_products: Array, rows: Indices, columns: Indices) -> None:
        """Fill (g, ...) with the elements at rows and columns (...) of the flights' matrices."""
        sizes = [
            len(self.matrices[self.order.index(number)]) for number in range(len(self.positions))
        ]
        indices = [
            at[rows] * size + at[columns] for at, size in zip(self.positions, sizes, strict=True)
        ]
        for target, matrix, order in zip(target_products, self.matrices, self.order, strict=True):
            matrix.take(indices[order], out=target, mode="clip")


def products_of(
    normal_equations: Sequence[FlightNormalEquations],
    known: Mapping[str, int],
    offsets: Mapping[int, str],
    shape_terms: Mapping[int, int],
) -> tuple[Products, Products | None, Array]:
    """Return the products, those of the noisy copies if any flight has them, and the columns'
    squares.

    known : id, or name of a shape-misfit term -> column; offsets : column -> axis whose own
    constant it is; shape_terms : shape-misfit term -> its base. The squares (columns,) are sums
    over all flights, SI units.
    """
    plain, diagonal = _aligned(
        normal_equations, [g.matrix for g in normal_equations], known, offsets, shape_terms
    )
    behind, beside = (
        np.array(list(shape_terms), dtype=np.intp),
        np.array(list(shape_terms.values()), dtype=np.intp),
    )
    cross, own = _pairs(plain, behind, beside), diagonal[:, beside]
    base_share = np.zeros_like(plain.varies)
    base_share[:, behind] = np.where(own > 0.0, cross / np.where(own > 0.0, own, 1.0), 0.0)
    among = base_share[:, behind]
    diagonal[:, behind] -= among * cross + among * (cross - among * own)
    largest = diagonal[:, :-1].max(axis=0)
    for index, axis in plain.offsets.items():
        largest[index] = plain.weight[:, axis].max()
    scale = np.sqrt(np.where(largest > 0.0, largest, 1.0))
    finished = {"base_share": base_share, "factor": np.r_[1.0 / scale, 1.0]}
    noisy = None
    if any(g.noisy is not None for g in normal_equations):
        copies = [g.matrix if g.noisy is None else g.noisy for g in normal_equations]
        noisy = replace(
            _aligned(normal_equations, copies, known, offsets, shape_terms)[0], **finished
        )
    return replace(plain, **finished), noisy, diagonal[:, :-1].sum(axis=0)


def _aligned(
    normal_equations: Sequence[FlightNormalEquations],
    matrices: Sequence[Array],
    known: Mapping[str, int],
    offsets: Mapping[int, str],
    shape_terms: Mapping[int, int],
) -> tuple[Products, Array]:
    """Products without base shares and scales, and (g, columns) of each column with itself."""
    axes = list(
        dict.fromkeys([*(axis for g in normal_equations for axis in g.axes), *offsets.values()])
    )
    columns = len(known) + 1
    shape = len(normal_equations), columns
    squares, orders = np.zeros(shape), dict[tuple[object, ...], tuple[Indices, Indices]]()
    intercepts, weight = (
        np.zeros((len(normal_equations), len(axes), columns)),
        np.zeros((len(normal_equations), len(axes))),
    )
    for row, (g, matrix) in enumerate(zip(normal_equations, matrices, strict=True)):
        if (g.axes, g.hypotheses) not in orders:
            index = np.array([*(known[name] for name in g.hypotheses), columns - 1], dtype=np.intp)
            orders[g.axes, g.hypotheses] = (
                np.array([axes.index(axis) for axis in g.axes], dtype=np.intp),
                index,
            )
        axis_count, (rows, index), square = (
            len(g.axes),
            orders[g.axes, g.hypotheses],
            np.diagonal(matrix),
        )
        squares[row, index], weight[row, rows] = square[axis_count:], square[:axis_count]
        intercepts[row][np.ix_(rows, index)] = (
            matrix[:axis_count, axis_count:] / square[:axis_count, None]
        )
    diagonal = squares - np.einsum("gtc,gt->gc", intercepts**2, weight)
    varies = (diagonal > _VARIES * squares).astype(np.float64)
    varies[:, -1] = 1.0
    base = np.arange(columns)
    base[list(shape_terms)] = list(shape_terms.values())
    constants = {index: axes.index(axis) for index, axis in offsets.items()}
    zero, one = np.zeros(shape), np.ones(columns)
    number = {each: number for number, each in enumerate(orders)}
    order = tuple(number[g.axes, g.hypotheses] for g in normal_equations)
    at = tuple(np.zeros(columns, dtype=np.intp) for _ in orders)
    for position, (rows, index) in zip(at, orders.values(), strict=True):
        position[index] = len(rows) + np.arange(len(index))
    k = columns - 1 - len(shape_terms)
    products = Products(
        k, tuple(matrices), at, order, intercepts, weight, varies, base, zero, one, constants
    )
    return products, diagonal * varies


def _pairs(products: Products, one: Indices, other: Indices) -> Array:
    """(g, n) of each column of `one` with that of `other` at the same index, not scaled."""
    pairs = np.empty((len(products.matrices), len(one)))
    products._gather(pairs, one, other)
    intercepts = products.intercepts
    pairs -= np.einsum(
        "gtn,gtn,gt->gn", intercepts[:, :, one], intercepts[:, :, other], products.weight
    )
    return np.asarray(pairs * products.varies[:, one] * products.varies[:, other])
