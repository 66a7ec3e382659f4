"""In moving air a claim must stand without and beside the air's rotation."""

from dataclasses import replace

from aerodb.loop.moving_air import claimed_by_both
from aerodb.tracing.decision.findings import Traced
from aerodb.tracing.decision.verdicts import trace
from aerodb.tracing.evidence.normal_equations import normal_equations_of
from tests.aerodb.tracing.test_rotating_air import DAMPING, LIBRARY, SETTINGS, SLOPE, flights


def _traced(damping: float, slope: float, gusts: float, rotating_air: bool) -> Traced:
    equations = [
        normal_equations_of(each, SETTINGS) for each in flights(damping, slope, gusts, rotating_air)
    ]
    return trace(equations, LIBRARY, SETTINGS)


def test_what_the_air_explains_is_named_as_not_decidable() -> None:
    both = claimed_by_both(_traced(0.0, 0.5, 0.5, False), _traced(0.0, 0.5, 0.5, True))
    assert [f.hypothesis for f in both.findings] == [SLOPE.id]
    assert len(both.notes) == 1
    assert DAMPING.id in both.notes[0]
    assert SLOPE.id not in both.notes[0]
    assert DAMPING.id in {item.hypothesis for item in both.not_found}


def test_what_only_the_search_beside_the_rotation_names_is_not_claimed() -> None:
    still = replace(_traced(0.5, 0.0, 0.0, False), findings=())
    both = claimed_by_both(still, _traced(0.5, 0.0, 0.0, True))
    assert both.findings == ()
    assert DAMPING.id in both.notes[0]


def test_what_both_find_has_no_note() -> None:
    rotating = _traced(0.5, 0.5, 0.3, True)
    both = claimed_by_both(_traced(0.5, 0.5, 0.3, False), rotating)
    assert both.findings == rotating.findings
    assert both.notes == rotating.notes
