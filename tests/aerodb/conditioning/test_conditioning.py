"""Local polynomials against direct fits, noise from data, and wild points: found where planted, nowhere else."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

from aerodb.conditioning.local_polynomial import half_width, local_polynomial, noise_covariance
from aerodb.conditioning.wild_points import flag_wild_points, physical_range, spikes, stuck, wild_points
from aerodb.flight import Flight
from aerodb.nomenclature import FLAGS
from tests.support.kinematic_flights import kinematic_flight
from tests.support.measured_flights import RECORDS, as_flight

STEP = 0.02


@pytest.mark.parametrize("at", [0, 3, 40, 97, 120, 199])
def test_local_polynomial_is_the_weighted_fit_of_its_window(at: int) -> None:
    rng = np.random.default_rng(1)
    values = np.cumsum(rng.standard_normal(200)) + 100.0
    good = np.ones(200, dtype=bool)
    good[95:99] = False
    half = half_width(STEP, 2.0)
    smoothed = local_polynomial(values, STEP, 2.0, good)
    centre = int(np.clip(at, half, 199 - half))
    window = np.arange(centre - half, centre + half + 1)
    window = window[good[window]]
    weight = 1.0 - ((window - centre) / (half + 1)) ** 2
    fit = np.polyfit((window - at) * STEP, values[window], 2, w=np.sqrt(weight))
    assert smoothed.value[at] == pytest.approx(fit[2], rel=1e-9)
    assert smoothed.rate[at] == pytest.approx(fit[1], rel=1e-7, abs=1e-9)


def test_local_polynomial_reproduces_a_parabola_to_its_ends() -> None:
    time = STEP * np.arange(100)
    smoothed = local_polynomial(1.0 - 2.0 * time + 3.0 * time**2, STEP, 1.5)
    np.testing.assert_allclose(smoothed.value, 1.0 - 2.0 * time + 3.0 * time**2, atol=1e-9)
    np.testing.assert_allclose(smoothed.rate, -2.0 + 6.0 * time, atol=1e-8)


def test_stated_errors_are_the_scatter_everywhere_and_larger_at_the_ends() -> None:
    rng = np.random.default_rng(2)
    time = STEP * np.arange(600)
    true, slope = np.sin(2 * np.pi * 0.1 * time), 0.2 * np.pi * np.cos(2 * np.pi * 0.1 * time)
    trials = [local_polynomial(true + 0.1 * rng.standard_normal(600), STEP, 1.5) for _ in range(200)]
    for at in (0, 5, 300, 599):
        assert np.std([(s.value[at] - true[at]) / s.value_sigma[at] for s in trials]) == pytest.approx(1.0, abs=0.2)
        assert np.std([(s.rate[at] - slope[at]) / s.rate_sigma[at] for s in trials]) == pytest.approx(1.0, abs=0.2)
    assert trials[0].rate_sigma[0] > 3.0 * trials[0].rate_sigma[300]
    assert np.mean([s.noise for s in trials]) == pytest.approx(0.1, rel=0.02)


def test_bandwidth_is_where_a_sine_is_halved() -> None:
    time = STEP * np.arange(2000)
    for wanted in (0.5, 2.0, 6.0):
        smoothed = local_polynomial(np.zeros(2000), STEP, wanted)
        assert smoothed.bandwidth == pytest.approx(wanted, rel=0.15)
        sine = local_polynomial(np.sin(2 * np.pi * smoothed.bandwidth * time), STEP, wanted).value
        assert np.max(np.abs(sine[400:-400])) == pytest.approx(0.5, abs=0.02)


def test_a_long_gap_has_no_value_and_a_short_record_is_refused() -> None:
    values = np.ones(300)
    values[100:200] = np.nan
    smoothed = local_polynomial(values, STEP, 2.0)
    assert np.isnan(smoothed.value[150])
    assert smoothed.value[50] == pytest.approx(1.0)
    with pytest.raises(ValueError, match="fewer than the window"):
        local_polynomial(np.ones(10), STEP, 1.0)
    with pytest.raises(ValueError, match="Nyquist"):
        local_polynomial(np.ones(100), STEP, 30.0)


def test_noise_covariance_of_correlated_channels() -> None:
    rng = np.random.default_rng(3)
    time = STEP * np.arange(6000)
    true = np.array([[4.0, 1.5], [1.5, 1.0]])
    noise = rng.multivariate_normal([0.0, 0.0], true, 6000).T
    channels = {"p": 20 * np.sin(time) + noise[0], "q": 10 * np.cos(0.7 * time) + noise[1]}
    found = noise_covariance(channels, STEP, 2.0)
    np.testing.assert_allclose(found.covariance, true, rtol=0.08)
    assert found.correlation[0, 1] == pytest.approx(0.75, abs=0.03)


@pytest.mark.parametrize("colour", [0.0, 0.5, 0.9, 0.99])
def test_clean_coloured_noise_has_hardly_a_spike(colour: float) -> None:
    rng = np.random.default_rng(4)
    assert spikes(lfilter([1.0], [1.0, -colour], rng.standard_normal(100_000))).sum() <= 2


def test_sharp_inputs_are_no_spikes() -> None:
    rng = np.random.default_rng(5)
    command = np.repeat([0.0, 0.1, -0.1, 0.1, -0.1, 0.0], [200, 75, 50, 25, 25, 200])
    assert not spikes(command).any()
    assert not spikes(command + 1e-3 * rng.standard_normal(len(command))).any()
    assert not spikes(lfilter([0.3], [1.0, -0.7], command) + 1e-4 * rng.standard_normal(len(command))).any()


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
def test_measured_records_have_at_most_single_wild_points(measured: Callable[[str], Path], record: str) -> None:
    """Two real ones are known: a sample of the pitch rate 0.01 rad/s off its neighbours in Elv1 (24.92 s) and one in AilRud1."""
    flight = as_flight(measured(record))
    flagged = flag_wild_points(flight)
    new = {name: int((bits & 0xC2 > 0).sum()) for name, bits in flagged.flags.items() if (bits & 0xC2).any()}
    assert sum(new.values()) <= 2
    if record.endswith("Elv1.mat"):
        assert new == {"q": 1}
        assert flagged.time[np.argmax(flagged.flags["q"])] == pytest.approx(24.92)


def test_nothing_to_judge() -> None:
    assert spikes(np.zeros(0)).shape == (0,)
    assert not spikes(np.full(100, np.nan)).any()
    assert not wild_points("q", np.zeros(50), STEP).stuck.any()
    assert physical_range("delta_elevator") == (-np.pi / 2, np.pi / 2)
    assert physical_range("mass") is None
    short = Flight("s", "synthetic", np.array([0.0, STEP]), {"q": np.array([0.0, 0.1])})
    assert flag_wild_points(short).flags == {}
