"""Period and damping from a response."""

import numpy as np
import pytest

from aerodb.simulation import at_rest_from, oscillation

TIME = np.arange(0.0, 8.0, 0.04)


def response(omega: float, zeta: float, phase: float = 0.3) -> np.ndarray:
    damped = omega * np.sqrt(1.0 - zeta**2)
    return np.exp(-zeta * omega * TIME) * np.cos(damped * TIME + phase)


@pytest.mark.parametrize(("omega", "zeta"), [(1.4, 0.1), (3.0, 0.05), (2.0, 0.3), (2.0, -0.05)])
def test_planted_oscillations_are_recovered(omega: float, zeta: float) -> None:
    found = oscillation(TIME, response(omega, zeta) + 0.3 - 0.02 * TIME)
    assert found is not None
    assert found.omega == pytest.approx(omega, rel=1e-4)
    assert found.zeta == pytest.approx(zeta, abs=1e-4)
    assert found.half_time == pytest.approx(np.log(2.0) / (zeta * omega), rel=1e-3)


@pytest.mark.campaign
def test_standard_errors_cover_the_scatter() -> None:
    rng = np.random.default_rng(3)
    score = []
    for _ in range(150):
        found = oscillation(TIME, response(2.0, 0.12) + 0.03 * rng.standard_normal(len(TIME)))
        assert found is not None
        score.append(
            [(found.omega - 2.0) / found.sigma_omega, (found.zeta - 0.12) / found.sigma_zeta]
        )
    assert np.all(np.abs(np.std(score, axis=0) - 1.0) < 0.2)
    assert np.all(np.abs(np.mean(score, axis=0)) < 0.3)


def test_noise_lines_and_short_records_are_no_oscillation() -> None:
    rng = np.random.default_rng(1)
    for values in (
        rng.standard_normal(len(TIME)),
        0.2 + 0.1 * TIME,
        np.exp(-TIME),
        np.full(len(TIME), np.nan),
        response(0.3, 0.1),  # a third of a period
    ):
        assert oscillation(TIME, values) is None


def test_the_free_response_begins_when_the_inputs_rest() -> None:
    pulse = np.where((TIME > 1.0) & (TIME < 2.0), 0.1, 0.0)
    assert TIME[at_rest_from(TIME, [pulse])] == pytest.approx(2.0, abs=0.05)
    assert at_rest_from(TIME, [0.0 * TIME]) == len(TIME)
    assert at_rest_from(TIME, []) == len(TIME), "a version may have no inputs"
