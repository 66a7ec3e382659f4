"""Fisher scoring of the likelihood that a Kalman filter gives: parameters, process noise and
measurement noise together."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from aerodb.estimation.filters.filter_problem import STAYS, FilterProblem, Point, Slopes
from aerodb.estimation.filters.filtering import FilterPass
from aerodb.estimation.parameters import bounds_of, priors_of
from aerodb.support import Array

#: Difference of a parameter, in its own standard errors.
_DIFFERENCE = 0.01
#: Difference before the standard errors are known, as a share of the parameter's value.
_FIRST = 1e-4
#: Least value that the first difference is a share of.
_LEAST = 1e-2
#: Difference of a noise, as a share of it.
_NOISE_DIFFERENCE = 1e-4
#: Directions in which the information, scaled to a unit diagonal, is below this are not moved.
SINGULAR = 1e-10
#: The search ends where no step is expected to gain more log-likelihood.
_NO_GAIN = 1e-3
#: Information added for the step to each logarithm of a noise, so that it moves little where the
#: likelihood is flat, as it is where a noise vanishes: this at first and at most.
_RIDGE = 1.0
#: Least information that is added.
_LEAST_RIDGE = 1e-3
#: Factor by which it falls and rises as steps succeed or fail.
_RIDGE_FACTOR = 3.0
#: Share of the gain that the undamped step promises, beyond which a step succeeds.
_GOOD = 0.3
#: Largest change of the logarithm of a noise in one step.
_FARTHEST = 1.5
#: Damping of the steps that are tried side by side, as a share of the scaled information.
_DAMPINGS = (1e-4, 1e-3, 1e-2, 0.1, 1.0, 10.0, 100.0, 1e4)
#: Shares of the undamped step that are tried too.
_SHARES = (1.0, 0.5, 0.2, 0.05)
#: Shares of a step that are tried where the motion that it leads to makes the record less likely.
_SHORTER = (1.0, 0.3, 0.1, 0.03, 0.01)
#: Times that the motion is renewed after a climb.
_RENEWALS = 12
#: Least curvature of steps that count it beyond the information, of which it is a share.
_FLATTEST = (1e-3, 0.03, 0.3)


@dataclass(frozen=True, eq=False)
class Optimum:
    """Where the search ended.

    problem : linearised there.
    information : (u, u) of parameters, process noise and measurement noise, with priors.
    log_likelihood : without priors. converged : at an optimum. iterations : steps taken.
    """

    problem: FilterProblem
    point: Point
    log_likelihood: float
    information: Array
    slopes: tuple[Slopes, ...]
    passes: tuple[FilterPass, ...]
    converged: bool
    iterations: int


def maximise(
    problem: FilterProblem, start: Point, most_iterations: int, enough: float = _NO_GAIN
) -> Optimum:
    """Climb the likelihood from `start`.

    A model that is not linear is linearised along the motion that the filter sees, and climbed;
    then the motion is renewed, until the likelihood stays.

    At a point with vector (f,), process (s,) and measurement (o, o), in SI units. Where the
    likelihood is not finite, the search ends without having converged.
    """
    problem = problem.settled(start)
    found = _climbed(problem, start, most_iterations, enough)
    if not problem.along:
        return found
    before = float(problem.likelihood(start, problem.unmoved)[0])
    iterations = found.iterations
    for _ in range(_RENEWALS):
        reached = float(found.problem.likelihood(found.point, found.problem.unmoved)[0])
        if found.converged and reached - before < max(STAYS, enough):
            break
        taken = _taken(found, start, before)
        if taken is None:
            break
        problem, start, before = taken
        found = _climbed(problem, start, max(1, most_iterations - iterations), enough)
        iterations += found.iterations
    return replace(found, iterations=iterations)


def scored(problem: FilterProblem, point: Point) -> tuple[Optimum, Array]:
    """Return a point as if a search had ended there, and the gradient (f,) of the log-likelihood
    with priors by the parameters, in one over the unit of each parameter; a likelihood that is not
    finite counts as not converged."""
    problem = problem.settled(point)
    steps = _steps(problem, point, np.zeros(0))
    pairs = [problem.slopes(record, point, steps) for record in problem.records]
    slopes, passes = tuple(pair[0] for pair in pairs), tuple(pair[1] for pair in pairs)
    now = float(sum(passed.log_likelihood[0] for passed in passes))
    information, gradient = _equations(problem, point, slopes, len(steps))
    found = Optimum(problem, point, now, information, slopes, passes, np.isfinite(now), 0)
    return found, gradient[: len(point.vector)]


def _taken(
    found: Optimum, start: Point, before: float
) -> tuple[FilterProblem, Point, float] | None:
    """The optimum linearised along its own motion, with its likelihood; on the way back to `start`
    where it is less likely there than `before`. None where nothing is more likely."""
    for share in _SHORTER:
        trial = _between(start, found.point, share)
        renewed = found.problem.settled(trial)
        now = float(renewed.likelihood(trial, renewed.unmoved)[0])
        if now > before:
            return renewed, trial, now
    return None


def _between(start: Point, end: Point, share: float) -> Point:
    """A share of the way from one point to another."""
    with np.errstate(divide="ignore", invalid="ignore"):
        change = share * np.log(end.process / start.process)
    process = np.where(start.process > 0.0, start.process * np.exp(change), end.process)
    return Point(
        start.vector + share * (end.vector - start.vector),
        process,
        start.measurement + share * (end.measurement - start.measurement),
    )


def _climbed(problem: FilterProblem, point: Point, most_iterations: int, enough: float) -> Optimum:
    """Climb the likelihood of a linear model, or of one linearised along a motion.

    Every iteration solves the normal equations with Fisher's information, and with what the
    gradients tell of the curvature beyond it, and tries several damped steps side by side, as lanes
    of one pass; the best is taken.

    References
    ----------
    Dennis, Gay & Welsch, ACM Transactions on Mathematical Software 7(3), 1981: the curvature beyond
    the information by secants.
    """
    f, alone = len(point.vector), np.zeros(0)
    iteration, converged = 0, False
    information, ridge = np.zeros((0, 0)), _RIDGE
    beyond, last = np.zeros((1, 1)), None
    while True:
        steps = _steps(problem, point, alone)
        pairs = [problem.slopes(record, point, steps) for record in problem.records]
        slopes, passes = tuple(pair[0] for pair in pairs), tuple(pair[1] for pair in pairs)
        now = float(sum(passed.log_likelihood[0] for passed in passes))
        information, gradient = _equations(problem, point, slopes, len(steps))
        if not (np.isfinite(now) and np.isfinite(information).all()):
            break
        if last is not None:
            beyond = _secant(beyond, information, last[0], last[1] - gradient)
        alone = np.diag(information)[:f]
        moves, expected = _moves(problem, point, information, beyond, gradient, ridge)
        if expected < enough:
            converged = True
            break
        if iteration == most_iterations:
            break
        iteration += 1
        reached = problem.likelihood(point, moves)
        best = int(np.argmax(reached))
        gain = reached[best] - (now - float(problem.penalty(point.vector[:, None])[0]))
        if not gain > 0.0:
            converged = expected < 100.0 * _NO_GAIN
            break
        good = gain > _GOOD * expected
        ridge = (
            max(_LEAST_RIDGE, ridge / _RIDGE_FACTOR) if good else min(_RIDGE, ridge * _RIDGE_FACTOR)
        )
        last = moves[:, best], gradient
        point = problem.moved(point, moves[:, best])
    return Optimum(problem, point, now, information, slopes, passes, converged, iteration)


def _secant(beyond: Array, information: Array, move: Array, change: Array) -> Array:
    """Curvature (u, u) beyond the information, by what a move (u,) changed of the gradient (u,):
    before minus after."""
    beyond = np.broadcast_to(beyond, information.shape)
    missing, along = change - information @ move, float(change @ move)
    if not along > 0.0:
        return np.zeros_like(information)
    bent = float(move @ beyond @ move)
    if bent != 0.0:
        beyond = min(abs(float(move @ missing) / bent), 1.0) * beyond
    rest = missing - beyond @ move
    cross = np.outer(rest, change) / along
    return np.asarray(
        beyond + cross + cross.T - (float(rest @ move) / along**2) * np.outer(change, change)
    )


def _steps(problem: FilterProblem, point: Point, alone: Array) -> Array:
    """Differences (u,), inside the bounds; alone (f,) is the information of each parameter alone,
    empty before it is known."""
    steps = _FIRST * np.maximum(np.abs(point.vector), _LEAST)
    if len(alone):
        with np.errstate(divide="ignore"):
            own = np.where(alone > 0.0, _DIFFERENCE / np.sqrt(alone), np.inf)
        steps = np.minimum(own, 100.0 * steps)
    upper = bounds_of(problem.model.parameters.unknown)[1]
    steps = np.where(point.vector + steps > upper, -steps, steps)
    noise = np.full(len(problem.disturbed) + problem.noises, _NOISE_DIFFERENCE)
    return np.concatenate([steps, noise])


def _equations(
    problem: FilterProblem, point: Point, slopes: Sequence[Slopes], size: int
) -> tuple[Array, Array]:
    """Information (u, u) and gradient (u,) of the log-likelihood with priors."""
    information, gradient = np.zeros((size, size)), np.zeros(size)
    for part in slopes:
        at, w = part.columns, part.innovations.reshape(-1)
        mean = part.mean.reshape(len(w), -1)
        variance = part.variance.reshape(len(w), -1)
        information[np.ix_(at, at)] += mean.T @ mean + 0.5 * variance.T @ variance
        gradient[at] += 0.5 * (w**2 - (w != 0.0)) @ variance - w @ mean
    prior, error = priors_of(problem.model.parameters.unknown)
    f = len(prior)
    information[:f, :f] += np.diag(error**-2.0)
    gradient[:f] -= (point.vector - prior) / error**2
    return information, gradient


def _moves(
    problem: FilterProblem,
    point: Point,
    information: Array,
    beyond: Array,
    gradient: Array,
    ridge: float,
) -> tuple[Array, float]:
    """Moves (u, k) to try, and the gain that the undamped one of Fisher's information promises."""
    f = len(point.vector)
    lower, upper = bounds_of(problem.model.parameters.unknown)
    go = np.ones(len(gradient), dtype=bool)
    go[:f] = ~(
        ((point.vector <= lower) & (gradient[:f] < 0))
        | ((point.vector >= upper) & (gradient[:f] > 0))
    )
    if not problem.full:
        least = np.diag(point.measurement) <= (1.0 + 1e-9) * problem.least
        go[len(go) - problem.noises :] = ~(least & (gradient[len(go) - problem.noises :] < 0))
    information = information + np.diag(np.where(np.arange(len(gradient)) < f, 0.0, ridge))
    size = np.sqrt(np.diag(information))
    live = np.flatnonzero(go & (size > 0.0))
    scale = size[live]
    values, vectors = np.linalg.eigh(information[np.ix_(live, live)] / np.outer(scale, scale))
    along = vectors.T @ (gradient[live] / scale)
    keep = values > SINGULAR * values.max(initial=0.0)
    expected = 0.5 * float((along[keep] ** 2 / values[keep]).sum())
    with np.errstate(divide="ignore", invalid="ignore"):
        newton = np.where(keep, along / values, 0.0)
    scaled = [share * newton for share in _SHARES]
    scaled += [along / (values + damping) for damping in _DAMPINGS]
    trials = [vectors @ move for move in scaled]
    if beyond.any():
        curved = (information + beyond)[np.ix_(live, live)] / np.outer(scale, scale)
        values, vectors = np.linalg.eigh(curved)
        along = vectors.T @ (gradient[live] / scale)
        trials += [vectors @ (along / np.maximum(np.abs(values), least)) for least in _FLATTEST]
    moves = np.zeros((len(gradient), len(trials) + 2))
    for number, trial in enumerate(trials):
        moves[live, number] = trial / scale
    moves[f:] /= np.maximum(1.0, np.abs(moves[f:]).max(axis=0) / _FARTHEST)
    moves[:f] = np.clip(moves[:f] + point.vector[:, None], lower[:, None], upper[:, None])
    moves[:f] -= point.vector[:, None]
    moves[:f, -2], moves[f:, -1] = moves[:f, 0], moves[f:, 0]
    return moves, expected
