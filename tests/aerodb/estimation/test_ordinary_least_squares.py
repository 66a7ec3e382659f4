"""Least squares against published Twin Otter results, coverage of planted truth, and rejected
input."""

import numpy as np
import pytest
import scipy.io

from aerodb.estimation.ordinary_least_squares import least_squares
from aerodb.signals.error_measures import theil

# Klein & Morelli, SIDPAC v2.0, Twin Otter f1_017: estimates and coloured standard errors, [beta p r
# da dr 1]
PUBLISHED = {
    "Cn": (
        [0.085436779, -0.051510765, -0.197584751, 0.002336487, -0.130535343, 0.000459883],
        [0.001161473, 0.004007629, 0.003664621, 0.001267497, 0.001881436, 0.000027117],
        0.9962,
    ),
    "Cl": (
        [-0.105131403, -0.528346554, 0.192587176, -0.211684732, 0.029943274, -0.000207957],
        [0.002543528, 0.009933321, 0.008332317, 0.003388022, 0.003857992, 0.000032649],
        0.9551,
    ),
    "CY": (
        [-0.845133669, 0.963112018, 0.342619570, -0.005145963],
        [0.007410523, 0.055337479, 0.028948744, 0.000176360],
        0.9907,
    ),
}
COLUMN = {"CY": 62, "Cl": 64, "Cn": 66}


@pytest.fixture(scope="module")
def columns(measured):
    data = scipy.io.loadmat(
        measured("twin_otter/totter_f1_017_data.mat"), variable_names=["fdata"]
    )["fdata"]
    return lambda index: data[:, index - 1]


@pytest.mark.parametrize("axis", PUBLISHED)
def test_published_equation_error_with_coloured_standard_errors(columns, axis):
    angle = np.pi / 180
    regressors = {
        "beta": columns(3) * angle,
        "p_hat": columns(71),
        "r_hat": columns(73),
        "delta_aileron": columns(15) * angle,
        "delta_rudder": columns(16) * angle,
        "1": np.ones(len(columns(1))),
    }
    if axis == "CY":
        regressors = {name: regressors[name] for name in ("beta", "r_hat", "delta_rudder", "1")}
    fit = least_squares(
        np.column_stack(list(regressors.values())), columns(COLUMN[axis]), list(regressors)
    )
    estimates, errors, r_squared = PUBLISHED[axis]
    np.testing.assert_allclose(fit.estimates, estimates, atol=6e-10, rtol=1e-6)
    np.testing.assert_allclose(fit.standard_errors, errors, rtol=1e-3)
    assert fit.r_squared == pytest.approx(r_squared, abs=5e-5)


def _coloured(rng, n, pole):
    noise = rng.standard_normal(n)
    for i in range(1, n):
        noise[i] += pole * noise[i - 1]
    return noise


@pytest.mark.heavy
def test_intervals_cover_the_truth_when_residuals_are_coloured_and_white_ones_do_not(trials):
    rng = np.random.default_rng(7)
    n, records, truth = 400, 4, np.array([0.5, -1.0])
    inside = white_inside = 0
    count = trials(200, 5000)
    for _ in range(count):
        slow = np.concatenate([_coloured(rng, n, 0.97) for _ in range(records)])
        x = np.column_stack([slow, np.ones(n * records)])
        y = x @ truth + np.concatenate([_coloured(rng, n, 0.9) for _ in range(records)])
        fit = least_squares(x, y, ["slow", "1"], [n] * records)
        error = abs(fit.estimates[0] - truth[0])
        inside += error < 1.96 * fit.standard_errors[0]
        white_inside += error < 1.96 * np.sqrt(fit.white_covariance[0, 0])
    assert inside / count > 0.88
    assert white_inside / count < 0.6


def test_dependent_and_unexcited_regressors_are_named():
    x = np.random.default_rng(0).standard_normal((50, 2))
    with pytest.raises(ValueError, match="speed_brake, body_flap"):
        least_squares(
            np.column_stack([x[:, 0], x[:, 1], x[:, 1]]),
            x[:, 0],
            ["alpha", "speed_brake", "body_flap"],
        )
    with pytest.raises(ValueError, match="never excited: body_flap"):
        least_squares(np.column_stack([x[:, 0], 0 * x[:, 1]]), x[:, 0], ["alpha", "body_flap"])


def test_variance_inflation_of_two_surfaces_that_move_together():
    rng = np.random.default_rng(1)
    brake = rng.standard_normal(2000)
    flap = 0.97 * brake + np.sqrt(1 - 0.97**2) * rng.standard_normal(2000)
    fit = least_squares(
        np.column_stack([brake, flap, np.ones(2000)]),
        brake + rng.standard_normal(2000),
        ["sb", "bf", "1"],
    )
    assert fit.vif[:2] == pytest.approx(1 / (1 - np.corrcoef(brake, flap)[0, 1] ** 2), rel=1e-9)
    assert fit.correlation[0, 1] == pytest.approx(-0.97, abs=0.02)


def test_theil_parts_sum_to_one():
    rng = np.random.default_rng(2)
    y = rng.standard_normal(100)
    parts = theil(1.3 * y + 0.2 + 0.1 * rng.standard_normal(100), y)
    assert parts.bias + parts.variance + parts.covariance == pytest.approx(1.0)
    assert 0 < parts.fit_percent < 100
