"""Regression of linear equations: published Twin Otter estimates, scipy's quadratic programme,
closed formulas for priors and ties, coverage, and what the records do not determine."""

import numpy as np
import pytest
import scipy.io
import scipy.optimize
import scipy.stats

from aerodb.errors import InputError
from aerodb.estimation import Parameter
from aerodb.estimation.coloured_noise import autoregressive_noise
from aerodb.estimation.regression.regression_fit import regression
from tests.aerodb.estimation.test_ordinary_least_squares import COLUMN, PUBLISHED
from tests.support.equations import coloured, equation, manoeuvre


@pytest.fixture(scope="module")
def otter(measured):
    data = scipy.io.loadmat(
        measured("twin_otter/totter_f1_017_data.mat"), variable_names=["fdata"]
    )["fdata"]
    degree = np.pi / 180
    columns = {
        "beta": data[:, 2] * degree,
        "p": data[:, 70],
        "r": data[:, 72],
        "da": data[:, 14] * degree,
        "dr": data[:, 15] * degree,
        "1": np.ones(len(data)),
    }
    return columns, {axis: data[:, index - 1] for axis, index in COLUMN.items()}


@pytest.mark.parametrize("axis", PUBLISHED)
def test_published_equation_error(otter, axis):
    columns, responses = otter
    if axis == "CY":
        columns = {name: columns[name] for name in ("beta", "r", "dr", "1")}
    fit = regression(equation([columns], [responses[axis]], axis))
    estimates, errors, r_squared = PUBLISHED[axis]
    np.testing.assert_allclose([e.value for e in fit.estimates], estimates, atol=6e-10, rtol=1e-6)
    # Klein and Morelli's coloured errors are those of the sample autocorrelation, without the lost
    # degrees of freedom: the same size, except that of the constant, which they understate.
    ratio = np.array([e.standard_error for e in fit.estimates])[:-1] / np.array(errors)[:-1]
    assert np.all((ratio > 0.8) & (ratio < 1.6))
    assert fit.estimates[-1].standard_error > errors[-1]
    residual = fit.residuals["r0"][axis]
    spread = np.sum((responses[axis] - responses[axis].mean()) ** 2)
    assert 1 - residual @ residual / spread == pytest.approx(r_squared, abs=5e-5)
    assert all(e.standing == "estimated" for e in fit.estimates)
    assert fit.p_value("beta") < 1e-6


def test_white_errors_and_p_values_are_the_textbook_ones():
    rng = np.random.default_rng(3)
    x = rng.standard_normal(2000)
    y = 0.02 * x + rng.standard_normal(2000)
    fit = regression(equation([{"x": x, "1": np.ones(2000)}], [y]))
    line = scipy.stats.linregress(x, y)
    assert fit["x"].value == pytest.approx(line.slope, rel=1e-10)
    assert fit["x"].cramer_rao == pytest.approx(line.stderr, rel=1e-10)
    assert fit["x"].standard_error == pytest.approx(line.stderr, rel=0.1)
    assert fit.p_value("x") == pytest.approx(line.pvalue, abs=0.1)
    low, high = fit.interval("x")
    assert high - low == pytest.approx(2 * 1.96 * fit["x"].standard_error, rel=1e-2)


def test_bounds_are_the_quadratic_programme_and_are_said():
    rng = np.random.default_rng(5)
    columns = manoeuvre(rng, 600)
    truth = {"alpha": 1.0, "q": -0.2, "de": 0.5, "1": 0.1}
    z = sum(truth[name] * column for name, column in columns.items()) + coloured(rng, 600, 0.8)
    bounded = Parameter("q", 0.1, lower=0.0, upper=1.0)
    fit = regression(equation([columns], [z], q=bounded))
    x = np.column_stack(list(columns.values()))
    low = [-np.inf, 0.0, -np.inf, -np.inf]
    expected = scipy.optimize.lsq_linear(x, z, (low, np.inf), method="bvls", tol=1e-14).x
    np.testing.assert_allclose([e.value for e in fit.estimates], expected, atol=1e-9)
    assert fit["q"].standing == "at bound"
    assert fit["q"].value == 0.0
    free = regression(equation([columns], [z]))
    assert f"{free['q'].value:.4g}" in fit["q"].reason
    assert fit["q"].standard_error == pytest.approx(free["q"].standard_error)
    assert fit["alpha"].standing == "estimated"
    wide = regression(equation([columns], [z], q=Parameter("q", 0.0, lower=-9.0, upper=9.0)))
    assert wide["q"].value == free["q"].value


def test_fixed_and_tied_parameters_are_those_of_the_reduced_problem():
    rng = np.random.default_rng(7)
    columns = manoeuvre(rng, 500)
    z = 2.0 * columns["alpha"] - columns["q"] + 0.5 * columns["de"] + coloured(rng, 500, 0.5)
    fit = regression(
        equation(
            [columns],
            [z],
            q=Parameter("q", -1.0, free=False),
            de=Parameter("de", 0.0, tied=("alpha", 0.25)),
        )
    )
    reduced = np.column_stack([columns["alpha"] + 0.25 * columns["de"], columns["1"]])
    expected = np.linalg.lstsq(reduced, z + columns["q"], rcond=None)[0]
    assert fit["alpha"].value == pytest.approx(expected[0], rel=1e-12)
    assert fit["de"].value == pytest.approx(0.25 * expected[0], rel=1e-12)
    assert (fit["q"].value, fit["q"].standing, fit["q"].standard_error) == (-1.0, "fixed", 0.0)
    assert fit["de"].standing == "tied"
    assert fit.names == ("alpha", "1")


