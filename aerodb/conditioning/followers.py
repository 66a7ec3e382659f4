"""Channels that must follow a rate of other channels: where one stands still, or leaps."""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, uniform_filter1d

from aerodb.conditioning.channel_rates import (
    KINEMATICS,
    OPTIONAL,
    airspeed_rate,
    alpha_rate,
    beta_rate,
)
from aerodb.conditioning.local_gravity import local_gravity
from aerodb.conditioning.pitot import MOST_WIND, SHOWN
from aerodb.flight import Flight
from aerodb.nomenclature import channel
from aerodb.signals import bridge, integrated, runs
from aerodb.support import HALF, QUARTER, Array, Mask

#: How many times the usual disagreement a motion must be, for a sensor that does not show it.
CLEAR: Final = 5.0
#: Share of a flight at least in which a sensor is well, for what its disagreement usually is.
WELL: Final = QUARTER
#: Time [s] within which a sensor leaps, rather than drifts.
LEAP: Final = 0.5
#: How many times the usual change within it that velocity does not explain, for a leap.
LEAPT: Final = 20.0
#: How many windows must say so before a sensor counts as failed.
WINDOWS: Final = 3


@dataclass(frozen=True)
class _Follower:
    """A channel that must follow a rate of other channels.

    window [s] : over which changes are compared. least : change in the channel's unit below which
    nothing is concluded.
    """

    rate: Callable[[Mapping[str, Array]], Array]
    needs: tuple[str, ...]
    window: float
    least: float


def _climb(f: Mapping[str, Array]) -> Array:
    return -f["velocity_down"]


def _sink_of_height(f: Mapping[str, Array]) -> Array:
    """Rate of static pressure [Pa/s] in a climb: ``dp = -rho g dh``."""
    return f["rho"] * local_gravity(f) * f["velocity_down"]


def _over_ground(axis: int) -> Callable[[Mapping[str, Array]], Array]:
    """Acceleration over ground [m/s^2] to the north (0) or east (1): specific force, rotated."""

    def rate(f: Mapping[str, Array]) -> Array:
        sf, cf = np.sin(f["phi"]), np.cos(f["phi"])
        st, ct = np.sin(f["theta"]), np.cos(f["theta"])
        right = cf * f["ay"] - sf * f["az"]
        ahead = ct * f["ax"] + st * (sf * f["ay"] + cf * f["az"])
        sp, cp = np.sin(f["psi"]), np.cos(f["psi"])
        return np.asarray(cp * ahead - sp * right if axis == 0 else sp * ahead + cp * right)

    return rate


def _velocity(name: str) -> Callable[[Mapping[str, Array]], Array]:
    return lambda f: f[name]


_MOTION = ("ax", "ay", "az", "phi", "theta", "psi")
#: Airspeed: 4 s in which it changes by 3 m/s. Vanes: 4 s of a manoeuvre, of 2 deg; attitude: of
#: 3 deg. Height and position: 10 s of a climb of 2 m/s, of 2 m/s over ground. Velocity: a turn that
#: changes it by 4 m/s, what 0.4 m/s^2 of an accelerometer's error makes in 10 s.
FOLLOWERS: Final[dict[str, _Follower]] = {
    "V": _Follower(airspeed_rate, ("alpha", "ax", "az", "theta"), 4.0, 3.0),
    "alpha": _Follower(alpha_rate, ("V", "q", "ax", "az", "theta"), 4.0, 0.035),
    "beta": _Follower(
        beta_rate, ("alpha", "V", "p", "r", "ax", "ay", "az", "theta", "phi"), 4.0, 0.035
    ),
    **{name: _Follower(*KINEMATICS[name], 4.0, 0.05) for name in ("phi", "theta")},
    "altitude": _Follower(_climb, ("velocity_down",), 10.0, 20.0),
    "height_above_ground": _Follower(_climb, ("velocity_down",), 10.0, 20.0),
    "static_pressure": _Follower(_sink_of_height, ("velocity_down", "rho"), 10.0, 200.0),
    "velocity_north": _Follower(_over_ground(0), _MOTION, 10.0, 4.0),
    "velocity_east": _Follower(_over_ground(1), _MOTION, 10.0, 4.0),
    "north": _Follower(_velocity("velocity_north"), ("velocity_north",), 10.0, 20.0),
    "east": _Follower(_velocity("velocity_east"), ("velocity_east",), 10.0, 20.0),
}
#: Channels that no gust moves: heights over ground step with the ground, and vanes with the air.
LEAPING: Final = ("altitude", "static_pressure", "north", "east")


