"""Kalman filters whose state is augmented by the parameters: extended and unscented, with a
fixed-interval smoother for the motion."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from aerodb.estimation.dynamic_model import DynamicModel
from aerodb.estimation.filters.filter_error import checked_states, likely_noise
from aerodb.estimation.filters.filter_kernels import predict
from aerodb.estimation.filters.filter_problem import Point
from aerodb.estimation.filters.kalman_fit import FilteredRecord, constant, walked
from aerodb.estimation.filters.linearisation import advanced_everywhere
from aerodb.estimation.filters.one_step import around
from aerodb.estimation.filters.scoring import SINGULAR, Optimum, scored
from aerodb.estimation.fit import Fit
from aerodb.estimation.parameters import Parameter, bounds_of
from aerodb.estimation.time_history import TimeHistory
from aerodb.support import Array

#: How a distribution is carried through the model: by derivatives, or by sigma points.
Transform = Literal["extended", "unscented"]
#: From states and parameters (n, l, k) to anything (n, m, k).
Law = Callable[[Array], Array]
#: Slopes, shifts and covariances of the rest.
Linear = tuple[Array, Array, Array]

#: Least standard deviation of a parameter without prior and bounds before the first sample.
_UNKNOWN = 1.0
#: Least variance that sigma points are spread with: without spread they have no slope.
_FLAT = 1e-14
#: Most passes about the smoothed motion.
_PASSES = 12
#: Change that ends the passes, as a share of a standard error.
_SMALL = 0.02
#: Most steps to the most likely parameters, each of at most one standard error.
_CORRECTIONS = 12
#: Shares of the process noise of constant parameters that are tried beside parameters that walk.
_LEFT = (1.0, 0.3, 0.1, 0.03, 0.0)


def extended_kalman(
    model: DynamicModel,
    records: Sequence[TimeHistory],
    *,
    process_noise: Sequence[str] | None = None,
) -> Fit:
    """Estimate parameters as states of an extended Kalman filter; see `unscented_kalman`.
    Jategaonkar, Flight Vehicle System Identification, 2015, chapter 7. Raises InputError for
    records of one name, lacking outputs and unknown states."""
    return _estimated("ekf", "extended", model, records, process_noise)


def unscented_kalman(
    model: DynamicModel,
    records: Sequence[TimeHistory],
    *,
    process_noise: Sequence[str] | None = None,
) -> Fit:
    """Estimate parameters as states of an unscented Kalman filter: constant, or walking at random
    where they say so (`Parameter.random_walk`).

    The first covariance is that of the priors; a parameter without one has the variance of a
    uniform distribution within its bounds, or a standard deviation of its start value and at least
    1. Process and measurement noise are those most likely by filter error. Records follow one
    another, each with its own motion.

    The motion is smoothed over its record (Bryson & Frazier), and the filter is run again
    about the smoothed motion and the parameters found, until these stay: a single pass trusts its
    first, poor linearisation. It begins where filter error found the noise. What it ends at is the
    most likely motion and parameters together, which in turbulence lies up to about one standard
    error from the most likely parameters; steps by the score of the likelihood of the innovations
    lead there. Standard errors grow with the innovations where these are larger than the filter
    expects.

    With parameters that walk, the estimates are those at the end of the last record, and their
    smoothed histories are given; the process noise is the share of that of constant parameters
    which makes the innovations most likely.

    Parameters
    ----------
    process_noise : the states that have process noise; None: all.

    References
    ----------
    Jategaonkar, Flight Vehicle System Identification, 2015, chapter 7.
    Julier & Uhlmann, Proceedings of the IEEE 92(3), 2004: sigma points.
    Bell, SIAM Journal on Optimization 4(3), 1994; Garcia-Fernandez, Svensson & Sarkka, IEEE
    Transactions on Automatic Control 62(4), 2017: passes about the smoothed motion.
    Bierman, Automatica 9(4), 1973: the smoother, which inverts no covariance of the state.
    """
    return _estimated("ukf", "unscented", model, records, process_noise)


def _estimated(
    method: str,
    transform: Transform,
    model: DynamicModel,
    records: Sequence[TimeHistory],
    process_noise: Sequence[str] | None,
) -> Fit:
    disturbed = checked_states(model, records, process_noise)
    likely = likely_noise(model, records, disturbed)
    unknown = model.parameters.unknown
    first = np.array([_first_deviation(item) for item in unknown])
    prior = np.array([item.value if item.prior is None else item.prior for item in unknown])
    if any(item.random_walk for item in unknown):
        given = (model, records, likely, prior, first, transform)
        tried = [_followed(*given, share) for share in _LEFT]
        noise, tracks = max(tried, key=lambda each: sum(t.log_likelihood for t in each[1]))
        return walked(method, model, records, noise, tracks, first)
    noise, tracks = _followed(model, records, likely, prior, first, transform)
    s, last = len(model.states), tracks[-1]
    mean, covariance = last.mean[-1, s:], last.covariance[-1, s:, s:]
    mean, reached = _most_likely(likely, mean, covariance, prior, first)
    return constant(method, model, records, noise, mean, covariance, reached, tracks)


def _followed(
    model: DynamicModel,
    records: Sequence[TimeHistory],
    likely: Optimum,
    mean: Array,
    deviation: Array,
    transform: Transform,
    share: float = 1.0,
) -> tuple[Point, list[FilteredRecord]]:
    """The records one after another, from parameters (f,), with a share of the likely process
    noise: constant parameters leave to it what the change of others explains."""
    noise = replace(likely.point, process=share * likely.point.process)
    covariance, tracks, s = np.diag(deviation**2), list[FilteredRecord](), len(model.states)
    for record, passed in zip(records, likely.passes, strict=True):
        states = passed.states[:, :, 0]
        about = np.hstack([states, np.tile(noise.vector, (len(states), 1))])
        track = _tracked(model, record, noise, mean, covariance, transform, about)
        tracks.append(track)
        mean, covariance = track.mean[-1, s:], track.covariance[-1, s:, s:]
    return noise, tracks


def _most_likely(
    likely: Optimum, mean: Array, covariance: Array, prior: Array, first: Array
) -> tuple[Array, Optimum | None]:
    """The parameters that are most likely whatever the motion, from those (f,) that are most likely
    together with one, by the score of the likelihood of the innovations; None for the likelihood
    there where they are not reached."""
    problem = replace(likely.problem, steady=False, along=())
    unknown = problem.model.parameters.unknown
    wide = np.array([each.prior is None for each in unknown], dtype=bool)
    lower, upper = bounds_of(unknown)
    deviation, f = np.sqrt(np.diag(covariance)), len(mean)
    mean = np.clip(mean, lower, upper)
    held = np.where(wide, first**-2.0, 0.0)
    for _ in range(_CORRECTIONS if np.isfinite(covariance).all() else 0):
        found, score = scored(problem, replace(likely.point, vector=mean))
        information = found.information[:f, :f] + np.diag(held)
        if not np.isfinite(information).all():
            break
        score = score - held * (mean - prior)
        go = ~(((mean <= lower) & (score < 0.0)) | ((mean >= upper) & (score > 0.0)))
        move = np.zeros(f)
        move[go] = np.linalg.lstsq(information[np.ix_(go, go)], score[go], rcond=SINGULAR)[0]
        size = float(np.max(np.abs(move) / deviation, initial=0.0))
        # beside a parameter at its bound the others may have a long way to go
        mean = np.clip(mean + (move / max(1.0, size) if go.all() else move), lower, upper)
        if size <= _SMALL:
            return mean, found
    return mean, None


def _first_deviation(item: Parameter) -> float:
    if item.prior_error is not None:
        return item.prior_error
    if np.isfinite(item.upper - item.lower):
        return float(item.upper - item.lower) / np.sqrt(12.0)
    return max(abs(item.value), _UNKNOWN)


def _linear(law: Law, centre: Array, spread: Array, transform: Transform) -> Linear:
    """``law(x) = A x + b + e`` about n distributions with means (n, l) and covariances (n, l, l): A
    (n, m, l), b (n, m) and the covariance of e (n, m, m).

    The extended form takes derivatives at the mean; the unscented one regresses on 2 l sigma points
    of equal weight.
    """
    n, size = centre.shape
    if transform == "extended":
        displaced, step = around(centre.T)
        values = law(np.moveaxis(displaced.reshape(size, 2 * size + 1, n), 2, 0))
        up, down = values[:, :, 1 : size + 1], values[:, :, size + 1 :]
        slope = (up - down) / (2.0 * step.T[:, None])
        rest = np.zeros((n, values.shape[1], values.shape[1]))
        return slope, values[:, :, 0] - (slope @ centre[:, :, None])[:, :, 0], rest
    flat, vectors = np.linalg.eigh(spread)
    steps = np.sqrt(np.maximum(flat, _FLAT) * size)[:, None]
    root = vectors * steps
    images = law(np.concatenate([centre[:, :, None] + root, centre[:, :, None] - root], axis=2))
    up, down = images[:, :, :size], images[:, :, size:]
    slope = ((up - down) / (2.0 * steps)) @ np.swapaxes(vectors, 1, 2)
    mean = images.mean(axis=2)
    bend = 0.5 * (up + down) - mean[:, :, None]
    shift = mean - (slope @ centre[:, :, None])[:, :, 0]
    return slope, shift, bend @ np.swapaxes(bend, 1, 2) / size


def _tracked(
    model: DynamicModel,
    record: TimeHistory,
    noise: Point,
    parameters: Array,
    uncertainty: Array,
    transform: Transform,
    about: Array,
) -> FilteredRecord:
    """Filter one record forwards, smooth it backwards, and repeat about the smoothed motion until
    the parameters stay; first about states with parameters (n, s + f)."""
    track = _passed(model, record, noise, parameters, uncertainty, "extended", about, None)
    for _ in range(_PASSES):
        if not np.isfinite(track.log_likelihood):
            break
        again = _passed(
            model, record, noise, parameters, uncertainty, transform, track.mean, track.covariance
        )
        if not np.isfinite(again.log_likelihood):
            break
        moved = np.abs(again.mean[-1] - track.mean[-1])
        small = bool(np.all(moved <= _SMALL * np.sqrt(np.diag(again.covariance[-1])) + 1e-12))
        track = again
        if small:
            break
    return track


def _passed(
    model: DynamicModel,
    record: TimeHistory,
    noise: Point,
    parameters: Array,
    uncertainty: Array,
    transform: Transform,
    about: Array,
    spread: Array | None,
) -> FilteredRecord:
    """One pass, linearised about states and parameters (n, s + f) with covariances.

    In the field's symbols: transition F, observation matrix H, innovation v with its
    covariance S, ``scores = H' S^-1 v``, ``informations = H' S^-1 H``, and ``I_KH = I - K H`` with
    the gain K. The adjoint and its matrix carry what later samples say back to earlier ones.
    """
    s, measured = len(model.states), record.stacked(model.outputs)
    n, size = about.shape
    walks = np.array([item.random_walk for item in model.parameters.unknown])
    random_walk = np.diag(walks**2 * record.step)
    if spread is None:
        spread = np.zeros((n, size, size))

    def start(part: Array) -> Array:
        state = model.initial_state(model.parameters.values(part[0]), record)
        return np.vstack([np.broadcast_to(state, (s, part.shape[2])), part[0]])[None]

    def both(whole: Array) -> Array:
        following, outputs = advanced_everywhere(model, record, whole[:, s:], whole[:, :s])
        return np.concatenate([following, whole[:, s:], outputs], axis=1)

    with np.errstate(all="ignore"):
        slope, shift, rest = (
            each[0] for each in _linear(start, about[-1:, s:], spread[-1:, s:, s:], transform)
        )
        mean, covariance = slope @ parameters + shift, slope @ uncertainty @ slope.T + rest
        slopes, shifts, rests = _linear(both, about, spread, transform)
        F, H = slopes[:, :size], slopes[:, size:]
        state_transition = np.ascontiguousarray(np.moveaxis(F[:, :s, :s], 0, -1))
        no_covariance, Q = np.zeros((s, s, n)), np.zeros((s, s, n))
        process = np.repeat(noise.process[:, None], n, axis=1)
        predict(state_transition, no_covariance, process, record.step, Q)
        means, covariances = np.empty((n, size)), np.empty((n, size, size))
        predicted, sizes, total = np.empty(measured.shape), np.full(n, np.nan), 0.0
        scores, informations = np.zeros((n, size)), np.zeros((n, size, size))
        I_KH = np.tile(np.eye(size), (n, 1, 1))
        for i in range(n):
            predicted[i] = H[i] @ mean + shifts[i, size:]
            seen = np.isfinite(measured[i])
            if seen.any():
                h = H[i, seen]
                R = (rests[i, size:, size:] + noise.measurement)[np.ix_(seen, seen)]
                S = h @ covariance @ h.T + R
                innovation = measured[i, seen] - predicted[i, seen]
                if not (np.isfinite(S).all() and np.isfinite(innovation).all()):
                    return _lost(means, covariances, measured, predicted, sizes)
                weighted = np.linalg.solve(S, np.column_stack([h, innovation]))
                scores[i], informations[i] = h.T @ weighted[:, -1], h.T @ weighted[:, :-1]
                squared = float(innovation @ weighted[:, -1])
                sizes[i] = squared / seen.sum()
                total -= 0.5 * (squared + np.linalg.slogdet(2.0 * np.pi * S)[1])
                mean = mean + covariance @ scores[i]
                I_KH[i] -= covariance @ informations[i]
                covariance = I_KH[i] @ covariance
                covariance = 0.5 * (covariance + covariance.T)
            means[i], covariances[i] = mean, covariance
            if not (np.isfinite(mean).all() and np.isfinite(covariance).all()):
                return _lost(means, covariances, measured, predicted, sizes)
            if i + 1 < n:
                mean = F[i] @ mean + shifts[i, :size]
                covariance = F[i] @ covariance @ F[i].T + rests[i, :size, :size]
                covariance[:s, :s] += Q[:, :, i]
                covariance[s:, s:] += random_walk
        adjoint, adjoint_matrix = np.zeros(size), np.zeros((size, size))
        for i in range(n - 1, -1, -1):
            means[i] += covariances[i] @ adjoint
            covariances[i] -= covariances[i] @ adjoint_matrix @ covariances[i]
            if i:
                filter_transition = I_KH[i] @ F[i - 1]
                adjoint = F[i - 1].T @ scores[i] + filter_transition.T @ adjoint
                adjoint_matrix = F[i - 1].T @ informations[i] @ F[i - 1] + (
                    filter_transition.T @ adjoint_matrix @ filter_transition
                )
    # constants have the estimate of the whole record at every sample
    constants = s + np.flatnonzero(walks == 0.0)
    rows, columns = np.ix_(constants, constants)
    means[:, constants] = mean[constants]
    covariances[:, rows, columns] = covariance[rows, columns]
    return FilteredRecord(means, covariances, predicted, measured - predicted, sizes, float(total))


def _lost(
    mean: Array, covariance: Array, measured: Array, predicted: Array, sizes: Array
) -> FilteredRecord:
    """The track of a filter that lost the motion."""
    return FilteredRecord(
        mean, covariance * np.nan, predicted, measured - predicted, sizes, -np.inf
    )