def test_a_prior_is_added_to_the_information():
    rng = np.random.default_rng(9)
    columns = {"x": coloured(rng, 900, 0.9)}
    z = 1.5 * columns["x"] + coloured(rng, 900, 0.9)
    alone = regression(equation([columns], [z]))["x"]
    prior = Parameter("x", 0.0, prior=1.0, prior_error=alone.standard_error)
    fit = regression(equation([columns], [z], x=prior))["x"]
    assert fit.value == pytest.approx(0.5 * (1.0 + alone.value), rel=1e-9)
    assert fit.standard_error == pytest.approx(alone.standard_error / np.sqrt(2), rel=1e-9)
    strong = Parameter("x", 0.0, prior=1.0, prior_error=0.01 * alone.standard_error)
    held = regression(equation([columns], [z], x=strong))["x"]
    assert held.standing == "prior"
    assert held.value == pytest.approx(1.0, abs=1e-3)


def test_combinations_that_the_records_do_not_determine():
    rng = np.random.default_rng(11)
    columns = manoeuvre(rng, 400)
    columns = {**columns, "flap": 2.0 * columns["de"], "mach": np.full(400, 0.3)}
    columns["none"] = np.zeros(400)
    z = columns["alpha"] + 0.4 * columns["de"] + 0.1 * coloured(rng, 400, 0.5)
    fit = regression(equation([columns], [z]))
    assert {e.name: e.standing for e in fit.estimates} == {
        "alpha": "estimated",
        "q": "estimated",
        "de": "not identifiable",
        "1": "estimated",
        "flap": "not identifiable",
        "mach": "not excited",
        "none": "not excited",
    }
    assert np.isnan(fit["de"].value)
    assert "flap" in fit["de"].reason
    assert any("0.89 de - 0.45 flap" in note for note in fit.notes)
    assert fit["alpha"].value == pytest.approx(1.0, abs=0.05)
    told = regression(
        equation([columns], [z], flap=Parameter("flap", 0.0, prior=0.0, prior_error=0.01))
    )
    assert told["de"].standing == "estimated"
    assert told["de"].value == pytest.approx(0.4, abs=3 * told["de"].standard_error)
    assert told["flap"].standing == "prior"


def test_theil_of_each_record_and_of_all():
    rng = np.random.default_rng(13)
    columns = [manoeuvre(rng, 300) for _ in range(3)]
    responses = [c["alpha"] + 0.1 * coloured(rng, 300, 0.5) for c in columns]
    fit = regression(equation(columns, responses))
    assert set(fit.theil) == {"r0", "r1", "r2"}
    part = fit.theil["r1"]["Cm"]
    assert part.bias + part.variance + part.covariance == pytest.approx(1.0)
    error = np.concatenate([fit.residuals[f"r{k}"]["Cm"] for k in range(3)])
    model = np.concatenate([fit.fitted[f"r{k}"]["Cm"] for k in range(3)])
    z = np.concatenate(responses)
    inequality = np.sqrt(np.mean(error**2)) / (np.sqrt(np.mean(model**2)) + np.sqrt(np.mean(z**2)))
    assert any(f"fit {100 * (1 - inequality):.1f} %" in note for note in fit.notes)


def test_nothing_to_estimate():
    still = {"x": np.zeros(50)}
    with pytest.raises(InputError, match="nothing moves"):
        regression(equation([still], [np.ones(50)]))
    with pytest.raises(InputError, match="fixed or tied"):
        regression(equation([still], [np.ones(50)], x=Parameter("x", 0.0, free=False)))
    with pytest.raises(InputError, match="cannot give"):
        regression(equation([{"x": np.ones(1)}], [np.ones(1)]))


def test_an_autoregressive_process_is_recovered():
    rng = np.random.default_rng(15)
    model = autoregressive_noise([coloured(rng, 4000, 0.9) for _ in range(3)])
    assert model.coefficients[0] == pytest.approx(0.9, abs=0.03)
    assert model.innovation == pytest.approx(1 - 0.9**2, rel=0.1)
    assert model.independent == pytest.approx(12000 * 0.1 / 1.9, rel=0.4)
    assert autoregressive_noise([np.zeros(100)]).independent == 100


@pytest.mark.heavy
@pytest.mark.parametrize("pole", [0.0, 0.9, 0.97])
def test_intervals_cover_the_truth(trials, pole):
    """95 % intervals of 300 fits hold the truth in 92 to 98 %, unless the fit says too short."""
    rng = np.random.default_rng(17)
    count, held, short = trials(60, 300), np.zeros(4), 0
    for _ in range(count):
        columns = [manoeuvre(rng, 1500) for _ in range(2)]
        responses = [sum(c.values()) + coloured(rng, 1500, pole) for c in columns]
        fit = regression(equation(columns, responses))
        short += any("Too short" in note for note in fit.notes)
        for k, each in enumerate(fit.estimates):
            low, high = fit.interval(each.name)
            held[k] += low <= 1.0 <= high
    spread = 2.5 * np.sqrt(0.95 * 0.05 / (4 * count)) if count < 300 else 0.0
    assert 0.92 - spread <= held.sum() / (4 * count) <= 0.98 + spread
    assert short < 0.5 * count


def test_short_records_say_so():
    rng = np.random.default_rng(19)
    columns = manoeuvre(rng, 250)
    z = sum(columns.values()) + coloured(rng, 250, 0.97)
    assert any("Too short" in note for note in regression(equation([columns], [z])).notes)
