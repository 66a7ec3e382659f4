"""Refit accepted terms beside the candidate that holds them: their gains, then their shapes.

Tracing whitened by a residual that still held the effect. Beside the candidate the noise is what
remains, and all terms stand together: their gains are estimated again. Then a gain may change from
node to node of a variable (`aerodb.effects.spline`), shrunk towards no change by a ridge that is
chosen on flights left out. Either change stays only if it predicts left-out flights better, flight
after flight: new gains better than the old ones, a finer shape better than the best gains. All of
it is algebra on normal equations: intercepts, and sensors with their priors, are eliminated as in
tracing.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from aerodb.effects import FlightView, Hypothesis, ramp_terms, spline_over, variables_of
from aerodb.support import Array
from aerodb.tracing.decision.findings import Finding, only_suspected
from aerodb.tracing.decision.functions import WORTH
from aerodb.tracing.decision.shapes import FEWEST_SHAPED
from aerodb.tracing.estimates import OFFSET, Campaign, campaign, paired_p
from aerodb.tracing.evidence import evidence_of, normal_equations_of
from aerodb.tracing.settings import TracingSettings

Folds = NDArray[np.intp]

#: Ridge on the change of the gain over one interval, in parts of the term's own information; the
#: last is as good as the template.
RIDGES: Final = (1e-4, 1e-3, 1e-2, 1e-1, 1.0)
#: Trace of ridge: a direction that no flight shows must not stop the others.
_TRACE: Final = 1e-9


@dataclass(frozen=True)
class Refined:
    """What enters in place of the templates.

    terms : all with increments; values (k,) and covariance (k, k). The first terms are the
    templates, whose values are corrections of those already in the candidate; the others are their
    ramps. variables : id of a template -> variables over which its shape was made finer; empty
    where only gains are new. fall : id -> share by which the whitened error that the best gains
    leave falls on flights that were left out.
    """

    terms: tuple[Hypothesis, ...]
    values: Array
    covariance: Array
    variables: dict[str, tuple[str, ...]]
    fall: dict[str, float]

    def beside(self, values: Array, covariance: Array) -> tuple[Array, Array]:
        """Return values (k,) and covariance (k, k) of all terms, added to what tracing gave the
        templates.

        values (t,), covariance (t, t) : of tracing. Where tracing is less sure than this fit, above
        all because of sensors, the difference is a gain common to a whole term; it is added there.

        Each value is in the unit of its term.
        """
        count = len(values)
        total, joint = self.values.copy(), self.covariance.copy()
        total[:count] += values
        for index in range(count):
            joint[index, index] += max(
                0.0, float(covariance[index, index] - self.covariance[index, index])
            )
        return total, joint


def downgraded_on_axes(findings: Sequence[Finding], axes: Collection[str]) -> tuple[Finding, ...]:
    """Return the findings of a later round; on `axes` they are suspected at most.

    axes : body axes on which a template's shape has been shown to be wrong. A finer shape follows
    nodes, not the truth: what it leaves is found again flight after flight, and looks like an
    effect.
    """
    but = (
        "on this axis an earlier term has another shape than its template, of which this may be the"
        " rest"
    )
    return tuple(
        (
            only_suspected(f, but)
            if f.verdict in ("confirmed", "alias_group") and set(f.axis) & set(axes)
            else f
        )
        for f in findings
    )


def refine(
    views: Sequence[FlightView],
    accepted: Sequence[Hypothesis],
    sensors: Sequence[Hypothesis],
    settings: TracingSettings,
) -> Refined | None:
    """Return new gains and finer shapes of the `accepted` terms, which the candidate holds already.

    views : of flights compared with the candidate. sensors : hypotheses that are in the model with
    their priors. Values (k,) and covariance (k, k) are in SI units. None where the result is not
    better, or flights are too few to tell.
    """
    if len(views) < FEWEST_SHAPED or not accepted:
        return None
    options: list[tuple[int, str, tuple[Hypothesis, ...]]] = []
    for index, hypothesis in enumerate(accepted):
        shaped = len(hypothesis.increment) == 1 and hypothesis.effect != OFFSET
        for variable in variables_of(hypothesis) if shaped else ():
            spline = spline_over(variable, hypothesis, views)
            if spline is not None:
                options.append((index, variable, ramp_terms(hypothesis, spline)))
    columns = [*accepted, *(ramp for _, _, ramps in options for ramp in ramps)]
    library = [*columns, *sensors]
    normal_equations = [normal_equations_of(evidence_of(view, library), settings) for view in views]
    of = [*range(len(accepted)), *(index for index, _, ramps in options for _ in ramps)]
    problem = _problem(campaign(normal_equations, library), of, settings)
    edges = np.cumsum([len(accepted), *(len(ramps) for _, _, ramps in options)]).tolist()
    groups = [tuple(range(start, stop)) for start, stop in pairwise(edges)]
    chosen = search(problem, groups, len(accepted), settings)
    if not chosen and not _better_gains(problem, len(accepted), settings):
        return None
    active = [*range(len(accepted)), *(i for each in chosen for i in groups[each.option])]
    values, covariance = problem.estimate(
        active, _ridge(problem, groups, chosen)[active], settings.prior_dof
    )
    variables: dict[str, tuple[str, ...]] = {}
    fall: dict[str, float] = {}
    for each in chosen:
        index, variable, _ = options[each.option]
        id = accepted[index].id
        variables[id] = (*variables.get(id, ()), variable)
        fall[id] = fall.get(id, 0.0) + each.fall
    return Refined(tuple(columns[i] for i in active), values, covariance, variables, fall)


@dataclass(frozen=True)
class ShapeProblem:
    """Whitened products, intercepts and sensors eliminated, of all flights or of folds of them.

    square (g, k, k), right (g, k), total (g,). Each column is scaled by the unit (k,) of its own
    template: scaled parameter = parameter * unit.
    """

    square: Array
    right: Array
    total: Array
    unit: Array

    def solved(self, folds: Folds, active: Sequence[int], ridge: Array) -> Array:
        """Return the values (k,) that these folds give; zero where not active. Dimensionless:
        scaled by `unit`; ridge (k,)."""
        solution = np.zeros(len(self.unit))
        square = self.square[folds].sum(axis=0)[np.ix_(active, active)]
        right = self.right[folds].sum(axis=0)[list(active)]
        solution[list(active)] = np.linalg.solve(
            square + np.diag(len(folds) * ridge[list(active)] + _TRACE), right
        )
        return solution

    def gain(self, fold: int, values: Array) -> float:
        """Return the fall of the sum of squares of a fold under these values (k,): a scalar in
        units of the whitened residual's square."""
        return float(2.0 * values @ self.right[fold] - values @ self.square[fold] @ values)

    def left_out(self, folds: Folds, active: Sequence[int], ridge: Array) -> Array:
        """Return the gain (f,) of each of the folds under the values that the others give, in units
        of the whitened residual's square."""
        return np.array(
            [
                self.gain(out, self.solved(folds[folds != out], active, ridge))
                for out in folds.tolist()
            ]
        )

    def estimate(
        self, active: Sequence[int], ridge: Array, prior_dof: float
    ) -> tuple[Array, Array]:
        """Return values (k,) and covariance (k, k) of the active columns in their own units.

        The covariance is that over flights (sandwich), moderated as in tracing by that of whitened
        noise.
        """
        index = list(active)
        count = len(self.total)
        square = self.square[:, index][:, :, index]
        inverse = np.linalg.inv(square.sum(axis=0) + np.diag(count * ridge + _TRACE))
        values = inverse @ self.right[:, index].sum(axis=0)
        score = self.right[:, index] - square @ values - ridge * values
        within = inverse @ square.sum(axis=0) @ inverse
        between = inverse @ (score.T @ score) @ inverse * (count / (count - 1.0))
        own = np.diagonal(within)
        shown = own > 0.0  # a constant of the axis is in no flight's changes
        ratios = np.diagonal(between)[shown] / own[shown]
        excess = max(1.0, float(np.median(ratios))) if len(ratios) else 1.0
        covariance = (prior_dof * excess * within + (count - 1.0) * between) / (
            prior_dof + count - 1.0
        )
        unit = self.unit[index]
        return values / unit, covariance / np.outer(unit, unit)


