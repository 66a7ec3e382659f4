"""Stalls in the loop.

Where flights stall, the shape of each flight's stall is fitted to the others, and what is found is
added with its state model. Flights that do not stall cost nothing here.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from aerodb.conditioning import Segment
from aerodb.effects import (
    STALL_GAIN_BOUNDS,
    FlightView,
    Hypothesis,
    LibraryContext,
    StallFlight,
    cross_fit_shapes,
    fit_shape,
    stall_hypotheses,
    stall_regressors,
    surfaces_of,
    zero_lift_alpha,
)
from aerodb.errors import InputError
from aerodb.estimation import least_squares
from aerodb.loop.flight_source import FlightSource
from aerodb.signals import bridge
from aerodb.support import NEARLY_ALL, Array
from aerodb.tables import (
    STATE_CHANNEL,
    AeroDatabase,
    Increment,
    Law,
    StateModel,
    continued,
    evaluate,
    flown_envelope,
    parse,
)
from aerodb.vehicle import Vehicle

EFFECT: Final = "stall_hysteresis"
#: The family of shapes: fixed before a residual is looked at, as its numbers cannot be.
FAMILY: Final = "kirchhoff"
#: Part of the angle of attack of a stall from which a flight counts as one that stalls. Lift does
#: not give way at one angle.
NEAR: Final = NEARLY_ALL
#: Least way [rad] that a surface must go in every flight for its effect on the attached flow to be
#: corrected.
LEAST: Final = np.deg2rad(2.0)


def stalled_flights(source: FlightSource, flights: Sequence[str]) -> tuple[str, ...]:
    """Return the flights (ids) that come near the angle of attack at which the lift of one of them
    breaks.

    Empty where fewer than two do: one flight cannot validate a shape that was fitted to it.

    Angles are in rad.
    """
    spans = {
        flight: [each for each in source.segments(flight) if each.kind == "stall"]
        for flight in flights
    }
    if not any(spans.values()):
        return ()
    alphas = {flight: _alpha(source, flight) for flight in flights}
    onsets = [
        float(alphas[flight][0][_at(alphas[flight][1], each)])
        for flight, segments in spans.items()
        for each in segments
    ]
    reached = tuple(
        flight
        for flight, (alpha, _) in alphas.items()
        if float(np.nanmax(alpha)) >= NEAR * min(onsets)
    )
    return reached if len(reached) > 1 else ()


def _at(time: Array, segment: Segment) -> int:
    return int(np.searchsorted(time, segment.start))


def _alpha(source: FlightSource, flight: str) -> tuple[Array, Array]:
    """Angle of attack (n,) rad, bridged where it is flagged (-inf without any), and time from the
    first sample."""
    channels = source.flight(flight)
    if "alpha" not in channels:
        return np.full(len(channels.time), -np.inf), channels.time - channels.time[0]
    alpha = bridge(np.where(channels.usable(["alpha"]), channels["alpha"], np.nan))
    return alpha, channels.time - channels.time[0]


def of_family(hypotheses: Sequence[Hypothesis]) -> tuple[Hypothesis, ...]:
    """Return the library with the stall stated by its family: this is frozen and hashed. Ids and
    columns (n,) of the others stay; see docs/method/tracing.md, section 2."""
    formula = f"{{}}; {STATE_CHANNEL} of family {FAMILY}, each flight's shape from the others"
    return tuple(
        replace(
            h,
            formula=formula.format(
                ", ".join(f"{axis} += k*({regressor})" for axis, regressor in h.increment)
            ),
        )
        if h.effect == EFFECT
        else h
        for h in hypotheses
    )


def with_laws(
    hypotheses: Sequence[Hypothesis],
    laws: Mapping[str, Law],
    database: AeroDatabase,
    vehicle: Vehicle,
) -> tuple[Hypothesis, ...]:
    """Return the library with the columns of each flight's own law; ids, formulas and hash
    unchanged. Columns (n,) are per unit of each gain.
    """
    fitted_stalls = {
        each.id: each
        for each in stall_hypotheses(LibraryContext(database, vehicle, frozenset()), laws)
    }
    return tuple(
        replace(h, tangent=fitted_stalls[h.id].tangent) if h.id in fitted_stalls else h
        for h in hypotheses
    )


def cross_fitted_laws(
    source: FlightSource, flights: Sequence[str], database: AeroDatabase
) -> dict[str, Law]:
    """Return, for each flight, the law that the others agree with.

    Empty where no shape separates their flow, or they lack channels that it needs.

    Angles of a law are in rad.
    """
    try:
        shapes = cross_fit_shapes(stall_flights(source, flights, database), FAMILY)
    except InputError:
        return {}
    return {flight: shape.law for flight, shape in shapes.items() if shape.law is not None}


def added_stall(
    source: FlightSource, database: AeroDatabase, flights: Sequence[str]
) -> AeroDatabase:
    """Return `database` with the stall that all these flights (ids) agree with.

    Its state model, its gains on all axes, and the corrections of the attached flow with which it
    was estimated. One flow stalls, so that no axis takes it alone. Covariances are those of least
    squares with coloured residuals for the shape as it is: that the shape was searched for is not
    in them. Raises InputError where no shape separates the flow of these flights.
    """
    stalls = stall_flights(source, flights, database)
    shape = fit_shape(stalls, FAMILY)
    law = shape.law
    assert law is not None  # the family has memory
    columns = [shape.columns(each) for each in stalls]
    with_state = replace(
        database,
        states=(
            *database.states,
            StateModel(STATE_CHANNEL, law, f"{FAMILY} of {len(stalls)} flights"),
        ),
    )
    views = [source.view(each.flight, database) for each in stalls]
    flown = [
        ({**view.channels, STATE_CHANNEL: f.attached(law)}, f.usable)
        for view, f in zip(views, stalls, strict=True)
    ]
    increments = []
    for axis, gain in shape.gains.items():
        names = (*(parse(name) for name in _free(views, axis)), stall_regressors(database)[axis])
        rows = [
            np.column_stack([f.nuisance[axis], c[axis]])[f.usable]
            for f, c in zip(stalls, columns, strict=True)
        ]
        response = np.concatenate([f.residual[axis][f.usable] for f in stalls])
        lengths = [len(each) for each in rows]
        covariance = least_squares(
            np.concatenate(rows), response, [str(name) for name in names], lengths
        ).covariance
        envelope = flown_envelope(
            frozenset[str]().union(*(name.names for name in names)), flown, database
        )
        values = np.append(shape.nuisance[axis], gain)
        note = f"traced: {EFFECT} with the attached flow's corrections"
        increments.append(
            continued(
                Increment(axis, names, values, covariance, envelope, tuple(flights), note), database
            )
        )
    return replace(with_state, increments=(*with_state.increments, *increments))


def _free(views: Sequence[FlightView], axis: str) -> tuple[str, ...]:
    """Corrections of the attached flow together with a stall: constant, alpha, pitch rate, pitch
    surfaces; alpha^2 of drag.

    A surface that hardly moves in one of the flights stays out: it would be estimated from noise
    there, and applied elsewhere.
    """
    surfaces = [
        f"delta_{each.name}"
        for each in surfaces_of(views[0].vehicle, views[0].channels)
        if each.role == "pitch"
    ]
    moved = [
        name
        for name in surfaces
        if all(view.has([name]) and np.ptp(view[name]) > LEAST for view in views)
    ]
    linear = (
        "1",
        *(name for name in ("alpha", "q_hat") if all(view.has([name]) for view in views)),
        *moved,
    )
    return (*linear, "alpha^2") if axis == "C_drag" else linear


def stall_flights(
    source: FlightSource, flights: Sequence[str], database: AeroDatabase
) -> list[StallFlight]:
    """Return the flights (ids) as stall shapes need them, compared with a database.

    Raises InputError where one lacks lift, drag and pitching moment, or angle of attack.

    Channels are (n,), in SI units.
    """
    views = [source.view(flight, database) for flight in flights]
    return [_stall_flight(source, view, views, database) for view in views]


def _stall_flight(
    source: FlightSource, view: FlightView, views: Sequence[FlightView], database: AeroDatabase
) -> StallFlight:
    comparison = view.comparison
    axes = [axis for axis in STALL_GAIN_BOUNDS if axis in comparison.usable]
    if not axes or not view.has(["alpha", "V"]):
        raise InputError(
            "no lift, drag or pitching moment beside alpha and V",
            f"flight {view.flight}",
            "see its coefficients",
        )
    return StallFlight(
        flight=view.flight,
        time=view.time,
        alpha=view["alpha"],
        V=view["V"],
        chord=database.reference.chord,
        residual={axis: np.nan_to_num(comparison.residual(axis)) for axis in axes},
        nuisance={
            axis: np.column_stack([_column(view, name) for name in _free(views, axis)])
            for axis in axes
        },
        usable=np.logical_and.reduce([comparison.usable[axis] for axis in axes]),
        alpha_0=zero_lift_alpha(database),
    )


def _column(view: FlightView, name: str) -> Array:
    return np.array(np.broadcast_to(evaluate(parse(name), view.channels), view.time.shape))
