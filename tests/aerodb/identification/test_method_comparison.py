"""Methods beside each other: spread, and which one to believe."""

import numpy as np
import pytest

from aerodb.estimation import Fit, ParameterEstimate
from aerodb.identification import chosen_methods, compare_methods
from aerodb.signals import theil


def fit(method: str, values: dict[str, tuple[float, float]], **more) -> Fit:
    estimates = tuple(ParameterEstimate(name, *pair) for name, pair in values.items())
    errors = [error for _, error in values.values()]
    return Fit(method, estimates, tuple(values), np.diag(np.square(errors)), **more)


def test_the_spread_is_the_largest_difference_in_standard_errors() -> None:
    fits = {
        "regression": [fit("regression", {"Cm_alpha": (-1.0, 0.03), "Cm_0": (0.0, 1.0)})],
        "recursive": [fit("recursive", {"Cm_alpha": (-1.01, 0.04)})],
        "output-error": [fit("output-error", {"Cm_alpha": (-1.25, 0.04)})],
    }
    slope, constant = compare_methods(fits).parameters
    assert slope.spread == pytest.approx(0.25 / 0.05)
    assert slope.furthest == ("regression", "output-error")
    assert not slope.agree
    assert np.isnan(constant.spread)
    assert constant.agree


def test_what_did_not_converge_is_not_believed() -> None:
    fits = {
        "regression": [fit("regression", {"Cm_alpha": (-1.0, 0.03)})],
        "output-error": [fit("output-error", {"Cm_alpha": (-1.1, 0.03)}, converged=False)],
    }
    comparison = compare_methods(fits)
    assert comparison.believe == "regression"
    assert "output-error did not converge" in comparison.reasons


@pytest.mark.parametrize(("p_value", "believed"), [(1e-6, "filter-error"), (0.4, "output-error")])
def test_process_noise_decides_between_output_and_filter_error(p_value, believed) -> None:
    fits = {
        name: [fit(name, {"CL_alpha": (value, 0.1)}, tests={"process noise": p_value})]
        for name, value in (("output-error", 3.2), ("filter-error", 4.3))
    }
    comparison = compare_methods(fits)
    assert comparison.believe == believed
    assert any("rocess noise" in reason for reason in comparison.reasons)


@pytest.mark.parametrize(("left", "believed"), [(0.0, "filter-error"), (0.95, "output-error")])
def test_process_noise_that_does_not_explain_the_record_is_not_believed(left, believed) -> None:
    """Innovations as correlated in time as output error's residuals: not turbulence, but a model
    that lacks something."""
    rng, fits = np.random.default_rng(5), {}
    for name, value, correlation in (("output-error", 3.2, 0.97), ("filter-error", 4.3, left)):
        series = np.zeros(2000)
        for i in range(1, 2000):
            series[i] = correlation * series[i - 1] + rng.standard_normal()
        fits[name] = [
            fit(
                name,
                {"CL_alpha": (value, 0.1)},
                tests={"process noise": 1e-9},
                residuals={"r": {"q": series}},
            )
        ]
    comparison = compare_methods(fits)
    assert comparison.believe == comparison.preferred == believed
    lacking = any("does not explain the record" in reason for reason in comparison.reasons)
    assert lacking == (believed == "output-error")


def test_a_filter_beside_a_model_that_follows_nothing_is_believed_with_reservation() -> None:
    for converged in (True, False):
        fits = {
            "output-error": [fit("output-error", {"Nb": (3.0, 0.1)}, converged=converged)],
            "filter-error": [
                fit("filter-error", {"Nb": (-2.9, 0.1)}, tests={"process noise": 1e-9})
            ],
        }
        comparison = compare_methods(fits)
        assert comparison.believe == "filter-error"
        assert any("wrong sign" in why for why in comparison.reasons) is not converged


def coloured(rng: np.random.Generator, correlation: float, n: int = 700) -> np.ndarray:
    """A first-order process of unit variance."""
    series = rng.standard_normal(n)
    series[1:] *= np.sqrt(1.0 - correlation**2)
    for i in range(1, n):
        series[i] += correlation * series[i - 1]
    return series