def _problem(flights: Campaign, of: Sequence[int], settings: TracingSettings) -> ShapeProblem:
    """The first columns of a campaign with its sensors eliminated.

    of : column -> index of its template among them.
    """
    k, sensors = len(of), list(flights.sensors)
    matrix, wanted = flights.products.matrix, [*range(k), -1]
    among = matrix[:, sensors][:, :, sensors] + np.diag(flights.precision[sensors])
    cross = matrix[:, sensors][:, :, wanted]
    left = matrix[:, wanted][:, :, wanted] - cross.transpose(0, 2, 1) @ np.linalg.solve(
        among, cross
    )
    # Each flight has a constant of its own: what a common one turns into on other axes is no
    # measure of it.
    constants = [i for i in flights.offsets if i < k]
    left[:, constants] = left[:, :, constants] = 0.0
    unit = flights.scale[list(of)]
    ratio = np.r_[flights.scale[:k] / unit, 1.0]
    left = left * np.outer(ratio, ratio)
    folds = np.array_split(np.arange(len(left)), min(len(left), settings.folds))
    joined = np.stack([left[fold].sum(axis=0) for fold in folds])
    return ShapeProblem(joined[:, :k, :k], joined[:, :k, k], joined[:, k, k], unit)


def _better_gains(problem: ShapeProblem, terms: int, settings: TracingSettings) -> bool:
    """Return whether the gains that the other folds give predict a fold better than those of the
    candidate.
    """
    folds = np.arange(len(problem.total))
    gains = problem.left_out(folds, range(terms), np.zeros(len(problem.unit)))
    return paired_p(gains, np.zeros(len(gains))) < settings.level


