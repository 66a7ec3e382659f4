"""The constant of CZ as the constant lift that it is.

Flights have constants of their own on body axes, so that tracing finds a constant force along z. A
constant lift turns with the angle of attack and changes CX by its sine as well. There it looks like
a drag that grows with the angle of attack, or that flaps or gear bring. So the constant is added
first, on the axis on which it predicts CX better; what CX still lacks beside it is found in the
next round. docs/method/tracing.md, section 13.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from aerodb.coefficients import Comparison
from aerodb.effects import Hypothesis
from aerodb.loop.frozen_library import Library
from aerodb.tables import number
from aerodb.tracing import Finding, doubted

#: A constant force along z.
CONSTANT: Final = "zero_offset@CZ"
#: On which a constant lift changes with the angle of attack.
_CHANGES: Final = "CX"

#: Hypothesis (its id) -> how it is written in a database in place of what the library has.
Written = Mapping[str, Hypothesis]


def as_constant_lift(
    new: Sequence[Finding],
    library: Library,
    compared: Callable[[Finding, Written], Mapping[str, Comparison]],
) -> Written:
    """Return how a constant of CZ among the admitted findings is written: as a lift where it
    predicts CX better so, about each flight's mean; empty where not.

    compared : flight -> comparison with the baseline that one finding was added to, dimensionless.
    Nothing changes where the library has no effect on the lift.
    """
    constant = next((each for each in new if each.hypothesis == CONSTANT), None)
    known = {each.id: each for each in library.hypotheses}
    if constant is None or not any("C_lift" in each.written_on for each in known.values()):
        return {}
    on_lift = {
        CONSTANT: replace(known[CONSTANT], axes=("CX", "CZ"), increment=(("C_lift", number(-1.0)),))
    }
    along_z, along_lift = (_varying(compared(constant, each)) for each in ({}, on_lift))
    return on_lift if along_lift < along_z else {}


def leans_on_it(finding: Finding) -> bool:
    """Return whether what a constant lift changes may have been taken for this effect."""
    return finding.hypothesis != CONSTANT and _CHANGES in finding.axis


def entering_first(finding: Finding, before: Finding | None) -> Finding:
    """Return the constant as it enters on the lift: with that reason, and with the size, interval
    and votes of the round that saw it first, beside the baseline."""
    seen = before or finding
    return replace(
        finding,
        value=seen.value,
        ci95=seen.ci95,
        test=seen.test,
        votes=seen.votes,
        reasons=(*finding.reasons, "CX follows it as a lift, on which it is written"),
    )


def beside_constant(finding: Finding, again: Finding | None) -> Finding:
    """Return a finding that leans on a constant of CZ which was not added, as `again` tracing finds
    it beside that constant as a lift: suspected where it does not, and else with an interval that
    holds both sizes."""
    if again is None:
        why = "a constant of the lift, which the levels of CZ show as well, takes it away"
        return doubted(finding, why, verdict="suspected")
    low, high = finding.ci95
    if low <= again.value <= high:
        return finding
    return doubted(
        finding,
        f"beside a constant of the lift, which the levels of CZ show, it is {again.value:.3g}",
        ci95=(min(low, again.ci95[0]), max(high, again.ci95[1])),
    )


def _varying(compared: Mapping[str, Comparison]) -> float:
    """Sum of squares of the error of CX about each flight's mean."""
    residuals = [
        each.residual(_CHANGES)[each.usable[_CHANGES]]
        for each in compared.values()
        if _CHANGES in each.usable and each.usable[_CHANGES].any()
    ]
    return float(sum(np.square(each - each.mean()).sum() for each in residuals))
