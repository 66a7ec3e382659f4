"""Effects that differ between flights: estimates per flight against the flights' conditions.

An effect that depends on a condition which hardly changes within a flight averages out of the
cross-flight test. Here the per-flight estimates are regressed on the flights' mean conditions:
weighted, with a moderated variance and a systematic bound, as the test of a mean over flights.
docs/method/tracing.md, section 25.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from scipy.special import fdtri, stdtr, stdtrit

from aerodb.effects import Hypothesis
from aerodb.support import LARGE, Array, Mask
from aerodb.tracing.decision.explanation_sets import may_be_off_by
from aerodb.tracing.decision.few_flights import LINEAR
from aerodb.tracing.decision.findings import Traced, Vote, with_unit
from aerodb.tracing.decision.selection import CrossFlightTests
from aerodb.tracing.estimates import OFFSET, FlightEstimates, Tested, campaign, holm
from aerodb.tracing.evidence import FlightNormalEquations
from aerodb.tracing.settings import TracingSettings

#: Flights from which a slope over a condition is tested.
FEWEST: Final = 5
#: Share of the weighted sum of squares of a condition that one flight may hold. A slope that rests
#: on one flight says nothing about others.
_ONE_FLIGHT: Final = LARGE
#: Claims at most.
_MOST: Final = 5
#: Condition -> unit in sentences, how many of it are one SI unit, step of "per".
_SHOWN: Final[Mapping[str, tuple[str, float, float]]] = {
    "qbar": ("kPa", 1e-3, 1.0),
    "mach": ("of Mach number", 1.0, 0.1),
    "alpha": ("deg", 180.0 / np.pi, 1.0),
    "mass": ("kg", 1.0, 100.0),
}


@dataclass(frozen=True)
class FlightDependence:
    """A hypothesis whose per-flight estimates change with a condition of the flights.

    slope, ci95 : of its parameter, per unit of `condition`, SI. relative : slope as a part of the
    effect's whole size, per unit of the condition; None where that is not known. span : least and
    largest condition flown. also : other conditions that fit as well; rivals : hypotheses, and
    sensors whose constant error could explain it as well. estimates : each flight's condition and
    estimate. because, settled_by : one plain sentence each.
    """

    hypothesis: Hypothesis
    condition: str
    slope: float
    ci95: tuple[float, float]
    relative: float | None
    p_adjusted: float
    span: tuple[float, float]
    also: tuple[str, ...]
    rivals: tuple[str, ...]
    estimates: tuple[tuple[float, Vote], ...]
    because: str
    settled_by: str

    def document(self) -> dict[str, Any]:
        """Return it as JSON of docs/reference/contract.md: values in `unit`, slope in that unit per
        unit of the condition, confidence intervals as (2,) lists."""
        return {
            "hypothesis": self.hypothesis.id,
            "effect": self.hypothesis.effect,
            "axis": list(self.hypothesis.axes),
            "subject": self.hypothesis.subject,
            "parameter": self.hypothesis.parameter,
            "unit": self.hypothesis.unit,
            "condition": self.condition,
            "slope": self.slope,
            "ci95": list(self.ci95),
            "relative": self.relative,
            "p_adjusted": self.p_adjusted,
            "condition_range": list(self.span),
            "conditions_as_well": list(self.also),
            "explained_as_well_by": list(self.rivals),
            "votes": [
                {"flight": vote.flight, "condition": at, "value": vote.value, "se": vote.se}
                for at, vote in self.estimates
            ],
            "because": self.because,
            "settled_by": self.settled_by,
        }


def dependences_on_conditions(
    normal_equations: Sequence[FlightNormalEquations],
    hypotheses: Sequence[Hypothesis],
    settings: TracingSettings,
    traced: Traced,
    conditions: Mapping[str, Mapping[str, float]],
    added: Sequence[str] = (),
    size_of: Callable[[Hypothesis], float | None] = lambda hypothesis: None,
) -> tuple[FlightDependence, ...]:
    """Return which effects change with the conditions of the flights; the largest first.

    Tested are the linear set and the terms accepted so far. None enters a database by itself.

    Parameters
    ----------
    normal_equations, hypotheses, settings : as given to `trace`
    traced : what came out
    conditions : condition -> flight -> its mean there, SI; flights that lack it may be missing
    added : ids of terms that earlier rounds added
    size_of : the value that the database has for the effect, None where it is not known

    Returns
    -------
    tuple : empty below five flights, or where no condition differs between the flights.

    References
    ----------
    docs/method/tracing.md, section 25; Thompson & Sharp, Statistics in Medicine 18, 1999
    (regression of estimates on a condition, with a common factor on their variances); Smyth, Stat.
    Appl. Genet. Mol. Biol. 3(1), 2004.
    """
    kept = [g for g in normal_equations if g.flight in traced.flights]
    if len(kept) < FEWEST or not conditions:
        return ()
    tests = CrossFlightTests(campaign(kept, hypotheses), tuple(range(len(kept))), settings)
    at = {
        name: np.array([values.get(g.flight, np.nan) for g in kept])
        for name, values in conditions.items()
    }
    number = {h.id: index for index, h in enumerate(hypotheses)}
    found = [number[f.hypothesis] for f in traced.findings if f.hypothesis in number]
    sensors = set(tests.campaign.sensors)
    terms = tuple(i for i in found if i not in sensors)
    freed = tuple(i for i in found if i in sensors)
    asked = [
        index
        for index, h in enumerate(hypotheses)
        if h.kind == "aerodynamic"
        and h.effect != OFFSET
        and (h.effect in LINEAR or index in terms or h.id in added)
    ]
    search = _Search(tests, terms, freed, tuple(asked), at, size_of)
    return tuple(search.claims())


@dataclass(frozen=True)
class _Slope:
    """The regression of one hypothesis' estimates on one condition.

    index, condition : of what on what. on (g,) : flights that take part. slope; lever (g,) : its
    derivative by each estimate; scale : its variance is `scale` times the factor on the variances;
    factor, expected : that factor, as seen and as the noise inside the flights makes it; dof of the
    former. gain : fall of the whitened sum of squares.
    """

    index: int
    condition: str
    on: Mask
    slope: float
    lever: Array
    scale: float
    factor: float
    expected: float
    dof: int
    gain: float


@dataclass(frozen=True)
class _Tested:
    """Slopes with their p values; p (k,), standard_error (k,), systematic (k,), dof (k,)."""

    slopes: tuple[_Slope, ...]
    p: Array
    standard_error: Array
    systematic: Array
    dof: Array
    estimates: FlightEstimates

    def p_of(self, index: int, condition: str) -> float:
        """Return the p value of one pair; 1 where it is not tested."""
        pairs = zip(self.slopes, self.p, strict=True)
        return next(
            (float(p) for s, p in pairs if (s.index, s.condition) == (index, condition)), 1.0
        )


@dataclass(frozen=True)
class _Search:
    """What is looked for: hypotheses `asked`, over the conditions `at`, given terms and freed
    sensors."""

    tests: CrossFlightTests
    terms: tuple[int, ...]
    freed: tuple[int, ...]
    asked: tuple[int, ...]
    at: Mapping[str, Array]
    size_of: Callable[[Hypothesis], float | None]

    def claims(self) -> list[FlightDependence]:
        """Return what is significant, one after the other; each flight then has its own value of
        it, given which the others are tested."""
        claims: list[FlightDependence] = []
        loose: tuple[int, ...] = ()
        while len(claims) < _MOST:
            tested = self._tested(loose)
            if tested is None:
                break
            adjusted = holm(tested.p, len(tested.p))
            level = self.tests.settings.level
            significant = [
                k
                for k in np.flatnonzero(adjusted < level).tolist()
                if tested.slopes[k].index not in loose
            ]
            if not significant:
                break
            best = max(significant, key=lambda k: tested.slopes[k].gain)
            near = {tested.slopes[k].index for k in significant} - {tested.slopes[best].index}
            rivals = self._rivals(tested.slopes[best], near, loose)
            claims.append(self._claim(tested, best, float(adjusted[best]), rivals))
            loose = (*loose, tested.slopes[best].index)
        return claims

    def _tested(self, loose: tuple[int, ...]) -> _Tested | None:
        """All slopes where each flight has its own value of `loose` hypotheses."""
        terms = (*self.terms, *(i for i in loose if i not in self.terms))
        test = self.tests.tested(terms, self.freed, FEWEST, exact=terms)
        estimates = self.tests.flight_estimates(terms, self.freed, exact=terms)
        slopes = [
            slope
            for index in self.asked
            if test.testable[index]
            for name, values in self.at.items()
            if (slope := _slope(index, name, values, test, estimates)) is not None
        ]
        if not slopes:
            return None
        return _with_p(slopes, estimates, test.sigma, self.tests.settings)

    def _rivals(self, claim: _Slope, near: set[int], loose: tuple[int, ...]) -> tuple[int, ...]:
        """Hypotheses that change with the conditions too, given which the claim does not hold."""
        rivals = []
        for index in sorted(near):
            tested = self._tested((*loose, index))
            if (
                tested is not None
                and tested.p_of(claim.index, claim.condition) >= self.tests.settings.level
            ):
                rivals.append(index)
        return tuple(rivals)

    def _claim(
        self, tested: _Tested, k: int, p_adjusted: float, rivals: Sequence[int]
    ) -> FlightDependence:
        claim, names = tested.slopes[k], self.tests.campaign.hypotheses
        hypothesis, values = names[claim.index], self.at[claim.condition]
        half = float(
            np.hypot(stdtrit(tested.dof[k], 0.975) * tested.standard_error[k], tested.systematic[k])
        )
        also = tuple(
            other.condition
            for other, p in zip(tested.slopes, tested.p, strict=True)
            if other.index == claim.index
            and other.condition != claim.condition
            and p < self.tests.settings.level
            and other.factor < claim.factor * fdtri(other.dof, claim.dof, 0.95)
        )
        estimates = tuple(
            (
                float(values[g]),
                Vote(
                    self.tests.campaign.flights[g],
                    float(tested.estimates.estimate[g, claim.index]),
                    float(tested.estimates.information[g, claim.index] ** -0.5),
                ),
            )
            for g in np.flatnonzero(claim.on)
        )
        span = float(values[claim.on].min()), float(values[claim.on].max())
        size = self.size_of(hypothesis)
        level = None if size is None else size + float(np.mean([v.value for _, v in estimates]))
        relative = None if level is None or level == 0.0 else claim.slope / level
        named = tuple(
            [names[i].id for i in rivals] + [names[i].id for i in self._constant(tested, claim)]
        )
        ci95 = (claim.slope - half, claim.slope + half)
        return FlightDependence(
            hypothesis,
            claim.condition,
            claim.slope,
            ci95,
            relative,
            p_adjusted,
            span,
            also,
            named,
            estimates,
            _because(hypothesis, claim, ci95, relative, p_adjusted, span, also, named),
            _settled_by(hypothesis, claim.condition, span, also, named),
        )

    def _constant(self, tested: _Tested, claim: _Slope) -> list[int]:
        """Sensors a believable constant error of which would make the slope; one that these
        flights' own estimates of the sensor do not exclude."""
        (bias,) = tested.estimates.biases.at([claim.index])
        test: Tested = self.tests.tested(self.terms, self.freed)
        able = []
        for number, sensor in enumerate(self.tests.campaign.sensors):
            per_unit = float(claim.lever @ bias.sensor_bias[:, number])
            if sensor in self.freed or per_unit == 0.0:
                continue
            if may_be_off_by(self.tests, test, sensor, claim.slope / per_unit):
                able.append(sensor)
        return able


