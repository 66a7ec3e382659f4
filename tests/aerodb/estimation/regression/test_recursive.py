"""Recursive estimators against the whole record at once, forgetting, coverage of planted truth, and
records that determine nothing."""

import numpy as np
import pytest
import scipy.io

from aerodb.errors import InputError
from aerodb.estimation import Parameter, Parameters, least_squares
from aerodb.estimation.regression.finite_fourier import band_of
from aerodb.estimation.regression.frequency_domain import frequency_domain_regression
from aerodb.estimation.regression.recursive import (
    FourierRegression,
    RecursiveLeastSquares,
    fourier_regression,
    normalised_recursive_least_squares,
    recursive_least_squares,
    running_frequencies,
)
from tests.aerodb.estimation.regression.test_frequency_domain import TRUTH, short_period
from tests.aerodb.estimation.test_ordinary_least_squares import PUBLISHED
from tests.support.equations import coloured, equation

NAMES = ("alpha", "q", "de", "1")


def parameters(names=NAMES):
    return Parameters(tuple(Parameter(name, 0.0) for name in names))


def values(fit):
    return np.array([each.value for each in fit.estimates])


def test_published_equation_error_sample_by_sample(measured):
    data = scipy.io.loadmat(
        measured("twin_otter/totter_f1_017_data.mat"), variable_names=["fdata"]
    )["fdata"]
    degree = np.pi / 180
    matrix = np.column_stack(
        [data[:, 2] * degree, data[:, 70], data[:, 72], data[:, 14:16] * degree, np.ones(len(data))]
    )
    estimator = RecursiveLeastSquares(parameters(("beta", "p", "r", "da", "dr", "1")))
    for row, response in zip(matrix, data[:, 65], strict=True):
        estimator.update(row, response)
    fit = estimator.fit()
    estimates, errors, _ = PUBLISHED["Cn"]
    np.testing.assert_allclose(values(fit), estimates, atol=6e-10, rtol=1e-6)
    ratio = np.array([each.standard_error for each in fit.estimates])[:-1] / errors[:-1]
    assert np.all((ratio > 0.6) & (ratio < 1.7))


def test_without_forgetting_it_is_least_squares():
    rng = np.random.default_rng(1)
    pieces = [short_period(rng, 700) for _ in range(2)]
    given = equation([c for c, _ in pieces], [z for _, z in pieces])
    matrix, response = given.stacked()
    fit = recursive_least_squares(given)
    batch = least_squares(matrix, response, NAMES, given.lengths)
    np.testing.assert_allclose(values(fit), batch.estimates, rtol=1e-10)
    white = np.sqrt(np.diag(batch.white_covariance))
    np.testing.assert_allclose([e.cramer_rao for e in fit.estimates], white, rtol=1e-8)
    assert set(fit.residuals) == {"r0", "r1"}
    assert fit.names == NAMES


def test_forgetting_and_normalising_are_weights():
    """The weighted least squares of the whole record, written with weights."""
    rng = np.random.default_rng(2)
    columns, z = short_period(rng, 600)
    matrix = np.column_stack(list(columns.values()))
    given = equation([columns], [z])
    age = np.arange(600)[::-1]
    for fit, weight in (
        (recursive_least_squares(given, forgetting=0.99), 0.99**age),
        (normalised_recursive_least_squares(given), 1.0 / (1.0 + np.sum(matrix**2, axis=1))),
        (
            normalised_recursive_least_squares(given, forgetting=0.98),
            0.98**age / (1.0 + np.sum(matrix**2, axis=1)),
        ),
    ):
        root = np.sqrt(weight)
        expected = np.linalg.lstsq(matrix * root[:, None], z * root, rcond=None)[0]
        np.testing.assert_allclose(values(fit), expected, rtol=1e-9)


def test_forgetting_follows_a_change_and_says_how_well():
    rng = np.random.default_rng(3)
    columns, _ = short_period(rng, 6000)
    matrix = np.column_stack(list(columns.values()))
    changed = TRUTH * np.array([1.0, 1.0, 0.5, 1.0])  # half of the elevator is lost
    half = np.arange(6000)[:, None] < 3000
    z = np.sum(matrix * np.where(half, TRUTH, changed), axis=1) + 0.005 * coloured(rng, 6000, 0.5)
    given = equation([columns], [z])
    with_it = recursive_least_squares(given, forgetting=0.998)["de"]
    assert with_it.value == pytest.approx(changed[2], abs=4 * with_it.standard_error)
    assert with_it.standard_error < 0.2
    without = recursive_least_squares(given)["de"]
    assert abs(without.value - changed[2]) > 10 * abs(with_it.value - changed[2])
    assert without.standard_error > 5 * without.cramer_rao  # the scatter of its stretches tells
    with pytest.raises(InputError, match="forgetting"):
        recursive_least_squares(given, forgetting=1.5)


