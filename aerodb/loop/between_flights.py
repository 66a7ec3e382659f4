"""What differs between flights of a closed loop: flight conditions, and effects that change with
them.

docs/method/tracing.md, section 25.
"""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from aerodb.effects import FlightView, Hypothesis, surfaces_of
from aerodb.loop.flight_source import FlightSource
from aerodb.loop.frozen_library import Library
from aerodb.loop.rounds import LoopResult
from aerodb.tracing import FlightDependence, dependences_on_conditions

#: Condition -> least spread (standard deviation) over the flights at which it counts as different,
#: relative to its mean.
_RELATIVE: Final[Mapping[str, float]] = {"qbar": 0.05, "mach": 0.05, "mass": 0.02}
#: The same of angles [rad].
_ABSOLUTE: Final[Mapping[str, float]] = {"alpha": np.deg2rad(0.5)}
#: Likewise of a deflection that is set for a flight [rad, or a part].
_CONFIGURED: Final = np.deg2rad(1.0)
#: Surfaces that are set rather than flown.
_SETTINGS: Final = frozenset({"flap", "landing_gear", "speed_brake"})


def dependences_between_flights(
    source: FlightSource, flights: Sequence[str], library: Library, loop: LoopResult
) -> tuple[FlightDependence, ...]:
    """Return which effects change with the conditions of the flights (ids) that identify.

    Flights are compared with the loop's candidate, with the terms and sensors of its last round.
    Conditions are the mean dynamic pressure, Mach number, angle of attack, mass, and settings of
    flaps, landing gear and speed brakes, as far as they differ between flights. Empty below five
    flights. Slopes are per SI unit of the condition; see docs/method/tracing.md, section 25. Raises
    InputError where a flight lacks what is needed.
    """
    if len(flights) < library.settings.fewest:
        return ()

    views = [source.view(id, loop.candidate) for id in flights]
    conditions = conditions_of(views)
    if not conditions:
        return ()
    normal_equations = source.normal_equations(flights, loop.candidate, library)
    return dependences_on_conditions(
        normal_equations,
        library.hypotheses,
        library.settings,
        loop.traced,
        conditions,
        [finding.hypothesis for finding in loop.added],
        lambda hypothesis: _size(hypothesis, views),
    )


def conditions_of(views: Sequence[FlightView]) -> dict[str, dict[str, float]]:
    """Return condition -> flight -> its mean over the samples used, as a scalar in the channel's SI
    unit (qbar [Pa], angles [rad], mass [kg]); only those that differ between flights.
    """
    configured = {
        surface.channel
        for surface in (surfaces_of(views[0].vehicle, views[0].channels) if views else ())
        if surface.role in _SETTINGS
    }
    conditions: dict[str, dict[str, float]] = {}
    for name in (*_RELATIVE, *_ABSOLUTE, *sorted(configured)):
        means = {view.flight: _mean(view, name) for view in views if view.has([name])}
        level = list(means.values())
        least = _ABSOLUTE.get(name, _CONFIGURED)
        if name in _RELATIVE:
            least = _RELATIVE[name] * abs(float(np.mean(level))) if level else 0.0
        if len(level) > 1 and float(np.std(level)) > least:
            conditions[name] = means
    return conditions


def _mean(view: FlightView, name: str) -> float:
    used = np.logical_or.reduce(list(view.usable.values()))
    return float(view[name][used].mean()) if used.any() else float(view[name].mean())


def _size(hypothesis: Hypothesis, views: Sequence[FlightView]) -> float | None:
    """Mean slope that the database has by the one channel of a hypothesis that is linear in it;
    None for others."""
    if hypothesis.kind != "aerodynamic" or len(hypothesis.increment) != 1:
        return None
    axis, regressor = hypothesis.increment[0]
    if str(regressor) not in regressor.names:
        return None
    slopes = [view.slope(str(regressor)).get(axis) for view in views if view.has(regressor.names)]
    known = [float(slope.mean()) for slope in slopes if slope is not None]
    return float(np.mean(known)) if known else None
