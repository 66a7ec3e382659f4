"""Matrices whose entries are sums of parameters."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from aerodb.errors import InputError
from aerodb.estimation.dynamic_model import Values
from aerodb.support import Array

#: A number, or a sum such as ``Lp``, ``-0.5*Lr`` or ``2*Lp + 0.1*Lr - 3``.
Entry = float | str

_NUMBER = r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_NAME = r"[A-Za-z_]\w*(?:\[[^\]]*\])?"
_TERM = re.compile(
    rf"\s*(?P<sign>[+-]?)\s*(?:(?P<factor>{_NUMBER})\s*(?:\*\s*(?P<times>{_NAME}))?"
    rf"|(?P<name>{_NAME})(?:\s*\*\s*(?P<by>{_NUMBER}))?)\s*"
)


@dataclass(frozen=True, eq=False)
class AffineMatrix:
    """``M(theta) = constant + sum_j slopes[j] theta_j``.

    Parameters
    ----------
    constant : (r, c).
    slopes : parameter -> (r, c).
    """

    constant: Array
    slopes: dict[str, Array]

    def at(self, values: Values) -> Array:
        """The matrix (k, r, c) for k sets of parameters; k is 1 where every value is a number, in
        the SI units of the entries."""
        if not self.slopes:
            return self.constant[None]
        each = [values[name] for name in self.slopes]
        if all(np.ndim(value) == 0 for value in each):
            sizes = np.array(each)[:, None]
        else:
            sizes = np.stack(np.broadcast_arrays(*(np.atleast_1d(value) for value in each)))
        moved = sizes.T @ self._stacked
        return self.constant + moved.reshape(len(moved), *self.constant.shape)

    @cached_property
    def _stacked(self) -> Array:
        """Slopes of all parameters, (p, r c)."""
        return np.stack([matrix.ravel() for matrix in self.slopes.values()])

    def slope(self, name: str) -> Array:
        """Derivative matrix (r, c) with respect to a parameter, in the unit of an entry per unit of
        the parameter; zeros for one that is in no entry."""
        return self.slopes.get(name, np.zeros_like(self.constant))


def affine_matrix(rows: Sequence[Sequence[Entry]], where: str) -> AffineMatrix:
    """Return the matrix of these entries; `where` names it in errors.

    Raises InputError for rows of unequal length and an entry that is no sum of parameters.

    >>> affine_matrix([["2*Lp - 1", 0.5]], "A").at({"Lp": np.array(3.0)}).tolist()
    [[[5.0, 0.5]]]
    """
    if len({len(row) for row in rows}) > 1:
        raise InputError("its rows differ in length", where, "give every row as many entries")
    constant = np.zeros((len(rows), len(rows[0]) if rows else 0))
    slopes: dict[str, Array] = {}
    for i, row in enumerate(rows):
        for j, entry in enumerate(row):
            for name, factor in _terms(entry, f"{where}, row {i + 1}, column {j + 1}"):
                matrix = slopes.setdefault(name, np.zeros_like(constant)) if name else constant
                matrix[i, j] += factor
    return AffineMatrix(constant, slopes)


def _terms(entry: Entry, where: str) -> list[tuple[str, float]]:
    """(parameter or empty, factor) of each term."""
    if not isinstance(entry, str):
        return [("", float(entry))]
    terms, place = list[tuple[str, float]](), 0
    while place < len(entry):
        match = _TERM.match(entry, place)
        if match is None or match.end() == place or (terms and not match["sign"]):
            raise InputError(
                f"'{entry}' is no sum of parameters",
                where,
                "write numbers and parameters, such as 2*Lp - 0.1*Lr",
            )
        name = match["times"] or match["name"] or ""
        size = float(match["factor"] or match["by"] or 1.0)
        terms.append((name, -size if match["sign"] == "-" else size))
        place = match.end()
    if not terms:
        raise InputError("an entry is empty", where, "write 0")
    return terms