def _slope(
    index: int, condition: str, values: Array, test: Tested, estimates: FlightEstimates
) -> _Slope | None:
    """Weighted least squares over the flights that show the hypothesis; None where they do not
    tell."""
    on = test.included[:, index] & np.isfinite(values)
    if on.sum() < FEWEST:
        return None
    variance, estimate, z = (
        1.0 / estimates.information[on, index],
        estimates.estimate[on, index],
        values[on],
    )
    # what differs between flights for other reasons counts alike in all: half of the mean variance
    weight = 1.0 / (variance + variance.mean())
    middle = float(weight @ z) / float(weight.sum())
    apart = z - middle
    square = weight * apart**2
    spread = float(square.sum())
    if not spread > 0.0 or square.max() > _ONE_FLIGHT * spread:
        return None
    lever = weight * apart / spread
    slope = float(lever @ estimate)
    rest = estimate - float(weight @ estimate) / float(weight.sum()) - slope * apart
    dof = int(on.sum()) - 2
    kept = 1.0 - weight / weight.sum() - square / spread
    full = np.zeros(len(values))
    full[on] = lever
    return _Slope(
        index,
        condition,
        on,
        slope,
        full,
        1.0 / spread,
        float(weight @ rest**2) / dof,
        float((weight * variance) @ kept) / dof,
        dof,
        slope**2 * float(np.sum(apart**2 / variance)),
    )


