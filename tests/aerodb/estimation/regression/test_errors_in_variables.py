"""Noisy regressors: total least squares against the singular value decomposition and Fuller's
formula, instruments against two-stage least squares written out, and planted truth."""

import numpy as np
import pytest

from aerodb.errors import InputError
from aerodb.estimation.regression.instrumental_variables import instrumental_variables
from aerodb.estimation.regression.regression_fit import regression
from aerodb.estimation.regression.total_least_squares import total_least_squares
from tests.support.equations import coloured, equation, manoeuvre

NOISE = 0.4
TRUTH = {"alpha": 1.0, "q": -0.8, "delta_e": 0.5, "1": 0.1}


def noisy(rng, n=2000, records=2, pole=0.8):
    """Records with alpha and q measured with white noise, and the columns without."""
    shown, clean, responses = [], [], []
    for _ in range(records):
        made = manoeuvre(rng, n)
        made = {"alpha": made["alpha"], "q": made["q"], "delta_e": made["de"], "1": made["1"]}
        responses.append(
            sum(TRUTH[name] * column for name, column in made.items())
            + 0.2 * coloured(rng, n, pole)
        )
        clean.append(made)
        shown.append(
            {**made, **{k: made[k] + NOISE * rng.standard_normal(n) for k in ("alpha", "q")}}
        )
    return shown, clean, responses


def test_plain_total_least_squares_is_the_last_singular_vector():
    """Golub and Van Loan: all columns and the response with the same noise."""
    rng = np.random.default_rng(1)
    x = rng.standard_normal((800, 2)) @ np.array([[1.0, 0.4], [0.0, 1.0]])
    y = x @ [1.0, -2.0] + 0.3 * rng.standard_normal(800)
    x = x + 0.3 * rng.standard_normal((800, 2))
    fit = total_least_squares(
        equation([{"a": x[:, 0], "b": x[:, 1]}], [y]),
        noise={"a": 0.3, "b": 0.3},
        response_noise=0.3,
    )
    vector = np.linalg.svd(np.column_stack([x, y]))[2][-1]
    root = np.linalg.svd(np.column_stack([x, y]))[1][-1] ** 2 / (800 * 0.3**2)
    assert root < 1.05
    if root < 1.0:
        expected = -vector[:2] / vector[2]
        assert [fit["a"].value, fit["b"].value] == pytest.approx(expected.tolist(), rel=1e-9)
    corrected = total_least_squares(
        equation([{"a": x[:, 0], "b": x[:, 1]}], [y]), noise={"a": 0.3, "b": 0.3}
    )
    fuller = np.linalg.solve(x.T @ x - 800 * 0.09 * np.eye(2), x.T @ y)
    assert [corrected["a"].value, corrected["b"].value] == pytest.approx(fuller.tolist(), rel=1e-9)


@pytest.mark.parametrize("told", [True, False])
def test_the_draw_towards_zero_is_removed(told):
    """With the noise told, and with the noise seen in the highest frequencies."""
    rng = np.random.default_rng(3)
    shown, _, responses = noisy(rng, 6000)
    whole = equation(shown, responses)
    drawn = regression(whole)
    assert drawn["q"].value > -0.7
    assert abs(drawn["q"].value + 0.8) > 5 * drawn["q"].standard_error
    fit = total_least_squares(whole, noise={"alpha": NOISE, "q": NOISE} if told else None)
    for name, value in TRUTH.items():
        slack = 3.5 * fit[name].standard_error + (0.0 if told else 0.06)
        assert fit[name].value == pytest.approx(value, abs=slack)
    assert any(f"least squares gives {drawn['q'].value:.4g}" in note for note in fit.notes)


