"""Parameters: named numbers of a database that flight can correct.

A parameter is a variable whose expression is a number. Expressions use it by name, in as many
places as share it; the machine that flies a database has it as an input, like an increment's
estimates. Its uncertainty is the variable's: additive and normal, before flight the prior, after an
update the standard error, with its correlations to the others of the same update.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from aerodb.errors import InputError
from aerodb.support import Array
from aerodb.tables.uncertainty import Uncertainty


@dataclass(frozen=True)
class Parameter:
    """What a variable that is a parameter has beside its value.

    Parameters
    ----------
    bounds : lowest and highest possible value, SI. flights : ids of those that estimated it; empty
        before. flown : variable -> lowest and highest value flown by them, SI. theory : the value
        that theory has, in its unit; None where it has none.

    Raises InputError for bounds of which the first is not the smaller.
    """

    bounds: tuple[float, float] = (-np.inf, np.inf)
    flights: tuple[str, ...] = ()
    flown: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    theory: float | None = None

    def __post_init__(self) -> None:
        if not self.bounds[0] < self.bounds[1]:
            raise InputError(
                f"bounds {self.bounds[0]:g} and {self.bounds[1]:g}",
                remedy="write the smaller one first",
            )

    def check(self, value: float) -> None:
        """Raise InputError for a value (a scalar, SI) outside the bounds."""
        low, high = self.bounds
        if not low <= value <= high:
            raise InputError(
                f"value {value:g} lies outside its bounds {low:g} to {high:g}",
                remedy="widen the bounds, or correct the value",
            )


def normal(
    sigma: float, others: Sequence[str] = (), correlations: Sequence[float] = ()
) -> Uncertainty:
    """The uncertainty of a parameter: one standard deviation, in its unit, and the correlations
    with others (m,) that come before it in the database. Raises InputError unless finite."""
    return Uncertainty(
        "additive",
        "normal",
        (float(sigma),),
        correlations=tuple(zip(others, map(float, correlations), strict=True)),
    )


def sigma_of(uncertainty: Uncertainty | None) -> float | None:
    """One standard deviation of a parameter, in its unit; None where nothing is known of it."""
    return None if uncertainty is None else float(uncertainty.bounds[0]) / uncertainty.sigmas  # type: ignore[arg-type]


def covariance_of(uncertainties: Mapping[str, Uncertainty | None]) -> Array:
    """Return the covariance (p, p) of parameters, in their order and units; 0 where nothing is
    known of one."""
    names = list(uncertainties)
    sigma = np.array([sigma_of(each) or 0.0 for each in uncertainties.values()])
    correlation = np.eye(len(names))
    for row, each in enumerate(uncertainties.values()):
        for other, value in () if each is None else each.correlations:
            if other in uncertainties:
                column = names.index(other)
                correlation[row, column] = correlation[column, row] = value
    return correlation * np.outer(sigma, sigma)
