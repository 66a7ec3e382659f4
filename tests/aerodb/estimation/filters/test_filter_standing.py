"""What filters say of parameters that a record does not determine: a rolling motion in turbulence,
given badly."""

from collections.abc import Callable

import numpy as np
import pytest

from aerodb.estimation import (
    Fit,
    Parameter,
    Parameters,
    StateSpace,
    TimeHistory,
    extended_kalman,
    filter_error,
    state_space,
    unscented_kalman,
)

TRUTH = {"Lp": -2.0, "Lda": 8.0}
STEP = 0.05


def _model(*items: Parameter, damping: str = "Lp", control: str = "Lda") -> StateSpace:
    return state_space(
        ("p",), ("da",), ("p",), Parameters((*items, Parameter("initial_p", 0.0, free=False))),
        a=[[damping]], b=[[control]], c=[[1.0]],
    )  # fmt: skip


@pytest.fixture(scope="module")
def record() -> TimeHistory:
    rng, n = np.random.default_rng(4), 400
    time = STEP * np.arange(n)
    da = 0.05 * np.sign(np.sin(1.3 * time))
    decay, p = np.exp(TRUTH["Lp"] * STEP), np.zeros(n)
    for i in range(n - 1):  # the aileron is constant over a step but where it reverses
        held = 0.5 * (da[i] + da[i + 1])
        p[i + 1] = decay * p[i] + (1.0 - decay) * TRUTH["Lda"] / -TRUTH["Lp"] * held
        p[i + 1] += 0.02 * np.sqrt(STEP) * rng.standard_normal()
    return TimeHistory("roll", time, {"da": da}, {"p": p + 0.005 * rng.standard_normal(n)})


LP, LDA = Parameter("Lp", -1.0), Parameter("Lda", 5.0)


@pytest.mark.parametrize("method", [filter_error, extended_kalman, unscented_kalman])
class TestStanding:
    def test_truth_without_faults(self, method: Callable[..., Fit], record: TimeHistory) -> None:
        fit = method(_model(LP, LDA), [record])
        for name, value in TRUTH.items():
            assert fit[name].standing == "estimated"
            assert abs(fit[name].value - value) < 3.0 * fit[name].standard_error

    def test_two_in_one_place(self, method: Callable[..., Fit], record: TimeHistory) -> None:
        model = _model(LP, LDA, Parameter("Lp2", -0.5), damping="Lp + Lp2")
        fit = method(model, [record])
        for name in ("Lp", "Lp2"):
            assert fit[name].standing == "not identifiable", fit[name]
            assert np.isnan(fit[name].value)
        assert "Lp2" in fit["Lp"].reason
        assert fit["Lda"].standing == "estimated"

    def test_not_excited(self, method: Callable[..., Fit], record: TimeHistory) -> None:
        quiet = TimeHistory("quiet", record.time, {"da": 0.0 * record.time}, record.outputs)
        fit = method(_model(LP, LDA), [quiet])
        assert fit["Lda"].standing == "not excited"
        assert np.isnan(fit["Lda"].value)
        assert fit["Lp"].standing == "estimated"

    def test_at_bound(self, method: Callable[..., Fit], record: TimeHistory) -> None:
        fit = method(_model(Parameter("Lp", -1.0, lower=-1.2), LDA), [record])
        assert (fit["Lp"].standing, fit["Lp"].value) == ("at bound", -1.2)
        assert np.isnan(fit["Lp"].standard_error)

    def test_tied(self, method: Callable[..., Fit], record: TimeHistory) -> None:
        fit = method(_model(LP, Parameter("Lda", 5.0, tied=("Lp", -4.0))), [record])
        assert fit["Lda"].standing == "tied"
        assert fit["Lda"].value == pytest.approx(-4.0 * fit["Lp"].value)
        assert fit["Lda"].standard_error == pytest.approx(4.0 * fit["Lp"].standard_error)

    def test_diverged(self, method: Callable[..., Fit], record: TimeHistory) -> None:
        fit = method(_model(Parameter("Lp", 1e5), LDA), [record])
        assert not fit.converged
        assert fit["Lp"].standing == "diverged"
        assert np.isnan(fit["Lp"].value)
        assert fit["Lp"].reason