def test_instruments_by_hand():
    rng = np.random.default_rng(5)
    shown, clean, responses = noisy(rng, 900, records=1)
    commands = np.column_stack(
        [clean[0][name] + 0.1 * coloured(rng, 900, 0.5) for name in ("alpha", "q")]
    )
    fit = instrumental_variables(equation(shown, responses), instruments={"r0": commands})
    x = np.column_stack(list(shown[0].values()))
    z = np.column_stack([shown[0]["delta_e"], shown[0]["1"], commands])
    predicted = z @ np.linalg.lstsq(z, x, rcond=None)[0]
    expected = np.linalg.lstsq(predicted, responses[0], rcond=None)[0]
    np.testing.assert_allclose([fit[name].value for name in TRUTH], expected, rtol=1e-8)


def test_lagged_instruments_remove_the_draw():
    rng = np.random.default_rng(7)
    shown, _, responses = noisy(rng, 6000)
    fit = instrumental_variables(equation(shown, responses))
    for name, value in TRUTH.items():
        assert fit[name].value == pytest.approx(value, abs=3.5 * fit[name].standard_error)
        assert fit[name].standing == "estimated"


def test_weak_instruments_are_told():
    rng = np.random.default_rng(9)
    shown, _, responses = noisy(rng, 1500, records=1)
    unrelated = rng.standard_normal((1500, 3))
    fit = instrumental_variables(equation(shown, responses), instruments={"r0": unrelated})
    assert fit["alpha"].standing == fit["q"].standing == "not identifiable"
    assert "weak" in fit["q"].reason
    assert np.isnan(fit["q"].value)
    assert fit["1"].standing == "estimated"


def test_a_regressor_of_noise_alone_is_told():
    rng = np.random.default_rng(11)
    shown, _, responses = noisy(rng, 1500, records=1)
    shown[0]["beta"] = 0.21 * rng.standard_normal(1500) + 0.05 * coloured(rng, 1500, 0.9)
    fit = total_least_squares(
        equation(shown, responses), noise={"alpha": NOISE, "q": NOISE, "beta": 0.2}
    )
    assert fit["beta"].standing == "not identifiable"
    assert fit["alpha"].standing == "estimated"
    with pytest.raises(InputError, match="as large as"):
        total_least_squares(equation(shown, responses), noise={"beta": 0.5})


def test_wrong_names_and_lengths():
    rng = np.random.default_rng(13)
    shown, _, responses = noisy(rng, 300, records=1)
    whole = equation(shown, responses)
    with pytest.raises(InputError, match="no unknown parameter 'alfa'"):
        total_least_squares(whole, noise={"alfa": 0.1})
    with pytest.raises(InputError, match="negative"):
        total_least_squares(whole, noise={"alpha": -0.1})
    with pytest.raises(InputError, match="not positive"):
        total_least_squares(whole, noise={"alpha": 0.1}, response_noise=0.0)
    with pytest.raises(InputError, match="no unknown parameter 'alfa'"):
        instrumental_variables(whole, noisy=["alfa"])
    with pytest.raises(InputError, match="cannot replace"):
        instrumental_variables(whole, instruments={"r0": np.arange(300.0)})
    with pytest.raises(InputError, match="300 samples"):
        instrumental_variables(whole, instruments={"r0": np.arange(30.0)})


@pytest.mark.heavy
@pytest.mark.parametrize("method", ["total", "instruments"])
def test_intervals_cover_the_truth(trials, method):
    rng = np.random.default_rng(15)
    count, held, total = trials(40, 300), 0, 0
    for _ in range(count):
        shown, _, responses = noisy(rng, 2000, pole=0.9)
        whole = equation(shown, responses)
        fit = (
            total_least_squares(whole, noise={"alpha": NOISE, "q": NOISE})
            if method == "total"
            else instrumental_variables(whole)
        )
        for name, value in TRUTH.items():
            low, high = fit.interval(name)
            held += low <= value <= high
            total += 1
    spread = 2.5 * np.sqrt(0.95 * 0.05 / total) if count < 300 else 0.0
    assert 0.92 - spread <= held / total <= 0.98 + spread
