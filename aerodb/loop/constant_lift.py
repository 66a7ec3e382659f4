"""The constant of CZ as the constant lift that it is.

Flights have constants of their own on body axes, so that tracing finds a constant force along z. A
constant lift turns with the angle of attack and changes CX by its sine as well; and where a
database has its drag as a function of the lift, the drag follows. So the constant is added first,
as a lift unless CX says flight after flight that it is none; what CX still lacks beside it is found
in the next round. docs/method/tracing.md, section 13.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from aerodb.coefficients import Comparison
from aerodb.effects import Hypothesis
from aerodb.loop.flight_source import FlightSource
from aerodb.loop.frozen_library import Library
from aerodb.loop.sensor_share import beside_sensors, compared_with
from aerodb.loop.turned_slopes import mean_constant
from aerodb.support import Array
from aerodb.tables import AeroDatabase, number
from aerodb.tracing import Finding, paired_p

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
    """Return how a constant of CZ among the admitted findings is written: as a lift; empty, along
    z, where that predicts CX better in flight after flight, about their means (paired t-test).

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
    return {} if paired_p(-along_z, -along_lift) < library.settings.level else on_lift


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


def level_again(
    source: FlightSource,
    flights: Sequence[str],
    database: AeroDatabase,
    library: Library,
    sensors: Mapping[str, float],
    constant: Finding,
    first: int,
) -> tuple[AeroDatabase, Finding]:
    """Return the database with the constant that leaves these flights (ids) no level of CZ, beside
    all that has been added since, and the finding with that value.

    It was seen beside a baseline that lacked a slope as well, whose mean over the flights was part
    of it. sensors : found to be wrong (id -> error, SI), whose part is no level. first : number of
    the first increment of the loop. A constant whose interval then holds zero leaves the database,
    and is suspected. Raises InputError where a flight lacks what is needed.
    """
    beside = beside_sensors(source, flights, database, library, sensors)
    left = mean_constant(compared_with(beside, flights, database), "CZ") or 0.0
    low, high = (end + left for end in constant.ci95)
    gone = low <= 0.0 <= high
    increments = list(database.increments)
    for place, each in enumerate(increments[first:], first):
        levels = [k for k, one in enumerate(each.regressors) if not one.names and each.estimates[k]]
        if each.axis in ("C_lift", "CZ") and levels:
            estimates = each.estimates.copy()
            estimates[levels[0]] = 0.0 if gone else estimates[levels[0]] + left
            increments[place] = replace(each, estimates=estimates)
            if not estimates.any():
                del increments[place]
            break
    reason = "what was found later leaves no constant"
    changed = replace(constant, value=constant.value + left, ci95=(low, high))
    if gone:
        changed = replace(changed, verdict="suspected", reasons=(*constant.reasons, reason))
    return replace(database, increments=tuple(increments)), changed


def _varying(compared: Mapping[str, Comparison]) -> Array:
    """Sum of squares of the error of CX about the mean of each flight that has it, (g,)."""
    residuals = [
        each.residual(_CHANGES)[each.usable[_CHANGES]]
        for each in compared.values()
        if _CHANGES in each.usable and each.usable[_CHANGES].any()
    ]
    return np.array([np.square(each - each.mean()).sum() for each in residuals])