def test_fourier_regression_is_the_frequency_domain_at_the_end_of_the_record():
    rng = np.random.default_rng(4)
    columns, z = short_period(rng, 1200)
    given = equation([columns], [z])
    frequencies = band_of(given, 0.1, 2.5, 0.04)
    estimator = FourierRegression(given.parameters, frequencies)
    record = given.records[0]
    for time, row, response in zip(record.time, record.regressors, z, strict=True):
        estimator.update(time, row, response)
    fit = estimator.fit()
    batch = frequency_domain_regression(given, lowest=0.1, highest=2.5, spacing=0.04)
    np.testing.assert_allclose(values(fit), values(batch), rtol=1e-8)
    np.testing.assert_allclose(fit.covariance, batch.covariance, rtol=1e-6)
    assert [e.standing for e in fit.estimates] == [e.standing for e in batch.estimates]


def test_fourier_regression_of_whole_records_is_the_running_one_and_finds_the_truth():
    """One record: exactly what runs along; several at once: the slopes that were planted, and 95 %
    intervals over 60 pairs of records with noise of half the response."""
    rng = np.random.default_rng(8)
    columns, z = short_period(rng, 1200)
    given = equation([columns], [z])
    fit = fourier_regression(given, highest=2.0)
    running = FourierRegression(given.parameters, running_frequencies(2.0))
    record = given.records[0]
    for time, row, response in zip(record.time, record.regressors, z, strict=True):
        running.update(time, row, response)
    np.testing.assert_array_equal(values(fit), values(running.fit()))
    inside = []
    for _ in range(60):
        pair = [short_period(rng, 1000, 0.5) for _ in range(2)]
        fit = fourier_regression(equation([p[0] for p in pair], [p[1] for p in pair]))
        for truth, each in zip(TRUTH, fit.estimates, strict=True):
            low, high = fit.interval(each.name)
            inside.append(low <= truth <= high)
    assert 0.90 < np.mean(inside) < 0.99, np.mean(inside)


def test_fourier_regression_passes_over_missing_samples():
    rng = np.random.default_rng(5)
    columns, _ = short_period(rng, 1200)
    matrix = np.column_stack(list(columns.values()))
    estimator = FourierRegression(parameters(), np.arange(0.1, 2.0, 0.05))
    for k in range(1200):
        if not 400 <= k < 460:
            estimator.update(0.02 * k, matrix[k], matrix[k] @ TRUTH)
    np.testing.assert_allclose(values(estimator.fit()), TRUTH, rtol=1e-6)


def test_estimates_converge_to_planted_truth():
    rng = np.random.default_rng(6)
    columns, z = short_period(rng, 3000, 0.9)
    estimator = RecursiveLeastSquares(parameters())
    matrix, errors = np.column_stack(list(columns.values())), []
    for k in range(3000):
        estimator.update(matrix[k], z[k])
        if k in (299, 2999):
            errors.append(estimator.fit()["q"].standard_error)
    fit = estimator.fit()
    assert errors[1] < 0.6 * errors[0]
    for k, each in enumerate(fit.estimates):
        assert each.value == pytest.approx(TRUTH[k], abs=4 * each.standard_error)


def test_what_the_samples_so_far_do_not_determine():
    estimator = RecursiveLeastSquares(parameters(("x", "y", "still")))
    assert {e.standing for e in estimator.fit().estimates} == {"not identifiable"}
    for k in range(50):
        estimator.update(np.array([k, 2.0 * k, 0.0]), 3.0 * k)
    fit = estimator.fit()
    assert [e.standing for e in fit.estimates] == [
        "not identifiable",
        "not identifiable",
        "not excited",
    ]
    assert np.isnan(fit["x"].value)
    assert fit.names == ()
    empty = FourierRegression(parameters(("x",)), np.array([0.1, 0.2]))
    with pytest.raises(InputError, match="too few"):
        empty.fit()
    for k in range(4):
        empty.update(0.02 * k, np.array([1.0]), 1.0)
    assert any("too short" in note for note in empty.fit().notes)


@pytest.mark.heavy
@pytest.mark.parametrize("pole", [0.0, 0.9, 0.97])
def test_intervals_cover_the_truth(trials, pole):
    """95 % intervals hold the truth in 92 to 98 % of 300 records, by stretches alone."""
    rng = np.random.default_rng(7)
    count, held = trials(20, 300), np.zeros(3)
    for _ in range(count):
        columns, z = short_period(rng, 2000, pole)
        fit = recursive_least_squares(equation([columns], [z]))
        for k, name in enumerate(("alpha", "q", "de")):
            low, high = fit.interval(name)
            held[k] += low <= TRUTH[k] <= high
    spread = 2.5 * np.sqrt(0.95 * 0.05 / (3 * count)) if count < 300 else 0.0
    assert 0.92 - spread <= held.sum() / (3 * count) <= 0.98 + spread
