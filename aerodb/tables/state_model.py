"""State models for effects with memory: a channel, the degree of flow attachment, is integrated
along a flight and used by terms.

`AeroDatabase.predict` is stateless. Along a flight the channel is integrated from the first sample
on (`StateModel.along`); where it is not given, it has its steady value (`StateModel.settled`). One
is attached flow, zero separated flow.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np

from aerodb.errors import InputError
from aerodb.signals import FEWEST_SAMPLES, smooth
from aerodb.support import Array
from aerodb.tables.expression import Expression, check_identifier, number, parse
from aerodb.tables.functions import Value
from aerodb.tables.rate_state import Rate


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
    """Kirchhoff flow: attachment falls with angle of attack over a smooth step, with lag and
    relaxation.

    ``tau1 dX/dt + X = (1 - tanh(sharpness (alpha - tau2 alphadot - alpha_star)))/2`` with ``tau1 =
    relaxation c/V``, ``tau2 = lag c/V``. Without relaxation there is no memory: the lag acts
    through alphadot.

    Parameters
    ----------
    sharpness : [1/rad], positive.
    alpha_star : [rad], where half of the flow is separated.
    lag, relaxation : [chords travelled].

    Raises InputError for values that are not finite, negative values and a sharpness of zero.

    References
    ----------
    Kirchhoff's flow as in Leishman & Beddoes, J. AHS 34(3), 1989; Fischenberg & Jategaonkar, RTO
    MP-35 paper 19, 1999; Jategaonkar, Flight Vehicle System Identification, 2015, chapter 12.

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
        """Steady flow attachment at an angle of attack [rad], (n,) or a number."""
        return 0.5 * (1.0 - np.tanh(self.sharpness * (angle - self.alpha_star)))

    def expression(self, angle: str) -> Expression:
        """`steady` as an expression; `angle` is the expression of the effective angle of attack.

        The angle is in rad.
        """
        return parse(
            f"0.5*(1 - tanh({number(self.sharpness)}*({angle} - ({number(self.alpha_star)}))))"
        )


@dataclass(frozen=True)
class GomanKhrabrov:
    """Goman-Khrabrov flow: ``tau1 dX/dt + X = X0(alpha - tau2 alphadot)``.

    X0 comes from static tests; it is linear between breakpoints and held beyond.

    Parameters
    ----------
    breakpoints : [rad], at least two, increasing.
    attached : X0 at the breakpoints, 0 to 1.
    lag, relaxation : [chords travelled], as in `Kirchhoff`.

    Raises InputError for anything else.

    References
    ----------
    Goman & Khrabrov, J. Aircraft 31(5), 1994, eqs. 1 and 2.
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
            raise InputError(what, where, "give as many values as breakpoints, at least two")
        if not (np.all(np.diff(self.breakpoints) > 0) and np.all(np.isfinite(self.breakpoints))):
            raise InputError(
                "breakpoints do not increase", where, "sort them and remove repetitions"
            )
        if not all(0.0 <= value <= 1.0 for value in self.attached):
            raise InputError("attached flow outside 0 to 1", where, "1 is attached, 0 separated")
        _not_negative(where, lag=self.lag, relaxation=self.relaxation)

    def steady(self, angle: Value) -> Value:
        """Steady flow attachment at an angle of attack [rad], (n,) or a number."""
        return np.interp(angle, self.breakpoints, self.attached)

    def expression(self, angle: str) -> Expression:
        """`steady` as an expression: the first value, plus the slope of each interval times the
        angle clipped to it.

        The angle is in rad.
        """
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
    """Hysteresis relay: separated above `high` [rad], attached below `low`, unchanged in between.
    JSBSim's ``hysteresis_limits``.

    separated : value of the channel in separated flow; 0 as everywhere here, 1 for JSBSim's
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


Law = Kirchhoff | GomanKhrabrov | Relay | Rate

#: Name in stored databases and files -> law of flow attachment.
LAWS: Final[dict[str, type[Kirchhoff | GomanKhrabrov | Relay]]] = {
    "kirchhoff": Kirchhoff,
    "goman_khrabrov": GomanKhrabrov,
    "relay": Relay,
}


