"""A candidate by another method than regression: what it says of collinearity and fit is the
method's own."""

import numpy as np
import pytest

from aerodb.errors import InputError
from aerodb.estimation import Fit, ParameterEstimate
from aerodb.identification.candidate import with_fitted_estimates
from aerodb.increments.acceptable import judge_aliases
from aerodb.increments.estimate import Update, estimate_increments
from aerodb.increments.model_file import parse_model_file
from aerodb.increments.validation import HoldOut
from aerodb.report.document import update_document
from tests.support.synthetic import comparison, database, flight, smooth_noise

MODEL = """
[[increment]]
axis = "CZ"
terms = ["1", "alpha", "q_hat"]
"""
NAMES = ("CZ_0", "CZ_alpha", "CZ_q_hat", "initial_q[f]")


@pytest.fixture(scope="module")
def by_regression() -> Update:
    rng = np.random.default_rng(1)
    flown = [flight(rng, f"f{k}") for k in range(2)]
    compared = [
        comparison(f, {"CZ": -0.5 * f["alpha"] + smooth_noise(rng, len(f.time), 0.1, 0.01)})
        for f in flown
    ]
    return estimate_increments(flown, compared, parse_model_file(MODEL), database())


def fit(correlation: float, values=(0.1, 4.46, 37.0, 0.2)) -> Fit:
    """Alpha and pitch rate are correlated so; the constant and the first rate with both, by what
    is unknown in any case."""
    error = np.array([0.01, 0.3, 5.0, 0.02])
    share = np.array([[1, 0.2, 0.1, 0], [0.2, 1, correlation, 0.3], [0.1, correlation, 1, 0.3],
                      [0, 0.3, 0.3, 1]])  # fmt: skip
    estimates = tuple(ParameterEstimate(*each) for each in zip(NAMES, values, error, strict=True))
    fitted = {"f": {"alpha": np.sin(np.arange(50.0)), "q": np.cos(np.arange(50.0))}}
    left = {"f": {"alpha": 0.1 * np.cos(np.arange(50.0)), "q": np.sin(3.0 * np.arange(50.0))}}
    return Fit("output-error", estimates, NAMES, share * np.outer(error, error), left, fitted)


def test_inflation_and_shares_are_those_of_the_fit(by_regression: Update) -> None:
    """Of two slopes, 1 / (1 - rho^2); the coefficient of determination by its definition."""
    found = fit(0.9)
    (axis,) = with_fitted_estimates(by_regression, [found]).axes
    assert axis.vif.tolist() == pytest.approx([1.0, 1 / (1 - 0.81), 1 / (1 - 0.81)])
    assert axis.estimates.tolist() == [0.1, 4.46, 37.0]
    for name, share in axis.outputs.items():
        left, model = found.residuals["f"][name], found.fitted["f"][name]
        measured = left + model
        assert share == pytest.approx(1.0 - left @ left / np.sum((measured - measured.mean()) ** 2))
    assert axis.r_squared == min(axis.outputs.values()) == axis.outputs["q"]
    assert by_regression.axes[0].vif[1] < 1.5, "regression's would have passed for it"
    assert by_regression.axes[0].outputs == {}


def document(update: Update) -> dict:
    return update_document(
        vehicle="v", baseline="b", hold_out=HoldOut(("f0",), (), "not validated"), excluded=(),
        looks={}, update=update, proof=(),
    )  # fmt: skip


def test_a_collinear_pair_is_said_and_refused_until_it_is_accepted(by_regression: Update) -> None:
    """Regression on the same flights tells the two apart; this method does not."""
    said = document(with_fitted_estimates(by_regression, [fit(0.97)]))
    assert said["increments"][0]["aliases"] == [["alpha", "q_hat"]]
    assert any("alpha and q_hat moved together" in remark for remark in said["remarks"])
    (reason,) = judge_aliases(said, ()).reasons
    assert "--accept alias@CZ" in reason
    assert judge_aliases(said, ("alias@CZ",)).passed
    assert not judge_aliases(said, ("alias@Cm",)).passed


def test_nothing_is_said_of_what_can_be_told_apart(by_regression: Update) -> None:
    for update in (by_regression, with_fitted_estimates(by_regression, [fit(0.9)])):
        said = document(update)
        assert said["increments"][0]["aliases"] == []
        assert judge_aliases(said, ()).passed
    assert judge_aliases({}, ()).passed


def test_a_fit_of_nothing_makes_no_candidate(by_regression: Update) -> None:
    still = fit(0.0)
    nothing = Fit("output-error", still.estimates, NAMES, still.covariance)
    with pytest.raises(InputError, match="explains no output"):
        with_fitted_estimates(by_regression, [nothing])
