"""A long comparison at the rate that its band needs: a hovering flow that goes round and round, gaps,
and what is left as it is."""

from dataclasses import replace

import numpy as np
import pytest

from aerodb.coefficients import Comparison, thinned_comparison
from aerodb.coefficients.comparison import DatabaseSide
from aerodb.exchange import read_native
from aerodb.increments import parameter_samples
from aerodb.support import Array

DRAG, RATE, BAND, NOISE = 0.3, 250.0, 5.0, 0.02
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
expression = "-drag*u - .01*w*abs(w)"
"""


def hover(seconds: float = 320.0, seed: int = 4) -> tuple[Comparison, Array]:
    """A vehicle that drifts ahead and back in its own air, so that alpha goes round, with white noise on
    the velocity over ground; and its velocity ahead [m/s]."""
    noise, time = np.random.default_rng(seed), np.arange(0.0, seconds, 1.0 / RATE)
    u = 0.4 * np.sin(2 * np.pi * 0.1 * time) + 0.2 * np.sin(2 * np.pi * 0.9 * time)
    shown = u + 0.05 * noise.standard_normal(len(time))
    w = 0.3 * np.cos(2 * np.pi * 0.13 * time) + 0.05 * noise.standard_normal(len(time))
    still, own = np.zeros_like(u), read_native(TEXT)
    speed = np.hypot(shown, w)
    channels = {
        "V": speed, "alpha": np.arctan2(w, shown), "beta": still, "p": still, "q": still, "r": still,
        "rho": still + 1.2, "qbar": 0.6 * speed**2,
    }  # fmt: skip
    used = {name: x for name, x in channels.items() if name in {*own.inputs, *own.needs}}
    prediction = own.predict(channels)
    measured = {"CX": -DRAG * u + NOISE * noise.standard_normal(len(time))}
    everywhere = np.ones(len(time), np.bool_)
    side = DatabaseSide(own, used, prediction, over_ground=True)
    comparison = Comparison(
        "a", time, measured, {"CX": still}, {"CX": prediction.coefficients["CX"]},
        {"CX": everywhere}, ~everywhere, BAND, (), database_side=side,
    )  # fmt: skip
    return comparison, u


def drag(comparison: Comparison) -> float:
    """The drag by least squares."""
    own = read_native(TEXT)
    (samples,) = parameter_samples([comparison], ["drag"], own)
    x, y = samples.over(samples.good)
    return DRAG + float(x[:, 0] @ y) / float(x[:, 0] @ x[:, 0])


def test_the_flow_of_what_hovers_goes_by_its_components() -> None:
    """Angles that go round would be averaged to a flow that nobody flew."""
    comparison, u = hover()
    thin = thinned_comparison(comparison)
    assert np.array_equal(thin.time, comparison.time[::4])
    side = thin.database_side
    assert side is not None
    alpha = side.channels["alpha"]
    assert np.abs(np.diff(alpha)).max() > 3.0
    ahead = side.channels["V"] * np.cos(alpha) * np.cos(side.channels["beta"])
    assert np.std(ahead - u[::4]) < 0.6 * 0.05, "noise above 28 Hz is gone, and nothing else"
    if "qbar" in side.channels:
        assert np.allclose(side.channels["qbar"], 0.6 * side.channels["V"] ** 2)


def test_a_parameter_comes_out_as_of_all_samples_and_noise_in_the_flow_takes_less_of_it() -> None:
    """Noise of the flow draws an estimate towards zero, by its share of the motion: here by 2.4 % of
    what all samples show, and thinned by less."""
    comparison, _ = hover()
    whole, thin = drag(comparison), drag(thinned_comparison(comparison))
    assert abs(whole / DRAG - 1.0) < 0.04
    assert abs(thin - DRAG) < abs(whole - DRAG)


def test_what_is_in_a_gap_stays_in_it() -> None:
    comparison, _ = hover()
    gap = slice(10000, 10600)
    good = comparison.usable["CX"].copy()
    good[gap] = False
    wild = comparison.measured["CX"].copy()
    wild[gap] = 50.0
    usable = {"CX": good}
    clean = thinned_comparison(replace(comparison, usable=usable))
    after = thinned_comparison(replace(comparison, measured={"CX": wild}, usable=usable))
    assert np.array_equal(clean.measured["CX"], after.measured["CX"])
    assert not after.usable["CX"][2499:2651].any(), "one sample more on each side"
    assert after.usable["CX"][:2499].all()
    assert after.usable["CX"][2652:].all()


@pytest.mark.parametrize("kind", ["short", "unlimited", "slow", "without its channels"])
def test_what_gains_nothing_is_left_as_it_is(kind: str) -> None:
    comparison, _ = hover(40.0 if kind == "short" else 320.0)
    if kind == "unlimited":
        comparison = replace(comparison, bandwidth=None)
    if kind == "slow":
        comparison = replace(comparison, bandwidth=12.0)
    if kind == "without its channels":
        comparison = replace(comparison, database_side=None)
    assert thinned_comparison(comparison) is comparison
