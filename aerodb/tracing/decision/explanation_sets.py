"""Explanation sets: rivals that explain a finding as well, and sensors that take it away.

docs/method/tracing.md, section 10. A rival is rejected only for a reason, and the reason is kept.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from aerodb.effects import BELIEVED
from aerodb.remarks import Remark, said
from aerodb.support import HALF, QUARTER, Array
from aerodb.tracing.decision.findings import Finding, MeanTest, Verdict, Wanted
from aerodb.tracing.decision.selection import (
    FEWEST_SUSPECTED,
    LOST,
    CrossFlightTests,
    Decision,
    flight_gains,
    half_interval,
    implausible,
    left_out_gains,
    reported_votes,
    twins_of,
)
from aerodb.tracing.estimates import Tested, paired_p, scatter_p

#: Two findings cancel where together they leave less than this part of the sum of squares of each.
_CANCELS = QUARTER
#: `LOST` where the finding is a sensor. A small effect is easily taken for the sensor that is
#: nearly its twin. Then the sensor does not take all of its gain.
_LOST_TO_SENSOR = HALF


@dataclass(frozen=True)
class Explanation:
    """The explanation set of one finding.

    index : of the finding. rivals : aerodynamic hypotheses that fit as well. sensors : sensors
    given which the finding does not hold, or that fit as well. fallen : index -> why that
    hypothesis is no rival, in plain words.
    """

    index: int
    rivals: tuple[int, ...]
    sensors: tuple[int, ...]
    fallen: dict[int, Remark]


def explain(tests: CrossFlightTests, decision: Decision, index: int) -> Explanation:
    """Return the explanation set of an accepted or suspected term, or of a freed sensor. See
    docs/method/tracing.md, section 10."""
    sensors = set(tests.campaign.sensors)
    fewest = (
        tests.settings.fewest
        if index in decision.accepted or index in decision.freed
        else FEWEST_SUSPECTED
    )
    terms = tuple(i for i in decision.terms if i != index)
    freed = tuple(i for i in decision.freed if i != index)
    # Intercepts are in every model: no other term can explain an axis' constant, and it can
    # explain no other term.
    fitting, fallen = (
        _fitting(tests, terms, freed, index, fewest)
        if index not in tests.campaign.offsets
        else ([], {})
    )
    broken = _breaking(tests, terms, freed, index, fewest) if index not in sensors else ()
    if index in tests.campaign.offsets:
        broken = tuple(_constant(tests, terms, freed, index, broken))
    rivals = tuple(i for i in fitting if i not in sensors)
    behind = tuple(dict.fromkeys([*broken, *(i for i in fitting if i in sensors)]))
    for i in (*rivals, *behind):
        fallen.pop(i, None)
    return Explanation(index, rivals, behind, fallen)


def with_cancelling(
    tests: CrossFlightTests, decision: Decision, explanations: Sequence[Explanation]
) -> list[Explanation]:
    """Return the explanation sets of all findings, each with the findings that cancel it.

    Two that leave together less than a quarter of what each of them leaves were not seen: only what
    they leave was. They are one group, and nothing is claimed of either. What varies within flights
    counts; of a constant and a freed sensor, the level. A linear effect and its change with alpha
    or Mach number are no pair: together they are one curve. What may stand in place of the change
    stands in place of the linear effect too, where they leave less than a quarter of what that
    leaves. docs/method/tracing.md, section 10.
    """
    products, rows, names = (
        tests.campaign.products,
        list(tests.flights),
        tests.campaign.hypotheses,
    )
    square, offsets = products.matrix[rows].sum(axis=0), products.offsets
    test = tests.tested(decision.terms, decision.freed, FEWEST_SUSPECTED)
    levels = products.intercepts[rows].mean(axis=0)

    def cancel(one: int, other: int) -> bool:
        constant = one if one in offsets else other if other in offsets else None
        if names[other].has_shape(names[one]) or (
            names[one].has_shape(names[other]) and not unsure[other]
        ):
            return False  # one effect that changes, with what it is on average
        if constant is None:
            pair = [one, other]
            size = np.nan_to_num(test.mean[pair]) / products.factor[pair]
            each = square[np.ix_(pair, pair)] * np.outer(size, size)
            seen = each[0, 0] if names[one].has_shape(names[other]) else np.diagonal(each).min()
            return bool(each.sum() < _CANCELS * seen)
        beside = other if constant == one else one
        if beside not in decision.freed:
            return False  # a slope and a constant turn a curve about a point of it
        left = float(levels[offsets[constant], beside] * test.mean[beside])
        own = float(test.mean[constant])
        return (own + left) ** 2 < _CANCELS * min(own**2, left**2)

    sensors = set(tests.campaign.sensors)
    indices = [explanation.index for explanation in explanations]
    unsure = {each.index: each.rivals or each.sensors for each in explanations}
    found = []
    for each in explanations:
        partners = [i for i in indices if i != each.index and cancel(each.index, i)]
        rivals = dict.fromkeys([*each.rivals, *(i for i in partners if i not in sensors)])
        behind = dict.fromkeys([*each.sensors, *(i for i in partners if i in sensors)])
        found.append(replace(each, rivals=tuple(rivals), sensors=tuple(behind)))
    return found


def _fitting(
    tests: CrossFlightTests, terms: tuple[int, ...], freed: tuple[int, ...], index: int, fewest: int
) -> tuple[list[int], dict[int, Remark]]:
    """Hypotheses that would be found in its place, lose their gain to it, and are not worse over
    flights.

    And the reason of each that was rejected.
    """
    sensors, hypotheses = set(tests.campaign.sensors), tests.campaign.hypotheses
    # The rivals of a sensor are tested with that sensor taken as right: beside the freed sensor
    # they would get only what it leaves.
    fixed, lost = ((index,), _LOST_TO_SENSOR) if index in sensors else ((), LOST)
    before = tests.tested(terms, freed, fewest, fixed)
    estimates = tests.flight_estimates(terms, freed, fixed)
    given = (terms, (*freed, index)) if index in sensors else ((*terms, index), freed)
    after = tests.tested(*given, fewest)
    barred = {index, *terms, *freed, *tests.campaign.offsets}
    own = _gain_by_flight(tests, terms, freed, index, fewest)
    # What the errors of other sensors may hide is no finding, but still explains what a sensor
    # would be blamed for; so does what the errors of a reconstructed angle may hide.
    shown = (
        before.unmasked < tests.settings.level
        if tests.campaign.angle_reconstructed or index in sensors
        else before.possible
    )
    fitting: list[int] = []
    fallen: dict[int, Remark] = {}
    twins = twins_of(tests, before, index)
    twins[list(sensors)] = False  # of these only what the flights show counts
    for rival in np.flatnonzero(shown | twins).tolist():
        if rival in barred:
            continue
        apart = after.possible[rival] or not before.possible[rival]
        if (
            not twins[rival]
            and apart
            and after.gain[rival] >= lost * before.gain[rival]
            and not _takes_share(tests, terms, freed, index, rival, before)
        ):
            continue  # a different defect, not a rival
        outside = implausible(tests, before, rival)
        if outside:
            fallen[rival] = outside
            continue
        gains = np.zeros(len(tests.flights))
        gains[before.included[:, rival]] = flight_gains(estimates, before, rival)
        no_more = twins[rival] or paired_p(gains, own) >= tests.settings.level
        own_kind = hypotheses[index].is_size_of(hypotheses[rival])
        shaped = own_kind or hypotheses[index].has_shape(hypotheses[rival])
        alike = set(hypotheses[rival].drivers) <= set(hypotheses[index].drivers)
        if shaped and no_more and (alike or not _levels_prefer(tests, before, rival, index)):
            fallen[rival] = said("is another shape of the same effect, and explains no more")
            continue
        if twins[rival]:
            fitting.append(rival)
            continue
        p = paired_p(own, gains)
        if p < tests.settings.level:
            fallen[rival] = said(f"explains less in flight after flight (p = {p:.1g})")
        else:
            fitting.append(rival)
    fitting.sort(key=lambda i: -float(before.gain[i]))
    return fitting, fallen


def _takes_share(
    tests: CrossFlightTests,
    terms: tuple[int, ...],
    freed: tuple[int, ...],
    index: int,
    rival: int,
    before: Tested,
) -> bool:
    """Return whether a hypothesis that explains more than a term takes more than a quarter (`LOST`)
    of its gain: the term's size is then partly that of the other. The other is in no model, where
    too few flights make it significant."""
    sensors = set(tests.campaign.sensors)
    if index in sensors or before.gain[rival] <= before.gain[index]:
        return False
    given = (terms, (*freed, rival)) if rival in sensors else ((*terms, rival), freed)
    return tests.gain(index, *given, ()) < (1.0 - LOST) * float(before.gain[index])


def _levels_prefer(tests: CrossFlightTests, test: Tested, rival: int, index: int) -> bool:
    """Return whether the levels of the flights speak for a rival: they scatter less about what it
    makes of them than about what the finding makes of them, on the axis where that is largest.

    What varies within flights has no level in it, so that this is evidence of its own, of what a
    rival depends on beside the finding's variable. A constant of the axis is left open.
    """
    products, rows = tests.campaign.products, list(tests.flights)
    both = [at for at, row in enumerate(test.included[:, [rival, index]]) if row.all()]
    levels = products.intercepts[rows][both]
    made = levels[:, :, [rival, index]] * test.mean[[rival, index]]
    axis = int(np.abs(made).sum(axis=(0, 2)).argmax())
    left = levels[:, axis, [-1]] - made[:, axis]
    return scatter_p(left[:, 0], left[:, 1]) < tests.settings.level


def _gain_by_flight(
    tests: CrossFlightTests, terms: tuple[int, ...], freed: tuple[int, ...], index: int, fewest: int
) -> Array:
    """Gain of the finding in each flight; 0 where the flight takes no part."""
    test = tests.tested(terms, freed, fewest)
    gains = np.zeros(len(tests.flights))
    gains[test.included[:, index]] = flight_gains(tests.flight_estimates(terms, freed), test, index)
    return gains


def _breaking(
    tests: CrossFlightTests, terms: tuple[int, ...], freed: tuple[int, ...], index: int, fewest: int
) -> tuple[int, ...]:
    """Sensors that, freed, take the finding's separability, sign or significance away.

    And sensors that are freed already and given which little of the finding is left: the column of
    a sensor is exact for small errors only, and the rest of a larger error looks like a small
    effect of the same kind.
    """
    every = (
        *terms,
        index,
    )  # asked for together: a sensor that is freed is the same model for all findings
    absent = tests.tested(terms, freed, fewest)
    full = tests.tested(every, freed, fewest)
    broken = []
    for sensor in tests.campaign.sensors:
        if sensor in freed:
            right = tests.gain(
                index, terms, tuple(i for i in freed if i != sensor), fixed=(sensor,)
            )
            if full.gain[index] < LOST * right:
                broken.append(sensor)
            continue
        test = tests.tested(every, (*freed, sensor), fewest)
        same = np.sign(test.mean[index]) == np.sign(full.mean[index])
        holds = test.testable[index] and same and test.p_at(every)[-1] < tests.settings.level
        if not holds and not implausible(tests, absent, sensor):
            broken.append(sensor)
    return tuple(broken)


def _constant(
    tests: CrossFlightTests,
    terms: tuple[int, ...],
    freed: tuple[int, ...],
    index: int,
    broken: Sequence[int],
) -> list[int]:
    """Sensors of which a believable constant error, the same in all flights, leaves an axis'
    constant, or what its interval has nearest to zero; one that these flights' own estimate of the
    sensor does not exclude. Where no single one does: those whose independent errors leave it
    together. Of the sensors that break it when they are freed (`broken`), those whose believable
    errors leave it.
    """
    products = tests.campaign.products
    each = products.intercepts[:, products.offsets[index]].mean(axis=0)
    test = tests.tested(terms, freed)
    sign, nearest = np.sign(test.mean[index]), _nearest(test, index)
    largest_shift = dict[int, float]()
    for sensor in tests.campaign.sensors:
        low, high = _may_be(tests, test, sensor)
        if low <= high:
            largest_shift[sensor] = float(max(0.0, *(sign * each[sensor] * np.array([low, high]))))
    able = [sensor for sensor, most in largest_shift.items() if most >= nearest and most > 0.0]
    constant = [
        sensor
        for sensor in largest_shift
        if tests.campaign.hypotheses[sensor].effect.endswith(("_bias", "_offset"))
    ]
    found = [sensor for sensor in able if sensor in broken or sensor in constant]
    if found:
        return found
    together = sorted(constant, key=lambda sensor: -largest_shift[sensor])
    size = np.sqrt(np.cumsum(np.square([largest_shift[sensor] for sensor in together])))
    enough = int(np.searchsorted(size, nearest))
    return together[: enough + 1] if enough < len(together) else []


def _nearest(test: Tested, index: int) -> float:
    """Size of what the interval of a hypothesis has nearest to zero, 0 where zero is inside."""
    return max(0.0, float(np.sign(test.mean[index])) * min(test.interval(index), key=abs))


def _may_be(tests: CrossFlightTests, test: Tested, sensor: int) -> tuple[float, float]:
    """The range of believable errors of a sensor that these flights' own estimate of it does not
    exclude; empty, as its ends are exchanged, where it excludes them all."""
    least, most = tests.campaign.hypotheses[sensor].plausible
    low, high = test.interval(sensor) if test.testable[sensor] else (least, most)
    return max(least, low), min(most, high)


def may_be_off_by(tests: CrossFlightTests, test: Tested, sensor: int, error: float) -> bool:
    """Return whether an error of a sensor (in the channel's SI unit) is believable, and these
    flights' own estimate of it does not exclude that."""
    low, high = _may_be(tests, test, sensor)
    return low <= error <= high


def wanted(
    tests: CrossFlightTests, decision: Decision, explanation: Explanation
) -> tuple[Wanted, ...]:
    """Return the measurements outside flight that would tell a term from each sensor in its set, or
    a freed sensor from its rivals.

    Three sigmas and what these flights leave open of the sensor, as independent errors, are then
    less than the error that would take the place of the term (`implausible`); of a constant, than
    the error that would leave what its interval has nearest to zero. Sigmas in SI units;
    docs/method/tracing.md, section 15.
    """
    index = explanation.index
    sensors = (index,) if index in decision.freed else explanation.sensors
    terms = tuple(i for i in decision.terms if i != index)
    test = tests.tested(terms, decision.freed, FEWEST_SUSPECTED)
    products = tests.campaign.products
    made = []
    for sensor in sensors:
        hypothesis = tests.campaign.hypotheses[sensor]
        if index in products.offsets:
            own = tests.tested(decision.terms, decision.freed, FEWEST_SUSPECTED)
            shift = abs(float(products.intercepts[:, products.offsets[index], sensor].mean()))
            shift *= float(np.sqrt(len(sensors)))  # independent errors of several
            excess = _nearest(own, index) / shift if shift else 0.0
        else:
            half = half_interval(test, sensor) if test.testable[sensor] else np.inf
            excess = float(np.sqrt(max(0.0, float(test.mean[sensor]) ** 2 - half**2)))
        known = hypothesis.prior_sigma or np.inf  # a measurement that knows less decides nothing
        sigma = min(excess / BELIEVED, known) if np.isfinite(excess) and excess > 0.0 else None
        made.append(Wanted(hypothesis.parameter, sigma, hypothesis.unit))
    return tuple(made)


def agreement(test: Tested, sensor: int, error: float) -> float:
    """Return by how much an error of a sensor (SI unit) explains what varies within flights.

    Twice the fall of the negative log-likelihood of the sensor's estimate, the errors that other
    sensors may have included: dimensionless, negative where the error contradicts what varies, and
    0 where nothing that varies shows it.
    """
    if not test.testable[sensor]:
        return 0.0
    by_sensors = float(test.systematic_at([sensor])[0]) / test.settings.kappa
    mean, own = float(test.mean[sensor]), float(test.standard_error[sensor])
    return (mean**2 - (error - mean) ** 2) / (own**2 + by_sensors**2)


def finding_of(
    tests: CrossFlightTests,
    decision: Decision,
    test: Tested,
    explanation: Explanation,
    *,
    verdict: Verdict,
    value: float,
    ci95: tuple[float, float],
    size: str,
    reasons: tuple[str, ...],
    refound: tuple[int, int] = (0, 0),
) -> Finding:
    """Return the finding of an explained hypothesis, with its votes and its explanation set.

    test : of the model of `decision`. value, ci95 : of the parameter, SI. size, reasons : as in
    `Finding`.
    """
    index, hypotheses = explanation.index, tests.campaign.hypotheses
    hypothesis = hypotheses[index]
    estimates = tests.flight_estimates(decision.terms, decision.freed)
    gains = left_out_gains(estimates, test, index)
    members = (index, *explanation.rivals, *explanation.sensors)
    return Finding(
        hypothesis=hypothesis.id,
        effect=hypothesis.effect,
        axis=tuple(hypothesis.axes),
        subject=hypothesis.subject,
        verdict=verdict,
        parameter=hypothesis.parameter,
        unit=hypothesis.unit,
        value=value,
        ci95=ci95,
        p_adjusted=float(test.adjusted[index]),
        test=MeanTest(
            float(test.mean[index]), test.not_rejected(index), float(test.p_at([index])[0])
        ),
        votes=reported_votes(tests, estimates, test, index),
        explanation_set=tuple(hypotheses[i].id for i in members),
        what=hypothesis.because,
        size=size,
        reasons=reasons,
        fallen={hypotheses[i].id: reason for i, reason in explanation.fallen.items()},
        refound=refound,
        held_out_share=float(np.mean(gains > 0.0)) if len(gains) else 0.0,
        wanted=wanted(tests, decision, explanation),
    )