@dataclass(frozen=True)
class ChosenShape:
    """One option taken: its number, its ridge, and the share by which it lowers the remaining error
    of left-out flights.
    """

    option: int
    ridge: float
    fall: float


def _ridge(
    problem: ShapeProblem, groups: Sequence[tuple[int, ...]], chosen: Sequence[ChosenShape]
) -> Array:
    ridge = np.zeros(len(problem.unit))
    for each in chosen:
        ridge[list(groups[each.option])] = each.ridge
    return ridge


def search(
    problem: ShapeProblem, groups: Sequence[tuple[int, ...]], terms: int, settings: TracingSettings
) -> list[ChosenShape]:
    """Return options one after the other, the one that predicts left-out flights best first.

    Until none does so significantly. Fall is dimensionless, tested by Student's paired t
    (`paired_p`).
    """
    chosen: list[ChosenShape] = []
    folds = np.arange(len(problem.total))
    while len(chosen) < len(groups):
        active = [*range(terms), *(i for each in chosen for i in groups[each.option])]
        ridge = _ridge(problem, groups, chosen)
        before = problem.left_out(folds, active, ridge)
        best: ChosenShape | None = None
        for option in sorted(set(range(len(groups))) - {each.option for each in chosen}):
            wider = [*active, *groups[option]]
            after = _nested(problem, wider, groups[option], ridge)
            fall = float((after - before).sum() / (problem.total - before).sum())
            better = fall > WORTH and paired_p(after, before) < settings.level / len(groups)
            if better and (best is None or fall > best.fall):
                best = ChosenShape(
                    option, _best_ridge(problem, folds, wider, groups[option], ridge), fall
                )
        if best is None:
            break
        chosen.append(best)
    return chosen


def _nested(
    problem: ShapeProblem, active: Sequence[int], group: tuple[int, ...], ridge: Array
) -> Array:
    """Gain of each fold under values and a ridge that the others chose."""
    folds = np.arange(len(problem.total))
    gains = []
    for out in folds.tolist():
        others = folds[folds != out]
        chosen = _with(ridge, group, _best_ridge(problem, others, active, group, ridge))
        gains.append(problem.gain(out, problem.solved(others, active, chosen)))
    return np.array(gains)


def _best_ridge(
    problem: ShapeProblem, folds: Folds, active: Sequence[int], group: tuple[int, ...], ridge: Array
) -> float:
    return max(
        RIDGES,
        key=lambda weight: float(
            problem.left_out(folds, active, _with(ridge, group, weight)).sum()
        ),
    )


def _with(ridge: Array, group: tuple[int, ...], weight: float) -> Array:
    changed = ridge.copy()
    changed[list(group)] = weight
    return changed
