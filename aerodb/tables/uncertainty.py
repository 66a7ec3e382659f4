"""Uncertainty that a source declares for a variable or a table, for error propagation and Monte
Carlo simulation.

Source: AIAA S-119 (DAVE-ML 2.0), "Statistical information encoding".
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from aerodb.errors import InputError, nearest
from aerodb.tables.expression import check_identifier

#: A bound: a number, the name of a variable, or one number per table node (flat, last axis
#: fastest).
Bound = float | str | tuple[float, ...]

EFFECTS: Final = ("additive", "multiplicative", "percentage", "absolute")
DISTRIBUTIONS: Final = ("normal", "uniform")


@dataclass(frozen=True)
class Uncertainty:
    """Declared uncertainty of a nominal value.

    Parameters
    ----------
    effect : one of `EFFECTS`, how bounds act on the value; ``additive`` is value +- bound.
    distribution : ``normal``, with one bound at `sigmas` standard deviations; or ``uniform``, with
        one symmetric bound, or two, below and above.
    correlates_with : variables or tables whose uncertainty depends on this one.
    correlations : (name, coefficient) of those that this one depends on; only for ``normal``.

    Raises InputError for anything else.
    """

    effect: str
    distribution: str
    bounds: tuple[Bound, ...]
    sigmas: float = 1.0
    correlates_with: tuple[str, ...] = ()
    correlations: tuple[tuple[str, float], ...] = ()

    def __post_init__(self) -> None:
        for word, known in ((self.effect, EFFECTS), (self.distribution, DISTRIBUTIONS)):
            if word not in known:
                raise InputError(f"uncertainty '{word}'", remedy=nearest(word, known))
        for field in ("bounds", "correlates_with", "correlations"):
            object.__setattr__(self, field, tuple(getattr(self, field)))
        if len(self.bounds) != 1 and not (self.distribution == "uniform" and len(self.bounds) == 2):
            raise InputError(f"{self.distribution} uncertainty with {len(self.bounds)} bounds")
        if self.distribution == "uniform" and (self.correlates_with or self.correlations):
            raise InputError(
                "a uniform uncertainty with correlations",
                remedy="the standard allows them only for normal uncertainties",
            )
        if not (np.isfinite(self.sigmas) and self.sigmas > 0):
            raise InputError(f"uncertainty bound at {self.sigmas:g} sigma")
        if any(not abs(coefficient) <= 1 for _, coefficient in self.correlations):
            raise InputError("a correlation beyond -1 to 1")
        for bound in self.bounds:
            if isinstance(bound, str):
                check_identifier(bound)
            elif not np.all(np.isfinite(bound)):
                raise InputError("an uncertainty bound that is not finite")

    @property
    def names(self) -> frozenset[str]:
        """Names of the variables that are bounds."""
        return frozenset(bound for bound in self.bounds if isinstance(bound, str))


def check_bounds(uncertainty: Uncertainty | None, nodes: int) -> None:
    """Raise InputError unless bounds per node match a table of `nodes` (0: a variable)."""
    for bound in uncertainty.bounds if uncertainty else ():
        if isinstance(bound, tuple) and len(bound) != nodes:
            raise InputError(f"{len(bound)} uncertainty bounds for {nodes} nodes")


def bound_arrays(uncertainty: Uncertainty | None) -> list[NDArray[np.float64]]:
    """Numeric bounds as arrays, for hashes.

    Each is at least (1,), in the unit that it was declared in.
    """
    bounds = uncertainty.bounds if uncertainty else ()
    return [
        np.atleast_1d(np.array(bound, dtype=np.float64))
        for bound in bounds
        if not isinstance(bound, str)
    ]
