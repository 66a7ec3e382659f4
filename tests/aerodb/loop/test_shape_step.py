"""What the loop says of shapes that it made finer, and on which axes later claims are suspected at most."""

from dataclasses import replace

import numpy as np

from aerodb.tables.database import AeroDatabase
from aerodb.tables.expression import parse
from aerodb.tables.increment import Increment
from aerodb.tables.reference import Reference
from aerodb.tasks.shape import remarks_on_shapes, said_of, wrong_shapes
from aerodb.tracing.decision.refinement import Refined, beside_wrong_shapes
from aerodb.tracing.decision.verdicts import trace
from aerodb.tracing.evidence.normal_equations import gram
from aerodb.tracing.settings import Settings
from tests.support.tracing_small import LIBRARY, evidence

EMPTY = AeroDatabase("empty", Reference(1.0, 1.0, 1.0, (0.0, 0.0, 0.0)))
NONE = Refined((), np.zeros(0), np.zeros((0, 0)), {}, {})


def database(*finer: Refined) -> AeroDatabase:
    """One with an increment on Cn for each refit."""
    made = [
        Increment("Cn", (parse("beta"),), np.ones(1), np.eye(1), {}, (), f"traced: a@Cn (confirmed){said_of(each)}")
        for each in finer
    ]
    return replace(EMPTY, increments=tuple(made))


def test_axes_are_those_of_the_refined_terms_alone() -> None:
    lift = replace(NONE, variables={"stall@C_lift:loop": ("alpha", "mach")}, fall={"stall@C_lift:loop": 0.2})
    two = replace(NONE, variables={"a@Cn": ("alpha",), "b@CY:p": ("beta",)}, fall={"a@Cn": 0.1, "b@CY:p": 0.1})
    assert wrong_shapes(database(lift)) == {"CX", "CZ"}
    assert wrong_shapes(database(NONE, two)) == {"Cn", "CY"}
    assert "shape refined of stall@C_lift:loop over alpha, mach" in remarks_on_shapes(database(lift))[0]


def test_only_new_gains_cast_no_suspicion() -> None:
    assert wrong_shapes(database(NONE)) == frozenset()
    assert remarks_on_shapes(database(NONE))
    assert wrong_shapes(EMPTY) == frozenset()
    assert remarks_on_shapes(EMPTY) == ()


def test_a_claim_on_such_an_axis_is_suspected_and_says_why() -> None:
    grams = [gram(evidence(seed, {LIBRARY[0].id: 0.4, LIBRARY[2].id: 0.4}), Settings()) for seed in range(6)]
    findings = trace(grams, LIBRARY, Settings()).findings
    assert {f.verdict for f in findings} == {"confirmed"}
    verdicts = {f.hypothesis: f for f in beside_wrong_shapes(findings, {"CX"})}
    assert verdicts[LIBRARY[0].id].verdict == "suspected"
    assert "earlier term" in verdicts[LIBRARY[0].id].because
    assert verdicts[LIBRARY[2].id].verdict == "confirmed"
    assert beside_wrong_shapes(findings, ()) == findings
