"""Segmentation of a flight: ground and air, configurations and manoeuvres, each with a reason.

`manoeuvres` recognises them from surface deflections, `responses` from the motion.
"""

import re
from typing import Final

import numpy as np
from scipy.ndimage import median_filter

from aerodb.conditioning.failures import failures
from aerodb.conditioning.ground_motion import despite_ground, wheel_speed
from aerodb.conditioning.manoeuvres import (
    ABOVE_ACTIVITY,
    DEGREE,
    HELD,
    INTENDED,
    PLAIN,
    SETTLED,
    Input,
    inputs,
)
from aerodb.conditioning.pitot import (
    LEAST_AIRSPEED,
    MOST_WIND,
    SLOW,
    airspeed_of,
    speed_over_ground,
)
from aerodb.conditioning.responses import (
    AircraftResponse,
    load_factors,
    slow_oscillations,
    spirals,
    stalls,
    steady,
)
from aerodb.conditioning.segment import STATES, Segment
from aerodb.flight import Flight
from aerodb.nomenclature import FLAGS, is_command
from aerodb.physics import GRAVITY
from aerodb.signals import bridge, runs
from aerodb.support import HALF, SLIGHT, Array, Mask

#: Height up to which it still rolls [m].
ROLLING_HEIGHT = 4.0
#: Steepest slope of a runway (ICAO Annex 14, volume I, 3.1.13, code 1 and 2).
STEEPEST_RUNWAY: Final = 0.02
#: Slow samples whose median height is that of the ground.
_LEVEL: Final = 50
#: Heights that show where it rolls; the first decides.
_HEIGHTS: Final = ("altitude", "height_above_ground")
#: What is moved now and then rather than flown with.
_MOVED = (
    r"landing_gear|(wing_|inboard_|outboard_)?flaps?|slats?|speed_?brakes?|air_?brakes?|spoilers?"
)
CONFIGURATION: Final = re.compile(rf"delta_({_MOVED})(_left|_right)?")
#: Difference of a new position of the gear, of its whole travel.
GEAR_STEP = SLIGHT
#: Surfaces that aircraft are flown with.
PRIMARY: Final = ("elevator", "aileron", "rudder", "elevon", "stabilator", "ruddervator", "canard")


#: Share of the usual command of rotors above which they carry the aircraft: half the speed lifts a
#: quarter of the weight.
CARRYING: Final = HALF
#: Speed [m/s] below which a vehicle that rotors carry hovers: a tenth of what induces its thrust.
HOVER_SPEED: Final = 1.0
#: Shortest hover [s]: about what a multicopter needs to stop.
HOVER_TIME: Final = 2.0
#: Why hover is a segment of its own.
HOVER: Final = "rotors carry the aircraft, by the modes of its autopilot"


def segments(flight: Flight) -> tuple[Segment, ...]:
    """Return all segments of a flight, in order of their start; they may overlap.

    Segments whose channels are missing are left out: without airspeed no ground, without attitude
    no steady flight. Manoeuvres are searched in the air only. Samples flagged as unusable are
    interpolated linearly.

    Times [s] on the clock of the flight, samples (n,).
    """
    failed, flight = _failed(flight), despite_ground(flight)
    view = _View(flight)
    parts = [*ground_and_air(flight), *configurations(flight), *failed]
    parts += _standing(flight)
    surfaces = _surfaces(view)
    manoeuvres = [*_inputs(view, surfaces), *_responses(view, surfaces)]
    parts += manoeuvres
    parts += _steady(view, manoeuvres)
    return tuple(sorted(parts, key=lambda segment: (segment.start, segment.end)))


def manoeuvres(flight: Flight) -> tuple[Segment, ...]:
    """Return only the manoeuvres among `segments`, start and end [s]."""
    return tuple(segment for segment in segments(flight) if segment.kind not in STATES)


class _View:
    """A flight's channels, bridged where they may not be used, and where it flies."""

    def __init__(self, flight: Flight) -> None:
        self.flight, self.time, self.step = flight, flight.time, flight.step
        self.flying = ~flagged(flag_on_ground(flight), "on_ground", "hover")
        self._known: dict[str, Mask] = {}

    def get(self, *names: str) -> Array | None:
        """The first of these channels that the flight has."""
        for name in names:
            if name in self.flight and (good := self.known(name)).any():
                values = self.flight[name]
                return bridge(values if good.all() else np.where(good, values, np.nan))
        return None

    def known(self, name: str) -> Mask:
        if name not in self._known:
            self._known[name] = self.flight.usable([name])
        return self._known[name]

    def segment(self, kind: str, first: int, last: int, reason: str, channel: str = "") -> Segment:
        return Segment(kind, float(self.time[first]), float(self.time[last]), reason, channel)

    def response(self, kind: str, response: AircraftResponse) -> Segment:
        return self.segment(kind, response.first, response.last, response.reason)


