"""Detection of stall, pull-up, low g, slow oscillation (phugoid), spiral and steady flight.

They are found in the motion, whatever the surfaces do. Functions return the `AircraftResponse` that
they detect; `segmentation` determines whether the aircraft is airborne.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d, median_filter

from aerodb.conditioning.manoeuvres import (
    ALONE,
    DEGREE,
    HELD,
    INTENDED,
    SETTLED,
    rank_correlation,
    rolling_range,
)
from aerodb.physics import GRAVITY
from aerodb.signals import runs
from aerodb.support import SMALL, Array, Mask


@dataclass(frozen=True)
class AircraftResponse:
    """A stretch of motion: its first and last sample, and the reason in words."""

    first: int
    last: int
    reason: str


@dataclass(frozen=True)
class _Oscillation:
    """A slow oscillation of airspeed.

    first, last : samples. period [s], amplitude [m/s] : of the best damped sine.
    """

    first: int
    last: int
    period: float
    amplitude: float


@dataclass(frozen=True)
class _DampedSine:
    """The best damped sine on a straight line.

    share : of the variance that it explains. period : s. amplitude : unit of the values.
    """

    share: float
    period: float
    amplitude: float


@dataclass(frozen=True)
class _Sines:
    """Damped sines of n samples, fitted together with a straight line.

    line : (n, 2), orthonormal. waves : (w, n, 2), sine and cosine of each. across : (w, n, 2),
    orthonormal, what of them no line explains. period : (w,) [s].
    """

    line: Array
    waves: Array
    across: Array
    period: Array

    @classmethod
    def of(cls, n: int, step: float, expected: float) -> "_Sines":
        """Sines over n samples at `step` [s], of periods near `expected` [s]."""
        time = step * np.arange(n)
        line, _ = np.linalg.qr(np.stack([np.ones_like(time), time], axis=1))
        periods, decays = expected * np.linspace(0.7, 1.4, 15), np.array([0.0, 0.3, 0.8])
        period, decay = np.repeat(periods, len(decays)), np.tile(decays, len(periods))
        share = time / period[:, None]
        fading, turn = np.exp(-decay[:, None] * share), 2 * np.pi * share
        waves = np.stack([fading * np.sin(turn), fading * np.cos(turn)], axis=2)
        across, _ = np.linalg.qr(waves - line @ (line.T @ waves))
        return cls(line, waves, across, period)

    def best(self, values: Array) -> _DampedSine:
        """The one that explains the largest share of values (n,)."""
        rest = values - self.line @ (self.line.T @ values)
        total = float(rest @ rest)
        if not total > 0:
            return _DampedSine(0.0, float(self.period[0]), 0.0)
        share = np.sum((rest @ self.across) ** 2, axis=1) / total
        best = int(np.argmax(share))
        basis = np.column_stack([self.line, self.waves[best]])
        solution = np.linalg.lstsq(basis, values)[0]
        size = float(np.hypot(*solution[2:]))
        return _DampedSine(float(share[best]), float(self.period[best]), size)


#: Lift short of its straight line, as a part of it, that is a stall.
LIFT_LOST = SMALL
#: Least time for which a stall's lift is short [s].
STALL_TIME = 0.3
#: Range of alpha that the straight line of lift needs [rad].
LINE_RANGE = 4.0 * DEGREE
#: Load factor above one, compensated for bank, from which on a flight pulls up [g]. Below one, as
#: measured, that from which on it pushes over.
LOAD_CHANGE = 0.5
#: Least time of a motion that is left to itself: steady flight, a spiral, a phugoid [s].
UNDISTURBED = 10.0
#: Greatest range of speed, relative, within `SETTLED` of steady flight.
STEADY_SPEED = 0.01
#: The same of bank [rad]; of pitch `INTENDED`.
STEADY_BANK = 2.0 * DEGREE
#: Least amplitude of a slow oscillation [m/s].
PHUGOID_SPEED = 1.5
#: Share of a motion that a slow oscillation explains, and correlation of height with loss of speed.
PHUGOID_SHARE = 0.8
#: Periods of it that must be seen.
PHUGOID_PERIODS = 1.25
#: Least change of bank of a spiral [rad].
SPIRAL_BANK = 15 * DEGREE
#: Greatest rate of a spiral [rad/s].
SPIRAL_RATE = 3 * DEGREE


def stalls(
    alpha: Array, az: Array, qbar: Array, step: float, flying: Mask
) -> list[AircraftResponse]:
    """Return stalls: lift (-az over qbar) at least 10 % below the record's own lift line.

    The line is fitted over the lower three fifths of the alpha range, so that no aircraft data are
    needed; stalls are searched above that range. Empty if the line covers less than four degrees.

    Parameters
    ----------
    alpha, az, qbar : (n,), rad, m/s^2, Pa
    step : s
    flying : (n,), mask of airborne samples
    """
    if flying.sum() * step < SETTLED:
        return []
    blur = 0.5 / step
    angle = gaussian_filter1d(alpha, blur)
    lift = gaussian_filter1d(-az, blur) / np.maximum(gaussian_filter1d(qbar, blur), 1.0)
    low, high = np.quantile(angle[flying], [0.01, 0.999])
    attached = flying & (angle < low + 0.6 * (high - low)) & (angle > low)
    if 0.6 * (high - low) < LINE_RANGE or attached.sum() < 20:
        return []
    deficit, normal = _short_of_line(angle, lift, attached)
    lost = flying & (angle > low + 0.6 * (high - low)) & (deficit > max(LIFT_LOST, 3.0 * normal))
    responses = []
    for first, last in runs(lost, max(2, round(STALL_TIME / step)), round(2.0 / step)):
        worst = 100 * float(np.max(deficit[first : last + 1]))
        peak = float(np.max(angle[first : last + 1])) / DEGREE
        responses.append(
            AircraftResponse(
                first,
                last,
                f"lift up to {worst:.0f} % below its straight line, alpha to {peak:.1f} deg",
            )
        )
    return responses


def _short_of_line(angle: Array, lift: Array, attached: Mask) -> tuple[Array, float]:
    """Return the lift deficit (n,) relative to the line through the attached samples.

    Also returns its usual size there. The line is fitted twice, the second time without samples
    three sigma off, such as take-off and flaps.
    """
    kept, deficit, normal = attached, np.zeros_like(lift), 0.0
    for _ in range(2):
        slope, level = np.polyfit(angle[kept], lift[kept], 1)
        line = level + slope * angle
        deficit = 1.0 - lift / np.where(line > 0, line, np.inf)
        normal = 1.4826 * float(np.median(np.abs(deficit[attached])))
        kept = attached & (np.abs(deficit) < 3.0 * max(normal, 1e-6))
        if kept.sum() < 20:
            break
    return deficit, normal


def load_factors(
    az: Array, phi: Array, step: float, flying: Mask
) -> list[tuple[str, AircraftResponse]]:
    """Return pull-ups and push-overs, each with its kind (``pull_up`` or ``low_g``).

    az [m/s^2], phi [rad], flying : (n,). step : s.
    """
    load = gaussian_filter1d(-az, 0.3 / step) / GRAVITY
    shortest = max(2, round(HELD / step))
    responses = []
    for kind, mask in (
        ("pull_up", load * np.cos(phi) > 1.0 + LOAD_CHANGE),
        ("low_g", load < 1.0 - LOAD_CHANGE),
    ):
        for first, last in runs(mask & flying, shortest, shortest):
            part = load[first : last + 1]
            extreme = float(part.max() if kind == "pull_up" else part.min())
            reason = f"load factor {'up' if kind == 'pull_up' else 'down'} to {extreme:.2f}"
            responses.append((kind, AircraftResponse(first, last, reason)))
    return responses


def slow_oscillations(
    speed: Array, altitude: Array | None, elevator: Array, step: float, flying: Mask
) -> list[AircraftResponse]:
    """Return phugoid-like oscillations of airspeed [m/s] (n,) with the elevator [rad] fixed.

    The period searched is 0.7 to 1.4 times ``sqrt(2) pi V / g`` (Lanchester 1908); a damped sine on
    a straight line must explain four fifths of the motion over one and a quarter periods or more.
    Where `altitude` [m] is known, it must rise as airspeed falls: the motion exchanges height for
    speed.
    """
    alone = flying & (rolling_range(median_filter(elevator, 3), round(2.0 / step)) < ALONE)
    responses = []
    for first, last in runs(alone, round(UNDISTURBED / step), round(1.0 / step)):
        first, last = _left_alone(elevator, first, last)
        mean = float(np.mean(speed[first : last + 1]))
        expected = float(np.sqrt(2) * np.pi * mean / GRAVITY)
        if (last - first) * step < PHUGOID_PERIODS * 0.7 * expected:
            continue
        best = _best_oscillation(speed[first : last + 1], step, expected)
        if best is not None:
            begin, end = first + best.first, first + best.last
            if altitude is not None and not _exchanged(speed, altitude, begin, end, step):
                continue
            reason = (
                f"airspeed swings by +-{best.amplitude:.1f} m/s in {best.period:.0f} s (phugoid:"
                f" {expected:.0f} s), elevator left alone"
            )
            responses.append(AircraftResponse(begin, end, reason))
    return responses


def _left_alone(surface: Array, first: int, last: int) -> tuple[int, int]:
    """The longest part of samples first..last in which a surface stays near its usual position
    there."""
    part = surface[first : last + 1]
    near = runs(np.abs(part - np.median(part)) < ALONE, 2)
    begin, end = max(near, key=lambda run: run[1] - run[0], default=(0, len(part) - 1))
    return first + begin, first + end


def _exchanged(speed: Array, altitude: Array, first: int, last: int, step: float) -> bool:
    """Return whether speed and height, each about its straight line, swing against each other."""
    part = slice(first, last + 1, max(1, round(0.5 / step)))
    time = np.arange(len(speed[part]))
    swing = [
        values[part] - np.polyval(np.polyfit(time, values[part], 1), time)
        for values in (speed, altitude)
    ]
    return bool(np.corrcoef(swing[0], swing[1])[0, 1] < -PHUGOID_SHARE)


def _best_oscillation(speed: Array, step: float, expected: float) -> _Oscillation | None:
    """The longest part with a slow oscillation."""
    coarse = max(1, round(expected / 80 / step))
    thin = speed[::coarse]
    dt = step * coarse
    for length in (1.0, 0.75, 0.5, 0.35):
        size = int(length * len(thin))
        sines = _Sines.of(size, dt, expected)
        for begin in range(0, len(thin) - size + 1, max(1, (len(thin) - size) // 6 or 1)):
            sine = sines.best(thin[begin : begin + size])
            if (
                sine.share > PHUGOID_SHARE
                and sine.amplitude > PHUGOID_SPEED
                and size * dt > PHUGOID_PERIODS * sine.period
            ):
                return _Oscillation(
                    begin * coarse,
                    min((begin + size) * coarse, len(speed)) - 1,
                    sine.period,
                    sine.amplitude,
                )
    return None


def spirals(
    phi: Array, surfaces: Sequence[Array], step: float, flying: Mask
) -> list[AircraftResponse]:
    """Return spirals: bank [rad] (n,) changes slowly and steadily by 15 deg, surfaces fixed."""
    alone = flying.copy()
    for surface in surfaces:
        alone &= rolling_range(median_filter(surface, 3), round(2.0 / step)) < ALONE
    responses = []
    for first, last in runs(alone, round(UNDISTURBED / step), round(1.0 / step)):
        part = phi[first : last + 1 : max(1, round(0.5 / step))]
        change = float(part[-1] - part[0])
        rate = abs(change) / ((last - first) * step)
        if abs(change) > SPIRAL_BANK and rate < SPIRAL_RATE and abs(rank_correlation(part)) > 0.95:
            reason = (
                f"bank from {part[0] / DEGREE:.0f} to {part[-1] / DEGREE:.0f} deg with all surfaces"
                " left alone"
            )
            responses.append(AircraftResponse(first, last, reason))
    return responses


def steady(
    speed: Array, theta: Array, phi: Array, step: float, flying: Mask
) -> list[AircraftResponse]:
    """Return stretches of ten seconds or more in which V [m/s], theta, phi [rad] hardly change.

    Each is (n,), step [s], flying (n,) mask; limits as `STEADY_SPEED` and those below it.
    """
    window = round(SETTLED / step)
    if len(speed) < window:
        return []
    blur = 0.5 / step
    calm = rolling_range(gaussian_filter1d(speed, blur), window) < STEADY_SPEED * np.maximum(
        speed, 1.0
    )
    calm &= rolling_range(gaussian_filter1d(theta, blur), window) < INTENDED
    calm &= rolling_range(gaussian_filter1d(phi, blur), window) < STEADY_BANK
    responses = []
    for first, last in runs(calm & flying, round(UNDISTURBED / step)):
        bank = float(np.mean(phi[first : last + 1])) / DEGREE
        kind = f"turn, bank {bank:.0f} deg" if abs(bank) > 5 else "flight"
        at = f"V {np.mean(speed[first : last + 1]):.1f} m/s"
        responses.append(AircraftResponse(first, last, f"steady {kind}, {at}"))
    return responses
