"""Propose what to fly next: per open question the smallest excitation that decides it, one
sentence.

docs/method/tracing.md, section 15.
"""

from collections.abc import Sequence

import numpy as np
from scipy.special import ndtri

from aerodb.effects import Hypothesis
from aerodb.support import counted
from aerodb.tracing.decision.explanation_sets import Explanation, wanted
from aerodb.tracing.decision.findings import Wanted, with_unit
from aerodb.tracing.decision.selection import FEWEST_SUSPECTED, CrossFlightTests, Decision
from aerodb.tracing.estimates import POWER
from aerodb.tracing.evidence import FlightNormalEquations

#: Sentences about hypotheses that no flight could show, at most.
MOST = 5


def next_flights(
    tests: CrossFlightTests,
    decision: Decision,
    explanations: Sequence[Explanation],
    normal_equations: Sequence[FlightNormalEquations],
) -> tuple[str, ...]:
    """Return sentences on alias groups, on sensors that may explain a finding, on suspected terms,
    and on what was never excited. Numbers in them carry SI units; docs/method/tracing.md, section
    15.
    """
    sentences: list[str] = []
    for explanation in explanations:
        rivals = explanation.rivals
        if explanation.index in decision.suspected:
            sentences.append(_more_flights(tests, decision, explanation.index))
        if rivals:
            sentences.append(
                _separation(tests, decision, explanation.index, rivals[0], normal_equations)
            )
        if explanation.sensors or (rivals and explanation.index in decision.freed):
            needed = wanted(tests, decision, explanation)
            sentences += [_calibration(tests, explanation, each) for each in needed[:1]]
    return tuple(dict.fromkeys([*sentences, *_unseen(tests, decision)]))


def excitation_needed(value: float, known: float, per_flight: float, level: float) -> float:
    """Factor on the excitation of one further flight that decides about `value`.

    Information grows with the square of the excitation: ``(f^2 I_1 + I) value^2 >= (z + z_p)^2``,
    one-sided `level`, power .8.

    Parameters
    ----------
    value : size to be decided about, in the parameter's unit
    known : I, information that all flights so far hold given the rival, one over variance
    per_flight : I_1, information of one flight on the column by itself
    level : of the one-sided test

    Returns
    -------
    float : f; 0 where enough is known already

    >>> round(excitation_needed(2.0, 0.0, 1.0, 0.05), 2)  # (1.645 + 0.842) / 2
    1.24
    """
    wanted = ((ndtri(POWER) - ndtri(level)) / value) ** 2
    return float(np.sqrt(max(0.0, wanted - known) / per_flight))


def _separation(
    tests: CrossFlightTests,
    decision: Decision,
    index: int,
    rival: int,
    normal_equations: Sequence[FlightNormalEquations],
) -> str:
    """Return how much the one has to move without the other."""
    names, sensors = tests.campaign.hypotheses, set(tests.campaign.sensors)
    terms, freed = (
        tuple(i for i in group if i != index) for group in (decision.terms, decision.freed)
    )
    mover, other = (rival, index) if index in sensors else (index, rival)
    if other in sensors:
        alone, beside = (
            tests.tested(terms, freed, FEWEST_SUSPECTED, fixed=(other,)),
            tests.flight_estimates(terms, (*freed, other)),
        )
    else:
        alone, beside = (
            tests.tested(terms, freed, FEWEST_SUSPECTED),
            tests.flight_estimates((*terms, other), freed),
        )
    why = f"to tell {names[mover].id} from {names[other].id}"
    free = [name for name in names[mover].drivers if name not in names[other].drivers]
    tied = ", ".join(names[other].drivers)
    value, per_flight = float(alone.mean[mover]), float(beside.information_before[:, mover].max())
    if not free or value == 0.0 or per_flight == 0.0:
        return f"fly over a wider range of {tied}, with fast and slow inputs, {why}"
    factor = excitation_needed(
        value, float(beside.information[:, mover].sum()), per_flight, tests.settings.level
    )
    held = f"while {tied} stays as it is" if tied else "with nothing else moving"
    return (
        f"move {', '.join(free)} on its own,"
        f" {_amount(names[mover], normal_equations, factor)} in one flight, {held}, {why}"
    )


def _amount(
    hypothesis: Hypothesis, normal_equations: Sequence[FlightNormalEquations], factor: float
) -> str:
    """Rms of the motion: in degrees for a deflection or an angle, else relative to that flown."""
    flown = [
        g.excitation[g.hypotheses.index(hypothesis.id)]
        for g in normal_equations
        if hypothesis.id in g.hypotheses
    ]
    level = float(max(flown, default=0.0))
    needed = max(factor, 0.05)
    angle = len(hypothesis.drivers) == 1 and (
        hypothesis.drivers[0].startswith("delta_") or hypothesis.drivers[0] in ("alpha", "beta")
    )
    if (
        angle
        and "landing_gear" not in hypothesis.drivers[0]
        and hypothesis.unit in ("1/rad", "rad^-1")
    ):
        return f"by about {np.rad2deg(needed * level):.2g} deg rms"
    return f"about {needed:.2g} times as much as so far"


def _calibration(tests: CrossFlightTests, explanation: Explanation, needed: Wanted) -> str:
    """Return how well the first sensor of a set must be known by other means."""
    names = tests.campaign.hypotheses
    rival = next(iter((*explanation.sensors, *explanation.rivals)))
    where = (
        f"state it as [measured.{needed.parameter}] in the vehicle file, or with --measured"
        f" {needed.parameter}=SIGMA"
    )
    known = "" if needed.sigma is None else f" to {with_unit(needed.sigma, needed.unit, 2)}"
    return (
        f"calibrate {needed.parameter}{known} by other means, to tell"
        f" {names[explanation.index].id} from {names[rival].id}; {where}"
    )


def _more_flights(tests: CrossFlightTests, decision: Decision, index: int) -> str:
    test = tests.tested(decision.terms, decision.freed, FEWEST_SUSPECTED)
    lacking = tests.settings.fewest - int(test.count[index])
    name = tests.campaign.hypotheses[index]
    flights = counted(lacking, "more flight")
    return (
        f"fly {flights} with {', '.join(name.drivers) or 'it'} excited as so far, at least, to test"
        f" {name.id}"
    )


def _unseen(tests: CrossFlightTests, decision: Decision) -> list[str]:
    """One sentence for each channel whose motion no flight shows, or shows only together with
    others.
    """
    test = tests.tested(decision.terms, decision.freed, FEWEST_SUSPECTED)
    idle: dict[tuple[str, ...], list[str]] = {}
    tied: dict[tuple[str, ...], list[str]] = {}
    for index, hypothesis in enumerate(tests.campaign.hypotheses):
        if hypothesis.kind == "sensor" or not hypothesis.drivers or index in decision.terms:
            continue
        if not test.excited[index]:
            idle.setdefault(hypothesis.drivers, []).append(hypothesis.id)
        elif test.inflation[index] > tests.settings.inflation_limit:
            tied.setdefault(hypothesis.drivers, []).append(hypothesis.id)
    sentences = [
        f"excite {', '.join(drivers)}: nothing is known of {', '.join(ids)}"
        for drivers, ids in sorted(idle.items())
    ]
    for drivers, ids in sorted(tied.items()):
        sentences.append(
            f"move {', '.join(drivers)} on its own: {', '.join(ids)} cannot be told from the rest"
            " of the motion"
        )
    return sentences[:MOST]
