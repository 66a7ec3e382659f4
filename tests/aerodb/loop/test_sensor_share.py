"""What sensors that were found to be wrong leave in a comparison."""

from dataclasses import replace

import numpy as np
import pytest

from aerodb.coefficients import total_coefficients
from aerodb.increments import HoldOut
from aerodb.loop import Accept, freeze_library, run_loop, validate_loop
from aerodb.loop.sensor_share import beside_sensors, compared_with
from aerodb.tables import Increment, Interval, parse
from tests.aerodb.loop import test_axis_models
from tests.support.flights_in_memory import FlightsInMemory, noisy_flights


def test_an_accelerometer_that_is_off_leaves_nothing_on_any_axis() -> None:
    source, known, off = (
        test_axis_models.flights(range(60, 62), 0.0),
        test_axis_models.database(1.0),
        0.1,
    )  # m/s2
    ids, seen = tuple(source.flown), {}
    for id, (flight, _) in source.flown.items():
        high = flight.with_channels({"az": flight["az"] + off})
        made = total_coefficients(high, source.vehicle, angular_acceleration="logged")
        seen[id] = (high, made)
    wrong = FlightsInMemory(source.vehicle, seen)
    library = freeze_library(wrong, ids, known)
    found = {"accelerometer_bias@all:z": off}
    right = compared_with(beside_sensors(wrong, ids, known, library, found), ids, known)
    for id in ids:
        before, after, truth = wrong.comparison(id, known), right[id], source.comparison(id, known)
        for axis in ("CZ", "C_lift", "C_drag", "Cm"):
            usable = before.usable[axis] & truth.usable[axis]
            added, left = (
                np.abs((each.residual(axis) - truth.residual(axis))[usable]).max()
                for each in (before, after)
            )
            assert added > 1e-4, axis
            assert left <= 0.01 * added, axis
    assert beside_sensors(wrong, ids, known, library, {}) is wrong


def test_a_wrong_centre_of_gravity_leaves_nothing_where_the_lift_is_wrong_too() -> None:
    """Its moment is that of the lift as it is, not as a database has it that lacks half of it."""
    known, off = test_axis_models.database(1.0), 0.1  # m
    lift = Increment(
        "CZ",
        (parse("alpha"),),
        np.array([-3.0]),
        np.array([[1e-4]]),
        {"alpha": Interval(-0.5, 0.5, 0.1)},
        ("one",),
    )
    flown = replace(known, increments=(lift,))
    source = noisy_flights(range(60, 62), flown, np.random.default_rng(5), 0.0)
    ids = tuple(source.flown)
    library = freeze_library(source, ids, known)
    (cg,) = (h for h in library.hypotheses if h.id == "cg_offset@all:x")
    seen = {}
    for id, (flight, made) in source.flown.items():
        column = cg.columns(source.view(id, flown))["Cm"]
        more = {**made.values, "Cm": made.values["Cm"] + off * column}
        seen[id] = (flight, replace(made, values=more))
    wrong = FlightsInMemory(source.vehicle, seen)
    right = compared_with(beside_sensors(wrong, ids, known, library, {cg.id: off}), ids, known)
    for id in ids:
        before, after, truth = wrong.comparison(id, known), right[id], source.comparison(id, known)
        usable = before.usable["Cm"] & truth.usable["Cm"]
        added, left = (
            np.std((each.residual("Cm") - truth.residual("Cm"))[usable]) for each in (before, after)
        )
        assert left <= 0.01 * added


@pytest.mark.parametrize("axis", ["x", "z"])
def test_what_is_missing_beside_a_wrong_centre_of_gravity_is_judged_without_it(axis: str) -> None:
    """The pitch damping lacks, and the centre of gravity is off: both are found, the damping enters
    with its size, nothing imitates the other, and errors are told without the centre of gravity.

    Off along x, it leaves so much that the damping is only seen without it."""
    whole, off = test_axis_models.database(1.0), 0.1  # m
    damping = Increment(
        "Cm",
        (parse("q_hat"),),
        np.array([-4.0]),
        np.array([[1e-4]]),
        {"alpha": Interval(-0.5, 0.5, 0.1)},
        ("one",),
    )
    flown = replace(whole, increments=(damping,))
    source = noisy_flights(range(60, 66), flown, np.random.default_rng(5), 1.0)
    ids = tuple(source.flown)
    (cg,) = (
        h for h in freeze_library(source, ids, whole).hypotheses if h.id == f"cg_offset@all:{axis}"
    )
    seen = {}
    for id, (flight, made) in source.flown.items():
        columns = cg.columns(source.view(id, whole))
        more = {axis: made.values[axis] + off * column for axis, column in columns.items()}
        seen[id] = (flight, replace(made, values={**made.values, **more}))
    wrong = FlightsInMemory(source.vehicle, seen)
    split = HoldOut(ids[:5], ids[5:], "held-out")
    library = freeze_library(wrong, split.identified, whole)
    loop = run_loop(wrong, split.identified, whole, library, Accept())
    found = {finding.hypothesis: finding for finding in loop.findings}
    assert found[cg.id].verdict == "sensor"
    assert [finding.hypothesis for finding in loop.added] == ["pitch_damping@Cm"]
    assert found["pitch_damping@Cm"].verdict == "confirmed"
    assert found["pitch_damping@Cm"].value == pytest.approx(-4.0, rel=0.1)
    axes = {entry.axis: entry for entry in validate_loop(wrong, split, library, loop, Accept())}
    (held,) = split.held_out
    truth = test_axis_models.error(source, held, flown)
    measured = test_axis_models.error(wrong, held, flown)
    assert measured > 2.0 * truth
    assert axes["Cm"].held_out_rms_after == pytest.approx(truth, rel=0.5)
