"""Logged angular accelerations are used where they are proved better than rates differentiated, and
the flight's notes say which were used and why.

Measured: the Twin Otter's columns 42-44 are rates differentiated (they end at 3 and 4.3 Hz).
"""

import numpy as np
import pytest

from aerodb.coefficients.angular_acceleration import choose_angular_accelerations
from aerodb.coefficients.total import total_coefficients
from aerodb.flight import Flight
from aerodb.signals import low_passed
from tests.aerodb.coefficients.test_coefficients import record, twin_otter  # noqa: F401

STEP, BAND, GYRO, ACCELEROMETER = 0.02, 5.0, 2e-3, 8e-3


def flown(
    seed, late=0.0, noise=ACCELEROMETER, bias=0.0, scale=1.0, derived=False, seconds=60.0, cut=None
):
    """A rolling, pitching and yawing flight with the noise of gyros and of angular accelerometers;
    and its true accelerations."""
    rng = np.random.default_rng(seed)
    t = STEP * np.arange(round(seconds / STEP))
    channels, truth = {}, []
    for name in "pqr":
        omega, phase = rng.uniform(1.0, 9.0, 6), rng.uniform(0, 2 * np.pi, 6)
        size = rng.uniform(0.02, 0.1, 6)

        def rate(at, size=size, omega=omega, phase=phase):
            return np.sin(np.outer(at, omega) + phase) @ size

        def slope(at, size=size, omega=omega, phase=phase):
            return np.cos(np.outer(at, omega) + phase) @ (size * omega)

        channels[name] = rate(t) + GYRO * rng.standard_normal(len(t))
        if derived:
            shown = np.gradient(channels[name], STEP)
            shown = low_passed(shown, STEP, cut) if cut else shown
        else:
            shown = scale * slope(t - late) + bias + noise * rng.standard_normal(len(t))
        channels[f"{name}dot"] = shown
        truth.append(slope(t))
    return Flight("f", "any", t, channels), np.column_stack(truth)


def error(choice, truth):
    inner = slice(50, -50)
    return np.sqrt(np.mean((choice.acceleration - truth)[inner] ** 2, axis=0))


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("bias", [0.0, 0.05])
def test_better_accelerometers_are_used_and_their_bias_removed(seed, bias):
    flight, truth = flown(seed, bias=bias)
    chosen = choose_angular_accelerations(flight, BAND)
    plain = choose_angular_accelerations(
        Flight("f", "any", flight.time, {name: flight[name] for name in "pqr"}), BAND
    )
    assert chosen.source == "logged"
    assert "the noise of differentiated rates" in chosen.because
    assert np.all(error(chosen, truth) < 0.6 * error(plain, truth))
    assert np.all(np.abs(chosen.sigma / error(chosen, truth) - 1.0) < 0.3)
    assert plain.because == ""


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"noise": 0.2}, "noisier"),
        ({"late": 0.03}, "30 ms late"),
        ({"scale": 1.2}, "differs from the rate"),
        ({"derived": True}, "differentiated: it holds the noise"),
        ({"derived": True, "cut": 5.0}, "differentiated: it holds the noise"),
        ({"derived": True, "cut": 3.5}, "differentiated: it holds the noise"),
    ],
)
def test_worse_ones_are_not_used_and_the_reason_is_said(seed, changes, says):
    flight, _ = flown(seed, **changes)
    chosen = choose_angular_accelerations(flight, BAND)
    assert chosen.source == "differentiated"
    assert says in chosen.because
    plain = choose_angular_accelerations(
        Flight("f", "any", flight.time, {name: flight[name] for name in "pqr"}), BAND
    )
    np.testing.assert_array_equal(chosen.acceleration, plain.acceleration)


def test_gaps_and_missing_axes_leave_the_rates():
    flight, _ = flown(0)
    holes = flight["qdot"].copy()
    holes[100:200] = np.nan
    assert (
        "qdot has gaps"
        in choose_angular_accelerations(flight.with_channels({"qdot": holes}), BAND).because
    )
    channels = {name: values for name, values in flight.channels.items() if name != "rdot"}
    chosen = choose_angular_accelerations(Flight("f", "any", flight.time, channels), BAND)
    assert chosen.source == "differentiated"
    assert "rdot not logged" in chosen.because


@pytest.mark.parametrize("name", ["totter_f1_017_data.mat", "totter_demo_data.mat"])
def test_twin_otters_columns_are_its_rates_differentiated(record, twin_otter, name):  # noqa: F811
    flight, _ = record(name)
    made = total_coefficients(flight, twin_otter, angular_acceleration="chosen")
    plain = total_coefficients(flight, twin_otter)
    (said,) = [note for note in made.notes if "not the logged ones" in note]
    assert "dot" in said
    for axis in plain.values:
        np.testing.assert_array_equal(made.values[axis], plain.values[axis])
    assert made.bandwidth == plain.bandwidth


@pytest.mark.parametrize("seed", range(3))
def test_chosen_accelerations_lower_the_noise_of_the_moments(seed, twin_otter):  # noqa: F811
    flight, _ = flown(seed)
    n = len(flight.time)
    constants = {
        "mass": 5000.0, "cg_x": 0.0, "cg_y": 0.0, "cg_z": 0.0, "Ixx": 22e3, "Iyy": 33e3,
        "Izz": 52e3, "Ixz": 1500.0, "qbar": 2800.0, "thrust": 0.0,
    }  # fmt: skip
    flight = flight.with_channels({k: np.full(n, v) for k, v in constants.items()})
    made = total_coefficients(flight, twin_otter, angular_acceleration="chosen")
    plain = total_coefficients(flight, twin_otter)
    for axis in ("Cl", "Cm", "Cn"):
        assert np.sqrt(np.mean(made.sigma[axis] ** 2)) < 0.7 * np.sqrt(
            np.mean(plain.sigma[axis] ** 2)
        )
    assert made.bandwidth == plain.bandwidth  # what is compared with them is limited alike
    assert any(note.startswith("angular accelerations: the logged ones") for note in made.notes)
