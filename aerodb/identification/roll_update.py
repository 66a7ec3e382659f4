"""Parameters of the legs from rolls on the ground, as a candidate database."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from aerodb.errors import InputError
from aerodb.estimation import Fit, TimeHistory
from aerodb.identification.database_parameters import within_bounds
from aerodb.identification.ground_records import Rolls, ground_fit
from aerodb.tables import AeroDatabase, Interval, with_estimated_parameters


@dataclass(frozen=True)
class RollUpdate:
    """The candidate with what the rolls determine, their fit, and name -> why a parameter has no
    value."""

    candidate: AeroDatabase
    fit: Fit
    without_value: Mapping[str, str]


def updated_by_rolls(
    function: Callable[..., Fit],
    rolls: Rolls,
    names: Sequence[str],
    database: AeroDatabase,
    wind: tuple[float, float] | None = None,
    start: Mapping[str, float] | None = None,
) -> RollUpdate:
    """Return the database with those of some parameters of its legs that rolls determine; the
    others stay.

    function : a method that flies. wind : north and east [m/s]; None: unknown, steady in each roll.
    start : as of `fitted_roll`.
    Covariance (k, k) is in the parameters' units. Raises InputError where the search does not end,
    and where the rolls determine none of the parameters.
    """
    fit = ground_fit(function, rolls, names, database, wind, start)
    if not fit.converged:
        raise InputError(
            "the search for friction, wind and start does not end",
            "update",
            "name fewer parameters, or state the wind in the model file",
        )
    known = {n: v for n, v in within_bounds(fit, database).items() if n in names and n in fit.names}
    lacking = {n: fit[n].reason for n in names if n not in known}
    if not known:
        reasons = "; ".join(f"{name}: {reason}" for name, reason in lacking.items())
        raise InputError(f"these rolls determine none of the parameters: {reasons}", "update", "")
    return RollUpdate(with_fitted_legs(database, fit, rolls, tuple(known)), fit, lacking)


def with_fitted_legs(
    database: AeroDatabase, fit: Fit, rolls: Rolls, names: Sequence[str]
) -> AeroDatabase:
    """Return the database with the estimates of some parameters of its legs, in their units, with
    covariance (k, k), flights and the flown interval of each input of the legs."""
    at = [fit.names.index(name) for name in names]
    known = within_bounds(fit, database)
    return with_estimated_parameters(
        database,
        {name: known[name] for name in names},
        fit.covariance[np.ix_(at, at)],
        list(dict.fromkeys(rolls.flights[record.name] for record in rolls.records)),
        {name: _interval(name, rolls.records) for name in rolls.model.inputs},
    )


def _interval(name: str, records: Sequence[TimeHistory]) -> Interval:
    """From where to where an input of the legs went in all rolls."""
    values = np.concatenate([record.inputs[name] for record in records])
    return Interval(float(values.min()), float(values.max()), float(np.ptp(values)))
