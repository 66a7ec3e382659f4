"""Effects with memory: a state model turns a flight into a channel, here how far the flow is
attached, which terms then use.

`predict` stays stateless. Along a flight the channel is integrated from its first sample on
(`StateModel.along`); where nobody gives it, it has the value at which it would settle
(`StateModel.settled`). One is attached flow, zero separated.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np

from aerodb.conditioning import FEWEST_SAMPLES, smooth
from aerodb.errors import InputError
from aerodb.support import Array
from aerodb.tables.expression import Expression, check_identifier, number, parse
from aerodb.tables.functions import Value


def _finite(where: str, **values: float) -> None:
    for name, value in values.items():
        if not np.isfinite(value):
            raise InputError(f"{name} is {value}", where, "give a finite number")


def _not_negative(where: str, **values: float) -> None:
    _finite(where, **values)
    for name, value in values.items():
        if value < 0:
            raise InputError(f"{name} is {value:g}", where, "it must not be negative")


@dataclass(frozen=True)
class Kirchhoff:
    """Attached flow falls over a smooth step, late in angle of attack, and if asked relaxes to it:

    ``tau1 dX/dt + X = (1 - tanh(sharpness (alpha - tau2 alphadot - alpha_star)))/2`` with ``tau1 =
    relaxation c/V``, ``tau2 = lag c/V``. sharpness [1/rad]; alpha_star [rad], where half is
    separated; lag, relaxation [chords travelled].

    Source: Kirchhoff's flow as in Leishman & Beddoes, J. AHS 34(3), 1989; Fischenberg &
    Jategaonkar, RTO MP-35 paper 19, 1999; Jategaonkar, Flight Vehicle System Identification, 2015,
    chapter 12. Without relaxation there is no memory: the lag acts through alphadot.

    >>> float(Kirchhoff(35.0, 0.29).steady(0.29))
    0.5
    """

    sharpness: float
    alpha_star: float
    lag: float = 0.0
    relaxation: float = 0.0

    def __post_init__(self) -> None:
        _finite("Kirchhoff flow", alpha_star=self.alpha_star)
        _not_negative(
            "Kirchhoff flow", sharpness=self.sharpness, lag=self.lag, relaxation=self.relaxation
        )
        if self.sharpness == 0.0:
            raise InputError("sharpness is 0", "Kirchhoff flow", "it must be positive")

    def steady(self, angle: Value) -> Value:
        """Attached flow in steady state at an angle of attack [rad], (n,) or a number."""
        return 0.5 * (1.0 - np.tanh(self.sharpness * (angle - self.alpha_star)))

    def expression(self, angle: str) -> Expression:
        """`steady` as an expression; `angle` is that of the effective angle of attack."""
        return parse(
            f"0.5*(1 - tanh({number(self.sharpness)}*({angle} - ({number(self.alpha_star)}))))"
        )


@dataclass(frozen=True)
class GomanKhrabrov:
    """``tau1 dX/dt + X = X0(alpha - tau2 alphadot)`` with X0 as static tests give it, linear
    between breakpoints, held beyond.

    breakpoints [rad], increasing; attached, X0 there, 0 to 1; lag, relaxation as in `Kirchhoff`.
    Source: Goman & Khrabrov, J. Aircraft 31(5), 1994, eqs. 1 and 2.
    """

    breakpoints: tuple[float, ...]
    attached: tuple[float, ...]
    lag: float = 0.0
    relaxation: float = 0.0

    def __post_init__(self) -> None:
        where = "Goman-Khrabrov flow"
        object.__setattr__(self, "breakpoints", tuple(map(float, self.breakpoints)))
        object.__setattr__(self, "attached", tuple(map(float, self.attached)))
        if len(self.breakpoints) < 2 or len(self.attached) != len(self.breakpoints):
            what = f"{len(self.breakpoints)} breakpoints, {len(self.attached)} values"
            raise InputError(what, where, "give as many, two at least")
        if not (np.all(np.diff(self.breakpoints) > 0) and np.all(np.isfinite(self.breakpoints))):
            raise InputError(
                "breakpoints do not increase", where, "sort them and leave doubles out"
            )
        if not all(0.0 <= value <= 1.0 for value in self.attached):
            raise InputError("attached flow outside 0 to 1", where, "1 is attached, 0 separated")
        _not_negative(where, lag=self.lag, relaxation=self.relaxation)

    def steady(self, angle: Value) -> Value:
        """Attached flow in steady state at an angle of attack [rad], (n,) or a number."""
        return np.interp(angle, self.breakpoints, self.attached)

    def expression(self, angle: str) -> Expression:
        """`steady` as an expression: the first value, and per interval its rise over the angle
        clipped to it."""
        parts = [str(number(self.attached[0]))]
        nodes = list(zip(self.breakpoints, self.attached, strict=True))
        for (low, first), (high, last) in pairwise(nodes):
            slope = (last - first) / (high - low)
            parts.append(
                f"({number(slope)})*(clip({angle}, {number(low)}, {number(high)}) -"
                f" ({number(low)}))"
            )
        return parse(" + ".join(parts))


@dataclass(frozen=True)
class Relay:
    """Separated above `high` [rad], attached below `low`, in between as it was. JSBSim's
    ``hysteresis_limits``.

    separated : what the channel shows then; 0 as everywhere here, 1 for JSBSim's
    ``aero/stall-hyst-norm``.
    """

    low: float
    high: float
    separated: float = 0.0

    def __post_init__(self) -> None:
        _finite("relay", low=self.low, high=self.high)
        if self.low > self.high:
            raise InputError(
                f"low {self.low:g} lies above high {self.high:g}", "relay", "swap them"
            )
        if self.separated not in (0.0, 1.0):
            raise InputError(f"separated is {self.separated:g}", "relay", "0 or 1")


Law = Kirchhoff | GomanKhrabrov | Relay

#: Name of a law in stored databases and files.
LAWS: Final[dict[str, type[Law]]] = {
    "kirchhoff": Kirchhoff,
    "goman_khrabrov": GomanKhrabrov,
    "relay": Relay,
}


@dataclass(frozen=True)
class StateModel:
    """A channel that a law makes of a flight. name : ``flow_attachment``, or a free input of the
    database that it is in."""

    name: str
    law: Law
    description: str = ""

    def __post_init__(self) -> None:
        check_identifier(self.name)

    @property
    def needs(self) -> tuple[str, ...]:
        """Channels of a flight that it is made of."""
        moving = not isinstance(self.law, Relay) and (
            self.law.lag > 0.0 or self.law.relaxation > 0.0
        )
        return ("alpha", "V") if moving else ("alpha",)

    @property
    def exact_steady(self) -> bool:
        """Whether it has no memory: `settled` then is `along`, as far as alphadot and V are
        given."""
        return not isinstance(self.law, Relay) and self.law.relaxation == 0.0

    def settled(self, channels: Mapping[str, Value], chord: float) -> Value:
        """What it would settle at if alpha and ``tau2 alphadot`` stayed: (n,) or a number.

        channels : alpha [rad]; alphadot [rad/s] and V [m/s] count where the law has a lag and both
        are given. A relay between its limits counts as attached: a flight begins so. chord :
        reference chord, m.
        """
        if isinstance(self.law, Relay):
            alpha = channels["alpha"]
            stalled = np.where(np.isnan(alpha), np.nan, np.greater(alpha, self.law.high))
            return stalled if self.law.separated else 1.0 - stalled
        return self.law.steady(self._angle(channels, chord))

    def along(self, time: Array, channels: Mapping[str, Array], chord: float) -> Array:
        """The channel along a flight, (n,): integrated, from a settled start.

        time : (n,) s, uniform. channels : `needs`, each (n,), SI, and alphadot where it is better
        known than from alpha: without it, it is that of alpha, slower than one over the lag.
        ``alpha - tau2 alphadot`` stands for alpha a while ago, which it is for slow motion only,
        and a faster rate would be the noise of alpha. Between samples the steady value is taken as
        linear, for which the relaxation is exact. Samples that are not finite are bridged for the
        memory and stay not finite.

        Raises InputError naming absent channels, and for a lag over too few samples to have a rate.
        """
        absent = [name for name in self.needs if name not in channels]
        if absent:
            raise InputError(
                f"channels missing: {', '.join(absent)}",
                f"state {self.name}",
                "it is integrated along a flight",
            )
        from aerodb.tables.state_kernel import (
            relaxed,
            relay,
        )  # compiled: nothing else should wait for it

        if isinstance(self.law, Relay):
            stalled = relay(
                np.asarray(channels["alpha"], dtype=np.float64), self.law.low, self.law.high
            )
            return stalled if self.law.separated else 1.0 - stalled
        if self.law.lag > 0.0 and "alphadot" not in channels:
            channels = {**channels, "alphadot": slow_rate(time, channels, self.law.lag * chord)}
        target = np.asarray(self.law.steady(self._angle(channels, chord)), dtype=np.float64)
        if self.law.relaxation == 0.0:
            return target
        with np.errstate(divide="ignore"):
            tau = self.law.relaxation * chord / np.asarray(channels["V"], dtype=np.float64)
        good = np.isfinite(target) & np.isfinite(tau) & (tau > 0)
        if not good.any():
            return np.full(len(time), np.nan)
        result = relaxed(
            time, np.interp(time, time[good], target[good]), np.interp(time, time[good], tau[good])
        )
        return np.where(good, result, np.nan)

    def expression(self) -> Expression:
        """What a format without memory can carry: the value that it settles at, over alpha, and
        alphadot and V for a lag.

        Exact where `exact_steady`. Raises InputError for a relay, which between its limits has no
        value without its past.
        """
        if isinstance(self.law, Relay):
            raise InputError(
                f"relay '{self.name}' has no steady value between its limits",
                remedy="give it as an input",
            )
        angle = (
            f"(alpha - {number(self.law.lag)}*c_ref/V*alphadot)" if self.law.lag > 0.0 else "alpha"
        )
        return self.law.expression(angle)

    def _angle(self, channels: Mapping[str, Value], chord: float) -> Value:
        """alpha as it was a while ago, to first order [rad]."""
        lag = 0.0 if isinstance(self.law, Relay) else self.law.lag
        if lag == 0.0 or "alphadot" not in channels or "V" not in channels:
            return channels["alpha"]
        with np.errstate(divide="ignore", invalid="ignore"):
            return channels["alpha"] - lag * chord / channels["V"] * channels["alphadot"]


def slow_rate(time: Array, channels: Mapping[str, Array], distance: float) -> Array:
    """alphadot (n,) [rad/s] of alpha, band-limited to one over the time in which a `distance` [m]
    is flown.

    time : (n,) s, uniform. channels : alpha [rad], V [m/s]. Raises InputError for too few samples
    to have a rate.
    """
    alpha, speed = channels["alpha"], channels["V"]
    if len(time) < FEWEST_SAMPLES:
        raise InputError(
            f"{len(time)} samples have no rate", "alphadot", f"{FEWEST_SAMPLES} are needed"
        )
    moving = np.isfinite(speed) & (speed > 0)
    if not (moving.any() and np.isfinite(alpha).any()):
        return np.full(len(time), np.nan)
    step = float(time[-1] - time[0]) / (len(time) - 1)
    bandwidth = float(np.median(speed[moving])) / distance
    return smooth(alpha, step, min(bandwidth, 0.25 / step), noise=0.0).rate
