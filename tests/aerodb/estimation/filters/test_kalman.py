"""Kalman filters augmented by the parameters: the answer of linear algebra, planted truth, and what
is not in the record."""

from collections.abc import Callable

import numpy as np
import pytest

from aerodb.estimation import (
    Fit,
    Parameter,
    Parameters,
    TimeHistory,
    extended_kalman,
    state_space,
    unscented_kalman,
)
from aerodb.estimation.filters.filter_problem import Point
from aerodb.estimation.filters.kalman import _tracked
from tests.support import short_period

METHODS = (extended_kalman, unscented_kalman)


@pytest.mark.parametrize("transform", ["extended", "unscented"])
def test_linear_regression_is_its_special_case(transform: str) -> None:
    """A bias and a slope of an output: the posterior of linear least squares with priors, at once and
    in closed form."""
    rng = np.random.default_rng(1)
    time, drive = 0.1 * np.arange(60), rng.normal(size=60)
    y = 0.3 + 2.0 * drive + 0.1 * rng.normal(size=60)
    y[20:25] = np.nan
    items = [Parameter("slope", 1.0, prior=1.0, prior_error=2.0), Parameter("bias", 0.0)]
    model = state_space(
        ("x",), ("u",), ("y",), Parameters((*items, Parameter("initial_x", 0.0, free=False))),
        a=[[0.0]], b=[[0.0]], c=[[1.0]], d=[["slope"]], output_bias=["bias"],
    )  # fmt: skip
    record = TimeHistory("r", time, {"u": drive}, {"y": y})
    noise = Point(np.zeros(2), np.zeros(1), np.array([[0.01]]))
    prior = np.diag([4.0, 1.0])
    about = np.tile([0.0, 1.0, 0.0], (60, 1))
    track = _tracked(model, record, noise, np.array([1.0, 0.0]), prior, transform, about)
    seen = np.isfinite(y)
    x = np.column_stack([drive, np.ones(60)])[seen]
    covariance = np.linalg.inv(x.T @ x / 0.01 + np.linalg.inv(prior))
    mean = covariance @ (x.T @ y[seen] / 0.01 + np.linalg.solve(prior, [1.0, 0.0]))
    np.testing.assert_allclose(track.mean[-1, 1:], mean, rtol=1e-8)
    np.testing.assert_allclose(track.covariance[-1, 1:, 1:], covariance, rtol=1e-7)


