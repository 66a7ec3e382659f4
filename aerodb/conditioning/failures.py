"""Sensors that fail in flight: airspeed, vanes, height and velocity that stop following the motion.

The stretch is flagged ``failed`` and left out; the rest of the flight stays. What is known of the
motion from elsewhere decides: speed over ground, accelerations, rates, attitude. Where nothing else
is logged, nothing is said.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from aerodb.conditioning.channel_rates import with_accelerations
from aerodb.conditioning.drifts import SENSORS, WINDOW, Drift, drift
from aerodb.conditioning.followers import FOLLOWERS, LEAPING, held, leaping, not_following, repeated
from aerodb.conditioning.frozen import frozen, torn
from aerodb.conditioning.ground_motion import despite_ground
from aerodb.conditioning.pitot import (
    AIR,
    SHORTEST,
    agrees,
    airspeed_failures,
    speed_over_ground,
    stuck,
)
from aerodb.flight import Flight
from aerodb.nomenclature import FLAGS, channel
from aerodb.signals import runs
from aerodb.support import Array, Mask

#: Channels of one receiver: its last message stands in all of them.
_RECEIVERS: Final = (
    ("velocity_north", "velocity_east", "velocity_down"),
    ("latitude", "longitude"),
    ("north", "east"),
)
#: Accelerometers by the names that they have at their own place.
_AT_IMU: Final = ("ax_imu", "ay_imu", "az_imu")
#: Silence [s] from which a sensor counts as failed rather than as logged a little less long.
LONGEST_SILENCE: Final = 3.0


def flag_failed(flight: Flight) -> Flight:
    """Return the flight with ``failed`` flagged where a sensor does not follow the motion; values
    (n,) stay, in SI units.

    All fail where the whole record stands still, or jumps. Airspeed fails where the speed over
    ground goes on, or where it falls within a second and no force slows the aircraft. Other sensors
    fail where they stand still while what they measure changes, heights and positions where they
    leap. One that repeats a value is told first: no other sensor is to be blamed for it. What
    drifts or jumps and goes on is told by all channels together (`drift`).
    """
    usable = with_accelerations(flight)
    for name in FOLLOWERS:
        if name in flight and (where := held(flight, usable, name)).any():
            flight = _with_its_receiver(_with_failed(flight, name, where), name, where)
    for name, where in airspeed_failures(flight).items():
        flight = flight.with_flag(name, "failed", where)
    for first, last in (*frozen(flight), *torn(flight)):
        where = np.zeros(len(flight.time), dtype=bool)
        where[first : last + 1] = True
        for name in flight.channels:
            flight = flight.with_flag(name, "failed", where)
    usable = with_accelerations(flight)
    for name in LEAPING:
        if name in flight and (where := leaping(flight, usable, name)).any():
            flight = _with_its_receiver(flight.with_flag(name, "failed", where), name, where)
    together: Collection[str] = ()
    while (found := drift(flight)) is not None and not _stands(flight, usable, found):
        if together and found.channel not in together:
            break
        together = next((each for each in _RECEIVERS if found.channel in each), ("",))
        where = np.zeros(len(flight.time), dtype=bool)
        where[found.first : found.last + 1] = True
        middle, least = (found.first + found.last) // 2, max(2, round(SHORTEST / flight.step))
        where |= repeated(flight[found.channel], middle, least)
        flight = _with_its_receiver(
            _with_failed(flight, found.channel, where), found.channel, where
        )
        usable = with_accelerations(flight)
    # What depends on fewest others first: a wrong attitude is no fault of the vanes.
    for name in sorted(FOLLOWERS, key=lambda each: len(FOLLOWERS[each].needs)):
        if name in flight and (where := not_following(flight, usable, name)).any():
            flight = _with_its_receiver(_with_failed(flight, name, where), name, where)
    return flight


def _stands(flight: Flight, usable: Mapping[str, Array], found: Drift) -> bool:
    """Whether a sensor that parts from the motion does so because it stands still."""
    values = flight[found.channel][found.first : found.last + 1]
    low, high = np.nanquantile(values, [0.1, 0.9]) if np.isfinite(values).any() else (0.0, 0.0)
    if high - low > 0.5 * abs(found.size) or found.channel not in FOLLOWERS:
        return False
    return bool(not_following(flight, usable, found.channel).any())


def _with_failed(flight: Flight, name: str, where: Mask) -> Flight:
    """The flight with a channel flagged as failed there, and what its tube gives as far as it
    agrees."""
    for other in AIR if name in AIR else (name,):
        if other in flight:
            flight = flight.with_flag(other, "failed", where & agrees(flight, name, other))
    return flight


def _with_its_receiver(flight: Flight, name: str, where: Mask) -> Flight:
    """The flight with what the same receiver gives flagged as well, where that is held, too."""
    least = max(2, round(SHORTEST / flight.step))
    for other in next((each for each in _RECEIVERS if name in each), ()):
        if other in flight and other != name:
            held = np.zeros(len(where), dtype=bool)
            for first, last in runs(where):
                held |= repeated(flight[other], (first + last) // 2, least)
            flight = flight.with_flag(other, "failed", held & where)
    return flight


@dataclass(frozen=True)
class Failure:
    """A sensor that fails in flight, from `start` to `end` [s], as the flags of its channel say.

    kind : ``behind`` (airspeed without the speed over ground), ``fallen`` (without a force that
    slows the aircraft), ``still`` (it does not follow the motion), ``leapt`` (it is elsewhere all
    at once, and no velocity says so), ``drifted`` (it goes on, but elsewhere: `drift` says how),
    ``silent`` (no samples in flight, or no more),
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
    drift: Drift | None = None

    @property
    def reason(self) -> str:
        """What shows the failure, in words without a subject."""
        shown = f"{self.value:.3g} {channel(self.channel).unit}".removesuffix(" 1")
        if self.kind == "frozen":
            return "every channel repeats its value, and then the motion has gone on"
        if self.kind == "torn":
            return "all channels jump at once there: samples are repeated, or in another order"
        if self.drift is not None:
            return self.drift.reason
        if self.kind == "silent":
            return "it has no samples, those of the rates go on"
        if self.kind == "still":
            if self.channel not in FOLLOWERS:
                return "the other channels do not change as it says"
            listed = ", ".join(n for n in FOLLOWERS[self.channel].needs if n != self.channel)
            return f"it stands at {shown} while {listed} say that it changes"
        if self.kind == "leapt":
            listed = ", ".join(n for n in FOLLOWERS[self.channel].needs if n != self.channel)
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
    names = [
        name for name in dict.fromkeys((*AIR, *FOLLOWERS, *SENSORS, *_AT_IMU)) if name in flight
    ]
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
    start, end = float(flight.time[first]), float(flight.time[last])
    long = end - start > WINDOW
    drifted = _drift_there(despite_ground(flight), name, first, last) if long else None
    if drifted is not None:
        return Failure(name, "drifted", start, end, drifted.size, np.nan, drifted)
    values = flight[name][here]
    value = float(np.median(values[np.isfinite(values)])) if np.isfinite(values).any() else np.nan
    beside = np.nan
    if name in AIR and ground is not None and np.isfinite(ground[here]).any():
        beside = float(np.nanmedian(ground[here]))
    still = name not in AIR or np.mean(stuck(flight, name)[here]) > 0.5
    kind = "still" if still else "behind" if np.isfinite(beside) else "fallen"
    if name in LEAPING and _leaps_there(flight[name], first, last, FOLLOWERS[name].least):
        kind = "leapt"
    return Failure(name, kind, start, end, value, beside)


