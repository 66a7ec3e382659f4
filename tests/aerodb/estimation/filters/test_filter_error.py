"""Filter error: the published answers of a flight in turbulence, an independent likelihood, planted
truth, and the record without turbulence."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.stats import multivariate_normal

from aerodb.errors import InputError
from aerodb.estimation import (
    Parameter,
    Parameters,
    TimeHistory,
    filter_error,
    output_error,
    output_or_filter_error,
    state_space,
)
from aerodb.estimation.filters.filtering import NoiseLevels, run_filter
from aerodb.estimation.filters.process_noise import boundary_p_value
from tests.support import hfb320_filter_model, short_period

DERIVATIVES = tuple(short_period.STABLE)


def _start(truth: dict[str, float], share: float = 0.6) -> dict[str, float]:
    return {name: share * value for name, value in truth.items()}


def _misses(fit, truth: dict[str, float]) -> dict[str, float]:
    return {
        name: (fit[name].value - value) / fit[name].standard_error for name, value in truth.items()
    }


def test_hfb320_in_turbulence_as_published(measured: Callable[[str], Path]) -> None:
    """The published values are of the same form, with a bound on the gain (K C at most 1) that acts
    on alpha there; without it, all eleven agree to half their Cramer-Rao bound."""
    record = hfb320_filter_model.record(measured("hfb320/hfb320_1_10.asc"))
    model = hfb320_filter_model.model(record)
    fit = filter_error(model, [record], covariance="innovations")
    assert fit.converged
    for name, value in hfb320_filter_model.PUBLISHED.items():
        assert abs(fit[name].value - value) < 0.5 * fit[name].cramer_rao, name
    assert fit["CL_alpha"].value == pytest.approx(4.33, abs=0.01)
    assert fit["Cm_q"].value == pytest.approx(-34.7, abs=0.3)
    assert "output error is biased" in fit.notes[0]
    plain = output_error(model, [record])
    believed = output_or_filter_error(plain, fit)
    assert believed.method == "filter-error"
    assert "residuals are correlated" in believed.reason


def _dense_log_density(a, c, process, noise, step: float, values: np.ndarray) -> float:
    """Log-density of the outputs of a linear model that starts at zero, by their whole covariance."""
    s, n = len(a), len(values)
    whole = np.zeros((2 * s, 2 * s))
    whole[:s, :s], whole[:s, s:], whole[s:, s:] = -a, np.diag(process**2), a.T
    power = expm(whole * step)
    phi = power[s:, s:].T
    added = phi @ power[:s, s:]
    variance, cross = [np.zeros((s, s))], {}
    for _ in range(1, n):
        variance.append(phi @ variance[-1] @ phi.T + added)
    for i in range(n):
        later = variance[i]
        for j in range(i, n):
            cross[i, j] = c @ later.T @ c.T if j > i else c @ later @ c.T
            cross[i, j] = c @ (np.linalg.matrix_power(phi, j - i) @ variance[i]).T @ c.T
    o = len(c)
    covariance = np.zeros((n * o, n * o))
    for (i, j), block in cross.items():
        covariance[i * o : (i + 1) * o, j * o : (j + 1) * o] = block
        covariance[j * o : (j + 1) * o, i * o : (i + 1) * o] = block.T
    covariance += np.kron(np.eye(n), noise)
    seen = np.isfinite(values.ravel())
    return float(
        multivariate_normal(np.zeros(int(seen.sum())), covariance[np.ix_(seen, seen)]).logpdf(
            values.ravel()[seen]
        )
    )


def test_likelihood_is_that_of_the_whole_record() -> None:
    """A filter's innovations give the density that the outputs' whole covariance gives, with
    correlated noise and gaps."""
    rng = np.random.default_rng(3)
    a = np.array([[-0.8, 1.0], [-3.0, -0.5]])
    c = np.array([[1.0, 0.0], [0.3, 2.0], [-1.0, 0.5]])
    root = rng.normal(size=(3, 3))
    noise, process = root @ root.T, np.array([0.4, 1.3])
    values = rng.normal(size=(40, 3))
    values[rng.random((40, 3)) < 0.2] = np.nan
    time = 0.002 * np.arange(40)
    model = state_space(
        ("x1", "x2"), (), ("y1", "y2", "y3"),
        Parameters((Parameter("initial_x1", 0.0), Parameter("initial_x2", 0.0))),
        a=a.tolist(), b=[[], []], c=c.tolist(),
    )  # fmt: skip
    record = TimeHistory("r", time, {}, dict(zip(model.outputs, values.T, strict=True)))
    passed = run_filter(
        model,
        model.parameters.values(np.zeros(2)),
        record,
        NoiseLevels(process[:, None], noise[:, :, None]),
        False,
    )
    expected = _dense_log_density(a, c, process, noise, 0.002, values)
    assert passed.log_likelihood[0] == pytest.approx(expected, abs=1e-8)


@pytest.mark.parametrize("gain", ["steady", "extended"])
def test_turbulence_of_unknown_intensity(gain: str) -> None:
    truth = short_period.STABLE
    record, model = short_period.flown(truth, 0.02, 2), short_period.model(_start(truth))
    fit = filter_error(model, [record], gain=gain, process_noise=("g1",))
    assert max(map(abs, _misses(fit, truth).values())) < 2.0
    gusts = fit["process_noise_g1"]
    assert abs(gusts.value - 0.02) < 2.0 * gusts.standard_error
    plain = output_error(model, [record])
    off = [abs(plain[name].value - value) / plain[name].cramer_rao for name, value in truth.items()]
    assert max(off) > 2.0
    believed = output_or_filter_error(plain, fit)
    assert believed.method == "filter-error"
    assert "standard errors away" in believed.reason


def test_without_turbulence_process_noise_is_not_needed() -> None:
    truth = short_period.STABLE
    record, model = short_period.flown(truth, 0.0, 3), short_period.model(_start(truth))
    fit, plain = filter_error(model, [record], process_noise=("g1",)), output_error(model, [record])
    assert (fit["process_noise_g1"].value, fit["process_noise_g1"].standing) == (0.0, "at bound")
    assert "not needed" in fit.notes[0]
    for name in truth:
        assert abs(fit[name].value - plain[name].value) < 0.05 * plain[name].standard_error
    assert output_or_filter_error(plain, fit).method == "output-error"


def test_unstable_aircraft() -> None:
    """Time to double 0.5 s, flown with feedback of alpha to the elevator."""
    truth = short_period.UNSTABLE
    roots = np.linalg.eigvals([[truth["Z_alpha"], 1.0], [truth["M_alpha"], truth["M_q"]]])
    assert np.log(2.0) / roots.real.max() == pytest.approx(0.5, abs=0.05)
    record = short_period.flown(truth, 0.005, 4, feedback=-1.5)
    fit = filter_error(short_period.model(_start(truth)), [record], process_noise=("g1",))
    assert max(map(abs, _misses(fit, truth).values())) < 2.0


def test_several_records_with_own_first_states_and_gaps() -> None:
    truth = short_period.STABLE
    records = [short_period.flown(truth, 0.02, seed, name=f"f{seed}") for seed in (5, 6)]
    records[0].outputs["q"][100:140] = np.nan
    fit = filter_error(short_period.model(_start(truth)), records, process_noise=("g1",))
    assert max(map(abs, _misses(fit, truth).values())) < 2.0
    assert np.isnan(fit.residuals["f5"]["q"][100:140]).all()


def test_standing_of_each_parameter() -> None:
    """What is not excited, not identifiable, at its bound, known or tied is said of each."""
    truth = short_period.STABLE
    record = short_period.flown(truth, 0.02, 7)
    quiet = TimeHistory("quiet", record.time, {"de": 0.0 * record.time}, record.outputs)
    silent = filter_error(short_period.model(_start(truth)), [quiet], process_noise=("g1",))
    assert silent["M_de"].standing == "not excited"
    assert np.isnan(silent["M_de"].value)
    bounded = short_period.model(
        _start(truth), M_q={"lower": -1.3}, Z_de={"prior": -0.1, "prior_error": 1e-4}
    )
    fit = filter_error(bounded, [record], process_noise=("g1",))
    assert (fit["M_q"].standing, fit["M_q"].value) == ("at bound", -1.3)
    assert fit["Z_de"].standing == "prior"
    assert (fit["initial_g1"].standing, fit["M_alpha"].standing) == ("fixed", "estimated")


def test_unknown_states_and_lacking_outputs_are_told() -> None:
    record = short_period.flown(short_period.STABLE, 0.0, 1, seconds=5.0)
    model = short_period.model(short_period.STABLE)
    with pytest.raises(InputError, match="no state 'g3'"):
        filter_error(model, [record], process_noise=("g3",))
    with pytest.raises(InputError, match="unique names"):
        filter_error(model, [record, record])
    with pytest.raises(InputError, match="no az"):
        filter_error(
            model,
            [
                TimeHistory(
                    "r",
                    record.time,
                    record.inputs,
                    {"alpha": record.outputs["alpha"], "q": record.outputs["q"]},
                )
            ],
        )


def test_innovations_need_a_steady_gain() -> None:
    record = short_period.flown(short_period.STABLE, 0.0, 1, seconds=5.0)
    model = short_period.model(short_period.STABLE)
    with pytest.raises(InputError, match="steady gain"):
        filter_error(model, [record], gain="extended", covariance="innovations")


def test_likelihood_ratio_at_the_boundary() -> None:
    """Half of all ratios are zero there: the 5 % point of one intensity is that of 10 %."""
    assert boundary_p_value(2.7055, 1) == pytest.approx(0.05, abs=1e-4)
    assert boundary_p_value(0.0, 3) == 1.0
    rng = np.random.default_rng(0)
    ratios = (np.maximum(rng.normal(size=(40_000, 3)), 0.0) ** 2).sum(axis=1)
    assert np.mean(ratios > 4.0) == pytest.approx(boundary_p_value(4.0, 3), abs=0.004)
