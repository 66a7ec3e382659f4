"""Which parameters of the legs rolls on the ground contradict: the closed loop of rolls.

Each parameter is freed by itself beside the wind and the start of each roll. The one that explains
most enters, and the others are tested beside it, until none is left that differs from the database
at the rate of a difference (`DIFFERENCE`), corrected for all that are tested. It is confirmed, and
added, at the rate of a claim (`CLAIM`). Few rolls have few degrees of freedom to show a model that
is off by a little; at 5 % such a one was suspected. What explains the rolls as well is named with
it, the drag of the air among them: it is a constant of CX that slows a roll.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from statistics import NormalDist
from typing import Any, Final

import numpy as np

from aerodb.estimation import Fit
from aerodb.identification import Rolls, bounded_roll_fit, roll_fit
from aerodb.loop.accept import Accept
from aerodb.support import CLAIM, DIFFERENCE, HINT, likelihood_gain, standard_errors
from aerodb.tables import AeroDatabase, Parameter, Term, Variable, parse
from aerodb.tracing import Finding, NotFound, Verdict, Vote

#: Name of the drag of the air [-] that is tested beside the legs.
AIR_DRAG: Final = "drag_of_the_air"
_EFFECT: Final = "parameter"
#: Probability with which an effect of the detectable size is found, in standard errors beyond the
#: level: 80 %.
_POWER: Final = 0.84


@dataclass(frozen=True)
class RollSearch:
    """Findings of rolls, those that enter, what was not found, and the fit of all that entered.

    start : wind and start of each roll beside the database. taken : parameters of the legs that
    entered. without_value : name -> what rolls exclude of it.
    notes : sentences on what differs between flights.
    """

    findings: tuple[Finding, ...]
    added: tuple[Finding, ...]
    not_found: tuple[NotFound, ...]
    start: Mapping[str, float]
    taken: tuple[str, ...]
    fit: Fit | None
    rounds: int
    without_value: Mapping[str, str]
    notes: tuple[str, ...]


def with_air_drag(database: AeroDatabase) -> AeroDatabase:
    """Return the database with a drag of the air beside its own, dimensionless and zero, as a
    parameter; as it is, where its pressure is a constant and the drag would be friction."""
    if database.reference.pressure is not None:
        return database
    drag = Variable(parse("0"), "1", "drag of the air", parameter=Parameter((-1.0, 1.0)))
    term = Term(AIR_DRAG, "CX", parse(f"-{AIR_DRAG}"))
    return replace(
        database,
        variables={**database.variables, AIR_DRAG: drag},
        terms=(*database.terms, term),
    )


def search_rolls(
    function: Callable[..., Fit],
    rolls: Rolls,
    names: Sequence[str],
    database: AeroDatabase,
    accept: Accept,
) -> RollSearch:
    """Return which parameters of the legs (`names`) rolls contradict, in the parameters' units.

    function : a method that flies, with the keyword ``at_least`` of `output_error`. rolls : of
    `database`, which has the drag of the air (`with_air_drag`). accept : what enters
    although it is not confirmed.
    """
    return _Search(function, rolls, names, database, accept).run()


def without_added(search: RollSearch, reason: str) -> RollSearch:
    """Return a search of which nothing is added, for a reason that its findings then have."""
    findings = tuple(
        replace(each, verdict="suspected", reasons=(*each.reasons, reason))
        if each.verdict == "confirmed"
        else each
        for each in search.findings
    )
    return replace(search, findings=findings, added=(), taken=())


class _Search:
    """The state of a search: what was taken, and what was found."""

    def __init__(
        self,
        function: Callable[..., Fit],
        rolls: Rolls,
        names: Sequence[str],
        database: AeroDatabase,
        accept: Accept,
    ) -> None:
        self.function, self.rolls, self.database, self.accept = function, rolls, database, accept
        self.names = tuple(names)
        self.tested = (*names, *([AIR_DRAG] if AIR_DRAG in database.parameters else []))
        self.taken: tuple[str, ...] = ()
        self.findings: list[Finding] = []
        self.joint: Fit | None = None
        self.notes: dict[str, str] = {}
        self.votes: dict[tuple[Any, ...], tuple[Vote, ...]] = {}
        alone = roll_fit(function, rolls, (), database)
        self.start = _found(alone)

    def run(self) -> RollSearch:
        """Search until nothing is left that differs; see `search_rolls`."""
        rounds = 0
        while True:
            rounds += 1
            fits = self._fitted()
            found = self._best(fits)
            if found is None:
                break
            name, rivals = found
            finding = self._finding(name, fits[name], rivals)
            self.findings.append(finding)
            if name != AIR_DRAG and not self.accept.admits(finding):
                break
            self.taken, self.joint = (*self.taken, name), fits[name]
        standing = {each.parameter for each in self.findings}
        bounded = {n: self._bounded(n, fits[n]) for n in self.names if n not in standing}
        findings = tuple(self._beside_all(each) for each in self.findings)
        return RollSearch(
            findings,
            tuple(f for f in findings if f.parameter in self.taken and f.parameter != AIR_DRAG),
            tuple(self._not_found(n, fit) for n, fit in bounded.items()),
            self.start,
            tuple(n for n in self.taken if n != AIR_DRAG),
            self.joint,
            rounds,
            {n: fit[n].reason for n, fit in bounded.items() if np.isnan(fit[n].value)},
            tuple(self.notes.values()),
        )

    def _fitted(self) -> dict[str, Fit]:
        """The fit of each parameter that was not taken, beside those that were. One that creeps far
        below another is ended, and has not converged."""
        start = self.start if self.joint is None else _found(self.joint)
        fits, least = dict[str, Fit](), -np.inf
        for name in (each for each in self.tested if each not in self.taken):
            function = partial(self.function, at_least=least)
            fit = roll_fit(function, self.rolls, (*self.taken, name), self.database, start)
            least = max(least, fit.log_likelihood if fit.converged else least)
            fits[name] = fit
        return fits

    def _bounded(self, name: str, fit: Fit) -> Fit:
        names = (*self.taken, name)
        return bounded_roll_fit(self.function, self.rolls, fit, names, self.database, (name,))

    def _beside_all(self, finding: Finding) -> Finding:
        """A finding that was taken, with its size beside all others that were."""
        if self.joint is None or finding.parameter not in self.taken:
            return finding
        sized = self._sized(finding.parameter, self.joint)
        return replace(
            finding, value=sized.change, ci95=sized.ci95, votes=sized.votes, size=sized.words
        )

    def _best(self, fits: Mapping[str, Fit]) -> tuple[str, list[str]] | None:
        """The most likely of those that differ from the database, and what explains as much; None
        where none does."""
        differing = [n for n, fit in fits.items() if self._adjusted(n, fit) < DIFFERENCE]
        differing.sort(key=lambda n: -fits[n].log_likelihood)
        for name in differing:
            # A likelihood that is no parabola has no standard error.
            if np.isnan(self._bounded(name, fits[name])[name].value):
                continue
            # Flights that differ among themselves by as much tell of no error of the database.
            votes = self._votes(name, fits[name])
            if self._adjusted(name, fits[name], _scatter(votes)) >= DIFFERENCE:
                low, high = (f(v.value for v in votes) for f in (min, max))
                self.notes[name] = (
                    f"flights want {_words(name)} changed by {low:.3g} to {high:.3g}: they differ"
                    " among themselves more than from the database, as runways do"
                )
                continue
            # Residuals that are correlated in time count less than their number.
            each = fits[name][name]
            part = min(1.0, (each.cramer_rao / each.standard_error) ** 2)
            rivals = [
                other
                for other in differing
                if other != name
                and part * (fits[name].log_likelihood - fits[other].log_likelihood)
                < likelihood_gain(DIFFERENCE)
            ]
            return name, rivals
        return None

    def _adjusted(self, name: str, fit: Fit, wider: float = 1.0) -> float:
        """Probability of such an estimate if the database were right, times the number of tests."""
        each = fit[name]
        if not fit.converged or not each.standard_error > 0.0:
            return 1.0
        off = abs(each.value - self.database.parameters[name]) / (wider * each.standard_error)
        return min(1.0, 2.0 * NormalDist().cdf(-off) * len(self.tested))

    def _votes(self, name: str, fit: Fit) -> tuple[Vote, ...]:
        """The change that each flight wants, beside the values of the others."""
        held = {n: fit[n].value for n in self.taken if n != name}
        asked = (name, *sorted(held.items()))
        if asked not in self.votes:
            self.votes[asked] = self._voted(name, held, fit)
        return self.votes[asked]

    def _voted(self, name: str, held: Mapping[str, float], fit: Fit) -> tuple[Vote, ...]:
        # From what all rolls found: beside a database that is far off, a search may not end.
        start = _found(fit)
        votes = []
        for flight in dict.fromkeys(self.rolls.flights[r.name] for r in self.rolls.records):
            alone = self.rolls.of([flight])
            own = roll_fit(self.function, alone, (name,), self.database, start, held)
            each = own[name]
            if own.converged and each.standard_error > 0.0:
                change = each.value - self.database.parameters[name]
                votes.append(Vote(flight, change, each.standard_error))
        return tuple(votes)

    def _sized(self, name: str, fit: Fit) -> "_Sized":
        votes, value, before = (
            self._votes(name, fit),
            fit[name].value,
            self.database.parameters[name],
        )
        wider, change = _scatter(votes), value - before
        half = standard_errors(HINT) * wider * fit[name].standard_error
        words = f"{value:.4g} +- {half:.2g} ({len(votes)} flights)"
        return _Sized(change, (change - half, change + half), votes, wider, words)

    def _finding(self, name: str, fit: Fit, rivals: Sequence[str]) -> Finding:
        sized = self._sized(name, fit)
        adjusted = self._adjusted(name, fit, sized.wider)
        reasons = [f"of what is left of {len(self.rolls.records)} rolls, it explains most"]
        verdict: Verdict = "confirmed"
        if rivals:
            verdict = "alias_group"
            words = ", ".join(_words(other) for other in rivals)
            reasons.append(f"{words} explains them as well")
        elif name == AIR_DRAG:
            verdict = "suspected"
            reasons.append("it is no parameter of the legs: see the drag in flight")
        elif len(sized.votes) < 2:
            verdict = "suspected"
            reasons.append("only one flight shows it")
        elif adjusted > CLAIM:
            verdict = "suspected"
            reasons.append(f"chance alone makes it once in {1.0 / adjusted:.0f} such searches")
        return Finding(
            hypothesis=_id(name),
            effect=_EFFECT if name != AIR_DRAG else "zero_offset",
            axis=(),
            subject=name if name != AIR_DRAG else "",
            verdict=verdict,
            parameter=name,
            unit=self.database.variables[name].unit,
            value=sized.change,
            ci95=sized.ci95,
            p_adjusted=adjusted,
            votes=sized.votes,
            explanation_set=tuple(_id(own) for own in (name, *rivals)),
            what=f"{_words(name)} differs from the database's {self.database.parameters[name]:.4g}",
            size=sized.words,
            reasons=tuple(reasons),
        )

    def _not_found(self, name: str, fit: Fit) -> NotFound:
        each, before = fit[name], self.database.parameters[name]
        known = self.database.variables[name].parameter
        ends = (-np.inf, np.inf) if known is None else known.bounds
        sound = fit.converged and each.standard_error > 0.0
        level = DIFFERENCE / len(self.tested)
        return NotFound(
            hypothesis=_id(name),
            effect=_EFFECT,
            axis=(),
            subject=name,
            verdict="not_detected" if sound else "not_excited",
            parameter=name,
            unit=self.database.variables[name].unit,
            upper_bound=abs(each.value - before) + standard_errors(HINT) * each.standard_error
            if sound
            else None,
            minimum_detectable=(standard_errors(level) + _POWER) * each.standard_error
            if sound
            else None,
            believable=(ends[0] - before, ends[1] - before) if np.isfinite(ends).all() else None,
        )


@dataclass(frozen=True)
class _Sized:
    """The change of a parameter, with how much wider than its error the flights scatter."""

    change: float
    ci95: tuple[float, float]
    votes: tuple[Vote, ...]
    wider: float
    words: str


def _found(fit: Fit) -> dict[str, float]:
    return {each.name: each.value for each in fit.estimates if np.isfinite(each.value)}


def _id(name: str) -> str:
    return "zero_offset@CX" if name == AIR_DRAG else f"{_EFFECT}@all:{name}"


def _words(name: str) -> str:
    return "the drag of the air" if name == AIR_DRAG else name


def _scatter(votes: Sequence[Vote]) -> float:
    """How much wider than their standard errors the flights' estimates scatter; 1 at least."""
    if len(votes) < 2:
        return 1.0
    values, weights = (
        np.array([vote.value for vote in votes]),
        np.array([vote.se for vote in votes]) ** -2.0,
    )
    mean = float(weights @ values / weights.sum())
    return max(1.0, float(np.sqrt(weights @ (values - mean) ** 2 / (len(votes) - 1))))
