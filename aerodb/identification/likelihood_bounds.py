"""Bounds of parameters that records do not determine, by the likelihood along each.

A standard error is that of a parabola at the best value. Where an effect is not excited, the
likelihood is no parabola: it stays flat far away from there, and the best value is that of the
noise. So the other unknowns are fitted again with the parameter two standard errors away. Where
that costs hardly any likelihood, or the standard error is a large part of the value, the parameter
has no estimate, only the values that 95 % of such records would not exclude.

References
----------
Murphy & van der Vaart, On profile likelihood, Journal of the American Statistical Association
95(450), 2000.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cache, partial
from typing import Any, Final

import numpy as np

from aerodb.estimation import Fit, Parameter, Parameters, TimeHistory

#: Standard errors over a value below which its likelihood is taken as a parabola: what is known
#: within 5 % hardly changes the motion across its interval.
_KNOWN: Final = 0.05
#: Standard errors over a value above which there is no estimate: the interval of two to either side
#: spans a factor of three.
_VAGUE: Final = 0.25
#: Loss of log-likelihood two standard errors away, below which there is no estimate: half of the
#: loss along a parabola, 2.
_FLAT: Final = 1.0
#: Loss of log-likelihood at the ends of an interval of 95 %: half of chi-squared of one degree of
#: freedom.
_EXCLUDED: Final = 1.92
#: First step towards an end where there is no standard error, over the way to the bound.
_FIRST: Final = 1.0 / 16.0
#: Distance from the best value within which an end is known, as a share of it: steps are doubled.
_WITHIN: Final = 0.5
#: Halvings at most of the interval in which an end is searched, where the first step is too far or
#: the bound is excluded.
_HALVINGS: Final = 2
#: Values that are tried where a parameter has no bounds, over the best one.
_FAR: Final = 10.0


def with_bounds(
    function: Callable[..., Fit], model: Any, records: Sequence[TimeHistory], fit: Fit,
    names: Sequence[str],
) -> Fit:  # fmt: skip
    """Return a fit in which parameters without an estimate say so, with the values that the
    records do not exclude, in the unit of each.

    The others have their answers with these held. Their standard errors hold what a value that is
    not excluded would change of them: a rolling friction that no record tells stands beside the
    brakes' in each.

    function : the method, of a model and records. model : a `DynamicModel` that is a dataclass.
    names : parameters that are examined.
    """
    if not fit.converged:
        return fit
    loose: dict[str, tuple[float, float]] = {}
    allowed: dict[str, list[Fit]] = {}
    estimates = {each.name: each for each in fit.estimates}
    for name in names:
        each = estimates[name]
        if each.standing not in ("estimated", "at bound"):
            continue
        item = model.parameters[name]
        possible = list[Fit]()
        loss = cache(partial(_loss, function, model, records, [fit], item, possible))
        error = each.standard_error
        if each.standing == "estimated":
            if error <= _KNOWN * abs(each.value):
                continue
            around = (each.value - 2.0 * error, each.value + 2.0 * error)
            if error <= _VAGUE * abs(each.value) and all(
                loss(end) > _FLAT for end in around if item.lower < end < item.upper
            ):
                continue
        ends = (_end(loss, each.value, bound, 2.0 * error) for bound in (item.lower, item.upper))
        loose[name] = (next(ends), next(ends))
        allowed[name] = possible
    if not loose:
        return fit
    values = {n: float(np.clip(model.parameters[n].value, *loose[n])) for n in loose}
    held = _held(model, _values(fit), values)
    again = function(held, records)
    if not again.converged:
        again = fit
    again = _with_spread(again, fit, allowed.values())
    return replace(
        again,
        estimates=tuple(
            replace(
                each,
                value=np.nan,
                standard_error=np.nan,
                standing="not excited",
                reason=_reason(model.parameters[each.name], *loose[each.name]),
            )
            if each.name in loose
            else each
            for each in again.estimates
        ),
    )


def _loss(
    function: Callable[..., Fit],
    model: Any,
    records: Sequence[TimeHistory],
    fits: list[Fit],
    item: Parameter,
    possible: list[Fit],
    value: float,
) -> float:
    """Log-likelihood lost where a parameter has this value and the others are fitted again. A fit
    that is not excluded is added to the possible ones.

    fits : the best one, then those with other values, to which this one is added. The search
    begins at the nearest of them, and goes along the ridge of the best one.
    """
    best = fits[0]
    nearest = min(fits, key=lambda each: abs(each[item.name].value - value))
    begun = _values(nearest)
    at = best.names.index(item.name)
    if best.covariance[at, at] > 0.0:
        along = best.covariance[at] / best.covariance[at, at]
        away = value - begun[item.name]
        for name, slope in zip(best.names, along.tolist(), strict=True):
            if name in begun and np.isfinite(slope):
                begun[name] += slope * away
    again = function(_held(model, begun, {item.name: value}), records)
    if not again.converged:
        return np.inf
    fits.append(again)
    lost = best.log_likelihood - again.log_likelihood
    if lost < _EXCLUDED:
        possible.append(again)
    return lost


def _with_spread(fit: Fit, joint: Fit, possible: Iterable[Sequence[Fit]]) -> Fit:
    """The fit with standard errors that hold what parameters without an estimate leave open.

    possible : of each, the fits that are not excluded: the farthest that an estimate lies from the
    fit is two standard errors more. Where there are none, the errors are those of the joint fit.
    """
    more = np.zeros(len(fit.names))
    for fits in possible:
        for k, name in enumerate(fit.names):
            if fits:
                far = max(abs(other[name].value - fit[name].value) for other in fits) / 2.0
            else:
                far = np.sqrt(
                    max(0.0, joint[name].standard_error ** 2 - fit[name].standard_error ** 2)
                )
            more[k] = np.hypot(more[k], np.nan_to_num(far))
    larger = dict(zip(fit.names, more.tolist(), strict=True))
    return replace(
        fit,
        estimates=tuple(
            replace(
                each,
                standard_error=float(np.hypot(each.standard_error, larger.get(each.name, 0.0))),
            )
            for each in fit.estimates
        ),
        covariance=fit.covariance + np.diag(more**2),
    )


def _values(fit: Fit) -> dict[str, float]:
    return {each.name: each.value for each in fit.estimates if np.isfinite(each.value)}


def _held(model: Any, begun: Mapping[str, float], values: Mapping[str, float]) -> Any:
    """The model with some parameters held, and the others beginning elsewhere."""
    found = {**begun, **values}
    return replace(
        model,
        parameters=Parameters(
            tuple(
                replace(
                    item,
                    value=float(np.clip(found.get(item.name, item.value), item.lower, item.upper)),
                    free=item.free and item.name not in values,
                )
                for item in model.parameters.items
            )
        ),
    )


def _end(loss: Callable[[float], float], best: float, bound: float, step: float) -> float:
    """The end of the interval towards a bound: the bound itself where it is not excluded.

    step : that is tried first; it is doubled until a value is excluded.
    """
    if best == bound:
        return bound
    if not np.isfinite(bound):
        bound = best + np.copysign(_FAR * abs(best), bound)
    way = bound - best
    share = step / abs(way) if step > 0.0 else _FIRST
    inside, outside = best, best + min(share, 1.0) * way
    while loss(outside) < _EXCLUDED:
        if share >= 1.0:
            return bound
        share *= 2.0
        inside, outside = outside, best + min(share, 1.0) * way
    for _ in range(_HALVINGS):
        if outside != bound and abs(outside - inside) <= _WITHIN * abs(outside - best):
            break
        middle = _between(inside, outside)
        inside, outside = (middle, outside) if loss(middle) < _EXCLUDED else (inside, middle)
    return outside


def _between(inside: float, outside: float) -> float:
    """The geometric mean of two values of one sign, else their mean."""
    if inside * outside > 0.0:
        return float(np.copysign(np.sqrt(inside * outside), inside))
    return 0.5 * (inside + outside)


def _reason(item: Parameter, low: float, high: float) -> str:
    ends = [
        f"{what} {end:.3g}"
        for what, end, bound in (("above", low, item.lower), ("below", high, item.upper))
        if end != bound
    ]
    known = f"only that it is {' and '.join(ends)} (95 %)" if ends else "nothing within its bounds"
    return f"these records tell {known}: excite what it acts on, or leave it out"
