"""Answers of several methods beside each other: do they agree, and which one to believe."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from aerodb.estimation import (
    FALSE_ALARMS,
    Fit,
    ParameterEstimate,
    coloured_innovations,
    dependent,
    output_or_filter_error,
)
from aerodb.identification.methods import METHODS

#: Methods agree where their estimates differ by no more than this many standard errors.
_AGREE: Final = 2.0
#: Least share of the estimates of a method with the standing ``estimated`` for it to be believed
#: before another one.
_STANDING: Final = 0.5
#: Least fit [%] of an output that a flown model follows.
_FOLLOWED: Final = 80.0
#: Fit [%] below which a method is believed with reservation.
_HALF_FOLLOWED: Final = 50.0


@dataclass(frozen=True)
class MethodAgreement:
    """One parameter by several methods.

    estimates : method -> estimate. spread : largest difference between two methods in standard
    errors; NaN with fewer than two. furthest : those two methods.
    """

    name: str
    estimates: Mapping[str, ParameterEstimate]
    spread: float
    furthest: tuple[str, str] | None

    @property
    def agree(self) -> bool:
        """Whether all methods agree within two standard errors (`spread`, dimensionless), or only
        one gives an estimate."""
        return not self.spread > _AGREE


@dataclass(frozen=True)
class MethodComparison:
    """Parameters by several methods, and which to believe.

    preferred : the method whose answer is the least doubtful; None where none gives any. believe :
    the same, or None where the innovations of a filter contradict what its answer rests on.
    reasons : why, in sentences. reserved : whether anything speaks against it.
    """

    parameters: tuple[MethodAgreement, ...]
    believe: str | None
    reasons: tuple[str, ...]
    reserved: bool = False
    preferred: str | None = None


def compare_methods(
    fits: Mapping[str, Sequence[Fit]], estimated: Collection[str] = ()
) -> MethodComparison:
    """Compare the fits of several methods, each method's fits over all axes.

    estimated : channels that no sensor measured but an estimator made, on board or afterwards.

    The difference of two estimates is measured by the root sum of squares of their standard errors:
    methods share the flights, so that this overstates the scatter of the difference where their
    errors are alike, and what disagrees by more than two does so in earnest. Spreads are
    dimensionless, in standard errors; see docs/method/estimation.md, section Which one to believe.
    """
    by_method = {
        method: {e.name: e for fit in each for e in fit.estimates} for method, each in fits.items()
    }
    names = dict.fromkeys(name for found in by_method.values() for name in found)
    parameters = tuple(
        _agreement(name, {m: found[name] for m, found in by_method.items() if name in found})
        for name in names
    )
    believe, reasons = _believe(fits)
    if believe is not None:
        believe, why = _beside_sensors(believe, fits, estimated)
        reasons += why
    preferred = believe
    reservations = reservations_of(believe or "", fits.get(believe or "", ()), estimated)
    if believe and METHODS[believe].disturbed and _coloured(fits[believe]):
        believe = None
    plain = fits.get("output-error", ())
    if preferred and METHODS[preferred].disturbed and not all(fit.converged for fit in plain):
        reservations += (
            "With reservation: without process noise the model does not follow the motion at all."
            " If the aircraft is stable, look for a wrong sign, unit or equation",
        )
    reasons += reservations
    apart = [each for each in parameters if not each.agree]
    if apart:
        worst = max(apart, key=lambda each: each.spread)
        pair = " and ".join(worst.furthest or ())
        reasons += (
            f"{len(apart)} of {len(parameters)} parameters differ by more than {_AGREE:g} standard"
            f" errors between methods, most {worst.name}, by {worst.spread:.1f} ({pair})",
        )
    return MethodComparison(parameters, believe, reasons, bool(reservations), preferred)


def _coloured(fits: Sequence[Fit]) -> dict[str, float]:
    return {
        name: value for fit in fits for name, value in coloured_innovations(fit.residuals).items()
    }


def _of_estimators(fits: Sequence[Fit], estimated: Collection[str]) -> list[str]:
    """The outputs of fits that an estimator made."""
    outputs = {name for fit in fits for record in fit.residuals.values() for name in record}
    return sorted(outputs.intersection(estimated))


def _beside_sensors(
    method: str, fits: Mapping[str, Sequence[Fit]], estimated: Collection[str]
) -> tuple[str, tuple[str, ...]]:
    """The method to prefer to one that fits an estimator's channels, and why: equation error, whose
    accelerations are measured, where it was tried and determines most of its parameters."""
    made = _of_estimators(fits[method], estimated) if METHODS[method].kind == "dynamic" else []
    other = next(
        (name for name in fits if METHODS[name].kind == "equation error" and _stands(fits[name])),
        None,
    )
    if not made or other is None:
        return method, ()
    own, others = (
        {e.name: e for fit in fits[name] for e in fit.estimates} for name in (method, other)
    )
    apart = [
        f"{name} {own[name].value:.3g} (standard error {own[name].standard_error:.2g}) by {method}"
        f" and {e.value:.3g} ({e.standard_error:.2g}) by {other}"
        for name, e in others.items()
        if name in own and _agreement(name, {method: own[name], other: e}).spread > _AGREE
    ]
    reasons = [
        f"{method} fits {' and '.join(made)}, which no sensor measured: errors of the estimator"
        f" count as motion. {other} takes the accelerations as measured"
    ]
    if apart:
        reasons.append(f"the two differ by more than their joint uncertainty: {'; '.join(apart)}")
    return other, tuple(reasons)


def reservations_of(
    method: str, fits: Sequence[Fit], estimated: Collection[str] = ()
) -> tuple[str, ...]:
    """Return what speaks against a method's answer, in sentences: outputs that no sensor measured
    (`estimated`), innovations of a filter that are not white, inputs of which its residuals still
    hold a response, estimates at bounds, and what the fits hold against themselves."""
    inputs = dict.fromkeys(each.input for fit in fits for each in dependent(fit.input_correlations))
    bound = [e.name for fit in fits for e in fit.estimates if e.standing == "at bound"]
    bound = [name for name in bound if not name.startswith("process_noise_")]
    found = [f"With reservation: {text}" for fit in fits for text in fit.reservations]
    if method and METHODS[method].kind == "dynamic" and (made := _of_estimators(fits, estimated)):
        found.append(
            f"With reservation: no sensor measured {' and '.join(made)}, and {method} takes the"
            " errors of its estimator for motion. Prefer regression on derived accelerations"
        )
    if method and METHODS[method].disturbed and (coloured := _coloured(fits)):
        rows = ", ".join(f"{name} ({value:.2f})" for name, value in coloured.items())
        found.append(
            f"With reservation: the innovations of {method} are not white (correlation from sample"
            f" to sample of {rows}; {FALSE_ALARMS:.0%} of right models are called so). Its"
            " estimates may be biased, and its standard errors are too small"
        )
    worst = _least_followed(fits)
    if worst is not None and worst[1] < _HALF_FOLLOWED:
        found.append(
            f"With reservation: {fits[0].method} follows {worst[0]} by {worst[1]:.0f} % only"
        )
    if inputs:
        found.append(
            f"With reservation: the residuals of {fits[0].method} still hold a response to"
            f" {', '.join(inputs)}, see its notes; more than noise or turbulence is missing"
        )
    if bound:
        found.append(
            f"With reservation: {', '.join(bound)} at a bound, which draws all other estimates;"
            " widen it unless it is known"
        )
    return tuple(found)


def _agreement(name: str, estimates: Mapping[str, ParameterEstimate]) -> MethodAgreement:
    usable = {m: e for m, e in estimates.items() if np.isfinite(e.value) and e.standard_error > 0}
    spread, furthest = float("nan"), None
    methods = list(usable)
    for i, one in enumerate(methods):
        for other in methods[i + 1 :]:
            a, b = usable[one], usable[other]
            distance = abs(a.value - b.value) / np.hypot(a.standard_error, b.standard_error)
            if not distance <= spread:
                spread, furthest = float(distance), (one, other)
    return MethodAgreement(name, estimates, spread, furthest)


def _believe(fits: Mapping[str, Sequence[Fit]]) -> tuple[str | None, tuple[str, ...]]:
    """The method to believe, and why: of those that converged with most of their parameters
    estimated, one that follows parameters which were declared to change, filter error where its
    likelihood ratio shows process noise, else one that flies the
    model and follows each output, because noise of the measured motion does not bias it; else the
    first."""
    reasons: list[str] = []
    standing: list[str] = []
    for method, each in fits.items():
        estimates = [e for fit in each for e in fit.estimates]
        good = _determined(each)
        if not all(fit.converged for fit in each):
            reasons.append(f"{method} did not converge")
        elif not _stands(each):
            reasons.append(f"{method} determines {good} of {len(estimates)} parameters")
        else:
            standing.append(method)
    if not standing:
        return None, (*reasons, "no method gives an answer to believe")
    following = [method for method in standing if any(fit.histories for fit in fits[method])]
    if following:
        reasons.append(f"{following[0]} follows the parameters that were declared to change")
        return following[0], tuple(reasons)
    if fits.get("output-error") and fits.get("filter-error"):
        turbulence = output_or_filter_error(fits["output-error"][0], fits["filter-error"][0])
        reasons.append(turbulence.reason)
        if turbulence.method in standing:
            return turbulence.method, tuple(reasons)
    for method in standing:
        if METHODS[method].kind == "dynamic":
            worst = _least_followed(fits[method])
            if worst is None or worst[1] >= _FOLLOWED:
                reasons.append(
                    f"{method} flies the model and follows every output: noise of the measured"
                    " motion does not bias it as it does equation error"
                )
                return method, tuple(reasons)
            reasons.append(f"{method} follows {worst[0]} by {worst[1]:.0f} % only")
    return standing[0], tuple(reasons)


def _determined(fits: Sequence[Fit]) -> int:
    known = ("estimated", "fixed", "tied", "prior")
    return sum(e.standing in known for fit in fits for e in fit.estimates)


def _stands(fits: Sequence[Fit]) -> bool:
    """Whether fits converged and determine at least half of their parameters."""
    count = sum(len(fit.estimates) for fit in fits)
    converged = all(fit.converged for fit in fits)
    return converged and count > 0 and _determined(fits) >= _STANDING * count


def _least_followed(fits: Sequence[Fit]) -> tuple[str, float] | None:
    """The output with the smallest median of Theil's fit over the records, and that fit [%], of
    those whose residuals are not white: where white noise is all that is left, such as of the
    heading of a roll along its centreline, no motion was there to follow."""
    found: dict[str, list[float]] = {}
    for fit in fits:
        fitted = {output for record in fit.residuals.values() for output in record}
        noisy = fitted - coloured_innovations(fit.residuals).keys()
        for outputs in fit.theil.values():
            for output, theil in outputs.items():
                if output not in noisy:
                    found.setdefault(output, []).append(theil.fit_percent)
    medians = {output: float(np.median(values)) for output, values in found.items()}
    return min(medians.items(), key=lambda item: item[1]) if medians else None
