"""What reconstruction leaves open, and what was measured outside flight, bounds a sensor's error."""

from typing import Any

import numpy as np
import pytest

from aerodb.effects import hypotheses_for, within_reconstruction_accuracy
from aerodb.effects.hypothesis import Hypothesis
from aerodb.exchange.native import read_native
from aerodb.vehicle import parse_vehicle
from tests.support.small_glider import DATABASE, VEHICLE

CHANNELS = ("V", "qbar", "alpha", "beta", "p", "q", "r", "ax", "ay", "az", "delta_elevator")


def library(text: str = "") -> dict[str, Hypothesis]:
    vehicle = parse_vehicle(VEHICLE + text)
    found = hypotheses_for(read_native(DATABASE), vehicle, CHANNELS)
    return {each.id: each for each in found}


def narrowed(id: str, *known: dict[str, tuple[float, float]], **options: Any) -> Hypothesis:
    return {
        each.id: each
        for each in within_reconstruction_accuracy(library().values(), known, **options)
    }[id]


def test_nothing_known_changes_nothing() -> None:
    before = tuple(library().values())
    assert within_reconstruction_accuracy(before, []) == before
    other = narrowed("alpha_scale@all", {"alpha_scale": (0.0, 0.01)}, {"beta_scale": (0.0, 0.01)})
    assert other == library()["alpha_scale@all"]


def test_a_bias_is_bounded_by_the_least_certain_flight() -> None:
    heave = narrowed(
        "accelerometer_bias@all:z", {"az_bias": (0.0, 0.004)}, {"az_bias": (0.003, 0.004)}
    )
    assert heave.plausible == pytest.approx((-0.015, 0.015))
    assert heave.prior_sigma == pytest.approx(0.005)
    assert heave.known_by == "the flight-path reconstruction"


def test_a_scale_is_known_better_by_many_flights_that_agree() -> None:
    """Nine flights: a third of the standard error, and not less than the flow allows."""
    flights = [{"alpha_scale": (0.0, 0.03)}] * 9
    assert narrowed("alpha_scale@all", *flights).plausible == pytest.approx((-0.03, 0.03))
    assert narrowed("alpha_scale@all", *flights, independent=False).plausible == pytest.approx(
        (-0.09, 0.09)
    )
    certain = [{"alpha_scale": (0.0, 1e-6)}] * 9
    assert narrowed("alpha_scale@all", *certain).plausible == pytest.approx((-0.015, 0.015))


def test_flights_that_agree_on_an_error_or_contradict_each_other_leave_it_possible() -> None:
    rng = np.random.default_rng(1)
    agree = [{"alpha_scale": (0.04 + 0.01 * e, 0.01)} for e in rng.standard_normal(6)]
    assert narrowed("alpha_scale@all", *agree).plausible[1] > 0.1
    differ = [{"alpha_scale": (value, 0.005)} for value in (0.06, -0.06, 0.05, -0.05)]
    assert narrowed("alpha_scale@all", *differ).plausible[1] > 0.07


def test_a_prior_is_never_widened() -> None:
    wide = narrowed("alpha_scale@all", {"alpha_scale": (0.0, 5.0)})
    assert wide == library()["alpha_scale@all"]


MEASURED = """
[measured]
mass = {sigma = "0.2 %", by = "scales, 2026-03-01"}
cg_x = {sigma = "3 mm"}
Iyy = {sigma = "1 %", by = "pendulum"}
delta_elevator = {sigma = "0.5 %", by = "rig"}
"""


def test_what_was_measured_outside_flight_bounds_it() -> None:
    found, before = library(MEASURED), library()
    expected = {
        "mass_error@all": (0.002, "scales, 2026-03-01"),
        "cg_offset@all:x": (0.003, "the vehicle file"),
        "inertia_error@all:Iyy": (0.01, "pendulum"),
        "surface_scale@all:elevator": (0.005, "rig"),
    }
    for id, (sigma, by) in expected.items():
        assert found[id].prior_sigma == pytest.approx(sigma)
        assert found[id].plausible == pytest.approx((-3.0 * sigma, 3.0 * sigma))
        assert found[id].known_by == by
    others = set(found) - set(expected)
    assert {id: found[id] for id in others} == {id: before[id] for id in others}


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("mas = {sigma = 0.01}", "did you mean 'mass'"),
        ("alpha = {sigma = 0.01}", "no mass property, thrust or deflection"),
        ("delta_elevatr = 3", "valid dictionary"),
        ('mass = {sigma = "3 mm"}', "cannot be converted"),
        ("Iyy = {sigma = 0}", "greater than 0"),
        ('Iyy = {by = "pendulum"}', "sigma is missing"),
    ],
)
def test_a_wrong_statement_is_refused_with_what_to_do(line: str, says: str) -> None:
    with pytest.raises(Exception, match=says):
        parse_vehicle(VEHICLE + f"[measured]\n{line}\n")
