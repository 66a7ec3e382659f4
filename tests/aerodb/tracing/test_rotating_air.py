"""A finding that rates drive is lost where the rotation of the air explains it as well."""

from dataclasses import replace

import numpy as np

from aerodb.effects.hypothesis import Hypothesis
from aerodb.tables.expression import parse
from aerodb.tracing.decision.rotating_air import driven_by_rates, lost_in_rotating_air
from aerodb.tracing.decision.verdicts import trace
from aerodb.tracing.evidence import Evidence
from aerodb.tracing.evidence.evidence import NUISANCE
from aerodb.tracing.evidence.normal_equations import normal_equations_of
from tests.support.tracing_flights import coloured
from tests.support.tracing_small import SETTINGS, STEP, term

DAMPING = replace(term("pitch_damping", "Cm"), increment=(("Cm", parse("q_hat")),))
SLOPE = replace(term("alpha_slope", "Cm"), increment=(("Cm", parse("alpha")),))
LIBRARY: tuple[Hypothesis, ...] = (DAMPING, SLOPE)


def flights(
    damping: float, slope: float, gusts: float, rotating_air: bool, follower: str = "q"
) -> list[Evidence]:
    """Pitch rate, angle of attack and a gust's rotation, which the pitch rate follows, or alpha;
    the air of all flights rotates alike with this strength, and may have a column."""
    found = []
    for seed in range(6):
        rng = np.random.default_rng([seed, 7])
        q, alpha, gust = (coloured(rng, 1500, 0.5) for _ in range(3))
        gust = 0.8 * {"q": q, "alpha": alpha}[follower] + 0.6 * gust
        residual = damping * q + slope * alpha + gusts * gust + 0.2 * coloured(rng, 1500, 0.5)
        columns = {DAMPING.id: q, SLOPE.id: alpha}
        if rotating_air:
            columns[f"{NUISANCE}q"] = gust
        found.append(
            Evidence(
                f"f{seed}",
                STEP,
                {"Cm": residual},
                {"Cm": np.ones(1500, dtype=bool)},
                {name: {"Cm": column} for name, column in columns.items()},
            )
        )
    return found


def lost(damping: float, slope: float, gusts: float) -> tuple[set[str], frozenset[str]]:
    """What tracing confirms without the rotation, and what of it is lost beside it."""
    plain, beside = (
        [normal_equations_of(each, SETTINGS) for each in flights(damping, slope, gusts, rotating)]
        for rotating in (False, True)
    )
    findings = trace(plain, LIBRARY, SETTINGS).findings
    confirmed = {f.hypothesis for f in findings if f.verdict == "confirmed"}
    return confirmed, lost_in_rotating_air(findings, beside, LIBRARY, SETTINGS)


def test_damping_that_the_air_explains_is_lost() -> None:
    assert lost(0.0, 0.0, 0.5) == ({DAMPING.id}, frozenset({DAMPING.id}))


def test_a_slope_that_stands_in_for_the_air_is_lost_too() -> None:
    """Alpha follows the gust, and no rate drives the slope."""
    plain, beside = (
        [
            normal_equations_of(each, SETTINGS)
            for each in flights(0.0, 0.0, 0.5, rotating, follower="alpha")
        ]
        for rotating in (False, True)
    )
    findings = trace(plain, LIBRARY, SETTINGS).findings
    assert [f.hypothesis for f in findings] == [SLOPE.id]
    assert lost_in_rotating_air(findings, beside, LIBRARY, SETTINGS) == {SLOPE.id}


def test_damping_that_is_there_and_what_no_rate_drives_stand() -> None:
    assert lost(0.5, 0.5, 0.3) == ({DAMPING.id, SLOPE.id}, frozenset())
    assert driven_by_rates(DAMPING)
    assert not driven_by_rates(SLOPE)
