"""Whitened products of named columns, functions and the residual of one flight on one axis, of
which every comparison of names and functions is made. docs/method/tracing.md, section 26.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from aerodb.support import Array
from aerodb.tracing.decision.functions import TRACE
from aerodb.tracing.evidence import Evidence, normal_equations_of
from aerodb.tracing.settings import TracingSettings


@dataclass(frozen=True)
class AxisProducts:
    """Whitened products of one flight on one axis, without the intercept.

    matrix (k + 1, k + 1) : columns `names` and the residual, which is last; the functions are
    columns ``function 0``, ``function 1``, ...
    """

    names: tuple[str, ...]
    matrix: Array
    functions: int

    @classmethod
    def of(
        cls,
        evidence: Evidence,
        axis: str,
        named: Sequence[str],
        functions: Array,
        settings: TracingSettings,
    ) -> "AxisProducts":
        """Products of named columns (those that act on the axis), functions (n, f) and residual."""
        flexible = {_function(number): {axis: each} for number, each in enumerate(functions.T)}
        acting = {
            name: {axis: evidence.columns[name][axis]}
            for name in named
            if axis in evidence.columns.get(name, {})
        }
        one = replace(
            evidence,
            residual={axis: evidence.residual[axis]},
            usable={axis: evidence.usable[axis]},
            columns=acting | flexible,
            noisy=(),
            instruments={},
        )
        made = normal_equations_of(one, settings)
        level = made.matrix[0, 1:]
        whole = made.matrix[1:, 1:] - np.outer(level, level) / made.matrix[0, 0]
        return cls(made.hypotheses, whole, functions.shape[1])

    def eliminated(
        self, named: Sequence[str], priors: Mapping[str, float], with_functions: bool
    ) -> tuple[Array, Array]:
        """Products (k + 1, k + 1) of named columns (zero where absent), functions and residual
        without the sensors, which have these prior precisions; and those (k, k) with the
        sensors."""
        place = {name: number for number, name in enumerate(self.names)}
        sensors = [id for id in priors if id in place]
        functions = [_function(number) for number in range(self.functions if with_functions else 0)]
        wanted = [*named, *functions]
        absent, last = len(self.matrix), len(self.matrix) - 1
        index = [place.get(name, absent) for name in wanted]
        padded = np.pad(self.matrix, (0, 1))
        kept = np.array([*index, last], dtype=np.intp)
        out = np.array([place[id] for id in sensors], dtype=np.intp)
        block = padded[np.ix_(out, out)] + np.diag([priors[id] for id in sensors])
        scale = np.sqrt(np.maximum(np.diagonal(block), TRACE))
        across = padded[np.ix_(out, kept)] / scale[:, None]
        inner = block / np.outer(scale, scale) + TRACE * np.eye(len(sensors))
        left = padded[np.ix_(kept, kept)] - across.T @ np.linalg.solve(inner, across)
        return left, padded[np.ix_(kept[:-1], kept[:-1])]


def _function(number: int) -> str:
    return f"function {number}"
