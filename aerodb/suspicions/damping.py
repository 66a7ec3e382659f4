"""A damping in roll that no wing of this size has, or that is far from the database's.

Gusts that no sensor measures roll the aircraft as the air would damp it: least squares then find
less damping, or none, with a small standard error. What the controls and their past move of the
rates is free of gusts (instruments: Theil, Repeated Least Squares, 1953).
"""

from collections.abc import Mapping
from typing import Final

import numpy as np
from numpy.typing import NDArray

from aerodb.conditioning import Suspicion
from aerodb.errors import InputError
from aerodb.estimation import (
    EquationRecord,
    LinearEquation,
    Parameter,
    Parameters,
    Regression,
    instrumental_variables,
    samples_per_independent,
)
from aerodb.nomenclature import is_surface
from aerodb.support import Array, half_interval
from aerodb.suspicions.derivatives import AxisShares
from aerodb.suspicions.equation_error import EquationError
from aerodb.suspicions.evidence import ERRORS, INFLATION, PART, RATIOS, WELL_EXPLAINED
from aerodb.suspicions.lift import helmbold
from aerodb.vehicle import Vehicle

#: How long ago the controls moved that are instruments [s]. Roll gusts last less than the first
#: (4 b / pi V: Hoblit, Gust Loads on Aircraft, 1988). Motion that a control makes ends by the last.
_AGO: Final = (0.3, 0.5, 0.7, 0.9, 1.1)
_WRONG: Final = "Ixx, span, area, airspeed or beta is wrong, or the log is another aircraft's"


def damping_beside_vehicle(
    axis: EquationError, fit: Regression, vehicle: Vehicle
) -> list[Suspicion]:
    """Return a damping in roll that no wing of this size has, with the inertia in it.

    axis, fit : of the moment about the roll axis; dCl/d(p b / 2V) is dimensionless.
    """
    if "p" not in fit.names or "beta" not in fit.names or fit.r_squared < WELL_EXPLAINED:
        return []
    k = fit.names.index("p")
    ratio = vehicle.reference.span**2 / vehicle.reference.area
    expected = -helmbold(ratio) / 8.0
    if fit.vif[k] > INFLATION or _is_usual(fit.estimates[k], fit.standard_errors[k], expected):
        return []
    told = _of_controls(axis.moment, axis.motion, axis.controls, axis.where, axis.step)
    if told is None or _is_usual(*told, expected):
        return []
    words = (
        f"the damping in roll is {told[0]:.3g} +- {half_interval(told[1]):.2g} per p b / 2V (wing"
        f" of aspect ratio {ratio:.3g}: {expected:.2g}). {_WRONG}"
    )
    return [Suspicion("Ixx", "size", words, {"damping": told[0], "expected": expected})]


def damping_beside_database(axis: AxisShares, fit: Regression) -> list[Suspicion]:
    """Return a damping in roll far from the database's.

    axis, fit : of Cl; the ratio of the flight to the database is dimensionless.
    """
    if "p" not in axis.parts or fit.r_squared < WELL_EXPLAINED:
        return []
    share = axis.share(fit, "p")
    if share.vif > INFLATION or share.weight < PART or _is_usual(share.ratio, share.error, 1.0):
        return []
    parts: tuple[dict[str, Array], dict[str, Array]] = ({}, {})
    for name, part in axis.parts.items():
        parts[is_surface(name)][name] = part
    told = _of_controls(axis.measured, *parts, axis.where, axis.step)
    if told is None or _is_usual(*told, 1.0):
        return []
    half = half_interval(told[1])
    words = f"the damping in roll is {told[0]:.3g} +- {half:.2g} times the database's: {_WRONG}"
    return [Suspicion("Ixx", "size", words, {"ratio": told[0]})]


def _is_usual(value: float, error: float, expected: float) -> bool:
    """Whether a damping is between the bounds of one that is expected, within its error."""
    ratio, margin = value / expected, ERRORS * error / abs(expected)
    return bool(RATIOS[0] - margin <= ratio <= RATIOS[1] + margin)


def _of_controls(
    moment: Array,
    motion: Mapping[str, Array],
    controls: Mapping[str, Array],
    where: NDArray[np.bool_],
    step: float,
) -> tuple[float, float] | None:
    """The effect of p as the controls tell it, and its standard error; None where they do not."""
    lags = [max(1, round(seconds / step)) for seconds in _AGO]
    used = where.copy()
    used[: max(lags)] = False
    columns = {**motion, **controls}
    matrix = np.column_stack([values[used] for values in columns.values()])
    past = [np.roll(values, lag)[used] for values in controls.values() for lag in lags]
    if not past:
        return None
    time: Array = step * np.arange(len(matrix), dtype=float)
    unknown = Parameters(tuple(Parameter(name, 0.0) for name in columns))
    record = EquationRecord("flight", time, matrix, moment[used])
    try:
        fit = instrumental_variables(
            LinearEquation("Cl", unknown, (record,)),
            instruments={"flight": np.column_stack(past)},
            noisy=tuple(motion),
        )
    except InputError:
        return None
    found = next(each for each in fit.estimates if each.name == "p")
    if found.standing != "estimated":
        return None
    # Regressors and instruments fit as many of the samples that are independent.
    left = moment[used] - matrix @ np.array([each.value for each in fit.estimates])
    independent = len(left) / samples_per_independent(left)
    free = independent - matrix.shape[1] - len(past)
    if not free > 0.0:
        return None
    return found.value, found.standard_error * float(np.sqrt(independent / free))
