"""Sensors that fail in flight: airspeed, vanes, height and velocity that stop following the motion.

The stretch is flagged ``failed`` and left out; the rest of the flight stays. What is known of the
motion from elsewhere decides: speed over ground, accelerations, rates, attitude. Where nothing else
is logged, nothing is said.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from aerodb.conditioning.channel_rates import (
    airspeed_rate,
    alpha_rate,
    beta_rate,
    with_accelerations,
)
from aerodb.conditioning.frozen import frozen, torn
from aerodb.conditioning.local_gravity import local_gravity
from aerodb.flight import Flight
from aerodb.nomenclature import FLAGS, channel, is_command
from aerodb.signals import bridge, runs
from aerodb.support import Array, Mask

#: Channels of one pitot tube: they fail together as far as they agree with each other.
AIR: Final = ("V", "calibrated_airspeed", "qbar", "mach")
#: Channels of one receiver: its last message stands in all of them.
_RECEIVERS: Final = (
    ("velocity_north", "velocity_east", "velocity_down"),
    ("latitude", "longitude"),
    ("north", "east"),
)
#: Part of the flying speed by which wind along the track does not change within `GUST`. Gusts of
#: thunderstorms reach a quarter of a slow airliner's (FAA AC 00-54).
MOST_WIND: Final = 0.5
#: Part of the record's high airspeed below which an aircraft is taken to stand or taxi, and air
#: data are not compared.
SLOW: Final = 0.3
#: Airspeed [m/s] that nothing with wings stays below in flight.
LEAST_AIRSPEED: Final = 6.0
#: Time [s] over which wind along a straight track is taken as steady.
GUST: Final = 10.0
#: Largest change of track [rad] over it for a straight one.
STRAIGHT: Final = 0.2
#: Shortest failure that is told [s].
SHORTEST: Final = 1.0
#: Part of the motion that a sensor must at least show; one that is dead shows noise alone.
SHOWN: Final = 0.2
#: How many times the usual disagreement a motion must be, for a sensor that does not show it.
CLEAR: Final = 5.0
#: Share of a flight at least in which a sensor is well, for what its disagreement usually is.
WELL: Final = 0.25
#: Silence [s] from which a sensor counts as failed rather than as logged a little less long.
LONGEST_SILENCE: Final = 3.0
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
#: Airspeed: 4 s in which it changes by 3 m/s. Vanes: 4 s of a manoeuvre, of 2 deg. Height and
#: position: 10 s of a climb of 2 m/s, of 2 m/s over ground. Velocity: a turn that changes it by
#: 4 m/s, what 0.4 m/s^2 of an accelerometer's error makes in 10 s.
_FOLLOWERS: Final[dict[str, _Follower]] = {
    "V": _Follower(airspeed_rate, ("alpha", "ax", "az", "theta"), 4.0, 3.0),
    "alpha": _Follower(alpha_rate, ("V", "q", "ax", "az", "theta"), 4.0, 0.035),
    "beta": _Follower(
        beta_rate, ("alpha", "V", "p", "r", "ax", "ay", "az", "theta", "phi"), 4.0, 0.035
    ),
    "altitude": _Follower(_climb, ("velocity_down",), 10.0, 20.0),
    "height_above_ground": _Follower(_climb, ("velocity_down",), 10.0, 20.0),
    "static_pressure": _Follower(_sink_of_height, ("velocity_down", "rho"), 10.0, 200.0),
    "velocity_north": _Follower(_over_ground(0), _MOTION, 10.0, 4.0),
    "velocity_east": _Follower(_over_ground(1), _MOTION, 10.0, 4.0),
    "north": _Follower(_velocity("velocity_north"), ("velocity_north",), 10.0, 20.0),
    "east": _Follower(_velocity("velocity_east"), ("velocity_east",), 10.0, 20.0),
}


#: Channels that no gust moves: heights over ground step with the ground, and vanes with the air.
_LEAPING: Final = ("altitude", "static_pressure", "north", "east")


def flag_failed(flight: Flight) -> Flight:
    """Return the flight with ``failed`` flagged where a sensor does not follow the motion; values
    (n,) stay, in SI units.

    All fail where the whole record stands still, or jumps. Airspeed fails where the speed over
    ground goes on, or where it falls within a second and no force slows the aircraft. Other sensors
    fail where they stand still while what they measure changes, heights and positions where they
    leap.
    """
    for name, where in _airspeed_failures(flight).items():
        flight = flight.with_flag(name, "failed", where)
    for first, last in (*frozen(flight), *torn(flight)):
        where = np.zeros(len(flight.time), dtype=bool)
        where[first : last + 1] = True
        for name in flight.channels:
            flight = flight.with_flag(name, "failed", where)
    usable = with_accelerations(flight)
    for name in _LEAPING:
        if name in flight and (where := _leaping(flight, usable, name)).any():
            flight = _with_its_receiver(flight.with_flag(name, "failed", where), name, where)
    for name in _FOLLOWERS:
        if name in flight and (where := _not_following(flight, usable, name)).any():
            for other in AIR if name in AIR else (name,):
                if other in flight:
                    flight = flight.with_flag(other, "failed", where & _agrees(flight, name, other))
            flight = _with_its_receiver(flight, name, where)
    return flight


def _with_its_receiver(flight: Flight, name: str, where: Mask) -> Flight:
    """The flight with what the same receiver gives flagged as well, where that is held, too."""
    least = max(2, round(SHORTEST / flight.step))
    for other in next((each for each in _RECEIVERS if name in each), ()):
        if other in flight and other != name:
            held = np.zeros(len(where), dtype=bool)
            for first, last in runs(where):
                held |= _held(flight[other], (first + last) // 2, least)
            flight = flight.with_flag(other, "failed", held & where)
    return flight


def speed_over_ground(flight: Flight) -> Array | None:
    """Return the horizontal speed over ground (n,) [m/s], nan where unknown; None without it."""
    names = ("velocity_north", "velocity_east")
    if any(name not in flight for name in names):
        return None
    good = flight.usable(names, despite=("on_ground", "hover"))
    if not good.any():
        return None
    return np.where(good, np.hypot(*(flight[name] for name in names)), np.nan)


def airspeed_of(flight: Flight) -> tuple[str, Array] | None:
    """Return the channel of the airspeed and its values (n,) [m/s], nan where they are unusable;
    None without one."""
    for name in ("V", "calibrated_airspeed"):
        if name in flight:
            good = flight.usable([name], despite=("on_ground", "hover"))
            if good.any():
                return name, np.where(good, flight[name], np.nan)
    return None


def _airspeed_failures(flight: Flight) -> dict[str, Mask]:
    """Channels of the pitot tube -> (n,) where they fail."""
    found = airspeed_of(flight)
    if found is None:
        return {}
    name, shown = found
    known = np.isfinite(shown)
    high = float(np.quantile(shown[known], 0.95))
    if high < LEAST_AIRSPEED:  # a tube that is closed shows nothing of a whole flight
        high = _fastest_over_ground(flight)
        if high < LEAST_AIRSPEED / MOST_WIND:
            return {}
    failed = _behind_ground_speed(flight, shown, high) | _without_force(flight, shown, high)
    failed = (failed & known) | _stuck(flight, name)
    stay = max(1, round(SHORTEST / flight.step))
    where = np.zeros_like(failed)
    for first, last in runs(failed, stay, stay):
        where[first : last + 1] = True
    if not where.any():
        return {}
    return {other: where & _agrees(flight, name, other) for other in AIR if other in flight}


def _fastest_over_ground(flight: Flight) -> float:
    """Speed over ground [m/s] that is rarely surpassed; 0 where it is unknown or rotors carry."""
    ground = speed_over_ground(flight)
    if ground is None or not np.isfinite(ground).any() or any(map(is_command, flight.channels)):
        return 0.0
    return float(np.nanquantile(ground, 0.95))


def _stuck(flight: Flight, name: str) -> Mask:
    """Where the samples of a channel are flagged as stuck: all that its tube gives is."""
    bits = flight.flags.get(name)
    none = np.zeros(len(flight.time), dtype=bool)
    return none if bits is None else np.asarray((bits & FLAGS["stuck"]) != 0)


def _behind_ground_speed(flight: Flight, shown: Array, high: float) -> Mask:
    """Where the speed over ground goes on without the airspeed, or the two part on a straight
    track faster than wind changes."""
    none = np.zeros(len(shown), dtype=bool)
    ground = speed_over_ground(flight)
    if ground is None or not np.isfinite(ground).any():
        return none
    both = np.isfinite(shown) & np.isfinite(ground)
    apart = np.where(both, shown - ground, np.nan)
    lost = both & (shown < SLOW * high) & (-apart > MOST_WIND * high)
    width = round(GUST / flight.step)
    if not 1 < width < len(shown) or not both.any():
        return lost
    apart = bridge(apart)
    track = np.unwrap(np.arctan2(flight["velocity_east"], flight["velocity_north"]))
    moved = np.nan_to_num(ground) > SLOW * high
    straight = both[width:] & both[:-width] & moved[width:] & moved[:-width]
    straight &= np.abs(np.nan_to_num(track[width:] - track[:-width], nan=9.0)) < STRAIGHT
    for at in np.flatnonzero(
        straight & (np.abs(apart[width:] - apart[:-width]) > MOST_WIND * high)
    ):
        if lost[at + width] or lost[at]:
            continue
        # From where the two begin to part, until they are together again.
        here, before = apart[at : at + width + 1], apart[at]
        begin = at + int(np.argmax(np.abs(here - before) > 0.2 * MOST_WIND * high))
        back = np.abs(apart[at + width :] - before) < 0.5 * MOST_WIND * high
        end = at + width + int(np.argmax(back)) if back.any() else len(shown)
        lost[begin:end] = True
    return lost & both


def _without_force(flight: Flight, shown: Array, high: float) -> Mask:
    """Where the airspeed is low since it fell, and no force slowed the aircraft: within a second,
    or within 5 s where the angle of attack is known."""
    where = np.zeros(len(shown), dtype=bool)
    f = with_accelerations(flight)
    if not {"ax", "theta"} <= f.keys():
        return where
    whole = {"alpha", "az"} <= f.keys()
    force = airspeed_rate(f) if whole else f["ax"] - local_gravity(f) * np.sin(f["theta"])
    given = np.concatenate([[0.0], np.cumsum(force[1:] + force[:-1])]) * 0.5 * flight.step
    speed = bridge(shown)
    low = speed < MOST_WIND * high
    for seconds in (1.0, 5.0) if whole else (1.0,):
        width = round(seconds / flight.step)
        if not 1 < width < len(shown) // 2:
            continue
        change = speed[width:] - speed[:-width] - (given[width:] - given[:-width])
        k = 0
        for at in np.flatnonzero((change < -MOST_WIND * high) & low[width:]).tolist():
            if at < k:
                continue
            begin = at + int(np.argmax(speed[at : at + width + 1] < speed[at] - 0.1 * high))
            again = np.flatnonzero(~low[at + width :])
            k = at + width + int(again[0]) if again.size else len(shown)
            where[begin:k] = True
    return where


def _agrees(flight: Flight, name: str, other: str) -> Mask:
    """Where another channel of the air data says the same as the failed airspeed: it comes from the
    same tube."""
    if other == name:
        return np.ones(len(flight.time), dtype=bool)
    speed, values = np.abs(flight[name]), np.abs(flight[other])
    as_speed = np.sqrt(values) if other == "qbar" else values
    # Within the change that the record makes of one into the other, by the medians of both.
    good = flight.usable([name, other]) & (speed > 0.0)
    if not good.any():
        return np.ones(len(flight.time), dtype=bool)
    high = np.quantile(speed[good], 0.95)
    ratio = float(np.median(as_speed[good] / speed[good]))
    near = np.abs(as_speed - ratio * speed) < SHOWN * ratio * high
    return np.asarray(near | ~np.isfinite(values))


def _not_following(flight: Flight, usable: Mapping[str, Array], name: str) -> Mask:
    """Where a channel stands still while the rate that it must follow moves it."""
    rule, where = _FOLLOWERS[name], np.zeros(len(flight.time), dtype=bool)
    width = round(rule.window / flight.step)
    if not {name, *rule.needs} <= usable.keys() or not 4 <= width < len(where) // 3:
        return where
    known = flight.usable([name], despite=("stuck",))
    known &= flight.usable([n for n in rule.needs if n in flight])
    if "V" in (name, *rule.needs):
        known &= usable["V"] > MOST_WIND * float(np.quantile(usable["V"], 0.95))
    with np.errstate(all="ignore"):
        rate = np.nan_to_num(rule.rate(usable))
    turned = np.concatenate([[0.0], np.cumsum(rate[1:] + rate[:-1])]) * 0.5 * flight.step
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
            where |= _held(values, middle, width)
    return where


def _leaping(flight: Flight, usable: Mapping[str, Array], name: str) -> Mask:
    """Where a height, pressure or position is elsewhere, since it leapt and no velocity says so:
    until it leaps back, else on the side of the leap where it follows the velocity less, or on the
    shorter one."""
    rule, where = _FOLLOWERS[name], np.zeros(len(flight.time), dtype=bool)
    width = max(1, round(LEAP / flight.step))
    needs = rule.needs if set(rule.needs) <= usable.keys() else ()
    # Without its rate, a height or position changes by no more than the airspeed.
    most = float(np.nanquantile(usable["V"], 0.95)) if "V" in usable else np.inf
    at_most = 0.0 if needs else most * LEAP * (1.0 if channel(name).unit == "m" else np.inf)
    if len(where) < 10 * width or not np.isfinite(at_most):
        return where
    known = flight.usable([name, *(n for n in needs if n in flight)], despite=("stuck",))
    with np.errstate(all="ignore"):
        rate = np.nan_to_num(rule.rate(usable)) if needs else np.zeros(len(where))
    turned = np.concatenate([[0.0], np.cumsum(rate[1:] + rate[:-1])]) * 0.5 * flight.step
    apart = np.where(known, flight[name] - turned, np.nan)
    change = np.abs(apart[width:] - apart[:-width])
    if np.isfinite(change).sum() < 10 * width:
        return where
    least = at_most + max(rule.least, LEAPT * float(np.nanquantile(change, 0.5)))
    k = 0
    for at in np.flatnonzero(change > least).tolist():
        if at < k:
            continue
        before = apart[at]
        begin = at + 1 + int(np.nanargmax(np.abs(np.diff(apart[at : at + width + 1]))))
        back = np.flatnonzero(np.abs(apart[begin:] - before) < 0.5 * least)
        end = begin + int(back[0]) if back.size else len(where)
        is_first = not back.size and _is_wrong_before(flight[name], apart, begin)
        where[slice(0, begin) if is_first else slice(begin, end)] = True
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


def _held(values: Array, at: int, least: int) -> Mask:
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


@dataclass(frozen=True)
class Failure:
    """A sensor that fails in flight, from `start` to `end` [s], as the flags of its channel say.

    kind : ``behind`` (airspeed without the speed over ground), ``fallen`` (without a force that
    slows the aircraft), ``still`` (it does not follow the motion), ``leapt`` (it is elsewhere all
    at once, and no velocity says so), ``silent`` (no samples more),
    ``frozen`` or ``torn`` (all channels stand still, or jump; one of them is named).
    value : median that it shows [unit of the channel]; beside : speed over ground [m/s] meanwhile;
    nan where there is none.
    """

    channel: str
    kind: str
    start: float
    end: float
    value: float
    beside: float

    @property
    def reason(self) -> str:
        """What shows the failure, in words without a subject."""
        shown = f"{self.value:.3g} {channel(self.channel).unit}".removesuffix(" 1")
        if self.kind == "frozen":
            return "every channel repeats its value, and then the motion has gone on"
        if self.kind == "torn":
            return "all channels jump at once there: samples are repeated, or in another order"
        if self.kind == "silent":
            return "its samples end, those of the rates go on"
        if self.kind == "still":
            listed = ", ".join(_FOLLOWERS[self.channel].needs)
            return f"it stands at {shown} while {listed} say that it changes"
        if self.kind == "leapt":
            listed = ", ".join(_FOLLOWERS[self.channel].needs)
            return f"it leaps to or from {shown}, faster than by {listed} or airspeed"
        if self.kind == "behind":
            return f"it shows {shown} at {self.beside:.3g} m/s over ground"
        return f"it falls to {shown} and no force slows the aircraft"

    @property
    def sensor(self) -> str:
        """Name of what was measured: the channel, the airspeed for all that its tube gives."""
        if self.kind in ("frozen", "torn"):
            return "the record"
        return "airspeed" if self.channel in AIR else self.channel


def failures(flight: Flight) -> tuple[Failure, ...]:
    """Return the failures that a flight's flags tell (`flag_failed`), and sensors that fall silent
    while rates go on; times [s]. Of one pitot tube, the first channel is named."""
    stand = [
        Failure("p", kind, float(flight.time[a]), float(flight.time[b]), np.nan, np.nan)
        for kind, listed in (("frozen", frozen(flight)), ("torn", torn(flight)))
        for a, b in listed
    ]
    found: list[Failure] = []
    ground = speed_over_ground(flight)
    names = [name for name in dict.fromkeys((*AIR, *_FOLLOWERS)) if name in flight]
    names = [n for n in names if n not in AIR or n == names[0]]
    for name in names:
        bits = flight.flags.get(name, np.zeros(len(flight.time), np.uint8)).astype(np.uint16)
        for first, last in runs((bits & FLAGS["failed"]) != 0):
            found.append(_failure(flight, name, first, last, ground))
        found += _silent(flight, name, bits)
    found = [each for each in found if not any(_overlap(each, other) for other in stand)]
    return tuple(sorted((*stand, *found), key=lambda each: (each.start, each.channel)))


def _overlap(one: Failure, other: Failure) -> bool:
    return one.start <= other.end and other.start <= one.end


def _failure(flight: Flight, name: str, first: int, last: int, ground: Array | None) -> Failure:
    here = slice(first, last + 1)
    values = flight[name][here]
    value = float(np.median(values[np.isfinite(values)])) if np.isfinite(values).any() else np.nan
    beside = np.nan
    if name in AIR and ground is not None and np.isfinite(ground[here]).any():
        beside = float(np.nanmedian(ground[here]))
    still = name not in AIR or np.mean(_stuck(flight, name)[here]) > 0.5
    kind = "still" if still else "behind" if np.isfinite(beside) else "fallen"
    if name in _LEAPING and _leaps_there(flight[name], first, last, _FOLLOWERS[name].least):
        kind = "leapt"
    start, end = float(flight.time[first]), float(flight.time[last])
    return Failure(name, kind, start, end, value, beside)


def _leaps_there(values: Array, first: int, last: int, least: float) -> bool:
    """Whether a stretch begins or ends with a leap, and is no single value."""
    ends = [k for k in (first, last + 1) if 0 < k < len(values)]
    leaps = any(abs(values[k] - values[k - 1]) > 0.5 * least for k in ends)
    return leaps and bool(np.ptp(values[first : last + 1]) > 0.0)


def _silent(flight: Flight, name: str, bits: NDArray[np.uint16]) -> list[Failure]:
    """A sensor that had samples and has none until the end, while body rates go on."""
    gone = ~np.isfinite(flight[name]) | ((bits & FLAGS["gap"]) != 0)
    rates = [rate for rate in ("p", "q", "r") if rate in flight]
    known = np.flatnonzero(~gone)
    if not rates or not known.size or known[-1] == len(gone) - 1:
        return []
    going = np.flatnonzero(flight.usable(rates, despite=("on_ground", "hover")))
    start, end = float(flight.time[known[-1]]), float(flight.time[going[-1]]) if going.size else 0.0
    if end - start < LONGEST_SILENCE:
        return []
    return [Failure(name, "silent", start, end, np.nan, np.nan)]
