"""Kalman filters whose state is augmented by the parameters: extended and unscented, with a
fixed-interval smoother for the motion."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Literal

import numpy as np

from aerodb.estimation.dynamic_model import DynamicModel
from aerodb.estimation.filter_error import checked_states, likely_noise
from aerodb.estimation.filter_kernels import predict
from aerodb.estimation.fit import Fit, ParameterEstimate, Standing
from aerodb.estimation.one_step import around, slopes, stepped
from aerodb.estimation.parameters import Parameter
from aerodb.estimation.scoring import Point
from aerodb.estimation.statistics import theil
from aerodb.estimation.time_history import TimeHistory, elapsed
from aerodb.estimation.whiteness import ljung_box
from aerodb.support import Array

#: How a distribution is carried through the model: by derivatives, or by sigma points.
Transform = Literal["extended", "unscented"]
#: From states and parameters (l, k) to anything (m, k).
Law = Callable[[Array], Array]

#: Least standard deviation of a parameter without prior and bounds before the first sample.
_UNKNOWN = 1.0
#: A parameter whose standard deviation falls by less than this share is not estimated, and two with
#: a greater correlation than this take each other's place.
_ADDED, _TIED = 0.05, 0.999
#: Least variance that sigma points are spread with; passes about the smoothed motion at most, and
#: the share of a standard error that ends them.
_FLAT, _PASSES, _SMALL = 1e-14, 12, 0.02
_COLOURED, _CORRELATED = 0.01, 0.2
_ASSUMES = (
    "Turbulence acts as white noise on the rates of the states; measurement noise is white.",
    "The parameters are constant, and the motion is close to linear within their uncertainty.",
    "What is most likely is motion and parameters together: in turbulence that lies up to about one"
    " standard error from the most likely parameters, which filter error gives.",
)


@dataclass(frozen=True, eq=False)
class _Track:
    """One record, filtered and smoothed: states (n, l) with covariances, innovations and their
    share of the expected size (n,)."""

    mean: Array
    covariance: Array
    predicted: Array
    innovations: Array
    sizes: Array
    log_likelihood: float


def extended_kalman(
    model: DynamicModel,
    records: Sequence[TimeHistory],
    *,
    process_noise: Sequence[str] | None = None,
) -> Fit:
    """Estimate parameters as states of an extended Kalman filter; see `unscented_kalman`."""
    return _estimated("ekf", "extended", model, records, process_noise)


def unscented_kalman(
    model: DynamicModel,
    records: Sequence[TimeHistory],
    *,
    process_noise: Sequence[str] | None = None,
) -> Fit:
    """Estimate parameters as constant states of an unscented Kalman filter.

    The first covariance is that of the priors; a parameter without one has the variance of a
    uniform distribution within its bounds, or a standard deviation of its start value and at least
    1. Process and measurement noise are those most likely by filter error. Records follow one
    another, each with its own motion.

    The motion is smoothed over its record (Rauch, Tung & Striebel), and the filter is run again
    about the smoothed motion and the parameters found, until these stay: a single pass trusts its
    first, poor linearisation. What it ends at is the most likely motion and parameters together.
    Standard errors grow with the innovations where these are larger than the filter expects.

    Parameters
    ----------
    process_noise : the states that have process noise; None: all.

    References
    ----------
    Jategaonkar, Flight Vehicle System Identification, 2015, chapter 7.
    Julier & Uhlmann, Proceedings of the IEEE 92(3), 2004: sigma points.
    Bell, SIAM Journal on Optimization 4(3), 1994; Garcia-Fernandez, Svensson & Sarkka, IEEE
    Transactions on Automatic Control 62(4), 2017: passes about the smoothed motion.
    Rauch, Tung & Striebel, AIAA Journal 3(8), 1965: the smoother.
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
    noise = likely_noise(model, records, disturbed)
    unknown = model.parameters.unknown
    first = np.array([_first_deviation(item) for item in unknown])
    mean = np.array([item.value if item.prior is None else item.prior for item in unknown])
    covariance = np.diag(first**2)
    tracks = []
    for record in records:
        track = _tracked(model, record, noise, mean, covariance, transform)
        tracks.append(track)
        s = len(model.states)
        mean, covariance = track.mean[-1, s:], track.covariance[-1, s:, s:]
    return _fit(method, model, records, noise, mean, covariance, first, tracks)


def _first_deviation(item: Parameter) -> float:
    if item.prior_error is not None:
        return item.prior_error
    if np.isfinite(item.upper - item.lower):
        return float(item.upper - item.lower) / np.sqrt(12.0)
    return max(abs(item.value), _UNKNOWN)