def ground_and_air(flight: Flight) -> tuple[Segment, ...]:
    """Return the segments on the ground and in the air.

    On the ground, the aircraft is slow through the air and over ground, or within 4 m of the height
    at which it was or will be slow; otherwise it is airborne. Needs V or calibrated airspeed; where
    that failed, or commands of wheels are logged without it, the speed over ground stands for it.
    With altitude or height above ground, the segments end at lift-off and begin at touch-down;
    where both are known, the altitude may follow a runway's slope. A record that is never slow is
    airborne throughout. Rotors whose commands are logged carry it at any speed.

    Speed (n,) [m/s], times [s].
    """
    flight = despite_ground(flight)
    found = airspeed_of(flight)
    shown = wheel_speed(flight) if found is None else found[1]
    ground = speed_over_ground(flight)
    if shown is None and any(name in flight for name in ("V", "calibrated_airspeed")):
        shown = ground  # the airspeed failed throughout
    if shown is None:
        return ()
    if ground is not None:
        shown = np.where(np.isfinite(shown), shown, ground)
    window = max(3, round(1.0 / flight.step))
    speed = median_filter(bridge(shown), window, mode="nearest")
    high = float(np.quantile(speed, 0.95))
    hovering = flagged(flight, "hover")
    by_rotors = carried(flight) & ~hovering
    lifted = [
        Segment("airborne", float(flight.time[a]), float(flight.time[b]), "its rotors carry it")
        for a, b in runs(by_rotors)
    ]
    hover = [
        Segment("hover", float(flight.time[a]), float(flight.time[b]), HOVER)
        for a, b in runs(hovering)
    ]
    if high < LEAST_AIRSPEED:
        reason = f"airspeed hardly above {max(high, 0.0):.1f} m/s"
        parts = [
            Segment("on_ground", float(flight.time[a]), float(flight.time[b]), reason)
            for a, b in runs(~hovering & ~by_rotors)
        ]
        return tuple(sorted([*parts, *lifted, *hover], key=lambda segment: segment.start))
    stay = round(SETTLED / flight.step)
    on_ground = np.zeros(len(speed), dtype=bool)
    slow = speed < SLOW * high
    if ground is not None:
        over = median_filter(bridge(ground), window, mode="nearest")
        slow &= ~((over > MOST_WIND * high) & np.isfinite(ground))
    slow &= ~hovering
    for first, last in _slow_runs(slow, speed, stay, window, flight.step):
        on_ground[slice(*_rolling(flight, speed, first, last))] = True
    on_ground &= ~hovering & ~by_rotors
    down = runs(on_ground, 1, stay)
    reason = (
        f"slower than {SLOW * high:.0f} m/s, or not yet {ROLLING_HEIGHT:g} m above where it was"
    )
    parts = [
        Segment("on_ground", float(flight.time[a]), float(flight.time[b]), reason) for a, b in down
    ]
    up = ~on_ground
    for first, last in down:
        up[first : last + 1] = False
    parts += hover
    up &= ~hovering
    reason = (
        "above the ground and fast enough to fly"
        if down
        else "never slow: no ground in this record"
    )
    parts += [
        Segment("airborne", float(flight.time[a]), float(flight.time[b]), reason)
        for a, b in runs(up)
    ]
    return tuple(sorted(parts, key=lambda segment: segment.start))


def _slow_runs(
    slow: Mask, speed: Array, stay: int, edge: int, step: float
) -> list[tuple[int, int]]:
    """First and last sample of what is slow for `stay` samples, or for `edge` where the record
    begins or ends and the speed (n,) [m/s] changes as on wheels: a log may end as the roll does. An
    airspeed that fails changes at once."""
    found, n = [], len(speed)
    for first, last in runs(slow, edge, stay):
        inside = last if first == 0 else first
        beside = last + edge if first == 0 else first - edge
        ends = (first == 0) != (last == n - 1) and 0 <= beside < n
        rolls = ends and abs(speed[beside] - speed[inside]) < GRAVITY * edge * step
        if last - first + 1 >= stay or rolls:
            found.append((first, last))
    return found


def _standing(flight: Flight) -> list[Segment]:
    """Where rotors whose commands are logged carry the aircraft and it hardly moves: hover, which
    counts like any other flight of what has no wing."""
    if "V" not in flight or not any(is_command(name) for name in flight.channels):
        return []
    slow = carried(flight) & (bridge(flight["V"]) < HOVER_SPEED) & ~flagged(flight, "hover")
    reason = f"rotors carry it at less than {HOVER_SPEED:g} m/s"
    return [
        Segment("hover", float(flight.time[a]), float(flight.time[b]), reason)
        for a, b in runs(slow, round(HOVER_TIME / flight.step))
    ]