@dataclass(frozen=True)
class StateModel:
    """A channel that a law computes along a flight.

    name : ``flow_attachment``, or a free input of its database. A `Rate` needs its database, which
    computes it (`AeroDatabase.states_along`); the methods here are those of the other laws.
    """

    name: str
    law: Law
    description: str = ""

    def __post_init__(self) -> None:
        check_identifier(self.name)

    @property
    def needs(self) -> tuple[str, ...]:
        """Channels of a flight, (n,) each, that it is computed from: alpha [rad], and V [m/s] where
        it lags."""
        if isinstance(self.law, Rate):
            return ()
        moving = not isinstance(self.law, Relay) and (
            self.law.lag > 0.0 or self.law.relaxation > 0.0
        )
        return ("alpha", "V") if moving else ("alpha",)

    @property
    def exact_steady(self) -> bool:
        """Whether it has no memory, so that `settled` equals `along` where alphadot and V are
        given."""
        return not isinstance(self.law, (Relay, Rate)) and self.law.relaxation == 0.0

    def settled(self, channels: Mapping[str, Value], chord: float) -> Value:
        """Steady value at constant alpha and ``tau2 alphadot``: (n,) or a number.

        Parameters
        ----------
        channels : alpha [rad]; also alphadot [rad/s] and V [m/s], which are used where the law has
            a lag and both are given.
        chord : reference chord [m].

        A relay between its limits counts as attached, as at the beginning of a flight.
        """
        if isinstance(self.law, Relay):
            alpha = channels["alpha"]
            stalled = np.where(np.isnan(alpha), np.nan, np.greater(alpha, self.law.high))
            return stalled if self.law.separated else 1.0 - stalled
        if isinstance(self.law, Rate):
            return self.law.initial
        return self.law.steady(self._angle(channels, chord))

    def along(self, time: Array, channels: Mapping[str, Array], chord: float) -> Array:
        """Integrate the channel along a flight, (n,), from steady state at its first sample.

        Parameters
        ----------
        time : (n,) [s], uniform.
        channels : those of `needs`, each (n,), SI; and alphadot where a better estimate than the
            derivative of alpha is available.
        chord : reference chord [m].

        Without alphadot, the rate of alpha is used, band-limited to one over the lag (`slow_rate`).
        ``alpha - tau2 alphadot`` approximates a delayed alpha only for slow motion, and a faster
        rate would be the noise of alpha. The steady value is taken as linear between samples, for
        which the integration is exact. Samples that are not finite are bridged in the integration,
        and are NaN in the result.

        Raises InputError naming missing channels, and where a lag is given for too few samples to
        compute a rate.
        """
        absent = [name for name in self.needs if name not in channels]
        if absent:
            raise InputError(
                f"channels missing: {', '.join(absent)}",
                f"state {self.name}",
                "it is integrated along a flight",
            )
        assert not isinstance(self.law, Rate)
        # Imported here because it loads the compiler.
        from aerodb.tables.state_kernel import relaxed, relay

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
        """The steady value as an expression over alpha, and over alphadot and V for a lag: for
        formats without state models.

        Exact where `exact_steady`. Raises InputError for a relay, which has no steady value between
        its limits.
        """
        if isinstance(self.law, Relay):
            raise InputError(
                f"relay '{self.name}' has no steady value between its limits",
                remedy="give it as an input",
            )
        assert not isinstance(self.law, Rate)
        angle = (
            f"(alpha - {number(self.law.lag)}*c_ref/V*alphadot)" if self.law.lag > 0.0 else "alpha"
        )
        return self.law.expression(angle)

    def _angle(self, channels: Mapping[str, Value], chord: float) -> Value:
        """Effective angle of attack, alpha delayed by the lag to first order [rad]."""
        lag = 0.0 if isinstance(self.law, (Relay, Rate)) else self.law.lag
        if lag == 0.0 or "alphadot" not in channels or "V" not in channels:
            return channels["alpha"]
        with np.errstate(divide="ignore", invalid="ignore"):
            return channels["alpha"] - lag * chord / channels["V"] * channels["alphadot"]


def slow_rate(time: Array, channels: Mapping[str, Array], distance: float) -> Array:
    """Derivative of alpha (n,) [rad/s], band-limited to one over the time to fly `distance`.

    Parameters
    ----------
    time : (n,) [s], uniform.
    channels : alpha [rad] and V [m/s], each (n,).
    distance : [m].

    Raises InputError for too few samples to compute a rate.
    """
    alpha, speed = channels["alpha"], channels["V"]
    if len(time) < FEWEST_SAMPLES:
        raise InputError(
            f"{len(time)} samples are too few for a rate",
            "alphadot",
            f"{FEWEST_SAMPLES} are needed",
        )
    moving = np.isfinite(speed) & (speed > 0)
    if not (moving.any() and np.isfinite(alpha).any()):
        return np.full(len(time), np.nan)
    step = float(time[-1] - time[0]) / (len(time) - 1)
    bandwidth = float(np.median(speed[moving])) / distance
    return smooth(alpha, step, min(bandwidth, 0.25 / step), noise=0.0).rate
