"""Equation error in the frequency domain: published Twin Otter estimates, the discrete Fourier
transform, coverage of planted truth, and what a band does not determine."""

import numpy as np
import pytest
import scipy.io
import scipy.signal

from aerodb.errors import InputError
from aerodb.estimation import EquationRecord, LinearEquation, Parameter, Parameters
from aerodb.estimation.regression.finite_fourier import transformed
from aerodb.estimation.regression.frequency_domain import frequency_domain_regression
from tests.aerodb.estimation.test_ordinary_least_squares import COLUMN
from tests.aerodb.estimation.test_ordinary_least_squares import PUBLISHED as TIME_DOMAIN
from tests.support.equations import coloured, equation

# Klein & Morelli, SIDPAC v2.0, Twin Otter f1_017, over frequencies from .1 to 1.5 Hz by .02 Hz:
# [beta p r da dr], CY [beta r dr].
PUBLISHED = {
    "Cn": [0.085052178, -0.055242654, -0.200479364, 0.000398326, -0.131904246],
    "Cl": [-0.113761985, -0.571564482, 0.179156866, -0.227049455, 0.025869189],
    "CY": [-0.845643568, 0.954573873, 0.336635751],
}


@pytest.mark.parametrize("axis", PUBLISHED)
def test_published_estimates(measured, axis):
    """The same within a twentieth of a standard error (.0001 on the moments): SIDPAC removes a
    line through smoothed end points beforehand, where this method estimates the line."""
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
    if axis == "CY":
        columns = {name: columns[name] for name in ("beta", "r", "dr", "1")}
    given = equation([columns], [data[:, COLUMN[axis] - 1]], axis)
    fit = frequency_domain_regression(given, lowest=0.1, highest=1.5, spacing=0.02)
    found = np.array([each.value for each in fit.estimates])
    errors = np.array([each.standard_error for each in fit.estimates])
    assert np.all(np.abs(found[:-1] - PUBLISHED[axis]) < 0.05 * errors[:-1])
    if axis != "CY":
        np.testing.assert_allclose(found[:-1], PUBLISHED[axis], atol=1e-4)
    # The band of its own choice begins at the published frequency, and agrees.
    own = frequency_domain_regression(given)
    assert own.notes[0].split()[3] == "0.0999"
    for name in list(columns)[:-1]:
        assert own[name].value == pytest.approx(fit[name].value, abs=0.3 * fit[name].standard_error)
    # The constant is not in the band: it follows from the means, as in the time domain.
    estimates, published_errors, _ = TIME_DOMAIN[axis]
    assert found[-1] == pytest.approx(estimates[-1], abs=2 * published_errors[-1])


def test_transforms_are_those_of_the_discrete_fourier_transform():
    rng = np.random.default_rng(1)
    n, step = 500, 0.02
    record = EquationRecord("r", 3.0 + step * np.arange(n), rng.standard_normal((n, 2)), np.ones(n))
    frequencies = np.arange(5, 40) / (n * step)
    spectra = transformed(record, frequencies)
    expected = step * np.fft.rfft(record.regressors, axis=0)[5:40]
    np.testing.assert_allclose(spectra.regressors, expected, atol=1e-9)
    np.testing.assert_allclose(spectra.response, 0.0, atol=1e-9)
    assert spectra.duration == pytest.approx(10.0)


def test_noise_and_drift_outside_the_band_do_not_matter():
    """A structural mode and a drift spoil a fit in time, and not one between 0.1 and 2 Hz."""
    rng = np.random.default_rng(2)
    columns, _ = short_period(rng, 1500)
    time = 0.02 * np.arange(1500)
    truth = {"alpha": -0.6, "q": -12.0, "de": -1.1, "1": 0.05}
    exact = sum(truth[name] * column for name, column in columns.items())
    spoiled = exact + 0.05 * np.sin(2 * np.pi * 7.3 * time + 1.0) + 0.002 * time
    fit = frequency_domain_regression(equation([columns], [spoiled]), lowest=0.1, highest=2.0)
    for name in ("alpha", "q", "de"):
        assert fit[name].value == pytest.approx(truth[name], rel=0.02)
    clean = frequency_domain_regression(equation([columns], [exact]))
    for name, value in truth.items():
        assert clean[name].value == pytest.approx(value, rel=1e-6)


