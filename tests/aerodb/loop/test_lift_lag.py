"""Lift that follows the angle of attack late has a name, is added as a state, and repairs flights
that were not used; what it resembles is not claimed."""

from dataclasses import replace

import numpy as np
import pytest

from aerodb.loop import Accept, LoopResult, freeze_library, run_loop
from aerodb.nomenclature import AXES
from aerodb.tables import (
    AeroDatabase,
    Increment,
    Interval,
    Rate,
    StateModel,
    number,
    parse,
    slopes_by,
    transfer_moments,
)
from tests.aerodb.loop import test_axis_models
from tests.support.flights_in_memory import FlightsInMemory, noisy_flights

_LAG = 10.0  # chords: between two of the library
_SLOPE = 4.0  # 1/rad of CZ, of what lags


def lagging(database: AeroDatabase) -> AeroDatabase:
    """`database` whose CZ is late by `_LAG`."""
    name, chord = "late", number(_LAG * database.reference.chord)
    state = StateModel(name, Rate(parse(f"(alpha - {name})*V/{chord}"), unit="rad"))
    term = Increment(
        "CZ",
        (parse(f"{name} - alpha"),),
        np.array([-_SLOPE]),
        np.array([[1e-4]]),
        {"alpha": Interval(-1.0, 1.0, 0.1)},
        ("one",),
    )
    return replace(
        database, states=(state,), free_inputs={name: "angle that lags"}, increments=(term,)
    )


def flights(flown: AeroDatabase) -> FlightsInMemory:
    """Flights whose CZ has what `flown` has beyond its steady coefficients."""
    source = noisy_flights(range(60, 66), flown, np.random.default_rng(5))
    seen = {}
    for id, (flight, made) in source.flown.items():
        late = flown.states_along(flight.time, flight.channels)["late"] - flight["alpha"]
        force = {axis: -_SLOPE * late if axis == "CZ" else 0.0 * late for axis in AXES}
        reference, point = flown.reference, made.moment_reference
        more = transfer_moments(force, reference.moment_reference, point, reference)
        values = {axis: made.values[axis] + more[axis] for axis in AXES}
        seen[id] = (flight, replace(made, values=values))
    return FlightsInMemory(source.vehicle, seen)


def closed(source: FlightsInMemory, known: AeroDatabase) -> LoopResult:
    *identified, _ = source.flown
    library = freeze_library(source, tuple(identified), known)
    return run_loop(source, tuple(identified), known, library, Accept())


def test_lift_that_lags_is_found_added_and_predicts_another_flight() -> None:
    known = test_axis_models.database(1.0)
    flown = lagging(known)
    source = flights(flown)
    loop = closed(source, known)
    named = [finding for finding in loop.added if finding.effect == "lift_lag"]
    assert named
    assert {finding.effect for finding in loop.added} == {"lift_lag"}
    assert {finding.subject for finding in named} <= {"8_chords", "13_chords"}
    *_, held_out = source.flown
    before, after, least = (
        test_axis_models.error(source, held_out, model, "CZ")
        for model in (known, loop.candidate, flown)
    )
    assert before > 2.0 * least
    assert after**2 - least**2 < 0.03 * (before**2 - least**2)


def test_the_slope_of_lift_that_lags_is_that_of_steady_flight() -> None:
    """The error of a vane lasts, and so it reaches the lift."""
    known = test_axis_models.database(1.0)
    names = {*known.inputs, "late", "V"}
    channels = {name: np.full(3, 0.01) for name in names} | {"V": np.full(3, 50.0)}
    slow, quick = (slopes_by(each, "alpha", channels)["CZ"] for each in (known, lagging(known)))
    assert quick == pytest.approx(slow, rel=1e-6)
