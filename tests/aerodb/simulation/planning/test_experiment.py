"""Designed manoeuvres: within limits, better than what was known, and as good as they promise."""

import numpy as np
import pytest

from aerodb.errors import InputError
from aerodb.estimation import TimeHistory, output_error
from aerodb.identification import flight_dynamics
from aerodb.simulation import (
    Condition,
    FlightStretch,
    design_manoeuvre,
    manoeuvre_text,
    parse_manoeuvre,
    simulate,
    trim,
)
from aerodb.simulation.planning.experiment import NOISE, STEP
from tests.support.flying_increments import ALTITUDE, BODY, SPEED, light_aircraft

DEFLECTIONS = dict.fromkeys(("delta_elevator", "delta_aileron", "delta_rudder"), (-0.35, 0.35))
LIMITS = {"alpha": (-0.05, 0.2), "az": (-20.0, 0.0)}
PITCH = {"estimate_Cm_1_0": "Cm_alpha", "estimate_Cm_1_1": "Cm_q", "estimate_Cm_1_2": "Cm_de"}


@pytest.fixture(scope="module")
def trimmed():
    return trim(light_aircraft(), Condition(SPEED, ALTITUDE), BODY)


@pytest.fixture(scope="module")
def designed(trimmed):
    return design_manoeuvre(trimmed, PITCH, DEFLECTIONS, LIMITS, duration=12.0, moved=("pitch",))


def test_it_stays_within_the_limits_and_moves_what_was_asked_for(designed) -> None:
    for name, (low, high) in LIMITS.items():
        least, greatest = designed.reached[name]
        assert low <= least < greatest <= high
    assert {each.target for each in designed.manoeuvre.inputs} == {"delta_elevator"}
    assert np.all(np.isinf(np.diag(designed.before)))


def test_output_error_reaches_the_promised_standard_errors(trimmed, designed) -> None:
    """One simulated flight of the manoeuvre with the stated noise: the Cramer-Rao bounds of output
    error are the standard errors that the design expects."""
    model = trimmed.problem.model
    time = np.arange(round(12.0 / STEP) + 1) * STEP
    series = {name: np.full(len(time), value) for name, value in trimmed.series.items()}
    for name, added in designed.manoeuvre.series(time).items():
        series[name] = series[name] + added
    run = simulate(model, time, trimmed.start, series)
    rng = np.random.default_rng(3)
    flown = {
        name: run.channels[name][:, 0] + rng.normal(0.0, sigma, len(time))
        for name, sigma in NOISE.items()
    }
    start = {name: value for name, value in trimmed.start.items() if np.ndim(value) == 0}
    stretch = FlightStretch(time, start, series, flown, (), {})
    dynamics, records = flight_dynamics(model, {"flight": stretch}, tuple(PITCH))
    assert isinstance(records[0], TimeHistory)
    fit = output_error(dynamics, records)
    expected = np.sqrt(np.diag(designed.after))
    for k, inside in enumerate(PITCH):
        assert fit[inside].cramer_rao == pytest.approx(expected[k], rel=0.15), PITCH[inside]
        truth = model.parameters[inside]
        assert abs(fit[inside].value - truth) < 4 * fit[inside].standard_error


def test_it_is_better_than_a_manoeuvre_at_hand(trimmed, designed) -> None:
    """What is known already counts: with it, the errors after are smaller than before."""
    known = np.linalg.inv(4.0 * designed.after)
    again = design_manoeuvre(
        trimmed, PITCH, DEFLECTIONS, LIMITS, duration=12.0, moved=("pitch",), known=known
    )
    assert np.all(np.diag(again.after) < np.diag(again.before))
    assert np.all(np.diag(again.after) <= np.diag(designed.after))


def test_its_file_reads_back_as_the_same_manoeuvre(designed) -> None:
    again = parse_manoeuvre(manoeuvre_text(designed.manoeuvre))
    time = np.linspace(0.0, 12.0, 500)
    for name, values in designed.manoeuvre.series(time).items():
        np.testing.assert_allclose(again.series(time)[name], values, atol=1e-5)
    assert again.condition == designed.manoeuvre.condition


def test_limits_that_no_manoeuvre_keeps_are_refused(trimmed) -> None:
    alpha = trimmed.channels["alpha"]
    with pytest.raises(InputError, match="leave the limits"):
        design_manoeuvre(
            trimmed, PITCH, DEFLECTIONS, {"alpha": (alpha + 0.01, alpha + 0.02)}, duration=8.0,
            moved=("pitch",),
        )  # fmt: skip


def test_without_a_surface_there_is_nothing_to_move(trimmed) -> None:
    with pytest.raises(InputError, match="no control"):
        design_manoeuvre(trimmed, PITCH, {}, LIMITS, duration=8.0)
