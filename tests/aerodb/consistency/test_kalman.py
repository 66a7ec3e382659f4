"""Tests of the compiled smoother against the Gaussian posterior of a whole record, computed by
dense linear algebra."""

from dataclasses import replace

import numpy as np
import pytest

from aerodb.consistency.smoother.kalman import Transition, smooth

N, M, C = 25, 7, 4
ROWS, COLUMNS = np.array([0, 1, 2, 0]), np.array([5, 6, 5, 1])


@pytest.fixture(scope="module")
def problem():
    """A random system whose states 3 and 4 move themselves only, with a fifth of the measurements
    missing."""
    rng = np.random.default_rng(0)
    root = rng.normal(0, 0.1, (N - 1, 3, 3))
    model = Transition(
        ROWS, COLUMNS, rng.normal(0, 0.3, (N - 1, 4)), np.array([1, 1, 1, 0.9, 0.8, 1, 1.0]),
        root @ root.transpose(0, 2, 1),
        np.array([0, 0, 0, 0.1, 0.2, 0, 0.01]), np.array([4, 4, 4, 0.5, 1, 1, 0.1]),
    )  # fmt: skip
    seen = rng.normal(size=(N, C, M)) * (rng.random((N, C, M)) < 0.5)
    variance = rng.uniform(0.3, 0.9, (N, C)) * (rng.random((N, C)) > 0.2)
    return model, rng.normal(size=(N, C, 2)), variance, seen


def dense(model, measured, variance, seen):
    """Posterior mean (n, m, k), covariances (n, m, m) and log-likelihood from the joint covariance
    of all states."""
    prior = np.zeros((N, M, N, M))
    for i in range(N):
        if i == 0:
            prior[0, :, 0] = np.diag(model.first)
            continue
        step = np.diag(model.diagonal)
        step[ROWS, COLUMNS] += model.values[i - 1]
        noise = np.diag(model.diagonal_noise)
        noise[:3, :3] += model.block[i - 1]
        for j in range(i):
            prior[i, :, j] = step @ prior[i - 1, :, j]
            prior[j, :, i] = prior[i, :, j].T
        prior[i, :, i] = step @ prior[i - 1, :, i - 1] @ step.T + noise
    joint = prior.reshape(N * M, N * M)
    time, channel = np.nonzero(variance > 0)
    rows = np.zeros((len(time), N, M))
    rows[np.arange(len(time)), time] = seen[time, channel]
    rows = rows.reshape(len(time), N * M)
    values = measured[time, channel]
    spread = rows @ joint @ rows.T + np.diag(variance[time, channel])
    gain = joint @ rows.T @ np.linalg.inv(spread)
    after = (joint - gain @ rows @ joint).reshape(N, M, N, M)
    _, size = np.linalg.slogdet(2 * np.pi * spread)
    likelihood = -0.5 * (values[:, 0] @ np.linalg.solve(spread, values[:, 0]) + size)
    return (
        (gain @ values).reshape(N, M, -1),
        np.stack([after[i, :, i] for i in range(N)]),
        likelihood,
    )


def test_states_covariances_and_likelihood(problem):
    result = smooth(*problem, covariances=np.arange(N))
    states, covariance, likelihood = dense(*problem)
    np.testing.assert_allclose(result.states, states, atol=1e-11)
    np.testing.assert_allclose(result.covariance, covariance, atol=1e-11)
    some = np.array([0, 3, N - 1])
    assert np.array_equal(smooth(*problem, covariances=some).covariance, result.covariance[some])
    assert result.log_likelihood == pytest.approx(likelihood, rel=1e-12)
    assert np.array_equal(np.isnan(result.innovations), problem[2] == 0)


def test_the_likelihoods_slope_is_exact(problem):
    """Against central differences of the dense likelihood: noise, first variance, memory of a
    state, noise of a channel."""
    model, measured, variance, seen = problem
    score = smooth(*problem).score

    def slope(change):
        up, down = (dense(change(sign * 1e-5), measured, variance, seen)[2] for sign in (1.0, -1.0))
        return (up - down) / 2e-5

    for state in (3, 4):
        unit = np.eye(M)[state]
        assert score.noise[state] / 2 == pytest.approx(
            slope(lambda h, e=unit: replace(model, diagonal_noise=model.diagonal_noise + h * e)),
            rel=1e-5,
        )
        assert score.first[state] / 2 == pytest.approx(
            slope(lambda h, e=unit: replace(model, first=model.first + h * e)), rel=1e-5
        )
        assert score.diagonal[state] == pytest.approx(
            slope(lambda h, e=unit: replace(model, diagonal=model.diagonal + h * e)), rel=1e-5
        )
    for channel in range(C):
        factor = np.exp(1e-5 * np.eye(C)[channel])
        up, down = (
            dense(model, measured, variance * scale, seen)[2] for scale in (factor, 1 / factor)
        )
        assert score.measurement[channel] == pytest.approx((up - down) / 2e-5, rel=1e-5)


def test_without_measurements_the_prior_remains(problem):
    model, measured, variance, seen = problem
    result = smooth(model, measured, 0 * variance, seen, np.array([0]))
    assert not result.states.any()
    assert result.log_likelihood == 0.0
    assert result.covariance[0] == pytest.approx(np.diag(model.first))
