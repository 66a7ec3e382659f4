"""Cross-products of all flights on one order of columns, trims projected out and scaled: those of
the hypotheses whole, those of companions for the few that are asked for."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aerodb.support import Array
from aerodb.tracing.evidence import NormalEquations

#: Part of a column's sum of squares below which what varies about its level is no excitation.
_VARIES = 1e-8

Places = NDArray[np.intp]


@dataclass(frozen=True)
class Products:
    """Cross-products of g flights. Columns are k hypotheses, then companions, then the residual: c
    in all.

    matrices : each flight's matrix, in its own order; positions : (c,) where a column stands in it,
    for each of the orders that there are, and order (g,) : which of them a flight has. levels (g,
    axes, c) : a column on an axis' constant, whose weight (g, axes) is its product with itself;
    kept (g, c) : 0 for columns that a flight has not, or that do not vary, else 1. base (c,) : the
    column beside which a companion stands, itself for others; part (g, c) : what a companion has of
    that, which is taken off it, so that the column keeps its meaning, the effect at the alpha of
    this flight. factor (c,) : a product of two columns is counted in units of one over their
    factors. offsets : hypothesis that is an axis' own constant -> that axis among the levels.
    """

    hypotheses: int
    matrices: tuple[Array, ...]
    positions: tuple[Places, ...]
    order: tuple[int, ...]
    levels: Array
    weight: Array
    kept: Array
    base: Places
    part: Array
    factor: Array
    offsets: Mapping[int, int]

    @property
    def core(self) -> Places:
        """(k + 1,) columns of the hypotheses and of the residual."""
        return np.r_[np.arange(self.hypotheses), len(self.base) - 1]

    @property
    def matrix(self) -> Array:
        """(g, k + 1, k + 1) of the hypotheses, residual last."""
        return self.block(self.core, self.core)

    def constants(self) -> tuple[Array, Array]:
        """Product (g, o) of each offset's trim with itself, and with all columns (g, o, c) over
        that; scaled."""
        places, axes = list(self.offsets), list(self.offsets.values())
        across = self.levels[:, axes] * self.kept[:, None]
        across -= across[:, :, self.base] * self.part[:, None]
        scale = 1.0 / self.factor[places]
        return self.weight[:, axes] / scale**2, across * np.outer(scale, self.factor)

    def block(self, rows: Places, columns: Places) -> Array:
        """(g, rows, columns) of any of the columns."""
        moved, beside = (
            np.flatnonzero(self.base[rows] != rows),
            np.flatnonzero(self.base[columns] != columns),
        )
        found = self._straight(
            np.r_[rows, self.base[rows[moved]]], np.r_[columns, self.base[columns[beside]]]
        )
        found[:, moved] -= self.part[:, rows[moved], None] * found[:, len(rows) :]
        found = found[:, : len(rows)]
        found[:, :, beside] -= self.part[:, None, columns[beside]] * found[:, :, len(columns) :]
        return found[:, :, : len(columns)] * np.outer(self.factor[rows], self.factor[columns])

    def _straight(self, rows: Places, columns: Places) -> Array:
        """As `block`, nothing taken off companions and not scaled."""
        found = np.empty((len(self.matrices), len(rows), len(columns)))
        self._gather(found, rows[:, None], columns)
        found -= (self.levels[:, :, rows] * self.weight[:, :, None]).transpose(
            0, 2, 1
        ) @ self.levels[:, :, columns]
        found *= self.kept[:, rows, None]
        found *= self.kept[:, None, columns]
        return found

    def _gather(self, found: Array, rows: Places, columns: Places) -> None:
        """Fills (g, ...) with the elements at rows and columns (...) of the flights' matrices."""
        sizes = [
            len(self.matrices[self.order.index(number)]) for number in range(len(self.positions))
        ]
        places = [
            at[rows] * size + at[columns] for at, size in zip(self.positions, sizes, strict=True)
        ]
        for target, matrix, order in zip(found, self.matrices, self.order, strict=True):
            matrix.take(places[order], out=target, mode="clip")


