"""Signs of columns that turns, climbs and forces of the flight contradict."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Final

import numpy as np

from aerodb.logs.clocks import ClockColumn, seconds_of
from aerodb.logs.guesses import Guess, in_si
from aerodb.logs.ties import LEAST_CORRELATION, together
from aerodb.physics import GRAVITY
from aerodb.recording import Recording
from aerodb.support import Array

LEFT: Final = "is it positive to the left?"
_BANKS: Final = f"it banks against its turns: {LEFT}"
_PITCHES: Final = "it pitches against its climbs: is it positive downwards?"
#: Channel, what follows it, whether by its rate, with which sign, and what to ask of either if it
#: does not: in turns, climbs, and by the forces of the air. The first of a channel that is there
#: decides.
_FOLLOWED: Final = (
    ("phi", "psi", True, 1.0, _BANKS, f"it turns against its banks: {LEFT}"),
    ("phi", "r", False, 1.0, _BANKS, f"it turns against the banks: {LEFT}"),
    ("theta", "altitude", True, 1.0, _PITCHES, ""),
    ("theta", "velocity_down", False, -1.0, _PITCHES, ""),
    ("alpha", "az_imu", False, -1.0, "lift falls as it grows: is it positive downwards?", ""),
    ("beta", "ay_imu", False, -1.0, f"the side force grows with it: {LEFT}", ""),
)
#: What is asked of other axes where one points up, which the flight itself may answer.
UPWARD: Final = "points up: does this axis point the other way as well?"
_DOWNWARD: Final = "it pitches against the lift: is it positive downwards?"
_SINKING: Final = "it pitches against the force along the body: is it positive downwards?"
#: X-Plane's sideslip is the heading relative to the flown path (DataRefs.txt).
HEADED: Final = f"of X-Plane, the heading relative to the path: {LEFT}"


def reversed_signs(
    recording: Recording,
    guesses: Mapping[str, Guess],
    clocks: Mapping[str, ClockColumn],
    columns: Mapping[tuple[str, str], Array],
) -> Iterator[tuple[str, Guess]]:
    """Angles that go against turns, climbs and forces of the flight, with the question about their
    sign."""
    compared: set[str] = set()
    for angle, path, by_rate, sign, *asks in _FOLLOWED:
        if not {angle, path} <= guesses.keys() or angle in compared:
            continue
        follows = _together(recording, guesses[angle], guesses[path], by_rate, clocks, columns)
        if follows is None or abs(follows) < LEAST_CORRELATION:
            continue
        compared.add(angle)
        for name, ask in zip((angle, path), asks, strict=True):
            if sign * follows < 0 and ask and not guesses[name].open:
                yield name, replace(guesses[name], open=ask)
            # The side force may point the other way with the sideslip, so that they agree.
            elif sign * follows > 0 and angle != "beta" and guesses[name].by_axis:
                yield (
                    name,
                    replace(guesses[name], open="", by_axis=False),
                )
    for name, agrees in _by_forces(recording, guesses, clocks, columns):
        ask = _DOWNWARD if name == "q" else _SINKING
        pitch = guesses.get("theta")
        for each in (guesses[name], pitch if name == "q" else None):
            if each is None or each.channel in compared:
                continue
            if not agrees and not each.open:
                yield each.channel, replace(each, open=ask)
            elif agrees and each.channel == name and each.by_axis:
                yield name, replace(each, open="", by_axis=False)
        compared |= {name, "theta"} if pitch is not None and not agrees else {name}


def _by_forces(
    recording: Recording,
    guesses: Mapping[str, Guess],
    clocks: Mapping[str, ClockColumn],
    columns: Mapping[tuple[str, str], Array],
) -> Iterator[tuple[str, bool]]:
    """Pitch rate and pitch angle, and whether they agree with the forces of the flight: lift turns
    the path, `q V = -az - g cos(phi)`, and `g sin(theta) = ax - dV/dt`, as means."""
    for name, force in (("q", "az_imu"), ("theta", "ax_imu")):
        speed = guesses.get("V", guesses.get("calibrated_airspeed"))
        used = [guesses.get(name), guesses.get(force), speed]
        known = [each for each in used if each is not None and each.unit]
        if len(known) < len(used) or len({each.topic for each in known}) > 1:
            continue
        time = seconds_of(recording, known[0].topic, clocks)
        shown, forced, flown = (in_si(each, columns) for each in known)
        bank = guesses.get("phi")
        banked = in_si(bank, columns) if bank is not None and bank.unit else np.zeros(1)
        if not time.size == shown.size == forced.size == flown.size:
            continue
        if banked.size not in (1, time.size) or time.size < 2 or np.any(np.diff(time) <= 0):
            continue
        with np.errstate(all="ignore"):
            path = (
                (-forced - GRAVITY * np.cos(banked)) / flown
                if name == "q"
                else forced - np.gradient(flown, time)
            )
        agrees = together(time, shown, path)
        if agrees is not None and abs(agrees) >= LEAST_CORRELATION:
            yield name, agrees > 0


def _together(
    recording: Recording,
    angle: Guess,
    path: Guess,
    by_rate: bool,
    clocks: Mapping[str, ClockColumn],
    columns: Mapping[tuple[str, str], Array],
) -> float | None:
    """Correlation of an angle with another channel, or with its rate, as means over some time;
    None where too little is there."""
    if angle.topic != path.topic or not (angle.unit and path.unit):
        return None
    time = seconds_of(recording, angle.topic, clocks)
    shown, way = in_si(angle, columns), in_si(path, columns)
    if not time.size == shown.size == way.size:
        return None
    good = np.isfinite(time) & np.isfinite(shown) & np.isfinite(way)
    if good.sum() < 2:
        return None
    way = np.unwrap(way[good]) if path.channel == "psi" else way[good]
    rate = np.gradient(way, time[good]) if by_rate else way
    return together(time[good], shown[good], rate)
