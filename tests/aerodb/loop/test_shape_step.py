"""What the loop says of shapes that it made finer, and on which axes later claims are suspected at
most."""

from dataclasses import replace

import numpy as np

from aerodb.effects.template import on_axis
from aerodb.loop.refit import axes_of_misfit_shapes, refit_of
from aerodb.loop.remarks import on_shapes
from aerodb.tables.database import AeroDatabase
from aerodb.tables.expression import parse
from aerodb.tables.increment import Increment, RefinedShape, Refit
from aerodb.tables.reference import ReferenceGeometry
from aerodb.tracing.decision.refinement import Refined, downgraded_on_axes
from aerodb.tracing.decision.verdicts import trace
from aerodb.tracing.evidence.normal_equations import normal_equations_of
from aerodb.tracing.settings import TracingSettings
from tests.support.tracing_small import LIBRARY, evidence

EMPTY = AeroDatabase("empty", ReferenceGeometry(1.0, 1.0, 1.0, (0.0, 0.0, 0.0)))
LIFT = RefinedShape("stall@C_lift:loop", "C_lift", ("alpha", "mach"), 0.2)


def database(*refits: Refit) -> AeroDatabase:
    """One with an increment on Cn for each refit."""
    made = [
        Increment(
            "Cn",
            (parse("beta"),),
            np.ones(1),
            np.eye(1),
            note="traced: a@Cn (confirmed)",
            refit=refit,
        )
        for refit in refits
    ]
    return replace(EMPTY, increments=tuple(made))


def test_axes_are_those_of_the_refined_terms_alone() -> None:
    two = Refit(
        (RefinedShape("a@Cn", "Cn", ("alpha",), 0.1), RefinedShape("b@CY:p", "CY", ("beta",), 0.1))
    )
    assert axes_of_misfit_shapes(database(Refit((LIFT,)))) == {"CX", "CZ"}
    assert axes_of_misfit_shapes(database(Refit(), two)) == {"Cn", "CY"}
    said = on_shapes(database(Refit((LIFT,))))[0]
    assert (
        "[traced: a@Cn (confirmed); gain fitted once more beside the rest, shape refined of"
        " stall@C_lift:loop over alpha, mach" in said
    )
    assert "(left-out flights: 20.0% less error)" in said


def test_a_refit_names_the_axis_on_which_a_term_is_written() -> None:
    lift = on_axis(
        "lift",
        "C_lift",
        parse("alpha"),
        unit="1",
        plausible=(-1, 1),
        because="",
        parameter="k",
        subject="p",
    )
    finer = Refined((lift,), np.zeros(1), np.eye(1), {lift.id: ("alpha",)}, {lift.id: 0.25})
    assert refit_of(finer) == Refit((RefinedShape("lift@C_lift:p", "C_lift", ("alpha",), 0.25),))


def test_only_new_gains_cast_no_suspicion() -> None:
    assert axes_of_misfit_shapes(database(Refit())) == frozenset()
    assert on_shapes(database(Refit()))
    assert axes_of_misfit_shapes(EMPTY) == frozenset()
    assert on_shapes(EMPTY) == ()


def test_a_claim_on_such_an_axis_is_suspected_and_says_why() -> None:
    normal_equations = [
        normal_equations_of(
            evidence(seed, {LIBRARY[0].id: 0.4, LIBRARY[2].id: 0.4}), TracingSettings()
        )
        for seed in range(6)
    ]
    findings = trace(normal_equations, LIBRARY, TracingSettings()).findings
    assert {f.verdict for f in findings} == {"confirmed"}
    verdicts = {f.hypothesis: f for f in downgraded_on_axes(findings, {"CX"})}
    assert verdicts[LIBRARY[0].id].verdict == "suspected"
    assert "earlier term" in verdicts[LIBRARY[0].id].because
    assert verdicts[LIBRARY[2].id].verdict == "confirmed"
    assert downgraded_on_axes(findings, ()) == findings
