"""Add accepted hypotheses to a database: increments with joint covariance, envelope and flights;
parameters of the database with new values, standard errors and correlations.

The regressors are those of the columns that were tested, so that within the envelope the candidate
equals the baseline plus value times column. Sensor and vehicle-data errors are not added to a
database; they belong to its measurements.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aerodb.effects.aerodynamic import PARAMETER, with_lagged, with_lags
from aerodb.effects.flight_view import FlightView
from aerodb.effects.hypothesis import Hypothesis
from aerodb.errors import InputError
from aerodb.support import Array
from aerodb.tables import (
    STATE_CHANNEL,
    AeroDatabase,
    Increment,
    Interval,
    Refit,
    continued,
    flown_envelope,
    with_estimated_parameters,
)


def add_effects(
    database: AeroDatabase,
    accepted: Sequence[Hypothesis],
    values: Array,
    covariance: Array,
    envelopes: Mapping[str, Mapping[str, Interval]],
    flights: Sequence[str],
    note: str = "",
    refit: Refit | None = None,
) -> AeroDatabase:
    """Add the accepted hypotheses to `database` as increments, one per axis.

    Parameters
    ----------
    values : (k,), in the hypotheses' units.
    covariance : (k, k). Each axis keeps the joint covariance of its estimates; covariance between
        axes is dropped, since an increment is on one axis.
    envelopes : axis -> variable -> interval, from `envelopes_of`.
    flights : ids of the identification flights.
    note : of the increments; default: the ids of the effects.
    refit : how the values were refitted, if they were.

    Raises
    ------
    InputError : a sensor hypothesis, a hypothesis without an expression or whose state model the
        database lacks, or values or covariance of the wrong shape.
    """
    values, covariance = (
        np.asarray(values, dtype=np.float64),
        np.asarray(covariance, dtype=np.float64),
    )
    k = len(accepted)
    if values.shape != (k,) or covariance.shape != (k, k):
        raise InputError(
            f"{k} effects with values {values.shape} and covariance {covariance.shape}",
            "adding effects",
        )
    own = [k for k, each in enumerate(accepted) if each.effect == PARAMETER]
    if own:
        corrected = {
            accepted[k].subject: float(database.parameters[accepted[k].subject] + values[k])
            for k in own
        }
        database = with_estimated_parameters(
            database, corrected, covariance[np.ix_(own, own)], flights, envelopes.get(PARAMETER, {})
        )
    by_axis = _by_axis(accepted)
    _check_states(accepted, database)
    database = with_lags(database, accepted)
    increments = []
    for axis, members in by_axis.items():
        index = [number for number, _ in members]
        added = Increment(
            axis=axis,
            regressors=tuple(accepted[number].increment[part][1] for number, part in members),
            estimates=values[index],
            covariance=covariance[np.ix_(index, index)],
            envelope=envelopes[axis],
            flights=tuple(flights),
            note=note or "effects: " + ", ".join(accepted[number].id for number in index),
            refit=refit,
        )
        increments.append(continued(added, database))
    return replace(database, increments=(*database.increments, *increments))


def envelopes_of(
    accepted: Sequence[Hypothesis], views: Sequence[FlightView], database: AeroDatabase
) -> dict[str, dict[str, Interval]]:
    """Envelope flown, axis -> variable -> interval, over the usable samples of those body axes of
    each axis that a flight has.

    Raises InputError where a flight lacks a channel of an accepted hypothesis, or no flight has a
    usable sample.

    Intervals are in the units of their variables.
    """
    envelopes = {}
    views = [with_lagged(view, accepted) for view in views]
    if any(each.effect == PARAMETER for each in accepted):
        flown = [(view.channels, _used(view)) for view in views]
        envelopes[PARAMETER] = flown_envelope(database.flight_inputs, flown, database)
    for axis, members in _by_axis(accepted).items():
        names = frozenset[str]().union(
            *(accepted[number].increment[part][1].names for number, part in members)
        )
        bodies = {body for number, _ in members for body in accepted[number].axes}
        flown = []
        for view in views:
            lacking = sorted(names - view.channels.keys())
            if lacking:
                raise InputError(
                    f"no channel {', '.join(lacking)}",
                    f"flight {view.flight}",
                    "leave the flight out",
                )
            # A flight that lacks the thrust shows a lift along z alone, and votes with that.
            seen = [view.usable[body] for body in sorted(bodies & view.usable.keys())]
            if seen and (good := np.logical_and.reduce(seen)).any():
                flown.append((view.channels, good))
        if not flown:
            raise InputError("no usable sample in any flight", f"effects on {axis}")
        envelopes[axis] = flown_envelope(names, flown, database)
    return envelopes


def _used(view: FlightView) -> NDArray[np.bool_]:
    """Samples (n,) of a flight that are used on every axis that it has."""
    return np.asarray(np.logical_and.reduce([*view.usable.values()]), dtype=np.bool_)


def _check_states(accepted: Sequence[Hypothesis], database: AeroDatabase) -> None:
    present = {state.name for state in database.states}
    for hypothesis in accepted:
        if STATE_CHANNEL in hypothesis.drivers and STATE_CHANNEL not in present:
            what = f"the database has no state model that makes {STATE_CHANNEL}"
            raise InputError(
                what, hypothesis.id, "add it with its law: stall_hysteresis.with_stall"
            )


def _by_axis(accepted: Sequence[Hypothesis]) -> dict[str, list[tuple[int, int]]]:
    """Axis -> (index of hypothesis, index of its increment part) of those that act there."""
    by_axis: dict[str, list[tuple[int, int]]] = {}
    for number, hypothesis in enumerate(accepted):
        if hypothesis.kind == "sensor":
            remedy = "correct the sensor or the vehicle file, and process the flights again"
            raise InputError(
                "an error of a sensor or of the vehicle data is not added to a database",
                hypothesis.id,
                remedy,
            )
        if hypothesis.effect == PARAMETER:
            continue
        if not hypothesis.increment:
            raise InputError(
                "the hypothesis has no expression over channels",
                hypothesis.id,
                "give its template a regressor",
            )
        for part, (axis, _) in enumerate(hypothesis.increment):
            by_axis.setdefault(axis, []).append((number, part))
    return by_axis