def _drift_there(flight: Flight, name: str, first: int, last: int) -> Drift | None:
    """What `drift` says of a stretch that it flagged; None of another."""
    flags = dict(flight.flags)
    for each in AIR if name in AIR else (name,):
        if each in flags:
            flags[each] = flags[each].astype(np.uint16)
            flags[each][first : last + 1] &= ~np.uint16(FLAGS["failed"])
    found = drift(replace(flight, flags=flags))
    same = found is not None and (found.channel, found.first, found.last) == (name, first, last)
    return found if same else None


def _leaps_there(values: Array, first: int, last: int, least: float) -> bool:
    """Whether a stretch begins or ends with a leap, and is no single value."""
    ends = [k for k in (first, last + 1) if 0 < k < len(values)]
    leaps = any(abs(values[k] - values[k - 1]) > 0.5 * least for k in ends)
    return leaps and bool(np.ptp(values[first : last + 1]) > 0.0)


def _silent(flight: Flight, name: str, bits: NDArray[np.uint16]) -> list[Failure]:
    """A sensor that had samples and has none in flight, or until the end, while body rates go
    on."""
    gone = ~np.isfinite(flight[name]) | ((bits & FLAGS["gap"]) != 0)
    rates = [rate for rate in ("p", "q", "r") if rate in flight]
    if not rates or gone.all():
        return []
    going = flight.usable(rates, despite=("on_ground", "hover"))
    flying = flight.usable(rates)
    least = round(LONGEST_SILENCE / flight.step)
    found = []
    for first, last in runs(gone & going, least, least):
        at_end = gone[last:].all()
        if first > 0 and (at_end or (gone & flying)[first : last + 1].sum() > least):
            start, end = float(flight.time[first - 1]), float(flight.time[last])
            found.append(Failure(name, "silent", start, end, np.nan, np.nan))
    return found
