"""Filters of the equations of motion: an aircraft flown by the engine through Dryden's turbulence,
whose derivatives output error misses and filter error finds."""

import numpy as np
import pytest

from aerodb.estimation import filter_error, output_error, output_or_filter_error
from aerodb.identification import flight_dynamics
from tests.support.flying_increments import TRUTH, light_aircraft, stretches

AXES = ("CZ", "Cm")
PLANTED = {
    f"estimate_{axis}_{list(TRUTH).index(axis)}_{j}": value
    for axis in AXES
    for j, value in enumerate(TRUTH[axis].values())
}


@pytest.fixture(scope="module")
def problem():
    """Start values 25 % off on the longitudinal axes."""
    rng = np.random.default_rng(2)
    flown = stretches(rng, count=1, seconds=16.0, wind_at_6m=6.0)
    wrong = {
        axis: {name: (0.75 if axis in AXES else 1.0) * value for name, value in own.items()}
        for axis, own in TRUTH.items()
    }
    names = ("V", "alpha", "q", "theta", "ax", "az")
    return flight_dynamics(
        light_aircraft(wrong), flown, tuple(PLANTED), outputs=names, initial=names[:4]
    )


def _misses(fit) -> list[float]:
    return [(fit[name].value - value) / fit[name].standard_error for name, value in PLANTED.items()]


@pytest.mark.campaign
def test_filter_error_finds_what_turbulence_hides_from_output_error(problem) -> None:
    model, records = problem
    fit = filter_error(model, records, process_noise=("V", "alpha", "q"))
    assert fit.converged
    assert max(map(abs, _misses(fit))) < 2.5
    assert all(fit[name].standard_error < 0.1 * abs(value) for name, value in PLANTED.items())
    assert fit["process_noise_alpha"].value > 0.003
    plain = output_error(model, records)
    off = [abs(plain[name].value / value - 1.0) for name, value in PLANTED.items()]
    own = [abs(fit[name].value / value - 1.0) for name, value in PLANTED.items()]
    assert max(off) > 5.0 * max(own)
    assert output_or_filter_error(plain, fit).method == "filter-error"
