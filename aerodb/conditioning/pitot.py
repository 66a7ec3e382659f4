"""Airspeed and speed over ground, and where the airspeed fails: the other goes on without it, or no
force slows the aircraft."""

from typing import Final

import numpy as np

from aerodb.conditioning.channel_rates import airspeed_rate, with_accelerations
from aerodb.conditioning.local_gravity import local_gravity
from aerodb.flight import Flight
from aerodb.nomenclature import FLAGS, is_command
from aerodb.signals import bridge, integrated, runs
from aerodb.support import HALF, NOTABLE, SUBSTANTIAL, Array, Mask

#: Channels of one pitot tube: they fail together as far as they agree with each other.
AIR: Final = ("V", "calibrated_airspeed", "qbar", "mach")
#: Part of the flying speed by which wind along the track does not change within `GUST`. Gusts of
#: thunderstorms reach a quarter of a slow airliner's (FAA AC 00-54).
MOST_WIND: Final = HALF
#: Part of the record's high airspeed below which an aircraft is taken to stand or taxi, and air
#: data are not compared.
SLOW: Final = SUBSTANTIAL
#: Airspeed [m/s] that nothing with wings stays below in flight.
LEAST_AIRSPEED: Final = 6.0
#: Time [s] over which wind along a straight track is taken as steady.
GUST: Final = 10.0
#: Largest change of track [rad] over it for a straight one.
STRAIGHT: Final = 0.2
#: Part of the motion that a sensor must at least show; one that is dead shows noise alone.
SHOWN: Final = NOTABLE
#: Shortest failure that is told [s]: recorders that log slower than others repeat less.
SHORTEST: Final = 1.0


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


def airspeed_failures(flight: Flight) -> dict[str, Mask]:
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
    failed = (failed & known) | stuck(flight, name)
    stay = max(1, round(SHORTEST / flight.step))
    where = np.zeros_like(failed)
    for first, last in runs(failed, stay, stay):
        where[first : last + 1] = True
    if not where.any():
        return {}
    return {other: where & agrees(flight, name, other) for other in AIR if other in flight}


def _fastest_over_ground(flight: Flight) -> float:
    """Speed over ground [m/s] that is rarely surpassed; 0 where it is unknown or rotors carry."""
    ground = speed_over_ground(flight)
    if ground is None or not np.isfinite(ground).any() or any(map(is_command, flight.channels)):
        return 0.0
    return float(np.nanquantile(ground, 0.95))


def stuck(flight: Flight, name: str) -> Mask:
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
    given = integrated(force, flight.step)
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


def agrees(flight: Flight, name: str, other: str) -> Mask:
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