def _linear(law: Law, centre: Array, spread: Array, transform: Transform) -> tuple[Array, ...]:
    """``law(x) = A x + b + e`` about a distribution with mean (l,) and covariance (l, l): A (m, l),
    b (m,) and the covariance of e (m, m).

    The extended form takes derivatives at the mean; the unscented one regresses on 2 l sigma points
    of equal weight.
    """
    if transform == "extended":
        moved, size = around(centre[:, None])
        value, jacobian = slopes(law(moved), size)
        slope = jacobian[:, :, 0]
        return slope, value[:, 0] - slope @ centre, np.zeros((len(slope), len(slope)))
    values, vectors = np.linalg.eigh(spread)
    steps = np.sqrt(np.maximum(values, _FLAT) * len(centre))
    root = vectors * steps
    images = law(np.hstack([centre[:, None] + root, centre[:, None] - root]))
    up, down = images[:, : len(centre)], images[:, len(centre) :]
    slope = ((up - down) / (2.0 * steps)) @ vectors.T
    mean = images.mean(axis=1)
    bend = 0.5 * (up + down) - mean[:, None]
    return slope, mean - slope @ centre, bend @ bend.T / len(centre)


def _tracked(
    model: DynamicModel,
    record: TimeHistory,
    noise: Point,
    parameters: Array,
    uncertainty: Array,
    transform: Transform,
) -> _Track:
    """Filter one record forwards, smooth it backwards, and repeat about the smoothed motion until
    the parameters stay."""
    track = _passed(model, record, noise, parameters, uncertainty, transform, None)
    for _ in range(_PASSES):
        if not np.isfinite(track.log_likelihood):
            break
        again = _passed(model, record, noise, parameters, uncertainty, transform, track)
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
    about: _Track | None,
) -> _Track:
    """One pass, linearised about a track, or about what the filter knows at each sample."""
    s, measured = len(model.states), record.stacked(model.outputs)
    n, size = len(measured), s + len(parameters)
    still, added = np.zeros((s, s, 1)), np.zeros((s, s, 1))

    def own(part: Array) -> dict[str, Array]:
        return model.parameters.values(part)

    def start(part: Array) -> Array:
        state = model.initial_state(own(part), record)
        return np.vstack([np.broadcast_to(state, (s, part.shape[1])), part])

    def outputs(i: int, whole: Array) -> Array:
        return model.observed(own(whole[s:]), record, i, whole[:s])

    def after_step(i: int, whole: Array) -> Array:
        return np.vstack([stepped(model, own(whole[s:]), record, i, whole[:s]), whole[s:]])

    def centre(i: int) -> tuple[Array, Array]:
        return (mean, covariance) if about is None else (about.mean[i], about.covariance[i])

    middle = (parameters, uncertainty) if about is None else (
        about.mean[-1, s:], about.covariance[-1, s:, s:]
    )  # fmt: skip
    slope, shift, rest = _linear(start, *middle, transform)
    mean, covariance = slope @ parameters + shift, slope @ uncertainty @ slope.T + rest
    before, after = np.empty((2, n, size)), np.empty((2, n, size, size))
    steps, predicted = np.empty((n, size, size)), np.empty(measured.shape)
    sizes, total = np.full(n, np.nan), 0.0
    with np.errstate(all="ignore"):
        for i in range(n):
            before[0, i], after[0, i] = mean, covariance
            sight, shift, rest = _linear(
                partial(outputs, i),
                *centre(i),
                transform,
            )
            predicted[i] = sight @ mean + shift
            seen = np.isfinite(measured[i])
            if seen.any():
                c = sight[seen]
                variance = c @ covariance @ c.T + (rest + noise.measurement)[np.ix_(seen, seen)]
                gain = np.linalg.solve(variance, c @ covariance).T
                miss = measured[i, seen] - predicted[i, seen]
                weighted = float(miss @ np.linalg.solve(variance, miss))
                sizes[i] = weighted / seen.sum()
                total -= 0.5 * (weighted + np.linalg.slogdet(2.0 * np.pi * variance)[1])
                mean = mean + gain @ miss
                covariance = covariance - gain @ variance @ gain.T
                covariance = 0.5 * (covariance + covariance.T)
            before[1, i], after[1, i] = mean, covariance
            if not (np.isfinite(mean).all() and np.isfinite(covariance).all()):
                lost = after[1] * np.nan
                return _Track(before[1], lost, predicted, measured - predicted, sizes, -np.inf)
            if i + 1 < n:
                steps[i], shift, rest = _linear(partial(after_step, i), *centre(i), transform)
                mean = steps[i] @ mean + shift
                moved = np.ascontiguousarray(steps[i, :s, :s, None])
                predict(moved, still, noise.process[:, None], record.step, added)
                covariance = steps[i] @ covariance @ steps[i].T + rest
                covariance[:s, :s] += added[:, :, 0]
    smoothed, spreads = before[1].copy(), after[1].copy()
    for i in range(n - 2, -1, -1):
        cross = after[1, i] @ steps[i].T
        gain = np.linalg.lstsq(after[0, i + 1], cross.T, rcond=1e-14)[0].T
        smoothed[i] += gain @ (smoothed[i + 1] - before[0, i + 1])
        spreads[i] += gain @ (spreads[i + 1] - after[0, i + 1]) @ gain.T
    # constants have the estimate of the whole record at every sample
    smoothed[:, s:], spreads[:, s:, s:] = mean[s:], covariance[s:, s:]
    return _Track(smoothed, spreads, predicted, measured - predicted, sizes, float(total))