@pytest.mark.parametrize("transform", ["extended", "unscented"])
def test_smoother_is_the_conditional_distribution(transform: str) -> None:
    """A random walk seen with noise: the smoothed states are the mean and variance of all states given
    all measurements, by their joint covariance."""
    rng = np.random.default_rng(2)
    n, step, q, r = 30, 0.2, 0.7, 0.5
    walk = np.concatenate([[0.0], np.cumsum(q * np.sqrt(step) * rng.normal(size=n - 1))])
    y = walk + r * rng.normal(size=n)
    model = state_space(
        ("x",), (), ("y",), Parameters((Parameter("initial_x", 0.0),)),
        a=[[0.0]], b=[[]], c=[[1.0]],
    )  # fmt: skip
    record = TimeHistory("r", step * np.arange(n), {}, {"y": y})
    noise = Point(np.zeros(1), np.array([q]), np.array([[r**2]]))
    track = _tracked(model, record, noise, np.zeros(1), np.eye(1), transform, np.zeros((n, 2)))
    order = np.arange(n)
    joint = 1.0 + q**2 * step * np.minimum.outer(order, order)
    gain = np.linalg.solve(joint + r**2 * np.eye(n), joint).T
    np.testing.assert_allclose(track.mean[:, 0], gain @ y, rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(track.covariance[:, 0, 0], np.diag(joint - gain @ joint), rtol=1e-6)
    _, determinant = np.linalg.slogdet(2.0 * np.pi * (joint + r**2 * np.eye(n)))
    density = -0.5 * (y @ np.linalg.solve(joint + r**2 * np.eye(n), y) + determinant)
    assert track.log_likelihood == pytest.approx(density, abs=1e-6)


@pytest.mark.parametrize("transform", ["extended", "unscented"])
def test_a_parameter_that_walks_is_the_conditional_distribution(transform: str) -> None:
    """The bias of an output walks: its history is its mean and variance given all measurements, by
    their joint covariance; a constant slope beside it is estimated with it."""
    rng = np.random.default_rng(4)
    n, step, q, r = 40, 0.25, 0.6, 0.3
    walk = np.concatenate([[0.0], np.cumsum(q * np.sqrt(step) * rng.normal(size=n - 1))])
    drive = rng.normal(size=n)
    y = walk + 1.5 * drive + r * rng.normal(size=n)
    items = (Parameter("bias", 0.0, random_walk=q), Parameter("slope", 0.0))
    model = state_space(
        ("x",), ("u",), ("y",), Parameters((*items, Parameter("initial_x", 0.0, free=False))),
        a=[[0.0]], b=[[0.0]], c=[[1.0]], d=[["slope"]], output_bias=["bias"],
    )  # fmt: skip
    record = TimeHistory("r", step * np.arange(n), {"u": drive}, {"y": y})
    noise = Point(np.zeros(2), np.zeros(1), np.array([[r**2]]))
    about = np.zeros((n, 3))
    track = _tracked(model, record, noise, np.zeros(2), np.eye(2), transform, about)
    order = np.arange(n)
    prior = np.zeros((n + 1, n + 1))
    prior[:n, :n] = 1.0 + q**2 * step * np.minimum.outer(order, order)
    prior[n, n] = 1.0
    seen = np.column_stack([np.eye(n), drive])
    gain = prior @ seen.T @ np.linalg.inv(seen @ prior @ seen.T + r**2 * np.eye(n))
    mean, covariance = gain @ y, prior - gain @ seen @ prior
    np.testing.assert_allclose(track.mean[:, 1], mean[:n], rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(track.covariance[:, 1, 1], np.diag(covariance)[:n], rtol=1e-6)
    np.testing.assert_allclose(track.mean[:, 2], mean[n], rtol=1e-7)


@pytest.mark.parametrize(
    "method", [METHODS[0], pytest.param(METHODS[1], marks=pytest.mark.campaign)]
)
def test_damping_in_roll_that_drops_half_way_is_followed(method: Callable[..., Fit]) -> None:
    """Simulated by the exact step of each half; within three standard errors away from the drop."""
    step, n, rng = 0.05, 320, np.random.default_rng(5)
    time = step * np.arange(n)
    aileron = 0.05 * np.sign(np.sin(2.0 * time)) * (time > 1.0)
    damping = np.where(time < 8.0, -2.1, -1.2)
    p = np.zeros(n)
    for i in range(n - 1):
        decay = np.exp(damping[i] * step)
        held = 0.5 * (aileron[i] + aileron[i + 1])
        p[i + 1] = decay * p[i] + (decay - 1.0) / damping[i] * -11.0 * held
    items = (Parameter("Lp", -1.5, random_walk=0.3), Parameter("Lda", -9.0), Parameter("Lx", -1.0))
    model = state_space(
        ("p",), ("da", "spare"), ("p",), Parameters((*items, Parameter("initial_p", 0.0, free=False))),
        a=[["Lp"]], b=[["Lda", "Lx"]], c=[[1.0]],
    )  # fmt: skip
    inputs = {"da": aileron, "spare": np.zeros(n)}
    record = TimeHistory("r", time, inputs, {"p": p + 0.004 * rng.standard_normal(n)})
    fit = method(model, [record])
    history = fit.histories["r"]["Lp"]
    away = (np.abs(time - 8.0) > 2.0) & (time > 2.0)
    assert np.mean(np.abs(history[away, 0] - damping[away]) < 3.0 * history[away, 1]) > 0.97
    assert np.abs(history[away, 0] - damping[away]).max() < 0.35
    assert (fit["Lp"].value, fit["Lp"].standard_error) == pytest.approx(tuple(history[-1]))
    assert abs(fit["Lda"].value + 11.0) < 3.0 * fit["Lda"].standard_error < 3.0
    assert fit["Lx"].standing == "not excited"
    assert "Lp is" in fit.notes[-1]


@pytest.mark.parametrize("method", METHODS)
def test_short_period_in_turbulence(method: Callable[..., Fit]) -> None:
    """Truth within two standard errors, from start values 40 % off."""
    truth = short_period.STABLE
    record = short_period.flown(truth, 0.02, 2)
    model = short_period.model({name: 0.6 * value for name, value in truth.items()})
    fit = method(model, [record], process_noise=("g1",))
    for name, value in truth.items():
        assert abs(fit[name].value - value) < 2.0 * fit[name].standard_error


@pytest.mark.parametrize("method", METHODS)
def test_what_the_record_does_not_hold_is_told(method: Callable[..., Fit]) -> None:
    truth = short_period.STABLE
    record = short_period.flown(truth, 0.02, 3, seconds=10.0)
    quiet = TimeHistory("quiet", record.time, {"de": 0.0 * record.time}, record.outputs)
    model = short_period.model(truth, M_de={"value": -7.0, "lower": -9.0, "upper": -5.0})
    fit = method(model, [quiet], process_noise=("g1",))
    assert fit["M_de"].standing == "not excited"
    assert np.isnan(fit["M_de"].value)
    assert fit["initial_g1"].standing == "fixed"
    assert fit["M_alpha"].standing == "estimated"
