"""Delay of a channel relative to its kinematics.

The kinematics of a channel are the integral of the rate that accelerations, angular rates, attitude
and gravity give for it. Both are band-passed alike, which removes biases (they integrate to ramps)
and noise. Standard errors for coloured residuals: Morelli & Klein, J. Aircraft 34(2), 1997.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aerodb.conditioning.channel_rates import KINEMATICS, with_accelerations
from aerodb.flight import Flight
from aerodb.signals import bridge, decimated, low_passed
from aerodb.support import HINT, Array, half_interval, standard_errors

#: Band of rigid-body motion [Hz], which manoeuvres and gusts excite: channels are compared there.
BAND = (0.1, 2.0)
#: Largest delay searched for by default [s]: longer ones are other manoeuvres.
LARGEST_DELAY = 0.5
#: Samples per period of the band's upper frequency after decimation.
SAMPLES_PER_PERIOD = 10.0
#: Least share of a channel's motion in the band that its kinematics must explain for a delay to be
#: accepted.
LEAST_EXPLAINED = 0.95
#: Largest deviation from one of a channel's scale relative to its kinematics. Beyond it, something
#: other than a delay is at work. A vane at a long boom is left with as much without a correction
#: (position errors: Gracey, NACA TN 4351, 1958).
SCALE_TOLERANCE = 0.15


@dataclass(frozen=True)
class Delay:
    """Delay of a channel.

    seconds : positive if the channel is late. standard_error : s, for coloured residuals. scale :
    measured over kinematic motion. explained : share (0..1) of the motion in the band that the
    kinematics explain. observable : whether `seconds` may be used; `because` says why not.
    """

    channel: str
    seconds: float
    standard_error: float
    scale: float
    explained: float
    observable: bool
    because: str


def delay_between(
    measured: Array,
    reference: Array,
    step: float,
    band: tuple[float, float] = BAND,
    largest: float = LARGEST_DELAY,
    name: str = "",
) -> Delay:
    """Estimate the delay of one signal behind another, to a fraction of a sample.

    Model: ``measured(t) = scale reference(t - delay) + slow drift + noise``, least squares in a
    band by Gauss-Newton, started from the best delay in whole samples.

    Parameters
    ----------
    measured, reference : (n,), units may differ; non-finite samples are interpolated linearly
    step : uniform sampling interval, s
    band : lower and upper frequency, Hz
    largest : largest delay searched for, s
    name : channel name in the result
    """
    upper = min(band[1], 0.45 / step)
    n = len(measured)
    if n * step < 2.0 / upper + 2 * largest:
        return _unobservable(
            name, f"the record of {n * step:.3g} s is too short to estimate a delay"
        )
    ours, theirs = (
        _band_passed(values, step, (band[0], upper)) for values in (measured, reference)
    )
    time = step * np.arange(n)
    edge = int(np.ceil((largest + 0.25 / upper) / step))
    inner = slice(edge, n - edge)
    if (
        min(
            np.ptp(ours[inner]) / (np.ptp(measured) or 1.0),
            np.ptp(theirs[inner]) / (np.ptp(reference) or 1.0),
        )
        < 1e-9
    ):
        return _unobservable(name, "nothing moves")
    from scipy.fft import irfft, next_fast_len, rfft  # slow to import, as below
    from scipy.interpolate import CubicSpline

    spline = CubicSpline(time, theirs)
    reach = round(largest / step)
    size = next_fast_len(n + reach, real=True)
    product = irfft(rfft(ours, size) * np.conj(rfft(theirs, size)), size)
    match = np.concatenate([product[size - reach :], product[: reach + 1]])  # lag -reach to reach
    delay = (int(np.argmax(match)) - reach) * step
    for _ in range(8):
        regressors = np.stack(
            [spline(time[inner] - delay), -spline(time[inner] - delay, 1)], axis=1
        )
        solution = np.linalg.lstsq(regressors, ours[inner])[0]
        change = float(solution[1] / solution[0]) if solution[0] else 0.0
        delay = float(np.clip(delay + np.clip(change, -step, step), -largest, largest))
        if abs(change) < 1e-5 * step:
            break
    scale = float(solution[0])
    shown = spline(time[inner] - delay)
    residual = ours[inner] - scale * shown
    explained = _explained(ours[inner], shown)
    sensitivity = np.stack([shown, -scale * spline(time[inner] - delay, 1)], axis=1)
    error = _coloured_error(sensitivity, residual, round(3.0 / (max(band[0], 0.02) * step)))
    return _judged(Delay(name, delay, error, scale, explained, True, ""), largest)


def _judged(delay: Delay, largest: float) -> Delay:
    reason = ""
    if delay.explained < LEAST_EXPLAINED or delay.scale < 0:
        sign = ", with the wrong sign" if delay.scale < 0 else ""
        reason = f"the kinematics explain only {100 * delay.explained:.0f} % of its motion{sign}"
    elif abs(delay.seconds) > 0.95 * largest:
        reason = f"the estimate lies at the limit of the search ({largest:g} s)"
    if not reason:
        return delay
    return replace(delay, standard_error=float("inf"), observable=False, because=reason)


def _unobservable(name: str, because: str) -> Delay:
    return Delay(name, 0.0, np.inf, 0.0, 0.0, False, because)


def _band_passed(values: Array, step: float, band: tuple[float, float]) -> Array:
    """Return `values` (n,) between two frequencies [Hz], zero phase.

    Anything slower than half a period per record is always removed.
    """
    record = bridge(values)
    slow = max(band[0], 1.0 / (len(record) * step))
    upper = low_passed(record, step, band[1])
    result: Array = upper - low_passed(upper, step, slow)
    return result


def _explained(measured: Array, reference: Array) -> float:
    total = float(measured @ measured) * float(reference @ reference)
    return (
        float(measured @ reference) * abs(float(measured @ reference)) / total if total > 0 else 0.0
    )


def _coloured_error(regressors: Array, residual: Array, longest: int) -> float:
    """Return the standard error of the last parameter for coloured residuals.

    From the autocorrelation of the residual up to `longest` samples.
    """
    from scipy.fft import irfft, next_fast_len, rfft

    n = len(residual)
    inverse = np.linalg.pinv(regressors.T @ regressors)
    lags = min(n - 1, max(10, min(n // 5, longest)))
    size = next_fast_len(n + lags, real=True)
    one, two, rest = (
        rfft(values, size) for values in (regressors[:, 0], regressors[:, 1], residual)
    )

    def together(a: NDArray[np.complex128], b: NDArray[np.complex128]) -> Array:
        """Sum over k of ``a[k + lag] b[k]`` for lags from zero on."""
        return np.asarray(irfft(a * b.conj(), size)[:lags])

    weight = together(rest, rest) / n
    weight *= 1.0 - np.arange(lags) / lags  # a taper keeps the sum positive
    middle = np.array([[weight @ together(a, b) for b in (one, two)] for a in (one, two)])
    middle += middle.T - weight[0] * regressors.T @ regressors
    return float(np.sqrt(max((inverse @ middle @ inverse)[1, 1], 0.0)))


def delays(flight: Flight, during: tuple[float, float] | None = None) -> tuple[Delay, ...]:
    """Return the delays of alpha, beta, V, phi, theta and psi, as far as the flight has them.

    alpha and beta must refer to the CG: on an uncorrected boom, the lever arm times q or r looks
    like a delay. They enter their own kinematics weakly; a second pass uses them with the delay
    removed. A channel whose inputs are missing, or that leads its kinematics beyond its error, is
    returned as not observable: no sensor is early.

    Parameters
    ----------
    during : start and end [s] of the part to use, such as the airborne part; None: all
    """
    channels, step = _prepared(flight, during, BAND[1])
    return tuple(
        _channel_delay(name, channels, step, BAND, LARGEST_DELAY)
        for name in KINEMATICS
        if name in flight
    )


def _prepared(
    flight: Flight, during: tuple[float, float] | None, upper: float
) -> tuple[dict[str, Array], float]:
    """Return the channels that kinematics need and their step [s].

    They are taken from part of the flight, decimated as a band up to `upper` [Hz] allows.
    """
    part = (
        slice(None)
        if during is None
        else slice(*(int(i) for i in np.searchsorted(flight.time, during)))
    )
    needed = {name for _, names in KINEMATICS.values() for name in names} | set(KINEMATICS) | {"ay"}
    channels = {
        name: values[part] for name, values in with_accelerations(flight).items() if name in needed
    }
    if "V" in channels:
        channels["V"] = np.maximum(
            channels["V"], 0.2 * np.max(channels["V"], initial=0.0)
        )  # avoid division by zero at rest
    return decimated(channels, flight.step, SAMPLES_PER_PERIOD * upper)


def _channel_delay(
    name: str, channels: Mapping[str, Array], step: float, band: tuple[float, float], largest: float
) -> Delay:
    """Return the delay of channel `name` (a key of KINEMATICS), as `delays` does.

    channels : name -> (n,) at `step` [s].
    """
    from scipy.integrate import cumulative_simpson
    from scipy.interpolate import CubicSpline

    rate, needed = KINEMATICS[name]
    lacking = [need for need in needed if need not in channels]
    if lacking:
        return _unobservable(name, f"{', '.join(lacking)} not in the flight")
    delay = _unobservable(name, "")
    inputs = dict(channels)
    clock = step * np.arange(len(channels[name]))
    before = np.zeros(0)
    for _ in range(2):
        path = cumulative_simpson(rate(inputs), dx=step, initial=0.0)
        if np.array_equal(path, before):  # the channel is not in its own kinematics
            break
        before = path
        delay = delay_between(channels[name], path, step, band, largest, name)
        if not delay.observable:
            break
        inputs[name] = CubicSpline(clock, channels[name])(
            np.clip(clock + delay.seconds, clock[0], clock[-1])
        )
    if delay.observable and abs(delay.scale - 1.0) > SCALE_TOLERANCE:
        because = (
            f"its motion is {delay.scale:.2f} times that of the kinematics: something other than a"
            " delay is at work"
        )
        return replace(delay, standard_error=float("inf"), observable=False, because=because)
    if delay.observable and delay.seconds < -standard_errors(HINT) * delay.standard_error:
        because = (
            f"it seems to lead the motion by {-1e3 * delay.seconds:.0f} +-"
            f" {1e3 * half_interval(delay.standard_error):.0f} ms, which no sensor does: check"
            " its time stamps, its position, and the clock of accelerations and rates"
        )
        return replace(delay, standard_error=float("inf"), observable=False, because=because)
    return delay
