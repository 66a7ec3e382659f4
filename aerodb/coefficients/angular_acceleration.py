"""Angular accelerations of a flight: rates differentiated, or the logged ones where those are
better.

Logged angular accelerations come from accelerometers of their own, or somebody differentiated the
rates before they were logged: those hold the noise of the same rates, within a bandwidth that the
log does not state. The two are told apart by their difference. Errors of independent sensors add;
the difference of two derivatives of one record is smaller than the error of either.
"""

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from aerodb.conditioning import delay_between
from aerodb.flight import Flight
from aerodb.signals import bridge, low_passed, low_passed_rate, smooth
from aerodb.support import Array

RATES: Final = ("p", "q", "r")

#: Times the noise of both that differentiated and logged accelerations may differ (rms).
AGREE: Final = 2.0
#: Part of the noise of differentiated rates below which their difference from the logged ones shows
#: that these are the same record differentiated.
SAME: Final = 0.5
#: Bands in which the noise is looked at.
BANDS: Final = 6
#: Least part of the samples of logged accelerations that must be usable.
COMPLETE: Final = 0.99


@dataclass(frozen=True)
class ChosenAcceleration:
    """Angular accelerations that were chosen for a flight.

    source : ``differentiated`` or ``logged``. acceleration : (n, 3) [rad/s2], at the bandwidth.
    sigma : (3,), one standard deviation of its noise. because : the choice and its evidence, in a
    sentence; empty where nothing is logged.
    """

    source: Literal["differentiated", "logged"]
    acceleration: Array
    sigma: Array
    because: str


def choose_angular_accelerations(flight: Flight, bandwidth: float) -> ChosenAcceleration:
    """Return the angular accelerations with less noise, of rates that are all logged.

    Parameters
    ----------
    bandwidth : Hz, of both.

    The logged ones are chosen where all three are complete, agree with the rates within the noise
    of both, have an error of their own (that of another sensor), and less noise on every axis. A
    constant difference is their bias, and is removed.
    """
    step = flight.step
    rates = [smooth(flight[name], step, bandwidth) for name in RATES]
    own = ChosenAcceleration(
        "differentiated",
        np.column_stack([each.rate for each in rates]),
        np.array([each.rate_sigma for each in rates]),
        "",
    )
    names = [f"{name}dot" for name in RATES]
    absent = [name for name in names if name not in flight]
    if len(absent) == len(names):
        return own
    if absent:
        return _kept(own, f"{', '.join(absent)} not logged")
    poor = [name for name in names if np.mean(flight.usable([name])) < COMPLETE]
    if poor:
        return _kept(own, f"{', '.join(poor)} has gaps")
    logged = [smooth(flight[name], step, bandwidth) for name in names]
    sigma = np.array([each.noise * _share(bandwidth, step) for each in logged])
    bias = [
        float(np.mean(ours.value - rate.rate)) for ours, rate in zip(logged, rates, strict=True)
    ]
    for k, name in enumerate(names):
        apart = _rms(logged[k].value - bias[k] - rates[k].rate)
        noise = float(np.hypot(sigma[k], own.sigma[k]))
        if apart > AGREE * noise:
            what = (
                f"{name} differs from the rate differentiated by {apart:.2g} rad/s2 rms, of which"
                f" noise explains {noise:.2g}{_late(flight, name)}"
            )
            return _kept(own, what)
    for k, (name, rate) in enumerate(zip(names, RATES, strict=True)):
        apart_here = logged[k].value - rates[k].rate
        if _same_record(apart_here, flight[rate], rates[k].noise, step, bandwidth):
            return _kept(own, f"{name} is {rate} differentiated: it holds the noise of that rate")
    if np.any(sigma > own.sigma):
        noisy = names[int(np.argmax(sigma - own.sigma))]
        return _kept(own, f"{noisy} is noisier than the rate differentiated")
    less = float(np.max(sigma / own.sigma))
    return ChosenAcceleration(
        "logged",
        np.column_stack(
            [
                low_passed_rate(flight[name], step, bandwidth) - b
                for name, b in zip(names, bias, strict=True)
            ]
        ),
        sigma,
        f"angular accelerations: the logged ones at a bandwidth of {bandwidth:g} Hz, with at most"
        f" {less:.2g} times the noise of differentiated rates;"
        f" biases removed: {', '.join(f'{b:.2g}' for b in bias)} rad/s2",
    )


def _kept(own: ChosenAcceleration, reason: str) -> ChosenAcceleration:
    because = f"angular accelerations: rates differentiated, not the logged ones: {reason}"
    return ChosenAcceleration("differentiated", own.acceleration, own.sigma, because)


def _same_record(
    difference: Array, rate: Array, noise: float, step: float, bandwidth: float
) -> bool:
    """Return whether a logged acceleration holds the noise of a rate: in some band, its difference
    from the rate differentiated is smaller than the noise of the latter, which no other sensor's
    is.

    difference : (n,) [rad/s2]. rate : (n,) [rad/s] and its noise. The bands cover three quarters of
    `bandwidth` [Hz]: the log may end below it, and slow noise is little.
    """
    edges = bandwidth * np.linspace(0.25, 1.0, BANDS + 1)
    passed = [low_passed(difference, step, edge) for edge in edges]
    sigma = [smooth(rate, step, edge, noise).rate_sigma for edge in edges]
    return any(
        _rms(upper - lower) < SAME * np.sqrt(max(above**2 - below**2, 0.0))
        for lower, upper, below, above in zip(
            passed[:-1], passed[1:], sigma[:-1], sigma[1:], strict=True
        )
    )


def _share(bandwidth: float, step: float) -> float:
    """Noise of a low-passed record as a part of its white noise."""
    return float(np.sqrt(min(1.0, 2.0 * bandwidth * step)))


def _late(flight: Flight, name: str) -> str:
    """Say by how much a logged acceleration is late, where that is known and no chance."""
    from scipy.integrate import cumulative_simpson  # slow to import

    path = cumulative_simpson(bridge(flight[name]), dx=flight.step, initial=0.0)
    delay = delay_between(path, bridge(flight[name.removesuffix("dot")]), flight.step, name=name)
    if not delay.observable or abs(delay.seconds) <= AGREE * delay.standard_error:
        return ""
    return f"; it is {1e3 * abs(delay.seconds):.0f} ms {'late' if delay.seconds > 0 else 'early'}"


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