@pytest.mark.parametrize(("correlation", "white"), [(0.0, True), (0.43, False), (-0.36, False)])
def test_a_filter_whose_innovations_are_not_white_is_preferred_and_not_believed(
    correlation, white
) -> None:
    """The correlations of beta and of other outputs on the measured F/A-18; output error's
    residuals are far longer correlated, so that process noise explains most of them."""
    rng = np.random.default_rng(11)
    fits = {
        "output-error": [
            fit("output-error", {"Lr": (0.28, 0.2)}, residuals={"r": {"p": coloured(rng, 0.97)}})
        ],
        "filter-error": [
            fit(
                "filter-error",
                {"Lr": (-0.6, 0.25)},
                tests={"process noise": 1e-9},
                residuals={"r": {"p": coloured(rng, correlation), "r": coloured(rng, 0.0)}},
            )
        ],
    }
    comparison = compare_methods(fits)
    assert comparison.preferred == "filter-error"
    assert (comparison.believe is not None, comparison.reserved) == (white, not white)
    said = [why for why in comparison.reasons if "not white" in why]
    assert len(said) == (not white)
    assert all(f"of p ({'-' * (correlation < 0)}0." in why and "too small" in why for why in said)


ANGLES = {"r": {"alpha": np.sin(np.arange(200.0)), "q": np.cos(np.arange(200.0))}}


def flown(value: float, error: float) -> dict[str, list[Fit]]:
    return {"output-error": [fit("output-error", {"Cm_alpha": (value, error)}, residuals=ANGLES)]}


@pytest.mark.parametrize(("left", "said"), [(0.0, False), (0.9, True)])
def test_an_output_that_holds_its_noise_alone_is_followed(left, said) -> None:
    """The heading of a roll along the centreline: white noise is no motion that a model lacks."""
    rng = np.random.default_rng(38)
    along, held = np.linspace(0.0, 1000.0, 700), coloured(rng, left)
    white = coloured(rng, 0.0)
    agreement = {
        "r": {"north": theil(along + white, along), "psi": theil(np.zeros_like(held), held)}
    }
    assert agreement["r"]["psi"].fit_percent < 1.0
    flown = fit(
        "output-error",
        {"mu": (0.2, 0.001)},
        residuals={"r": {"north": white, "psi": held}},
        theil=agreement,
    )
    comparison = compare_methods({"output-error": [flown]})
    assert any("follows psi by" in why for why in comparison.reasons) is said
    assert comparison.reserved is said


def test_what_an_estimator_made_is_no_measurement_for_a_method_that_flies() -> None:
    """A pitch stiffness that output error loses in the autopilot's alpha, and regression has."""
    regression = {"regression": [fit("regression", {"Cm_alpha": (-0.34, 0.07)})]}
    comparison = compare_methods(regression | flown(-0.015, 0.019), {"alpha"})
    assert comparison.believe == "regression"
    (apart,) = (why for why in comparison.reasons if "joint uncertainty" in why)
    assert (
        "Cm_alpha -0.015 (standard error 0.019) by output-error and -0.34 (0.07) by regression"
        in apart
    )
    alike = compare_methods(regression | flown(-0.30, 0.02), {"alpha"})
    assert alike.believe == "regression"
    assert not any("joint uncertainty" in why for why in alike.reasons)
    alone = compare_methods(flown(-0.015, 0.019), {"alpha"})
    assert (alone.believe, alone.reserved) == ("output-error", True)
    assert any("regression on derived accelerations" in why for why in alone.reasons)


def test_sensors_and_what_is_not_fitted_give_no_reservation() -> None:
    regression = {"regression": [fit("regression", {"Cm_alpha": (-0.34, 0.07)})]}
    for estimated in ((), ("beta", "phi")):
        comparison = compare_methods(regression | flown(-0.015, 0.019), estimated)
        assert (comparison.believe, comparison.reserved) == ("output-error", False)
        assert not any("no sensor measured" in why for why in comparison.reasons)


def test_nothing_is_believed_where_nothing_is_determined() -> None:
    lost = ParameterEstimate("Cm_q", np.nan, np.nan, standing="not excited")
    none = Fit("regression", (lost,), (), np.zeros((0, 0)))
    comparison = compare_methods({"regression": [none]})
    assert comparison.believe is None
    assert any("no method" in reason for reason in comparison.reasons)


def test_all_leaves_out_displays() -> None:
    flown = {method.name for method in chosen_methods(["all"])}
    dynamic = {"output-error", "multiple-shooting", "filter-error", "ekf", "ukf"}
    assert dynamic | {"regression"} <= flown
    assert "stepwise" not in flown
