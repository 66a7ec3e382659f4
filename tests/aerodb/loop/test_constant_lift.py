"""A constant that the lift lacks changes CX with the angle of attack: one effect, not two."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("jsbsim")

from aerodb.coefficients import total_coefficients
from aerodb.loop import Accept, LoopResult, freeze_library, run_loop
from aerodb.tables.database import AeroDatabase, Term
from aerodb.tables.expression import parse
from aerodb.tracing import TracingSettings, evidence_of
from aerodb.vehicle import Sensor
from tests.support.flights_in_memory import FlightsInMemory
from tests.support.jsbsim_campaign import imported
from tests.support.jsbsim_cases import CASES, IDENTIFIED, campaign

NAME = "f16 with an alpha slope 8 % too small"  # its flights, with alpha well excited
SIZE = 0.05


def whole() -> AeroDatabase:
    return imported(CASES[NAME].aircraft)


def flown(flaperon: float = 0.0) -> FlightsInMemory:
    """The flights; flaperon : one sigma of the zero of the flaperons, as the vehicle file says
    [rad]."""
    vehicle, flights = campaign(NAME)
    if flaperon:
        sensors = {**vehicle.sensors, "delta_flaperon": Sensor(bias_prior=flaperon)}
        vehicle = vehicle.model_copy(update={"sensors": sensors})
    return FlightsInMemory(
        vehicle,
        {each.id: (each, total_coefficients(each, vehicle)) for each in flights[:IDENTIFIED]},
    )


@pytest.fixture(scope="module")
def source() -> FlightsInMemory:
    return flown()


def looped(source: FlightsInMemory, *terms: Term) -> LoopResult:
    ids, database = tuple(source.flown), replace(whole(), terms=(*whole().terms, *terms))
    return run_loop(source, ids, database, freeze_library(source, ids, database), Accept())


def lacks(axis: str, regressor: str) -> Term:
    return Term(f"lacks {axis}", axis, parse(regressor))


def added(loop: LoopResult) -> dict[str, list[float]]:
    """Axis -> estimates of what was added on it."""
    first = len(loop.baseline.increments)
    return {
        each.axis: np.asarray(each.estimates).tolist() for each in loop.candidate.increments[first:]
    }


def test_a_constant_lift_is_one_effect(source: FlightsInMemory) -> None:
    loop = looped(source, lacks("C_lift", repr(SIZE)))
    (found,) = loop.added
    assert (found.hypothesis, found.verdict) == ("zero_offset@CZ", "confirmed")
    assert found.ci95[0] < SIZE < found.ci95[1]  # the database has too much lift, CZ too little
    assert added(loop) == {"C_lift": [pytest.approx(SIZE, rel=0.1)]}
    assert not [each for each in loop.findings if each.verdict == "confirmed" and each is not found]


def test_a_constant_along_z_stays_on_it(source: FlightsInMemory) -> None:
    loop = looped(source, lacks("CZ", repr(SIZE)))
    assert [each.hypothesis for each in loop.added] == ["zero_offset@CZ"]
    assert added(loop) == {"CZ": [pytest.approx(-SIZE, rel=0.1)]}


def test_a_drag_that_grows_with_alpha_beside_it_is_found_as_well(source: FlightsInMemory) -> None:
    loop = looped(source, lacks("C_lift", repr(SIZE)), lacks("C_drag", "-0.3*alpha"))
    found = {each.hypothesis: each for each in loop.added}
    assert found.keys() == {"zero_offset@CZ", "alpha_slope@C_drag"}
    low, high = found["alpha_slope@C_drag"].ci95
    assert low < 0.3 < high


def test_no_drag_stands_for_a_constant_lift_that_may_be_a_surfaces_zero() -> None:
    source = flown(flaperon=0.03)
    alone = looped(source, lacks("C_lift", repr(SIZE)))
    assert not alone.added
    verdicts = {f.hypothesis: f.verdict for f in alone.findings}
    assert verdicts["zero_offset@CZ"] == "ambiguous_sensor"
    assert "confirmed" not in verdicts.values()
    both = looped(source, lacks("C_lift", repr(SIZE)), lacks("C_drag", "-0.3*alpha"))
    truth = {"alpha_slope@C_drag": 0.3, "zero_offset@CZ": SIZE}
    found = {each.hypothesis: each for each in both.added}
    assert "alpha_slope@C_drag" in found
    for id, each in found.items():
        assert each.ci95[0] < truth[id] < each.ci95[1]


def test_a_lift_curve_wrong_by_slope_and_constant_is_named_as_such(
    source: FlightsInMemory,
) -> None:
    """A break of the slope at a node of the table below what was flown is the same function. The
    constant, which was seen before the slope, leaves no level beside it."""
    loop = looped(source, lacks("C_lift", f"{SIZE} + 0.5*alpha"))
    found = {each.hypothesis: each for each in loop.findings if each.verdict == "confirmed"}
    assert found.keys() == {"zero_offset@CZ", "alpha_slope@C_lift"}
    for id, truth in (("zero_offset@CZ", SIZE), ("alpha_slope@C_lift", -0.5)):
        low, high = found[id].ci95
        assert low < truth < high
    left = [source.comparison(id, loop.candidate) for id in source.flown]
    assert abs(np.mean([each.residual("CZ")[each.usable["CZ"]].mean() for each in left])) < 1e-4


def test_the_mean_lift_turns_with_no_angle_of_attack(source: FlightsInMemory) -> None:
    ids = tuple(source.flown)
    right, lacking = whole(), replace(whole(), terms=(*whole().terms, lacks("C_lift", repr(SIZE))))
    settings = TracingSettings()
    for id in ids:
        before, after = (
            evidence_of(source.view(id, each, settings.bandwidth), []) for each in (right, lacking)
        )
        used = before.usable["CX"] & before.usable["CZ"]
        # the database alone changes CX by .05 sin(alpha), of which nothing but a level remains
        changed = (after.residual["CX"] - before.residual["CX"])[used]
        plain = SIZE * np.sin(source.view(id, right)["alpha"])[used]
        assert changed.std() < 1e-3 * plain.std()