def _fit(
    method: str,
    model: DynamicModel,
    records: Sequence[TimeHistory],
    noise: Point,
    mean: Array,
    covariance: Array,
    first: Array,
    tracks: Sequence[_Track],
) -> Fit:
    """The answer, with standard errors for innovations of the size that they have."""
    unknown, lost = model.parameters.unknown, not np.isfinite(covariance).all()
    size = float(np.nanmean(np.concatenate([track.sizes for track in tracks]))) if not lost else 1.0
    covariance = covariance * max(1.0, size)
    values = model.parameters.values(mean)
    deviation = np.sqrt(np.diag(covariance))
    judged = {
        item.name: _standing(j, unknown, mean, covariance, first, lost)
        for j, item in enumerate(unknown)
    }
    number = {item.name: j for j, item in enumerate(unknown)}
    estimates = []
    for item in model.parameters.items:
        source, factor = item.tied or (item.name, 1.0)
        standing, reason = judged.get(source, ("fixed", "not estimated"))
        value, error = float(values[item.name]), np.nan
        if standing in ("estimated", "prior"):
            error = abs(factor) * float(deviation[number[source]])
        elif standing == "at bound":
            value = float(np.clip(value, item.lower, item.upper))
        elif standing != "fixed":
            value = np.nan
        if item.tied is not None and standing == "estimated":
            standing, reason = "tied", f"{factor:g} times {source}"
        estimates.append(ParameterEstimate(item.name, value, error, item.unit, standing, reason))
    pairs = list(zip(records, tracks, strict=True))
    residuals = {r.name: dict(zip(model.outputs, t.innovations.T, strict=True)) for r, t in pairs}
    notes = ["The filter lost the motion: state priors or bounds, or start closer."] if lost else []
    tests, rows = {}, []
    for name in model.outputs:
        p_value, correlation = ljung_box([each[name] for each in residuals.values()])
        tests[f"white innovations of {name}"] = p_value
        if p_value < _COLOURED and abs(correlation) > _CORRELATED:
            rows.append(f"{name} ({correlation:.2f})")
    if rows and not lost:
        notes.append(
            f"The innovations of {', '.join(rows)} are correlated from sample to sample: the noise"
            " is not white as assumed, and the standard errors are too small."
        )
    return Fit(
        method=method,
        estimates=tuple(estimates),
        names=tuple(number),
        covariance=covariance,
        residuals=residuals,
        fitted={r.name: dict(zip(model.outputs, t.predicted.T, strict=True)) for r, t in pairs},
        times=elapsed([record for record, _ in pairs]),
        noise=dict(zip(model.outputs, np.sqrt(np.diag(noise.measurement)).tolist(), strict=True)),
        theil={
            r.name: {
                name: theil(t.predicted[seen, j], r.outputs[name][seen])
                for j, name in enumerate(model.outputs)
                if (seen := np.isfinite(t.innovations[:, j])).any()
            }
            for r, t in pairs
        },
        converged=not lost,
        log_likelihood=float(sum(track.log_likelihood for track in tracks)),
        tests=tests,
        assumes=_ASSUMES,
        notes=tuple(notes),
    )


def _standing(
    j: int, unknown: Sequence[Parameter], mean: Array, covariance: Array, first: Array, lost: bool
) -> tuple[Standing, str]:
    item, deviation = unknown[j], np.sqrt(np.diag(covariance))
    if lost:
        return "diverged", "the filter lost the motion: state its prior, or start closer"
    with np.errstate(divide="ignore", invalid="ignore"):
        correlation = np.abs(covariance[j] / (deviation * deviation[j]))
    correlation[j] = 0.0
    if deviation[j] > (1.0 - _ADDED) * first[j]:
        if item.prior_error is not None:
            return "prior", "the data hardly reduce the prior's standard deviation"
        return "not excited", "no output changes with it: excite what it acts on, or fix it"
    if correlation.max(initial=0.0) > _TIED and item.prior_error is None:
        other = unknown[int(correlation.argmax())].name
        return "not identifiable", f"{other} can take its place: excite them apart, or fix one"
    if not item.lower < mean[j] < item.upper:
        return "at bound", "the filter moves it beyond its bound"
    return "estimated", ""
