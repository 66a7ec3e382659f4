"""An unstable aircraft: output error says that it diverges; a stabilised model and multiple
shooting give the truth."""

import numpy as np
import pytest

from aerodb.errors import InputError
from aerodb.estimation import filter_error, multiple_shooting, output_error, stabilised
from tests.support.unstable_aircraft import TRUTH, matrices, piloted_flight, unstable_model

GAINS = {("alpha", "alpha"): 3.0, ("q", "q"): 3.0}


@pytest.fixture(scope="module")
def record():
    return piloted_flight(np.random.default_rng(5))


@pytest.fixture(scope="module")
def start():
    rng = np.random.default_rng(6)
    return {name: value * (1.0 + 0.3 * rng.standard_normal()) for name, value in TRUTH.items()}


def test_the_motion_doubles_in_half_a_second():
    growth = np.linalg.eigvals(matrices(TRUTH)[0]).real.max()
    assert np.log(2.0) / growth == pytest.approx(0.51, abs=0.02)


def test_plain_output_error_diverges_and_says_so(record, start):
    fit = output_error(unstable_model(start), [record])
    assert not fit.converged
    assert {estimate.standing for estimate in fit.estimates} == {"diverged"}
    assert all(np.isnan(estimate.standard_error) for estimate in fit.estimates)
    assert "multiple shooting" in fit["M_alpha"].reason
    assert "diverged" in fit.notes[0]


def test_a_stabilised_model_gives_the_truth(record, start):
    fit = output_error(stabilised(unstable_model(start), GAINS), [record])
    assert fit.converged
    for name, value in TRUTH.items():
        assert abs(fit[name].value - value) < 2.0 * fit[name].standard_error


@pytest.mark.parametrize("continuous", [True, False])
def test_multiple_shooting_gives_the_truth(record, start, continuous):
    fit = multiple_shooting(unstable_model(start), [record], continuous=continuous)
    assert fit.converged
    assert set(fit.names) == {*TRUTH, "initial_alpha", "initial_q"}
    for name, value in TRUTH.items():
        assert abs(fit[name].value - value) < 2.0 * fit[name].standard_error


def test_filter_error_keeps_the_process_noise_that_it_needs_to_follow(record):
    """Without any, sensitivities grow with the motion until no parameter is told from another."""
    start = {name: 0.97 * value for name, value in TRUTH.items()}
    fit = filter_error(unstable_model(start), [record])
    assert fit.converged
    assert "unstable" in fit.notes[0]
    for name, value in TRUTH.items():
        assert fit[name].standing == "estimated", fit[name]
        assert abs(fit[name].value - value) < 2.5 * fit[name].standard_error


def test_segments_that_join_are_output_error_where_that_converges(record):
    """On four seconds, which the motion of the model still follows."""
    short = type(record)(
        "short",
        record.time[:200],
        {name: values[:200] for name, values in record.inputs.items()},
        {name: values[:200] for name, values in record.outputs.items()},
    )
    whole = output_error(unstable_model(TRUTH), [short])
    parts = multiple_shooting(unstable_model(TRUTH), [short], segment=0.5)
    assert whole.converged
    assert parts.converged
    for name in TRUTH:
        error = whole[name].cramer_rao
        assert parts[name].value == pytest.approx(whole[name].value, abs=0.02 * error)
        assert parts[name].cramer_rao == pytest.approx(error, rel=0.01)


def test_wrong_feedback_and_segments_are_refused(record):
    with pytest.raises(InputError, match="no 'beta'"):
        stabilised(unstable_model(TRUTH), {("q", "beta"): 1.0})
    with pytest.raises(InputError, match="shorter than a sample"):
        multiple_shooting(unstable_model(TRUTH), [record], segment=1e-3)
