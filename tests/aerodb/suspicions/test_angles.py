"""Angles against the motion: a flight in closed form, measured ones, an upwash and delays planted,
gusts, and nothing to say where there is nothing."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

from aerodb.flight import Flight
from aerodb.physics import GRAVITY
from aerodb.suspicions import limits_flight
from aerodb.suspicions.angles import angle_suspicions
from tests.support.measured_flights import TWIN_OTTER, as_flight

V, STEP = 60.0, 0.02


def flown(noise: float = 1.0, size: float = 0.03, gusts: float = 0.0) -> Flight:
    """A flight at constant airspeed whose normal acceleration is the one that its alpha and theta
    need: ``V (gammadot) = -az cos(alpha) + ax sin(alpha) - g cos(gamma)``, gamma = theta - alpha."""
    t = np.arange(0.0, 30.0, STEP)
    alpha = 0.06 + size * (np.sin(3.0 * t) + 0.5 * np.sin(1.7 * t + 1.0))
    alphadot = size * (3.0 * np.cos(3.0 * t) + 0.85 * np.cos(1.7 * t + 1.0))
    theta = 0.08 + 0.1 * np.sin(1.3 * t)
    q, ax, gamma = 0.13 * np.cos(1.3 * t), 0.4, theta - alpha
    az = (V * (alphadot - q) - GRAVITY * np.cos(gamma) + ax * np.sin(alpha)) / np.cos(alpha)
    rng = np.random.default_rng(5)
    felt = gusts * np.convolve(rng.standard_normal(len(t)), np.ones(20) / np.sqrt(20.0), "same")

    def sensed(values: Any, sigma: float) -> np.ndarray:
        return np.asarray(values + noise * sigma * rng.standard_normal(len(t)))

    channels = {
        "V": sensed(V, 0.1),
        "alpha": sensed(alpha + felt, 2e-3),
        "q": sensed(q, 1e-3),
        "theta": sensed(theta, 1e-3),
        "ax": sensed(ax, 0.05),
        "az": sensed(az, 0.05),
    }
    return Flight("vane", "light", t, channels)


def scaled(flight: Flight, factor: float) -> Flight:
    return flight.with_channels({"alpha": factor * flight["alpha"]})


@pytest.mark.parametrize("factor", [1.1**2, 1.3**2])
def test_an_inverted_upwash_shows_its_square(factor: float) -> None:
    (found,) = angle_suspicions(scaled(flown(), factor))
    assert found.channel == "alpha"
    assert found.evidence["ratio"] == pytest.approx(factor, rel=0.01)
    assert "upwash" in found.sentence
    assert not limits_flight(found)  # flight-path reconstruction judges it


@pytest.mark.parametrize("factor", [1.0, 1.1, 0.8])
def test_a_right_vane_and_one_without_a_correction_are_no_fault(factor: float) -> None:
    assert angle_suspicions(scaled(flown(), factor)) == ()
    assert angle_suspicions(scaled(flown(noise=0.0), factor)) == ()


def test_a_measured_vane(measured: Callable[[str], Path]) -> None:
    """Twin Otter, pulses of the elevator: a vane on a boom, calibrated."""
    flight = as_flight(measured(TWIN_OTTER[1]))
    assert angle_suspicions(flight) == ()
    (found,) = angle_suspicions(scaled(flight, 1.3**2))
    assert found.evidence["ratio"] == pytest.approx(1.3**2, rel=0.05)


def filtered(flight: Flight, name: str, seconds: float) -> Flight:
    """A channel as a filter of first order shows it."""
    gain = 1.0 - np.exp(-flight.step / seconds)
    first = flight[name][0]
    shown = lfilter([gain], [1.0, gain - 1.0], flight[name] - first) + first
    return flight.with_channels({name: shown})


@pytest.mark.parametrize(("name", "seconds"), [("az", 0.5), ("az", 1.0), ("q", 0.4)])
def test_a_filtered_sensor_shows_its_time(name: str, seconds: float) -> None:
    (found,) = angle_suspicions(filtered(flown(), name, seconds))
    assert (found.channel, found.kind) == (name, "delay")
    assert found.evidence["delay"] == pytest.approx(seconds, rel=0.1)
    assert limits_flight(found)  # flight-path reconstruction knows no such delay


@pytest.mark.parametrize("seconds", [0.2, 0.3])
def test_a_gyro_that_is_late(seconds: float) -> None:
    shift = round(seconds / STEP)
    flight = flown()
    late = np.concatenate([np.full(shift, flight["q"][0]), flight["q"][:-shift]])
    (found,) = angle_suspicions(flight.with_channels({"q": late}))
    assert found.channel == "q"
    assert found.evidence["delay"] == pytest.approx(seconds, rel=0.1)


def test_a_gyro_that_is_late_from_one_time_on() -> None:
    flight = flown()
    shift, begin = round(0.3 / STEP), 12.0
    late = np.where(flight.time > begin, np.roll(flight["q"], shift), flight["q"])
    (found,) = angle_suspicions(flight.with_channels({"q": late}))
    assert (found.channel, found.kind) == ("q", "delay")
    assert found.evidence["delay"] == pytest.approx(0.3, rel=0.15)
    assert found.evidence["from"] == pytest.approx(begin, abs=1.0)


def test_a_gyro_that_is_reversed_from_one_time_on() -> None:
    flight = flown()
    q = np.where(flight.time > 12.0, -flight["q"], flight["q"])
    (found,) = angle_suspicions(flight.with_channels({"q": q}))
    assert (found.channel, found.kind) == ("q", "changed")
    assert found.evidence["before"] == pytest.approx(1.0, abs=0.02)
    assert found.evidence["ratio"] == pytest.approx(-1.0, abs=0.05)
    assert "from about 12.0 s on" in found.sentence
    assert limits_flight(found)


@pytest.mark.parametrize("gain", [1.6, 0.6])
def test_a_gyro_with_another_gain_to_one_side(gain: float) -> None:
    flight = flown()
    q = np.where(flight["q"] > 0.0, gain * flight["q"], flight["q"])
    (found,) = angle_suspicions(flight.with_channels({"q": q}))
    assert found.evidence["ratio"] == pytest.approx(1.0 / gain, rel=0.03)
    assert "where q is positive" in found.sentence


def test_a_gyro_whose_gain_grows() -> None:
    flight = flown()
    over = flight.time / flight.time[-1]
    (found,) = angle_suspicions(flight.with_channels({"q": flight["q"] * (1.0 + 0.6 * over)}))
    assert found.evidence["before"] == pytest.approx(1.0, abs=0.05)
    assert found.evidence["ratio"] == pytest.approx(1.0 / 1.6, abs=0.07)  # 1/x bends
    assert "at the end" in found.sentence


@pytest.mark.parametrize("noise", [1.0, 20.0])
def test_a_gyro_with_another_gain_all_the_time_does_not_change(noise: float) -> None:
    flight = flown(noise)
    scaled = flight.with_channels({"q": 1.1 * flight["q"]})
    assert all(each.kind != "changed" for each in angle_suspicions(scaled))


@pytest.mark.parametrize("name", TWIN_OTTER[:1])
def test_a_measured_gyro_that_is_reversed_from_one_time_on(
    measured: Callable[[str], Path], name: str
) -> None:
    """In a right flight, rates turn the attitude by one factor."""
    flight = as_flight(measured(name))
    assert all(each.kind != "changed" for each in angle_suspicions(flight))
    middle = float(np.mean(flight.time[[0, -1]]))
    p = np.where(flight.time > middle, -flight["p"], flight["p"])
    (found,) = angle_suspicions(flight.with_channels({"p": p}))
    assert (found.channel, found.kind) == ("p", "changed")
    assert found.evidence["ratio"] == pytest.approx(-1.0, abs=0.1)


def test_measured_accelerometers_that_are_filtered(measured: Callable[[str], Path]) -> None:
    for record, name in ((TWIN_OTTER[0], "ay"), (TWIN_OTTER[1], "az")):
        flight = as_flight(measured(record))
        assert angle_suspicions(flight) == ()
        (found,) = angle_suspicions(filtered(flight, name, 1.0))
        assert (found.channel, found.kind) == (name, "delay")
        assert found.evidence["delay"] == pytest.approx(1.0, abs=0.2)


def test_gusts_make_no_accelerometer_late() -> None:
    for gusts in (0.01, 0.03, 0.1):
        assert angle_suspicions(flown(gusts=gusts)) == ()


@pytest.mark.parametrize("seconds", [0.7, 1.5])
def test_a_vane_behind_a_filter_is_told(seconds: float) -> None:
    (found,) = angle_suspicions(filtered(flown(), "alpha", seconds))
    assert (found.channel, found.kind) == ("alpha", "late")
    # Two waves do not tell a filter from a delay: behind .7 s they come .38 and .51 s late.
    assert 0.4 * seconds < found.evidence["delay"] <= seconds
    assert not limits_flight(found)  # flight-path reconstruction judges it


def test_a_vane_that_is_late_is_told() -> None:
    flight = flown()
    late = np.interp(flight.time - 0.4, flight.time, flight["alpha"])
    (found,) = angle_suspicions(flight.with_channels({"alpha": late}))
    assert (found.channel, found.kind) == ("alpha", "late")
    assert found.evidence["delay"] == 0.4
    assert "alpha is late by about 0.4 s" in found.sentence


@pytest.mark.parametrize("begin", [7.0, 12.0])
def test_a_vane_that_is_late_from_one_time_on_is_told(begin: float) -> None:
    flight = flown()
    late = np.interp(flight.time - 0.4, flight.time, flight["alpha"])
    switched = np.where(flight.time > begin, late, flight["alpha"])
    (found,) = angle_suspicions(flight.with_channels({"alpha": switched}))
    assert (found.channel, found.kind) == ("alpha", "late")
    assert found.evidence["delay"] == pytest.approx(0.4, abs=0.1)
    assert found.evidence["from"] == pytest.approx(begin, abs=1.5)


def test_a_vane_behind_a_filter_is_told_in_gusts() -> None:
    (found,) = angle_suspicions(filtered(flown(gusts=0.003), "alpha", 0.7))
    assert (found.channel, found.kind) == ("alpha", "late")


def test_measured_vanes_behind_filters_are_told(measured: Callable[[str], Path]) -> None:
    for record, name in (("attas/fAttasElv1.mat", "alpha"), ("attas/fAttasRud1.mat", "beta")):
        flight = as_flight(measured(record))
        assert angle_suspicions(flight) == ()
        (found,) = angle_suspicions(filtered(flight, name, 1.5))
        assert (found.channel, found.kind) == (name, "late")


@pytest.mark.parametrize("seconds", [0.05, 0.1])
def test_a_vane_that_is_hardly_late_is_none(seconds: float) -> None:
    assert angle_suspicions(filtered(flown(), "alpha", seconds)) == ()


@pytest.mark.parametrize("gusts", [0.003, 0.01, 0.03, 0.1])
def test_gusts_make_no_vane_late(gusts: float) -> None:
    assert angle_suspicions(flown(gusts=gusts)) == ()


def test_where_gusts_move_the_vane_nothing_is_said() -> None:
    assert angle_suspicions(scaled(flown(gusts=0.03), 1.3**2)) == ()


def test_nothing_is_said_of_nothing() -> None:
    whole = scaled(flown(), 1.3**2)
    for name in whole.channels:
        rest = {n: values for n, values in whole.channels.items() if n != name}
        assert angle_suspicions(replace(whole, channels=rest)) == ()
    assert angle_suspicions(scaled(flown(size=1e-3), 1.3**2)) == ()
    short = {name: values[:200] for name, values in whole.channels.items()}
    assert angle_suspicions(replace(whole, time=whole.time[:200], channels=short)) == ()
    assert angle_suspicions(Flight("n", "light", np.zeros(0), {})) == ()


@pytest.mark.parametrize("value", [np.nan, np.inf, 0.0, 1e300])
def test_rubbish_ends_no_check(value: float) -> None:
    for name in flown().channels:
        for part in (slice(None), slice(100, 200)):
            values = flown()[name].copy()
            values[part] = value
            with np.errstate(all="ignore"):
                angle_suspicions(flown().with_channels({name: values}))
