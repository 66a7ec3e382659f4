"""Flights near the ground, flown again: over a runway that is not at sea level."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("jsbsim")

from aerodb.coefficients import total_coefficients
from aerodb.flight import Flight
from aerodb.simulation.flown_vehicle import stretch_model
from aerodb.simulation.replay import FlightStretch, fly_stretch, stretch_of
from tests.support.jsbsim_campaign import STEP, flown, imported, vehicle_of
from tests.support.jsbsim_cases import C172P, approaching
from tests.support.jsbsim_flights import FOOT

ELEVATION = 1500.0  # ft
#: Along the ground at a fifth of the span [s].
SINCE, UNTIL = 24.0, 29.0
DATABASE = imported(C172P)


def approach() -> Flight:
    """JSBSim's approach to a runway high above the sea, without noise."""
    plan = approaching(0)
    start = {**plan.start, "ic/terrain-elevation-ft": ELEVATION}
    start["ic/h-sl-ft"] = start["ic/h-sl-ft"] + ELEVATION
    channels = flown(C172P, replace(plan, start=start))
    time = np.arange(len(channels["V"]), dtype=np.float64) * STEP
    return Flight("approach", "c172p", time, channels)


def stretch(flight: Flight) -> FlightStretch:
    vehicle = vehicle_of(C172P, DATABASE)
    made = total_coefficients(flight, vehicle)
    return stretch_of(stretch_model(DATABASE, flight), flight, made, vehicle, SINCE, UNTIL)


def climb(flight: Flight, path: FlightStretch) -> float:
    """Largest error of the altitude [m] when it is flown without feedback."""
    run = fly_stretch(stretch_model(DATABASE, flight), path)
    return float(np.abs(run.channels["altitude"][:, 0] - path.flown["altitude"]).max())


def test_the_ground_is_where_the_height_says() -> None:
    """The rest is what JSBSim and this engine differ by in 5 s; without ground effect it sinks."""
    flight = approach()
    assert flight["height_above_ground"][flight.time > SINCE].min() < 3.0
    path = stretch(flight)
    assert path.series["ground_altitude"] == pytest.approx(ELEVATION * FOOT, abs=0.1)
    low = replace(path, series={**path.series, "ground_altitude": np.zeros(len(path.time))})
    assert climb(flight, path) < 0.3 < 3.0 < climb(flight, low)


def test_without_a_height_it_is_flown_outside_ground_effect_and_said() -> None:
    whole = approach()
    gone = {n: v for n, v in whole.channels.items() if n != "height_above_ground"}
    path = stretch(replace(whole, channels=gone))
    assert any("outside ground effect" in note for note in path.notes)
    height = path.flown["altitude"] - path.series["ground_altitude"]
    assert height.min() > 1.1 * DATABASE.reference.span


def test_a_height_that_is_lost_leaves_the_ground_where_it_was() -> None:
    whole = approach()
    lost = np.where(whole.time > SINCE + 2.0, np.nan, whole["height_above_ground"])
    path = stretch(whole.with_channels({"height_above_ground": lost}))
    assert path.series["ground_altitude"] == pytest.approx(ELEVATION * FOOT, abs=0.1)
