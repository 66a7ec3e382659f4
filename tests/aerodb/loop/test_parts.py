"""Parameters of an aircraft of 40 strips are corrected by its flights; nothing where all are right."""

from collections.abc import Mapping

import pytest

from aerodb.increments import HoldOut
from aerodb.loop import Accept, LoopResult, freeze_library, run_loop, validate_loop
from aerodb.tables import AeroDatabase, Parameter
from tests.support.flights_in_memory import FlightsInMemory
from tests.support.parts import aircraft, flights


def closed(source: FlightsInMemory, wrong: Mapping[str, float]) -> LoopResult:
    ids, database = tuple(source.flown), aircraft(dict(wrong))
    return run_loop(source, ids, database, freeze_library(source, ids, database), Accept())


def test_a_wrong_fin_gets_its_slope_and_the_parts_stay_as_written() -> None:
    loop = closed(flights(range(10, 14), aircraft()), {"fin_slope": 2.2})
    (finding,) = loop.added
    assert (finding.subject, finding.verdict) == ("fin_slope", "confirmed")
    assert finding.ci95[0] < 0.8 < finding.ci95[1]
    assert loop.candidate.parts == aircraft().parts
    assert loop.candidate.parameters["fin_slope"] == pytest.approx(3.0, rel=0.05)


def test_three_flights_predict_each_other_though_two_confirm_nothing() -> None:
    """What three confirm enters the prediction of one by two, which suspect at most. Its value is
    that of the two."""
    source, wrong = flights(range(3), aircraft()), {"fin_slope": 2.0}
    ids, database = tuple(source.flown), aircraft(wrong)
    split, loop = HoldOut(ids, (), "cross-validated"), closed(source, wrong)
    assert [finding.subject for finding in loop.added] == ["fin_slope"]
    library = freeze_library(source, ids, database)
    used: dict[str, AeroDatabase] = {}
    axes = {a.axis: a for a in validate_loop(source, split, library, loop, Accept(), used)}
    for left_out in ids:
        assert used[left_out].parameters["fin_slope"] == pytest.approx(3.0, rel=0.1)
        assert (
            left_out not in (used[left_out].variables["fin_slope"].parameter or Parameter()).flights
        )
    for axis in ("CY", "Cn"):
        before, after = axes[axis].held_out_rms_before, axes[axis].held_out_rms_after
        assert after is not None
        assert before is not None
        assert after < 0.8 * before, axis


@pytest.mark.campaign
def test_a_right_build_up_is_left_alone() -> None:
    """In ten campaigns of three flights nothing is confirmed."""
    confirmed = []
    for seed in range(100, 130, 3):
        findings = closed(flights(range(seed, seed + 3), aircraft()), {}).findings
        confirmed += [each.hypothesis for each in findings if each.verdict == "confirmed"]
    assert confirmed == []


@pytest.mark.campaign
@pytest.mark.parametrize(
    ("name", "least"),
    [
        ("wing_slope", 2),
        ("tail_slope", 2),
        ("fin_slope", 2),
        ("elevator_part", 2),
        ("rudder_part", 2),
        ("wing_zero", 0),  # a constant, which a wrong zero of the normal force is as well
    ],
)
def test_intervals_hold_what_a_parameter_lacks(name: str, least: int) -> None:
    """In at least this many of three campaigns it is named; each interval holds what it lacks."""
    true = aircraft().parameters[name]
    hits = named = 0
    for seed in range(200, 209, 3):
        source = flights(range(seed, seed + 3), aircraft())
        findings = closed(source, {name: 0.85 * true}).findings
        own = [each for each in findings if each.subject == name]
        named += bool(own)
        hits += any(each.ci95[0] < 0.15 * true < each.ci95[1] for each in own)
    assert named >= least
    assert hits == named