def carried(flight: Flight) -> Mask:
    """Return where (n,) the mean command of rotors is above `CARRYING` times its usual value."""
    names = [name for name in flight.channels if is_command(name)]
    if not names:
        return np.zeros(len(flight.time), dtype=bool)
    mean = np.mean([bridge(flight[name]) for name in names], axis=0)
    usual = float(np.quantile(mean, 0.95))
    return np.asarray((mean > CARRYING * usual) & (usual > 0.0))


def _failed(flight: Flight) -> list[Segment]:
    return [
        Segment("failed", each.start, each.end, each.reason, each.channel)
        for each in failures(flight)
    ]


def flag_on_ground(flight: Flight) -> Flight:
    """The flight with ``on_ground`` flagged for all channels where `ground_and_air` finds it there.

    Flags are (n,).
    """
    down = np.zeros(len(flight.time), dtype=bool)
    for segment in ground_and_air(flight):
        if segment.kind == "on_ground":
            down |= (flight.time >= segment.start) & (flight.time <= segment.end)
    return flight.with_flag("flight", "on_ground", down) if down.any() else flight


def was_airborne(flight: Flight) -> bool:
    """Return whether any sample (n,) is on wings: flagged neither as on the ground
    (`flag_on_ground`) nor as hover."""
    return not bool(np.all(flagged(flight, "on_ground", "hover")))


def flagged(flight: Flight, *reasons: str) -> Mask:
    """Return where (n,) the flight as a whole has one of these flags."""
    bits = flight.flags.get("flight", np.zeros(len(flight.time), dtype=np.uint16))
    return (bits.astype(np.uint16) & np.uint16(sum(FLAGS[each] for each in reasons))) != 0


def _rolling(flight: Flight, speed: Array, first: int, last: int) -> tuple[int, int]:
    """Start and stop of the ground run around slow samples first..last of a speed (n,) [m/s]."""
    heights = [height for name in _HEIGHTS if (height := _height(flight, name)) is not None]
    if not heights:
        return first, last + 1
    low = np.zeros(len(speed), dtype=bool)
    if len(heights) > 1:
        low = flight.usable([_HEIGHTS[1]], despite=("hover",))
    begun = slice(first, min(first + _LEVEL, last + 1))
    ended = slice(max(first, last + 1 - _LEVEL), last + 1)

    def rolled(outwards: slice, near: slice) -> int:
        """Number of samples outwards that are on the ground."""
        rises = [height[outwards] - float(np.median(height[near])) for height in heights]
        way = np.cumsum(speed[outwards]) * flight.step
        sloped = low[outwards] & (np.abs(rises[-1]) < ROLLING_HEIGHT) & _on_a_line(rises[0], way)
        left = np.flatnonzero((np.abs(rises[0]) > ROLLING_HEIGHT) & ~sloped)
        return int(left[0]) if left.size else len(way)

    start = first - rolled(slice(first - 1, None, -1) if first else slice(0, 0), begun)
    return start, last + 1 + rolled(slice(last + 1, None), ended)


def _on_a_line(rise: Array, way: Array) -> Mask:
    """Where (n,) rises [m] over distances `way` [m] from the start are still about the line of a
    runway of one slope."""
    way = np.maximum(way, 1e-9)
    least = np.maximum.accumulate((rise - ROLLING_HEIGHT) / way)
    most = np.minimum.accumulate((rise + ROLLING_HEIGHT) / way)
    return np.asarray(np.maximum(least, -STEEPEST_RUNWAY) <= np.minimum(most, STEEPEST_RUNWAY))


def _height(flight: Flight, name: str) -> Array | None:
    """One of the heights (n,) [m] of a flight, bridged where not usable; None without it."""
    if name in flight and (good := flight.usable([name], despite=("hover",))).any():
        return bridge(np.where(good, flight[name], np.nan))
    return None


def configurations(flight: Flight) -> tuple[Segment, ...]:
    """Positions of gear, flaps, slats, speed brakes and spoilers, and the times at which they move.

    Times [s], positions [rad] (gear: part of its travel), from (n,) samples.
    """
    parts: list[Segment] = []
    for name in sorted(flight.channels):
        if CONFIGURATION.fullmatch(name) and flight.usable([name]).any():
            parts += _positions(flight, name)
    return tuple(sorted(parts, key=lambda segment: segment.start))


