"""What else would explain a finding: rivals that fit as well, and sensors that a finding does not
survive.

TRACING steps 7 and 8. A rival is rejected only for a reason, and the reason is kept.
"""

from dataclasses import dataclass

import numpy as np

from aerodb.support import Array
from aerodb.tracing.decision.selection import SUSPICION, Court, Decision, flight_gains, implausible
from aerodb.tracing.estimates import paired_p

#: A rival's gain is lost when less than this part of it is left once the term is in.
LOST = 0.25


@dataclass(frozen=True)
class Explanation:
    """The explanation set of one finding.

    place : of the finding. rivals : aerodynamic ones that fit as well. sensors : sensors that the
    finding does not survive, or that fit as well. fallen : place -> why that rival is none, plain
    words.
    """

    place: int
    rivals: tuple[int, ...]
    sensors: tuple[int, ...]
    fallen: dict[int, str]


def explain(court: Court, decision: Decision, place: int) -> Explanation:
    """Rivals and sensors of an accepted (or suspected) term, or of a freed sensor."""
    sensors = set(court.campaign.sensors)
    fewest = (
        court.settings.fewest
        if place in decision.accepted or place in decision.freed
        else SUSPICION
    )
    terms = tuple(i for i in decision.terms if i != place)
    freed = tuple(i for i in decision.freed if i != place)
    # Trims are in every model: nothing else can take an axis' constant away, and it can take
    # nothing from others.
    fitting, fallen = (
        _fitting(court, terms, freed, place, fewest)
        if place not in court.campaign.offsets
        else ([], {})
    )
    broken = _breaking(court, terms, freed, place, fewest) if place not in sensors else ()
    rivals = tuple(i for i in fitting if i not in sensors)
    behind = tuple(dict.fromkeys([*broken, *(i for i in fitting if i in sensors)]))
    for i in (*rivals, *behind):
        fallen.pop(i, None)
    return Explanation(place, rivals, behind, fallen)


def _fitting(
    court: Court, terms: tuple[int, ...], freed: tuple[int, ...], place: int, fewest: int
) -> tuple[list[int], dict[int, str]]:
    """Hypotheses that would be found in place of it, whose gain it takes away and that are not
    worse over flights."""
    sensors = set(court.campaign.sensors)
    # The rivals of a sensor are heard as if that sensor were right: beside it they would only get
    # what it leaves.
    fixed = (place,) if place in sensors else ()
    before = court.tested(terms, freed, fewest, fixed)
    votes = court.votes(terms, freed, fixed)
    given = (terms, (*freed, place)) if place in sensors else ((*terms, place), freed)
    after = court.tested(*given, fewest)
    barred = {place, *terms, *freed, *court.campaign.offsets}
    own = _gain_by_flight(court, terms, freed, place, fewest)
    # What the errors of a reconstructed angle may hide is no finding, but still explains what a
    # stand-in would be blamed for.
    shown = (
        before.unmasked < court.settings.level
        if court.campaign.angle_reconstructed
        else before.possible
    )
    fitting: list[int] = []
    fallen: dict[int, str] = {}
    for rival in np.flatnonzero(shown).tolist():
        if rival in barred:
            continue
        apart = after.possible[rival] or not before.possible[rival]
        if apart and after.gain[rival] >= LOST * before.gain[rival]:
            continue  # a different defect, not a rival
        outside = implausible(court, before, rival)
        if outside:
            fallen[rival] = outside
            continue
        gains = np.zeros(len(court.flights))
        gains[before.voters[:, rival]] = flight_gains(votes, before, rival)
        p = paired_p(own, gains)
        if p < court.settings.level:
            fallen[rival] = f"explains less in flight after flight (p = {p:.1g})"
        else:
            fitting.append(rival)
    fitting.sort(key=lambda i: -float(before.gain[i]))
    return fitting, fallen


def _gain_by_flight(
    court: Court, terms: tuple[int, ...], freed: tuple[int, ...], place: int, fewest: int
) -> Array:
    """What the finding is worth in each flight, 0 where it has no vote."""
    test = court.tested(terms, freed, fewest)
    gains = np.zeros(len(court.flights))
    gains[test.voters[:, place]] = flight_gains(court.votes(terms, freed), test, place)
    return gains


def _breaking(
    court: Court, terms: tuple[int, ...], freed: tuple[int, ...], place: int, fewest: int
) -> tuple[int, ...]:
    """Sensors that, left without a prior, take the finding's separability, sign or significance
    away.

    And sensors that are freed already, beside which the finding is only a left-over: a tangent is
    exact for small errors only, and what it leaves of a larger one looks like a small effect of the
    same kind.
    """
    every = (
        *terms,
        place,
    )  # asked for together: a sensor that is freed is the same model for all findings
    absent = court.tested(terms, freed, fewest)
    full = court.tested(every, freed, fewest)
    broken = []
    for sensor in court.campaign.sensors:
        if sensor in freed:
            right = court.gain(
                place, terms, tuple(i for i in freed if i != sensor), fixed=(sensor,)
            )
            if full.gain[place] < LOST * right:
                broken.append(sensor)
            continue
        test = court.tested(every, (*freed, sensor), fewest)
        same = np.sign(test.mean[place]) == np.sign(full.mean[place])
        holds = test.testable[place] and same and test.p_at(every)[-1] < court.settings.level
        if not holds and not implausible(court, absent, sensor):
            broken.append(sensor)
    return tuple(broken)