def products_of(
    normal_equations: Sequence[NormalEquations],
    known: Mapping[str, int],
    offsets: Mapping[int, str],
    shapes: Mapping[int, int],
) -> tuple[Products, Products | None, Array]:
    """Products of the normal equations and, where any has them, of their noisy copies; and the columns with
    themselves (columns,), over all flights, SI.

    known : id or companion's name -> column; offsets : column -> axis whose own constant it is;
    shapes : companion -> its column.
    """
    plain, diagonal = _aligned(
        normal_equations, [g.matrix for g in normal_equations], known, offsets, shapes
    )
    behind, beside = (
        np.array(list(shapes), dtype=np.intp),
        np.array(list(shapes.values()), dtype=np.intp),
    )
    across, own = _pairs(plain, behind, beside), diagonal[:, beside]
    part = np.zeros_like(plain.kept)
    part[:, behind] = np.where(own > 0.0, across / np.where(own > 0.0, own, 1.0), 0.0)
    among = part[:, behind]
    diagonal[:, behind] -= among * across + among * (across - among * own)
    largest = diagonal[:, :-1].max(axis=0)
    for place, axis in plain.offsets.items():
        largest[place] = plain.weight[:, axis].max()
    scale = np.sqrt(np.where(largest > 0.0, largest, 1.0))
    finished = {"part": part, "factor": np.r_[1.0 / scale, 1.0]}
    noisy = None
    if any(g.noisy is not None for g in normal_equations):
        copies = [g.matrix if g.noisy is None else g.noisy for g in normal_equations]
        noisy = replace(_aligned(normal_equations, copies, known, offsets, shapes)[0], **finished)
    return replace(plain, **finished), noisy, diagonal[:, :-1].sum(axis=0)


def _aligned(
    normal_equations: Sequence[NormalEquations],
    matrices: Sequence[Array],
    known: Mapping[str, int],
    offsets: Mapping[int, str],
    shapes: Mapping[int, int],
) -> tuple[Products, Array]:
    """Products without companions' parts and scales, and (g, columns) of each column with
    itself."""
    axes = list(
        dict.fromkeys([*(axis for g in normal_equations for axis in g.axes), *offsets.values()])
    )
    columns = len(known) + 1
    shape = len(normal_equations), columns
    squares, indices = np.zeros(shape), dict[tuple[object, ...], tuple[Places, Places]]()
    levels, weight = (
        np.zeros((len(normal_equations), len(axes), columns)),
        np.zeros((len(normal_equations), len(axes))),
    )
    for row, (g, matrix) in enumerate(zip(normal_equations, matrices, strict=True)):
        if (g.axes, g.hypotheses) not in indices:
            index = np.array([*(known[name] for name in g.hypotheses), columns - 1], dtype=np.intp)
            indices[g.axes, g.hypotheses] = (
                np.array([axes.index(axis) for axis in g.axes], dtype=np.intp),
                index,
            )
        trims, (rows, index), square = (
            len(g.axes),
            indices[g.axes, g.hypotheses],
            np.diagonal(matrix),
        )
        squares[row, index], weight[row, rows] = square[trims:], square[:trims]
        levels[row][np.ix_(rows, index)] = matrix[:trims, trims:] / square[:trims, None]
    diagonal = squares - np.einsum("gtc,gt->gc", levels**2, weight)
    kept = (diagonal > _VARIES * squares).astype(np.float64)
    kept[:, -1] = 1.0
    base = np.arange(columns)
    base[list(shapes)] = list(shapes.values())
    constants = {place: axes.index(axis) for place, axis in offsets.items()}
    zero, one = np.zeros(shape), np.ones(columns)
    number = {each: number for number, each in enumerate(indices)}
    order = tuple(number[g.axes, g.hypotheses] for g in normal_equations)
    at = tuple(np.zeros(columns, dtype=np.intp) for _ in indices)
    for position, (rows, index) in zip(at, indices.values(), strict=True):
        position[index] = len(rows) + np.arange(len(index))
    k = columns - 1 - len(shapes)
    made = Products(k, tuple(matrices), at, order, levels, weight, kept, base, zero, one, constants)
    return made, diagonal * kept


def _pairs(products: Products, one: Places, other: Places) -> Array:
    """(g, n) of each column of `one` with that of `other` in the same place, not scaled."""
    found = np.empty((len(products.matrices), len(one)))
    products._gather(found, one, other)
    levels = products.levels
    found -= np.einsum("gtn,gtn,gt->gn", levels[:, :, one], levels[:, :, other], products.weight)
    return np.asarray(found * products.kept[:, one] * products.kept[:, other])
