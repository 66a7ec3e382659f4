"""Check findings beside the rotation of the air, which no gyro shows.

docs/method/tracing.md, section 4.
"""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from aerodb.effects import Hypothesis
from aerodb.tracing.decision.findings import Finding
from aerodb.tracing.decision.selection import CrossFlightTests
from aerodb.tracing.estimates import campaign
from aerodb.tracing.evidence import FlightNormalEquations
from aerodb.tracing.settings import TracingSettings

_RATES: Final = frozenset(
    {name + hat for name in ("p", "q", "r", "alphadot", "betadot") for hat in ("", "_hat")}
)


def driven_by_rates(hypothesis: Hypothesis) -> bool:
    """Return whether an aerodynamic effect depends on a rate (p, q or r [rad/s]), which rotating
    air changes too."""
    return hypothesis.kind == "aerodynamic" and bool(_RATES & set(hypothesis.drivers))


def lost_in_rotating_air(
    findings: Sequence[Finding],
    normal_equations: Sequence[FlightNormalEquations],
    hypotheses: Sequence[Hypothesis],
    settings: TracingSettings,
    earlier: Mapping[str, float] | None = None,
) -> frozenset[str]:
    """Return the findings that the rotation of the air takes away, sensors included.

    Lost is what is no longer significant over the library, or changes its sign, in the model of all
    findings where each flight has its own share of the rotation. normal_equations : of the flights
    that identified, with the columns of `aerodb.effects.air_rotation_columns` eliminated; findings,
    earlier : of the model, as from `trace` without these columns. Raises InputError where columns
    were made with another library.
    """
    tests = CrossFlightTests(
        campaign(normal_equations, hypotheses, earlier),
        tuple(range(len(normal_equations))),
        settings,
    )
    number = {h.id: index for index, h in enumerate(hypotheses)}
    found = [number[f.hypothesis] for f in findings if f.hypothesis in number]
    sensors = set(tests.campaign.sensors)
    terms = tuple(i for i in found if i not in sensors)
    test = tests.tested(terms, tuple(i for i in found if i in sensors))
    return frozenset(
        finding.hypothesis
        for finding in findings
        if finding.value is not None
        and finding.hypothesis in number
        and not (
            test.significant[index := number[finding.hypothesis]]
            and np.sign(test.mean[index]) == np.sign(finding.value)
        )
    )
