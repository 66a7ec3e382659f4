"""The price of air that no sensor measures, against its closed form for a drag linear in the flow."""

import numpy as np
import pytest

from aerodb.coefficients import Comparison
from aerodb.coefficients.comparison import DatabaseSide
from aerodb.exchange import read_native
from aerodb.increments import air_covariance, parameter_samples

DRAG, RATE = 0.3, 50.0
TEXT = f"""
name = "drag"
[reference]
area = 1.0
chord = 1.0
span = 1.0
pressure = "1 Pa"
moment_reference = [0.0, 0.0, 0.0]
[parameters]
drag = {{ value = {DRAG} }}
[parts.frame]
kind = "body"
position = [0.0, 0.0, 0.0]
[[parts.frame.load]]
axis = "FX"
expression = "-drag*u"
"""


def flown(over_ground: bool, gust: float, noise: float = 0.02) -> tuple[Comparison, np.ndarray]:
    """A flight ahead and back, beside its right database, in gusts of .2 Hz that no sensor sees, and
    noise; and its velocity [m/s]."""
    time = np.arange(0.0, 100.0, 1.0 / RATE)
    u = 3.0 * np.sin(2 * np.pi * 0.1 * time)
    air = gust * np.sqrt(2.0) * np.cos(2 * np.pi * 0.2 * time)
    own = read_native(TEXT)
    channels = {
        "V": np.abs(u), "alpha": np.where(u < 0.0, np.pi, 0.0), "beta": 0.0 * u, "p": 0.0 * u,
        "q": 0.0 * u, "r": 0.0 * u, "rho": 0.0 * u + 1.2, "qbar": 0.6 * u**2,
    }  # fmt: skip
    used = {name: x for name, x in channels.items() if name in {*own.inputs, *own.needs}}
    prediction = own.predict(channels)
    error = noise * np.random.default_rng(4).standard_normal(len(time))
    measured = {"CX": -DRAG * (u - air) + error}
    everywhere = np.ones(len(time), np.bool_)
    side = DatabaseSide(own, used, prediction, over_ground)
    comparison = Comparison(
        "a", time, measured, {"CX": 0.0 * u}, {"CX": prediction.coefficients["CX"]},
        {"CX": everywhere}, ~everywhere, None, (), database_side=side,
    )  # fmt: skip
    return comparison, u


@pytest.mark.parametrize("gust", [0.2, 0.8])
def test_it_is_the_share_of_the_motion_that_air_may_be(gust: float) -> None:
    """Air of a standard deviation s that goes with the motion u by an unknown correlation (even
    between -1 and 1) changes a drag of k u by k s/(sqrt(3) rms u)."""
    comparison, u = flown(True, gust)
    own = read_native(TEXT)
    samples = parameter_samples([comparison], ["drag"], own, own_constants=False)
    error = np.sqrt(air_covariance([(each, each.good) for each in samples], own)[0, 0])
    rms = np.sqrt(np.mean(u**2))
    assert error == pytest.approx(DRAG * gust / np.sqrt(3.0) / rms, rel=0.05)


def test_a_flow_that_is_measured_has_no_such_price() -> None:
    own = read_native(TEXT)
    comparison, _ = flown(False, 0.8)
    samples = parameter_samples([comparison], ["drag"], own)
    assert not air_covariance([(each, each.good) for each in samples], own).any()


def test_calm_air_costs_what_slow_noise_allows() -> None:
    """White noise of .2 over 25 Hz leaves .04 below 1 Hz."""
    own = read_native(TEXT)
    comparison, u = flown(True, 0.0, 0.2)
    samples = parameter_samples([comparison], ["drag"], own, own_constants=False)
    error = np.sqrt(air_covariance([(each, each.good) for each in samples], own)[0, 0])
    assert error < 1.3 * 0.2 * np.sqrt(1.0 / 25.0) / np.sqrt(3.0) / np.sqrt(np.mean(u**2))
