"""Wild points: found where planted, nowhere else."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

from aerodb.conditioning.wild_points import (
    flag_wild_points,
    physical_range,
    spikes,
    stuck,
    wild_points,
)
from aerodb.flight import Flight
from aerodb.nomenclature import FLAGS
from tests.support.kinematic_flights import kinematic_flight
from tests.support.measured_flights import RECORDS, as_flight

STEP = 0.02


@pytest.mark.parametrize("colour", [0.0, 0.5, 0.9, 0.99])
def test_clean_coloured_noise_has_hardly_a_spike(colour: float) -> None:
    rng = np.random.default_rng(4)
    assert spikes(lfilter([1.0], [1.0, -colour], rng.standard_normal(100_000))).sum() <= 2


def test_sharp_inputs_are_no_spikes() -> None:
    rng = np.random.default_rng(5)
    command = np.repeat([0.0, 0.1, -0.1, 0.1, -0.1, 0.0], [200, 75, 50, 25, 25, 200])
    assert not spikes(command).any()
    assert not spikes(command + 1e-3 * rng.standard_normal(len(command))).any()
    assert not spikes(
        lfilter([0.3], [1.0, -0.7], command) + 1e-4 * rng.standard_normal(len(command))
    ).any()


@pytest.mark.parametrize("length", [1, 2, 3])
def test_planted_spikes_are_found_and_nothing_else(length: int) -> None:
    flight = kinematic_flight(6, seconds=15.0, rate=200.0)
    rng = np.random.default_rng(6)
    for name, size in (("q", 0.3), ("az", 25.0), ("alpha", 0.1)):
        spike = np.zeros(len(flight.time))
        for at in rng.choice(np.arange(50, 2900, 60), 15, replace=False):
            spike[at : at + length] = size * rng.choice([-1.0, 1.0])
        found, planted = spikes(flight[name] + spike), spike != 0.0
        assert (found & planted).sum() >= 0.95 * planted.sum()
        assert (found & ~planted).sum() <= 0.05 * planted.sum()


def test_a_stuck_stretch_is_found_exactly_and_a_quantised_turning_point_is_not() -> None:
    values = kinematic_flight(7)["q"]
    held = values.copy()
    held[700:800] = held[700]
    assert np.flatnonzero(stuck(held, STEP)).tolist() == list(range(700, 800))
    assert not stuck(values, STEP).any()
    coarse = np.round(0.02 * np.sin(0.5 * STEP * np.arange(3000)), 3)
    assert not stuck(coarse, STEP).any()


def test_flags_carry_reasons_and_no_value_changes() -> None:
    flight = kinematic_flight(8)
    bad = {name: flight[name].copy() for name in ("q", "alpha", "theta")}
    bad["q"][500] += 1.0
    bad["alpha"][300:400] = bad["alpha"][300]
    bad["theta"][900] = 7.0
    planted = flight.with_channels(bad)
    flagged = flag_wild_points(planted)
    assert np.flatnonzero(flagged.flags["q"] & FLAGS["wild_point"]).tolist() == [500]
    assert np.flatnonzero(flagged.flags["alpha"] & FLAGS["stuck"]).tolist() == list(range(300, 400))
    assert np.flatnonzero(flagged.flags["theta"] & FLAGS["implausible"]).tolist() == [900]
    assert any(note.startswith("q: 1 spikes, the first at 10") for note in flagged.notes)
    for name in planted.channels:
        np.testing.assert_array_equal(flagged[name], planted[name])
    assert flag_wild_points(flight).flags == {}


@pytest.mark.parametrize("record", RECORDS)
def test_measured_records_have_at_most_single_wild_points(
    measured: Callable[[str], Path], record: str
) -> None:
    """Two real ones are known: a sample of the pitch rate 0.01 rad/s off its neighbours in Elv1
    (24.92 s) and one in AilRud1."""
    flight = as_flight(measured(record))
    flagged = flag_wild_points(flight)
    new = {
        name: int((bits & 0xC2 > 0).sum())
        for name, bits in flagged.flags.items()
        if (bits & 0xC2).any()
    }
    assert sum(new.values()) <= 2
    if record.endswith("Elv1.mat"):
        assert new == {"q": 1}
        assert flagged.time[np.argmax(flagged.flags["q"])] == pytest.approx(24.92)


def test_nothing_to_judge() -> None:
    assert spikes(np.zeros(0)).shape == (0,)
    assert not spikes(np.full(100, np.nan)).any()
    assert not wild_points("q", np.zeros(50), STEP).stuck.any()
    assert physical_range("delta_elevator") == (-2 * np.pi / 3, 2 * np.pi / 3)
    assert physical_range("mass") is None
    short = Flight("s", "synthetic", np.array([0.0, STEP]), {"q": np.array([0.0, 0.1])})
    assert flag_wild_points(short).flags == {}
