"""Delays: recovered where planted, with intervals that cover, and found in measured flight."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from aerodb.conditioning.delay import Delay, delay_between, delays
from aerodb.flight import Flight
from tests.support.kinematic_flights import kinematic_flight, waves
from tests.support.measured_flights import TWIN_OTTER, as_flight

STEP = 0.02


def channel_delay(flight: Flight, name: str, during: tuple[float, float] | None = None) -> Delay:
    """The delay of one channel."""
    return {delay.channel: delay for delay in delays(flight, during)}[name]


def late(flight: Flight, name: str, by: float) -> Flight:
    """The flight with one channel shown `by` seconds late."""
    shifted = CubicSpline(flight.time, flight[name])(np.maximum(flight.time - by, flight.time[0]))
    return flight.with_channels({name: shifted})


def test_delay_of_a_known_shift_is_found_to_a_fiftieth_of_a_sample() -> None:
    time = STEP * np.arange(2000)
    true = waves(np.random.default_rng(1), time + 5.0, 1.0)
    shifted = waves(np.random.default_rng(1), time + 5.0 - 0.0371, 1.0)
    found = delay_between(0.3 * shifted + 2.0, true, STEP)
    assert found.observable
    assert found.seconds == pytest.approx(0.0371, abs=4e-4)
    assert found.scale == pytest.approx(0.3, rel=5e-3)


def test_intervals_cover_the_truth_under_coloured_noise() -> None:
    errors = []
    for seed in range(100):
        rng = np.random.default_rng(seed)
        time = STEP * np.arange(1500)
        motion = CubicSpline(time, waves(rng, time, 1.0))
        noise = 0.1 * waves(rng, time, 1.0) + 0.05 * rng.standard_normal(1500)
        found = delay_between(motion(np.maximum(time - 0.03, 0.0)) + noise, motion(time), STEP)
        assert found.observable
        errors.append((found.seconds - 0.03) / found.standard_error)
    assert 0.86 <= np.mean(np.abs(errors) < 1.96) <= 1.0
    assert abs(np.mean(errors)) < 0.4


@pytest.mark.parametrize(
    ("name", "by"),
    [("alpha", 0.025), ("beta", 0.031), ("phi", 0.047), ("theta", -0.02), ("psi", 0.1)],
)
def test_planted_channel_delays(name: str, by: float) -> None:
    flight = late(kinematic_flight(11), name, by) if by > 0 else kinematic_flight(11)
    expected = by if by > 0 else 0.0
    found = channel_delay(flight, name)
    assert found.observable, found.because
    assert found.seconds == pytest.approx(expected, abs=max(3.0 * found.standard_error, 2e-3))
    assert found.standard_error < 0.01


def test_twin_otter_alpha_and_beta_are_late(measured: Callable[[str], Path]) -> None:
    """The vanes are .02-.03 s late against the kinematics; where a record hardly moves, nothing is
    claimed."""
    lateral, doublets, longitudinal = (as_flight(measured(record)) for record in TWIN_OTTER)
    for flight, name in ((lateral, "beta"), (doublets, "alpha"), (longitudinal, "alpha")):
        found = channel_delay(flight, name)
        assert found.observable
        assert 0.015 < found.seconds < 0.03
        assert found.standard_error < 0.003
        assert found.explained > 0.99
    assert not channel_delay(doublets, "beta").observable
    assert not channel_delay(longitudinal, "beta").observable
    assert not channel_delay(lateral, "alpha").observable


def test_attas_boom_looks_like_a_delay_of_its_lever_arm_over_airspeed(
    measured: Callable[[str], Path],
) -> None:
    """alpha 13.08 m ahead of the CG shows q x / V less: as if late by x / V = .10 s, until the boom
    is corrected."""
    flight = as_flight(measured("attas/fAttasElv1.mat"))
    assert channel_delay(flight, "alpha").seconds == pytest.approx(13.08 / 128.0, abs=0.02)
    corrected = flight.with_channels({"alpha": flight["alpha"] + flight["q"] * 13.08 / flight["V"]})
    assert abs(channel_delay(corrected, "alpha").seconds) < 0.03


def test_a_channel_that_does_not_follow_its_kinematics_gets_no_delay() -> None:
    flight = kinematic_flight(12)
    rng = np.random.default_rng(12)
    other = flight.with_channels({"alpha": 0.08 + waves(rng, flight.time, 0.02)})
    found = channel_delay(other, "alpha")
    assert not found.observable
    assert found.standard_error == np.inf
    assert "explain" in found.because
    scaled = flight.with_channels({"theta": 1.4 * flight["theta"]})
    assert "other than a delay" in channel_delay(scaled, "theta").because


def test_missing_inputs_and_short_records() -> None:
    flight = kinematic_flight(13)
    without = Flight(
        "w", "synthetic", flight.time, {name: flight[name] for name in ("theta", "alpha", "V")}
    )
    found = channel_delay(without, "alpha")
    assert (found.observable, found.because) == (False, "q, ax, az not in the flight")
    assert "too short" in delay_between(np.ones(20), np.ones(20), STEP).because
    assert delay_between(np.ones(500), np.ones(500), STEP).because == "nothing moves"
    assert [d.channel for d in delays(flight)] == ["alpha", "beta", "V", "phi", "theta", "psi"]
    during = channel_delay(flight, "theta", during=(5.0, 35.0))
    assert abs(during.seconds) < 0.005