def _positions(flight: Flight, name: str) -> list[Segment]:
    """One channel's plateaus and the moves between them; plateaus of one position are one."""
    gear = name == "delta_landing_gear"
    least, what = (
        (GEAR_STEP if gear else INTENDED),
        name.removeprefix("delta_").replace("_", " "),
    )
    usable = flight.usable([name])
    values = median_filter(
        bridge(np.where(usable, flight[name], np.nan)),
        max(3, round(0.2 / flight.step)),
        mode="nearest",
    )
    shortest = max(2, round(HELD / flight.step))
    segments: list[Segment] = []
    level: float | None = None
    for first, last in runs(np.abs(_change(values, shortest)) < 0.5 * least, shortest):
        here = float(np.median(values[first : last + 1]))
        start, end = float(flight.time[first]), float(flight.time[last])
        text = f"{what} {here:.2f}" if gear else f"{what} {here / DEGREE:.1f} deg"
        if level is not None and abs(here - level) < least:
            segments[-1] = Segment(
                "configuration", segments[-1].start, end, segments[-1].reason, name
            )
            continue
        if segments:
            segments.append(
                Segment("configuration", segments[-1].end, start, f"{what} moves", name)
            )
        level = here
        segments.append(Segment("configuration", start, end, text, name))
    return segments


def _change(values: Array, samples: int) -> Array:
    """Change over `samples` around each value (n,)."""
    half = max(1, samples // 2)
    padded = np.pad(values, half, mode="edge")
    result: Array = padded[2 * half :] - padded[: -2 * half]
    return result


def _surfaces(view: _View) -> dict[str, Array]:
    """Primary surfaces: each name itself, else the asymmetric part of a left and a right one
    (ailerons) or the mean."""
    deflections: dict[str, Array] = {}
    for name in PRIMARY:
        whole = view.get(f"delta_{name}")
        right, left = view.get(f"delta_{name}_right"), view.get(f"delta_{name}_left")
        if whole is not None:
            deflections[f"delta_{name}"] = whole
        elif right is not None and left is not None:
            deflections[f"delta_{name}"] = (
                0.5 * (right - left) if name == "aileron" else 0.5 * (right + left)
            )
            if name in ("elevon", "ruddervator"):
                deflections[f"delta_{name}_asymmetric"] = 0.5 * (right - left)
    return deflections


def _inputs(view: _View, surfaces: dict[str, Array]) -> list[Segment]:
    """Inputs on all surfaces in the air, without the irregular companions of larger ones: dampers
    and crossfeeds make them, and they are no manoeuvres."""
    detected = [
        (name, shape) for name, values in surfaces.items() for shape in inputs(values, view.step)
    ]
    detected = [
        (name, shape) for name, shape in detected if view.flying[shape.first : shape.last + 1].all()
    ]
    segments = []
    for name, shape in detected:
        others = [
            other
            for owner, other in detected
            if owner != name and other.first <= shape.last and shape.first <= other.last
        ]
        largest = max((abs(other.deflection) for other in others), default=0.0)
        if shape.name not in PLAIN or largest < ABOVE_ACTIVITY * abs(shape.deflection):
            segments.append(
                view.segment(shape.name, shape.first, shape.last, _described(shape, name), name)
            )
    return segments


def _described(shape: Input, name: str) -> str:
    pulses = ", ".join(f"{duration:.1f}" for duration in shape.durations[:8])
    what = name.removeprefix("delta_").replace("_", " ")
    return (
        f"{what} {shape.deflection / DEGREE:+.1f} deg from trim, to alternating sides for"
        f" {pulses} s"
    )


def _responses(view: _View, surfaces: dict[str, Array]) -> list[Segment]:
    """Stall, load factor, slow oscillation and spiral, as far as their channels are there."""
    segments: list[Segment] = []
    az, phi, speed = view.get("az", "az_imu"), view.get("phi"), view.get("V")
    alpha, qbar = view.get("alpha"), view.get("qbar")

    def add(kind: str, detected: list[AircraftResponse]) -> None:
        segments.extend(view.response(kind, each) for each in detected)

    if az is not None and alpha is not None and qbar is not None:
        add("stall", stalls(alpha, az, qbar, view.step, view.flying & view.known("alpha")))
    if az is not None:
        level = np.zeros_like(az) if phi is None else phi
        segments += [
            view.response(kind, each)
            for kind, each in load_factors(az, level, view.step, view.flying)
        ]
    if speed is not None and "delta_elevator" in surfaces:
        add(
            "slow_oscillation",
            slow_oscillations(
                speed,
                view.get("altitude"),
                surfaces["delta_elevator"],
                view.step,
                view.flying & view.known("V"),
            ),
        )
    if phi is not None and surfaces:
        add(
            "spiral",
            spirals(phi, list(surfaces.values()), view.step, view.flying & view.known("phi")),
        )
    return segments


def _steady(view: _View, busy: list[Segment]) -> list[Segment]:
    speed, theta, phi = view.get("V"), view.get("theta"), view.get("phi")
    if speed is None or theta is None:
        return []
    free = view.flying & view.known("V") & view.known("theta")
    for segment in busy:
        free[(view.time >= segment.start) & (view.time <= segment.end)] = False
    bank = np.zeros_like(theta) if phi is None else phi
    return [view.response("steady", each) for each in steady(speed, theta, bank, view.step, free)]