def _width(flight: Flight, name: str) -> int:
    """Samples over which changes of a channel are compared."""
    return round(FOLLOWERS[name].window / flight.step)


def _moved(
    flight: Flight, usable: Mapping[str, Array], name: str, needs: Collection[str]
) -> tuple[Array, Mask]:
    """What its rate makes of a channel, zero at first, and where both are known, (n,); zero without
    what the rate needs."""
    known = flight.usable([name], despite=("stuck",))
    if not needs:
        return np.zeros(len(known)), known
    known &= flight.usable([n for n in (*needs, *OPTIONAL.get(name, ())) if n in flight])
    with np.errstate(all="ignore"):
        rate = np.nan_to_num(FOLLOWERS[name].rate(usable), posinf=0.0, neginf=0.0)
    return integrated(rate, flight.step), known


def not_following(flight: Flight, usable: Mapping[str, Array], name: str) -> Mask:
    """Where a channel stands still while the rate that it must follow moves it."""
    rule, where = FOLLOWERS[name], np.zeros(len(flight.time), dtype=bool)
    width = _width(flight, name)
    if not {name, *rule.needs} <= usable.keys() or not 4 <= width < len(where) // 3:
        return where
    turned, known = _moved(flight, usable, name, rule.needs)
    if "V" in (name, *rule.needs):
        known &= usable["V"] > MOST_WIND * float(np.quantile(usable["V"], 0.95))
    values = bridge(np.where(np.isfinite(flight[name]), flight[name], np.nan))
    starts = np.arange(0, len(where) - width, max(1, width // 4))
    whole = uniform_filter1d(known.astype(float), width)[starts + width // 2] > 0.99
    if whole.sum() < 4 * WINDOWS:
        return where
    # A constant error of the rate, such as that of a gyro, is no motion.
    grown = ((values - turned)[starts + width] - (values - turned)[starts])[whole]
    turned += _commonest(grown) / width * np.arange(len(turned))
    moved, shown = _swing(turned, starts, width), _swing(values, starts, width)
    usual = float(np.quantile(_swing(values - turned, starts, width)[whole], WELL))
    clear = whole & (moved > rule.least) & (moved > CLEAR * usual)
    dead, well = clear & (shown < SHOWN * moved), clear & (shown > 0.5 * moved)
    # A sensor that never follows was not connected, or is another: that is said elsewhere.
    if dead.sum() < WINDOWS or well.sum() < WINDOWS:
        return where
    for first, last in _stretches(dead, well):
        if (dead[first : last + 1]).sum() >= WINDOWS:
            where[starts[first] : starts[last] + width] = True
            middle = (int(starts[first]) + int(starts[last]) + width) // 2
            where |= repeated(values, middle, width)
    return where


def held(flight: Flight, usable: Mapping[str, Array], name: str) -> Mask:
    """Where a channel that does not follow repeats exactly one value for as long as it must
    follow."""
    where, same = not_following(flight, usable, name), np.zeros(len(flight.time), dtype=bool)
    if where.any():
        for first, last in runs(np.diff(flight[name]) == 0.0, _width(flight, name)):
            same[first : last + 2] = where[first : last + 2].any()
    return same


def leaping(flight: Flight, usable: Mapping[str, Array], name: str) -> Mask:
    """Where a height, pressure or position is elsewhere, since it leapt and no velocity says so:
    until it leaps back, else on the side of the leap where it follows the velocity less, or on the
    shorter one."""
    rule, where = FOLLOWERS[name], np.zeros(len(flight.time), dtype=bool)
    width = max(1, round(LEAP / flight.step))
    needs = rule.needs if set(rule.needs) <= usable.keys() else ()
    # Without its rate, a height or position changes by no more than the airspeed.
    most = float(np.nanquantile(usable["V"], 0.95)) if "V" in usable else np.inf
    at_most = 0.0 if needs else most * LEAP * (1.0 if channel(name).unit == "m" else np.inf)
    if len(where) < 10 * width or not np.isfinite(at_most):
        return where
    turned, known = _moved(flight, usable, name, needs)
    # A velocity that repeats a value tells nothing of a leap.
    for need in (each for each in needs if each.startswith("velocity")):
        for first, last in runs(np.diff(flight[need]) == 0.0, _width(flight, name)):
            known[first : last + 2] = False
    apart = np.where(known, flight[name] - turned, np.nan)
    change = np.abs(apart[width:] - apart[:-width])
    if np.isfinite(change).sum() < 10 * width:
        return where
    least = at_most + max(rule.least, LEAPT * float(np.nanquantile(change, 0.5)))
    # What stands still, or follows a wrong velocity, goes elsewhere, too, but evenly.
    short = max(1, width // 4)
    at_once = maximum_filter1d(np.nan_to_num(np.abs(apart[short:] - apart[:-short])), width)
    leapt = np.nan_to_num(change) > least
    leapt &= at_once[width // 2 :][: len(leapt)] > HALF * change
    k = 0
    for at in np.flatnonzero(leapt).tolist():
        if at < k:
            continue
        before = apart[at]
        begin = at + 1 + int(np.nanargmax(np.abs(np.diff(apart[at : at + width + 1]))))
        back = np.flatnonzero(np.abs(apart[begin:] - before) < 0.5 * least)
        first, end = begin, begin + int(back[0]) if back.size else len(where)
        if not back.size:
            there = np.abs(apart[:begin] - apart[at + width]) < 0.5 * least
            well = runs(there, _width(flight, name), width)
            if well:  # it went wrong by and by, and is itself again
                first, end = well[-1][1] + 1, begin
            elif _is_wrong_before(flight[name], apart, begin):
                first, end = 0, begin
        where[first:end] = True
        k = end + width
    return where & np.isfinite(flight[name])


def _is_wrong_before(values: Array, apart: Array, begin: int) -> bool:
    """Whether a channel is wrong before sample `begin` rather than from there on: it stands still
    there, or velocity leaves more of it (`apart`)."""
    stands = [np.mean(np.diff(part) == 0.0) > 0.5 for part in np.split(values, [begin])]
    if stands[0] != stands[1]:
        return bool(stands[0])
    before, after = (float(np.nanstd(part)) for part in np.split(apart, [begin]))
    if not 1.0 / CLEAR < before / max(after, 1e-9) < CLEAR:
        return before > after
    return begin < len(apart) // 2


def repeated(values: Array, at: int, least: int) -> Mask:
    """Where a value is repeated exactly around sample `at`; nowhere if less often than `least`."""
    where = np.zeros(len(values), dtype=bool)
    for first, last in runs(values == values[at], least):
        if first <= at <= last:
            where[first : last + 1] = True
    return where


def _swing(values: Array, starts: NDArray[np.intp], width: int) -> Array:
    """Change of values over each window, less their drift over the record: the largest difference
    between its quarters."""
    marks = np.stack([values[starts + k * width // 4] for k in range(5)])
    return np.asarray(np.ptp(marks, axis=0))


def _commonest(values: Array) -> float:
    """Middle of the narrowest interval that holds the share `WELL` of the values."""
    ordered = np.sort(values)
    count = max(2, int(WELL * len(ordered)))
    first = int(np.argmin(ordered[count - 1 :] - ordered[: len(ordered) - count + 1]))
    return float(0.5 * (ordered[first] + ordered[first + count - 1]))


def _stretches(dead: Mask, well: Mask) -> list[tuple[int, int]]:
    """First and last of the windows between which a sensor is dead and none says that it is not."""
    found: list[tuple[int, int]] = []
    for k in np.flatnonzero(dead):
        if found and not well[found[-1][1] : k].any():
            found[-1] = (found[-1][0], int(k))
        else:
            found.append((int(k), int(k)))
    return found
