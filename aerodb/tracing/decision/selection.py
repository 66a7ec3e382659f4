"""Forward selection: terms that the model lacks and sensors that are wrong compete for the
residual.

Only per-flight estimates are used here, no samples. See docs/method/tracing.md, section 9. What
fits equally well is in `aerodb.tracing.decision.explanation_sets`.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.special import stdtrit

from aerodb.remarks import NOT_BELIEVABLE, Remark
from aerodb.support import QUARTER, Array, Mask
from aerodb.tracing.decision.findings import Vote
from aerodb.tracing.estimates import (
    Campaign,
    FlightEstimates,
    Tested,
    coherent_gain,
    holm,
    over_flights,
    paired_p,
)
from aerodb.tracing.settings import TracingSettings

#: Flights that a suspected term needs: one flight says nothing about another.
FEWEST_SUSPECTED = 2
#: A gain is lost when less than this part of it is left once another hypothesis is in.
LOST = QUARTER
#: Correlation of two columns from which they are twins: no flight of this kind tells them apart.
TWIN = 0.999


@dataclass(frozen=True)
class Decision:
    """Indices of the accepted terms in the order found, of those only suspected, and of freed
    sensors.

    A term is only suspected where too few flights take part in its test.
    """

    accepted: tuple[int, ...]
    suspected: tuple[int, ...]
    freed: tuple[int, ...]

    @property
    def terms(self) -> tuple[int, ...]:
        """All terms that the final model holds."""
        return (*self.accepted, *self.suspected)


@dataclass(frozen=True)
class CrossFlightTests:
    """Tests of all hypotheses over some flights of a campaign, given a model; results are cached.

    campaign : all flights; flights : which of them take part, by their number; settings : of
    tracing. pairs : linear effects with another shape that are searched together; None: all.
    """

    campaign: Campaign
    flights: tuple[int, ...]
    settings: TracingSettings
    pairs: tuple[tuple[int, int], ...] | None = None
    cached: dict[tuple[object, ...], Tested] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    def flight_estimates(
        self,
        accepted: Sequence[int],
        freed: Sequence[int],
        fixed: Sequence[int] = (),
        exact: Sequence[int] = (),
    ) -> FlightEstimates:
        """Return the estimates (flights, hypotheses) of these flights, SI units; see
        `Campaign.flight_estimates`."""
        return self.campaign.flight_estimates(
            tuple(accepted), tuple(freed), tuple(fixed), tuple(exact)
        ).rows(self.flights)

    def tested(
        self,
        accepted: Sequence[int],
        freed: Sequence[int],
        fewest: int | None = None,
        fixed: Sequence[int] = (),
        exact: Sequence[int] = (),
    ) -> Tested:
        """Return the test (k,) of every hypothesis given the accepted terms and the sensors.

        fewest : flights that a test needs; of the settings, unless given. freed : sensors without
        prior; fixed : sensors taken as right. exact : accepted terms whose shape is taken as right.
        Means are in the unit of each hypothesis; docs/method/tracing.md, section 8.
        """
        fewest = self.settings.fewest if fewest is None else fewest
        key = (frozenset(accepted), frozenset(freed), fewest, frozenset(fixed), frozenset(exact))
        if key not in self.cached:
            estimates = self.flight_estimates(accepted, freed, fixed, exact)
            self.cached[key] = self._over_flights(estimates, {*freed, *fixed}, fewest)
        return self.cached[key]

    def remaining(self, accepted: Sequence[int], freed: Sequence[int], fewest: int) -> Tested:
        """Return `tested`, by the noise that remains when what the model explains is taken away.

        So the values of the model itself are known. Searched is with all that is in the residual:
        what is in no model yet must not be found by noise that another term was before.
        """
        left = self.campaign.noise_left(accepted, freed)
        rows = None if left is None else left[list(self.flights)]
        return self._over_flights(self.flight_estimates(accepted, freed), set(freed), fewest, rows)

    def _over_flights(
        self,
        estimates: FlightEstimates,
        certain: Collection[int],
        fewest: int,
        left: Array | None = None,
    ) -> Tested:
        sigma = [
            0.0 if s in certain else self.campaign.hypotheses[s].prior_sigma or 0.0
            for s in self.campaign.sensors
        ]
        return over_flights(
            estimates,
            np.array(sigma),
            self.settings,
            fewest,
            self.campaign.offsets,
            self.campaign.own_errors,
            left,
        )

    def gain(
        self, index: int, accepted: Sequence[int], freed: Sequence[int], fixed: Sequence[int]
    ) -> float:
        """Return the coherent gain (dimensionless; `coherent_gain`) of one hypothesis alone."""
        rows = list(self.flights)
        estimate, information = self.campaign.flight_estimate(index, accepted, freed, fixed)
        return coherent_gain(estimate[rows], information[rows], self.settings)

    def without(self, flights: Sequence[int]) -> "CrossFlightTests":
        """Return the tests without some flights."""
        return CrossFlightTests(
            self.campaign, tuple(f for f in self.flights if f not in flights), self.settings
        )


def decide(tests: CrossFlightTests) -> Decision:
    """Select terms and sensors until nothing more is found; then suspected terms, then constants.

    docs/method/tracing.md, section 9.
    """
    accepted: tuple[int, ...] = ()
    freed: tuple[int, ...] = ()
    dropped: set[int] = set()  # what has had to leave does not return: each round ends for good
    while len(accepted) < tests.settings.most_terms:
        term, sensor = _candidates(tests, accepted, freed, dropped)
        if (
            term is not None
            and sensor is not None
            and _sensor_wins(tests, accepted, freed, term, sensor)
        ):
            term = None
        if term is not None:
            kept = _kept(tests, (*accepted, term), freed)
            dropped |= {*accepted, term} - set(kept)
            accepted = kept
        elif sensor is not None:
            freed = (*freed, _behind(tests, accepted, freed, sensor))
        elif pair := _pair(tests, accepted, freed, dropped):
            kept = _kept(tests, (*accepted, *pair), freed)
            both = set(pair) <= set(kept)  # neither says anything without the other
            dropped |= {*accepted, *pair} - set(kept) if both else {pair[1]}
            accepted = kept if both else accepted
        else:
            break
    suspected = _suspected(tests, accepted, freed)
    return Decision((*accepted, *_offsets(tests, (*accepted, *suspected), freed)), suspected, freed)


def _candidates(
    tests: CrossFlightTests, accepted: tuple[int, ...], freed: tuple[int, ...], dropped: set[int]
) -> tuple[int | None, int | None]:
    """The term and the sensor of the largest coherent gain among those that are significant over
    the whole library.
    """
    test = tests.tested(accepted, freed)
    sensors = set(tests.campaign.sensors)
    taken = {*accepted, *freed, *dropped, *tests.campaign.offsets}
    significant = [int(i) for i in np.flatnonzero(test.significant) if i not in taken]
    terms = [
        i for i in significant if i not in sensors and not is_no_term(tests, test, i, accepted)
    ]
    wrong = [i for i in significant if i in sensors and not _known_better(tests, test, i)]
    wrong = wrong if len(freed) < tests.settings.most_freed else []
    term = _largest(test.gain, terms)
    if term is not None:
        term = _plainest(tests, tests.flight_estimates(accepted, freed), test, term, terms)
    return term, _largest(test.gain, wrong)


def _pair(
    tests: CrossFlightTests, accepted: tuple[int, ...], freed: tuple[int, ...], dropped: set[int]
) -> tuple[int, ...]:
    """A linear effect and another shape of it that is significant beside it; empty if none is.

    An effect that changes sign within what was flown, as one of Mach number does about the Mach
    number at which the database is right, shows in neither alone. All such pairs are tests beside
    those of the library (Bonferroni). docs/method/tracing.md, section 9.
    """
    taken = {*accepted, *freed, *dropped}
    alone = tests.tested(accepted, freed)
    pairs = [
        pair
        for pair in (tests.campaign.shapes if tests.pairs is None else tests.pairs)
        if taken.isdisjoint(pair) and alone.testable[list(pair)].all()
    ]
    every = len(tests.campaign.hypotheses) + len(tests.campaign.shapes)
    level = tests.settings.level / every
    best: tuple[float, tuple[int, ...]] = (0.0, ())
    for linear, shape in pairs:
        test = tests.tested((*accepted, linear), freed)
        gain = float(test.gain[shape])
        if (
            gain > best[0]
            and test.unmasked[shape] < level  # what sensors may add only raises p
            and test.p_at([shape])[0] < level
            and not is_no_term(tests, test, shape, accepted)
        ):
            best = (gain, (linear, shape))
    return best[1]


def is_no_term(tests: CrossFlightTests, test: Tested, index: int, terms: Sequence[int]) -> bool:
    """Return whether a hypothesis would need a size at which it is not what its name says.

    One that no size near zero has (a reversed sign) is itself at a believable size only. Another
    shape of a term of the model, over the same variable, would take that term back beyond it, and
    neither size would say anything of the effect.
    """
    names = tests.campaign.hypotheses
    own = names[index]
    least, most = own.plausible
    another = any(
        (own.has_shape(names[term]) or names[term].has_shape(own))
        and set(own.drivers) == set(names[term].drivers)
        for term in terms
    )
    return (another or not least <= 0.0 <= most) and bool(implausible(tests, test, index))


def _plainest(
    tests: CrossFlightTests,
    estimates: FlightEstimates,
    test: Tested,
    term: int,
    terms: Sequence[int],
) -> int:
    """The linear effect among `terms` of which `term` is another shape, if the two are twins or the
    shape explains no more flight after flight; else `term`."""
    hypotheses = tests.campaign.hypotheses
    linear = _largest(test.gain, [i for i in terms if hypotheses[i].has_shape(hypotheses[term])])
    if linear is None or linear == term:
        return term
    if twins_of(tests, test, term)[linear]:
        return linear
    gains = np.zeros((2, len(tests.flights)))
    for row, index in enumerate((term, linear)):
        gains[row, test.included[:, index]] = flight_gains(estimates, test, index)
    return linear if paired_p(gains[0], gains[1]) >= tests.settings.level else term


def twins_of(tests: CrossFlightTests, test: Tested, index: int) -> Mask:
    """Return which hypotheses (k,) have the column of another up to a factor, within `TWIN`, in
    every flight that has both.

    Noise of the two channels, not the effect, makes one of them explain more: no test over flights
    tells them apart.
    """
    matrix, rows = tests.campaign.products.matrix, list(tests.flights)
    own = np.diagonal(matrix, axis1=1, axis2=2)[rows, :-1]
    alike = matrix[rows, index, :-1] ** 2 > TWIN**2 * own[:, index, None] * own
    both = test.included & test.included[:, [index]]
    return np.asarray(both.any(axis=0) & np.all(alike | ~both, axis=0))


def _known_better(tests: CrossFlightTests, test: Tested, index: int) -> bool:
    """Return whether a sensor would have to be wrong by more than is known of it.

    What is known of it is its prior already: beyond that, the estimate itself must be believable,
    not only the nearer end of its interval.
    """
    hypothesis = tests.campaign.hypotheses[index]
    least, most = hypothesis.plausible
    return not least <= float(test.mean[index]) <= most


def _largest(gain: Array, indices: Sequence[int]) -> int | None:
    return max(indices, key=lambda i: float(gain[i])) if indices else None


def _sensor_wins(
    tests: CrossFlightTests,
    accepted: tuple[int, ...],
    freed: tuple[int, ...],
    term: int,
    sensor: int,
) -> bool:
    """Test each given the other: the sensor wins if it remains, and the term does not or gains
    less.

    The gains are compared fairly: the term's with the sensor taken as right, not with a sensor that
    has taken its share.
    """
    given_term = tests.tested((*accepted, term), freed, exact=(term,))
    if given_term.p_at([sensor])[0] >= tests.settings.level:
        return False
    given_sensor = tests.tested(accepted, (*freed, sensor))
    if given_sensor.p_at([term])[0] >= tests.settings.level:
        return True
    alone = tests.gain(term, accepted, freed, fixed=(sensor,))
    return bool(tests.tested(accepted, freed).gain[sensor] > alone)


def _behind(
    tests: CrossFlightTests, accepted: tuple[int, ...], freed: tuple[int, ...], sensor: int
) -> int:
    """The sensor that explains `sensor` and is not explained by it; `sensor` itself where there is
    none.

    Errors of several others may imitate it together, and so hide it: those of dynamic pressure and
    of all moments of inertia imitate that of the mass.
    """
    test, given = tests.tested(accepted, freed), tests.tested(accepted, (*freed, sensor))
    shown = holm(test.unmasked, len(test.unmasked)) < tests.settings.level
    behind = [
        other
        for other in tests.campaign.sensors
        if shown[other]
        and other not in (*freed, sensor)
        and not _known_better(tests, test, other)
        and given.gain[other] >= LOST * test.gain[other]
        and tests.tested(accepted, (*freed, other)).gain[sensor] < LOST * test.gain[sensor]
    ]
    return max(behind, key=lambda other: float(test.gain[other]), default=sensor)


def _kept(
    tests: CrossFlightTests, accepted: tuple[int, ...], freed: tuple[int, ...]
) -> tuple[int, ...]:
    """Return the accepted terms that still hold given each other.

    An early stand-in leaves when the true terms are in.
    """
    while len(accepted) > 1:
        test = tests.tested(accepted, freed)
        if test.significant[list(accepted)].all():
            break
        p = test.p_at(accepted)
        if p.max() < tests.settings.level:
            break
        weakest = accepted[int(p.argmax())]
        accepted = tuple(i for i in accepted if i != weakest)
    return accepted


def _suspected(
    tests: CrossFlightTests, accepted: tuple[int, ...], freed: tuple[int, ...]
) -> tuple[int, ...]:
    """Terms with too few flights for the error rate, whose value predicts each flight from the
    others.

    Largest gain first.
    """
    suspected: tuple[int, ...] = ()
    while len(accepted) + len(suspected) < tests.settings.most_terms:
        terms = (*accepted, *suspected)
        test = tests.tested(terms, freed, FEWEST_SUSPECTED)
        estimates = tests.flight_estimates(terms, freed)
        few = (test.count < tests.settings.fewest) & test.significant
        barred = {*tests.campaign.sensors, *tests.campaign.offsets, *terms}
        indices = [int(i) for i in np.flatnonzero(few) if i not in barred]
        best = _largest(
            test.gain,
            [
                i
                for i in indices
                if cross_validated(estimates, test, i) and not is_no_term(tests, test, i, terms)
            ],
        )
        if best is None:
            break
        suspected = (*suspected, best)
    return suspected


def _offsets(
    tests: CrossFlightTests, terms: tuple[int, ...], freed: tuple[int, ...]
) -> tuple[int, ...]:
    """Constants that recur over flights.

    They come last: intercepts are in every model, and every lacking term leaves one. One that may
    be zero is none: the test counts a SIMEX bias to one side, the interval to both.
    """
    test = tests.tested(terms, freed)
    return tuple(
        index
        for index in tests.campaign.offsets
        if test.significant[index] and np.prod(test.interval(index)) > 0.0
    )


def flight_gains(estimates: FlightEstimates, test: Tested, index: int) -> Array:
    """Fall of the whitened sum of squares of each flight in the test (m,) under one common value.

    ``2 m b - m^2 A``.

    It is dimensionless.
    """
    on = test.included[:, index]
    information = estimates.information[on, index]
    right = information * estimates.estimate[on, index]
    total = information.sum()
    common = right.sum() / total if total > 0.0 else 0.0
    return np.asarray(2.0 * common * right - common**2 * information)


def cross_validated(estimates: FlightEstimates, test: Tested, index: int) -> bool:
    """Return whether the value that the others give (SI unit of the hypothesis) lowers the sum of
    squares of every flight in the test."""
    return bool(np.all(left_out_gains(estimates, test, index) > 0.0)) and bool(
        test.count[index] >= FEWEST_SUSPECTED
    )


def reported_votes(
    tests: CrossFlightTests, estimates: FlightEstimates, test: Tested, index: int
) -> tuple[Vote, ...]:
    """Return the vote of each flight in the test: estimate and standard error, SI units of the
    parameter.
    """
    return tuple(
        Vote(
            tests.campaign.flights[tests.flights[g]],
            float(estimates.estimate[g, index]),
            float(estimates.information[g, index] ** -0.5),
        )
        for g in np.flatnonzero(test.included[:, index])
    )


def left_out_gains(estimates: FlightEstimates, test: Tested, index: int) -> Array:
    """As `flight_gains`, each flight under the value of the others.

    What the term is worth on a flight that was not used to estimate it.

    It is (m,), dimensionless.
    """
    on = test.included[:, index]
    information = estimates.information[on, index]
    right = information * estimates.estimate[on, index]
    others = information.sum() - information
    common = (right.sum() - right) / np.where(others > 0.0, others, np.inf)
    return np.asarray(2.0 * common * right - common**2 * information)


def half_interval(test: Tested, index: int) -> float:
    """Return half of the 95 % interval (Student's t) and the systematic bound of a hypothesis, in
    its unit (SI)."""
    return float(
        stdtrit(test.dof[index], 0.975) * test.standard_error[index]
        + test.systematic_at([index])[0]
    )


def implausible(tests: CrossFlightTests, test: Tested, index: int) -> Remark | None:
    """Return why the value that a rival would need is not believable; None if it is, or is not
    known.

    Its 95 % interval and bound (`half_interval`) must be outside the believable range. Where that
    is known from measurements it is three standard deviations, independent of the estimate: the two
    add in quadrature.
    """
    hypothesis = tests.campaign.hypotheses[index]
    half = half_interval(test, index)
    if not np.isfinite(half) or not test.testable[index]:
        return None
    (least, most), value = hypothesis.plausible, float(test.mean[index])
    if hypothesis.known_by:
        outside = value < -np.hypot(half, least) or value > np.hypot(half, most)
    else:
        outside = value + half < least or value - half > most
    if outside:
        needed = {"value": value, "low": least, "high": most}
        values = {name: (size, hypothesis.unit) for name, size in needed.items()}
        return Remark(NOT_BELIEVABLE, (hypothesis.known_by,), values)
    return None