def _with_p(
    slopes: Sequence[_Slope], estimates: FlightEstimates, sigma: Array, settings: TracingSettings
) -> _Tested:
    """p of "no more than the systematic bound" of each slope, as of a mean over flights
    (`aerodb.tracing.estimates`)."""
    factor, expected, dof, slope = (
        np.array([getattr(s, name) for s in slopes])
        for name in ("factor", "expected", "dof", "slope")
    )
    excess = max(1.0, float(np.median(factor / expected)))
    moderated = (settings.prior_dof * excess * expected + dof * factor) / (settings.prior_dof + dof)
    error = np.sqrt(moderated * np.array([s.scale for s in slopes]))
    indices = sorted({s.index for s in slopes})
    biases = dict(zip(indices, estimates.biases.at(indices), strict=True))
    sensors, noise = np.empty(len(slopes)), np.empty(len(slopes))
    for k, each in enumerate(slopes):
        bias = biases[each.index]
        common = each.lever[each.on] @ bias.sensor_bias[each.on]
        sensors[k] = settings.kappa * np.sqrt(np.square(common * sigma).sum())
        noise[k] = settings.shift_factor * float(each.lever[each.on] @ bias.simex_bias[each.on])
    counted = sensors + np.where(slope * noise > 0.0, np.abs(noise), 0.0)
    total = settings.prior_dof + dof
    size = np.abs(slope)
    p = stdtr(total, -(size - counted) / error) + stdtr(total, -(size + counted) / error)
    return _Tested(
        tuple(slopes), np.minimum(p, 1.0), error, sensors + np.abs(noise), total, estimates
    )