def test_fixed_tied_bounded_and_prior_parameters():
    rng = np.random.default_rng(3)
    columns, z = short_period(rng, 1000)
    free = frequency_domain_regression(equation([columns], [z]))
    held = frequency_domain_regression(
        equation(
            [columns],
            [z],
            q=Parameter("q", free["q"].value, free=False),
            de=Parameter("de", 0.0, tied=("alpha", free["de"].value / free["alpha"].value)),
        )
    )
    assert held["alpha"].value == pytest.approx(free["alpha"].value, rel=0.05)
    assert (held["q"].standing, held["de"].standing) == ("fixed", "tied")
    bound = frequency_domain_regression(
        equation([columns], [z], q=Parameter("q", -6.0, lower=-10.0))
    )
    assert (bound["q"].value, bound["q"].standing) == (-10.0, "at bound")
    alone = free["q"]
    prior = Parameter("q", 0.0, prior=alone.value + 1.0, prior_error=alone.standard_error)
    both = frequency_domain_regression(equation([columns], [z], q=prior))["q"]
    assert both.value == pytest.approx(alone.value + 0.5, rel=1e-6)
    assert both.standard_error == pytest.approx(alone.standard_error / np.sqrt(2.0), rel=1e-6)


def test_what_a_band_does_not_determine():
    rng = np.random.default_rng(4)
    columns, z = short_period(rng, 1000)
    columns |= {"flap": 2.0 * columns["de"], "gear": np.zeros(1000)}
    fit = frequency_domain_regression(equation([columns], [z]))
    assert {each.name: each.standing for each in fit.estimates} == {
        "alpha": "estimated",
        "q": "estimated",
        "de": "not identifiable",
        "1": "estimated",
        "flap": "not identifiable",
        "gear": "not excited",
    }
    assert np.isnan(fit["de"].value)
    assert "flap" in fit["de"].reason
    assert set(fit.names) == {"alpha", "q", "1"}


def test_constants_of_several_records():
    rng = np.random.default_rng(5)
    pieces = [short_period(rng, 800) for _ in range(3)]
    rows = []
    for k, (columns, z) in enumerate(pieces):
        own = np.zeros((800, 3))
        own[:, k] = 1.0
        matrix = np.column_stack([columns["alpha"], columns["q"], columns["de"], own])
        rows.append(EquationRecord(f"r{k}", 0.02 * np.arange(800), matrix, z + 0.01 * k))
    names = ("alpha", "q", "de", "c0", "c1", "c2")
    parameters = Parameters(tuple(Parameter(name, 0.0) for name in names))
    fit = frequency_domain_regression(LinearEquation("Cm", parameters, tuple(rows)))
    for k in range(3):
        each = fit[f"c{k}"]
        assert each.value == pytest.approx(0.05 + 0.01 * k, abs=4 * each.standard_error)


def test_bands_that_the_record_does_not_hold():
    rng = np.random.default_rng(8)
    columns, z = short_period(rng, 100)
    with pytest.raises(InputError, match="no band from"):
        frequency_domain_regression(equation([columns], [z]), lowest=1.0, highest=60.0)
    fit = frequency_domain_regression(equation([columns], [z]), lowest=1.0, highest=1.3)
    assert any("too short" in note for note in fit.notes)
    assert fit["alpha"].standing == "not identifiable"
    nothing = equation([{"x": np.zeros(200), "1": np.ones(200)}], [np.ones(200)])
    assert frequency_domain_regression(nothing)["x"].standing == "not excited"


TRUTH = np.array([-0.6, -12.0, -1.1, 0.05])


def short_period(rng, n, pole=0.5):
    """Columns of a pitching motion under random doublets, and a response with noise of that
    pole."""
    control = np.repeat(rng.choice([-1.0, 0.0, 1.0], n // 25 + 1), 25)[:n] * 0.05
    a, b = np.array([[-1.2, 0.95], [-6.0, -1.8]]), np.array([[-0.1], [-8.0]])
    system = scipy.signal.StateSpace(a, b, np.eye(2), np.zeros((2, 1)))
    _, state, _ = scipy.signal.lsim(system, control, 0.02 * np.arange(n))
    columns = {
        "alpha": state[:, 0],
        "q": 0.02 * state[:, 1],
        "de": control,
        "1": np.ones(n),
    }
    exact = sum(value * column for value, column in zip(TRUTH, columns.values(), strict=True))
    return columns, exact + 0.005 * coloured(rng, n, pole)


@pytest.mark.heavy
@pytest.mark.parametrize("pole", [0.0, 0.9, 0.97])
def test_intervals_cover_the_truth(trials, pole):
    """95 % intervals of the slopes hold the truth in 92 to 98 % of 300 records of 20 s."""
    rng = np.random.default_rng(7)
    count, held = trials(40, 300), np.zeros(3)
    for _ in range(count):
        columns, z = short_period(rng, 1000, pole)
        fit = frequency_domain_regression(equation([columns], [z]))
        assert not any("too short" in note for note in fit.notes)
        for k, name in enumerate(("alpha", "q", "de")):
            low, high = fit.interval(name)
            held[k] += low <= TRUTH[k] <= high
    spread = 2.5 * np.sqrt(0.95 * 0.05 / (3 * count)) if count < 300 else 0.0
    assert 0.92 - spread <= held.sum() / (3 * count) <= 0.98 + spread
