"""The hysteresis of a stall's lift, a rival of flow that separates smoothly.

The tests over flights decide between them. The two angles of each flight are fitted to the others,
as the shapes in `aerodb.loop.stall` are; what is added has those of all together.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from aerodb.effects import (
    Columns,
    FlightView,
    Hypothesis,
    LibraryContext,
    from_zero_lift,
    lift_hysteresis,
)
from aerodb.errors import InputError
from aerodb.loop.flight_source import FlightSource
from aerodb.loop.stall import EFFECT, stall_flights
from aerodb.tables import AeroDatabase, Relay
from aerodb.tracing import Finding, TracingSettings
from aerodb.vehicle import Vehicle

#: Stands for the angles until they are known.
_ANY: Final = Relay(0.1, 0.3)


def is_lift_hysteresis(named: Hypothesis | str) -> bool:
    """Return whether this hypothesis (or id) is the lift hysteresis."""
    id = named if isinstance(named, str) else named.id
    return id == f"stall_hysteresis@C_lift:{lift_hysteresis.SUBJECT}"


def lift_hysteresis_of_family(database: AeroDatabase, vehicle: Vehicle) -> Hypothesis:
    """Return the lift hysteresis as it is frozen and hashed, without the angles [rad] of any flight
    (docs/method/tracing.md, section 2)."""
    formula = (
        f"C_lift += k*{lift_hysteresis.LIFT_LOST.format(from_zero_lift(database), 0, 0)}, angles of"
        " each flight from the others"
    )
    family = replace(_with(_ANY, {}, database, vehicle), formula=formula)
    return with_lift_hysteresis([family], {}, database, vehicle)[0]


def with_lift_hysteresis(
    hypotheses: Sequence[Hypothesis],
    laws: Mapping[str, Relay],
    database: AeroDatabase,
    vehicle: Vehicle,
) -> tuple[Hypothesis, ...]:
    """Return the library with each flight's own angles [rad]; a flight without any has a zero
    column (n,)."""
    law = next(iter(laws.values()), _ANY)
    replacement = _with(law, laws, database, vehicle)

    def tangent(view: FlightView) -> Columns:
        return (
            replacement.columns(view)
            if view.flight in laws
            else dict.fromkeys(replacement.axes, np.zeros(len(view.time)))
        )

    return tuple(replace(h, tangent=tangent) if is_lift_hysteresis(h) else h for h in hypotheses)


def cross_fitted_lift_hysteresis(
    source: FlightSource, flights: Sequence[str], database: AeroDatabase
) -> dict[str, Relay]:
    """Return, for each flight (its id), the angles [rad] that the others agree with.

    Empty below `TracingSettings.fewest` flights and where they show none (InputError of the fit).
    """
    if len(flights) < TracingSettings.fewest:
        return {}
    try:
        measured = stall_flights(source, flights, database)
        return {
            one.flight: lift_hysteresis.fitted([other for other in measured if other is not one])
            for one in measured
        }
    except InputError:
        return {}


def added_lift_hysteresis(
    source: FlightSource, database: AeroDatabase, flights: Sequence[str]
) -> tuple[AeroDatabase, Hypothesis]:
    """Return `database` with the state of the lift hysteresis that all these flights (ids) agree
    with, and its hypothesis.

    Raises InputError where they show none, and where the database has such a state already.
    """
    law = lift_hysteresis.fitted(stall_flights(source, flights, database))
    return lift_hysteresis.with_state(database, law), _with(law, {}, database, source.vehicle)


def with_unused_states(view: FlightView) -> FlightView:
    """Return the view with the channels (n,) of states that no term of its database uses yet."""
    chord = view.database.reference.chord
    state_channels = {
        state.name: state.along(view.time, view.channels, chord)
        for state in view.database.states
        if view.has(state.needs)
    }
    return replace(view, channels={**state_channels, **view.channels})


def one_stall(findings: Sequence[Finding]) -> list[Finding]:
    """Return the findings with at most one law of separation, static or smooth: the one with the
    lower adjusted p (a scalar, `Finding.p_adjusted`).
    """
    stalls = [finding for finding in findings if finding.effect == EFFECT]
    if not stalls:
        return list(findings)
    static = is_lift_hysteresis(min(stalls, key=lambda finding: finding.p_adjusted).hypothesis)
    return [
        finding
        for finding in findings
        if finding.effect != EFFECT or is_lift_hysteresis(finding.hypothesis) == static
    ]


def _with(
    law: Relay, others: Mapping[str, Relay], database: AeroDatabase, vehicle: Vehicle
) -> Hypothesis:
    (hypothesis,) = lift_hysteresis.template(law, others).hypotheses(
        LibraryContext(database, vehicle, frozenset())
    )
    return hypothesis