def _because(
    hypothesis: Hypothesis,
    claim: _Slope,
    ci95: tuple[float, float],
    relative: float | None,
    p: float,
    span: tuple[float, float],
    also: Sequence[str],
    rivals: Sequence[str],
) -> str:
    unit, factor, step = _shown(claim.condition)
    per = step / factor
    if relative is None:
        change = f"changes by {with_unit(claim.slope * per, hypothesis.unit, 2)}"
    else:
        verb = "falls" if relative < 0.0 else "grows"
        change = f"{verb} by {abs(relative) * per:.1%} of itself"
    by = f"{step:g} {unit}" if step != 1.0 else unit
    text = (
        f"{hypothesis.parameter} ({hypothesis.because}) {change} per {by} between flights"
        f" ({with_unit(claim.slope * per, hypothesis.unit)}, 95 %: {ci95[0] * per:.3g} to"
        f" {ci95[1] * per:.3g}; p = {p:.2g} over all pairs) from {span[0] * factor:.3g} to"
        f" {span[1] * factor:.3g} {unit}, {int(claim.on.sum())} flights"
    )
    if also:
        text += f"; {', '.join(also)} of these flights fits as well"
    if rivals:
        text += f"; {', '.join(rivals)} would explain it as well"
    return text


def _settled_by(
    hypothesis: Hypothesis,
    condition: str,
    span: tuple[float, float],
    also: Sequence[str],
    rivals: Sequence[str],
) -> str:
    """The flight that decides: both ends of the condition with the same sensors."""
    unit, factor, _ = _shown(condition)
    moved = ", ".join(hypothesis.drivers) or hypothesis.parameter
    text = (
        f"{hypothesis.id} over {condition}: one flight that excites {moved} at"
        f" {span[0] * factor:.3g} and at {span[1] * factor:.3g} {unit} shows the change with the"
        " same sensors"
    )
    if also:
        text += f"; with {', '.join(also)} held, it also tells {condition} from these"
    return text


def _shown(condition: str) -> tuple[str, float, float]:
    if condition in _SHOWN:
        return _SHOWN[condition]
    if condition.startswith("delta_"):
        return f"of {condition}", 1.0, 0.1
    return f"of {condition}", 1.0, 1.0
