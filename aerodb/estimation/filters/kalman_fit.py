"""The answers of Kalman filters that carry the parameters as states."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from aerodb.estimation.dynamic_model import DynamicModel
from aerodb.estimation.filters.filter_fit import covariances
from aerodb.estimation.filters.filter_problem import Point
from aerodb.estimation.filters.scoring import SINGULAR, Optimum
from aerodb.estimation.fit import Fit, ParameterEstimate, Standing
from aerodb.estimation.standing import standings
from aerodb.estimation.time_history import TimeHistory, elapsed
from aerodb.estimation.whiteness import ljung_box
from aerodb.signals import theil
from aerodb.support import Array, half_interval

_LOST: Final = "the filter lost the motion: start closer, or state priors or bounds"
#: Probability of white innovations below which they are called coloured.
_COLOURED = 0.01
#: Correlation of one innovation with the next from which they are called coloured.
_CORRELATED = 0.2
_ASSUMES: Final = tuple(
    (
        "Turbulence acts as white noise on the rates of the states; measurement noise is white.",
        f"{parameters}, and the motion is close to linear within their uncertainty.",
    )
    for parameters in ("The parameters are constant", "Parameters walk as declared")
)
#: A record tells nothing of a parameter of which it leaves this share of the first deviation.
_NOTHING: Final = 0.95
_UNTOLD: Final = "the records do not move what it acts on: excite it, or fix it"


@dataclass(frozen=True, eq=False)
class FilteredRecord:
    """One record, filtered and smoothed: states (n, l) with covariances, innovations and their
    share of the expected size (n,)."""

    mean: Array
    covariance: Array
    predicted: Array
    innovations: Array
    sizes: Array
    log_likelihood: float


def constant(
    method: str,
    model: DynamicModel,
    records: Sequence[TimeHistory],
    noise: Point,
    mean: Array,
    covariance: Array,
    reached: Optimum | None,
    tracks: Sequence[FilteredRecord],
) -> Fit:
    """Return the answer where no parameter changes, values in SI units and covariance (f, f), with
    standard errors for innovations of the size and colour that they have; reached : the likelihood
    at the mean (f,), None where there is none."""
    unknown = model.parameters.unknown
    judged: Mapping[str, tuple[Standing, str]] = {
        item.name: ("diverged", _LOST) for item in unknown
    }
    if reached is not None:
        size = _size(tracks)
        f = len(unknown)
        white, coloured = (each[:f, :f] for each in covariances(reached.problem, reached))
        judged = standings(unknown, mean, reached.information[:f, :f], white, SINGULAR)
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.nan_to_num(np.diag(coloured) / np.diag(white), nan=1.0, posinf=1.0)
        covariance = covariance * max(1.0, size) * np.sqrt(np.outer(ratio, ratio))
    return _assembled(method, model, records, noise, mean, covariance, judged, tracks)


def walked(
    method: str,
    model: DynamicModel,
    records: Sequence[TimeHistory],
    noise: Point,
    tracks: Sequence[FilteredRecord],
    first: Array,
) -> Fit:
    """Return the answer where parameters walk: at the end of the last record, with their histories
    (n, 2) of value and standard deviation.

    first : (f,) standard deviations before the first sample.

    In SI units; where the filter lost the motion the estimates are NaN.
    """
    unknown, s = model.parameters.unknown, len(model.states)
    found = np.isfinite(sum(track.log_likelihood for track in tracks))
    growth = max(1.0, _size(tracks)) if found else 1.0
    mean, covariance = tracks[-1].mean[-1, s:], growth * tracks[-1].covariance[-1, s:, s:]
    judged: dict[str, tuple[Standing, str]] = {}
    for j, item in enumerate(unknown):
        if not found:
            judged[item.name] = ("diverged", _LOST)
        elif covariance[j, j] > (_NOTHING * first[j]) ** 2:
            standing: Standing = "not excited" if item.prior is None else "prior"
            judged[item.name] = (standing, _UNTOLD)
    fit = _assembled(method, model, records, noise, mean, covariance, judged, tracks)
    if not found:
        return fit
    histories, notes = dict[str, dict[str, Array]](), list[str]()
    for record, track in zip(records, tracks, strict=True):
        deviation = np.sqrt(growth * np.diagonal(track.covariance, axis1=1, axis2=2))
        histories[record.name] = {
            item.name: np.column_stack([track.mean[:, s + j], deviation[:, s + j]])
            for j, item in enumerate(unknown)
            if item.random_walk
        }
        notes += [
            f"{record.name}: {name} is {_told(history[0])} at the start,"
            f" {_told(history[len(history) // 2])} in the middle, {_told(history[-1])} at the end."
            for name, history in histories[record.name].items()
        ]
    return replace(fit, histories=histories, notes=(*fit.notes, *notes), assumes=_ASSUMES[True])


def _told(value: Array) -> str:
    """A value and half of its 95 % interval; value : with its standard error, (2,)."""
    return f"{value[0]:.4g} +- {half_interval(value[1]):.2g}"


def _size(tracks: Sequence[FilteredRecord]) -> float:
    """Mean square of the innovations, as a share of what the filter expects."""
    return float(np.nanmean(np.concatenate([track.sizes for track in tracks])))


def _assembled(
    method: str,
    model: DynamicModel,
    records: Sequence[TimeHistory],
    noise: Point,
    mean: Array,
    covariance: Array,
    judged: Mapping[str, tuple[Standing, str]],
    tracks: Sequence[FilteredRecord],
) -> Fit:
    """Estimates (f,) with covariance (f, f) and standings, and what the innovations show."""
    unknown = model.parameters.unknown
    lost = any(standing == "diverged" for standing, _ in judged.values())
    values = model.parameters.values(mean)
    deviation = np.sqrt(np.diag(covariance))
    number = {item.name: j for j, item in enumerate(unknown)}
    estimates = []
    for item in model.parameters.items:
        source, factor = item.tied or (item.name, 1.0)
        standing, reason = judged.get(source, ("estimated", ""))
        if source not in number:
            standing, reason = "fixed", "not estimated"
        value, error = float(values[item.name]), np.nan
        if standing in ("estimated", "prior"):
            error = abs(factor) * float(deviation[number[source]])
        elif standing not in ("fixed", "at bound"):
            value = np.nan
        if item.tied is not None and standing == "estimated":
            standing, reason = "tied", f"{factor:g} times {source}"
        estimates.append(ParameterEstimate(item.name, value, error, item.unit, standing, reason))
    pairs = list(zip(records, tracks, strict=True))
    residuals = {r.name: dict(zip(model.outputs, t.innovations.T, strict=True)) for r, t in pairs}
    notes = [f"There is no estimate: {_LOST}."] if lost else []
    tests, rows = {}, []
    for name in model.outputs:
        p_value, correlation = ljung_box([each[name] for each in residuals.values()])
        tests[f"white innovations of {name}"] = p_value
        if p_value < _COLOURED and abs(correlation) > _CORRELATED:
            rows.append(f"{name} ({correlation:.2f})")
    if rows and not lost:
        notes.append(
            f"The innovations of {', '.join(rows)} are correlated from sample to sample: the noise"
            " is not white as assumed. Standard errors count it, the estimates may be biased."
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
        assumes=_ASSUMES[False],
        notes=tuple(notes),
    )
