"""What an ArduPilot log says of its aircraft: kind, surfaces, airspeeds, positions of sensors.

Parameters: ardupilot.org/plane, "Complete Parameter List" (SERVOn_FUNCTION, AIRSPEED_*,
INS_POSn_*, GPS_POSn_*). Surfaces are those of the servos' functions, commanded as AETR logs them:
about roll right, pitch up and yaw right, so that scales are negative where trailing edge down and
left are positive.
"""

from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from aerodb.logs.autopilot import LoggedAircraft, LoggedSurface, stretches_of
from aerodb.logs.rotors import FoundRotors, ardupilot_rotors
from aerodb.recording import Recording

#: First word of the firmware's name -> kind of vehicle.
_KINDS: Final = {
    "ArduPlane": "fixed wing",
    "ArduCopter": "multicopter",
    "ArduRover": "rover",
    "Rover": "rover",
    "ArduSub": "submarine",
}
#: SERVOn_FUNCTION -> surfaces that its servo moves.
_FUNCTIONS: Final = {
    4: ("aileron",),
    **dict.fromkeys((24, 25), ("aileron",)),
    19: ("elevator",),
    21: ("rudder",),
    **dict.fromkeys((77, 78), ("elevator", "aileron")),
    **dict.fromkeys((79, 80), ("elevator", "rudder")),
}
#: Airspeed -> its parameters, of this and of former firmware, and what a value of 1 is in m/s.
_AIRSPEEDS: Final = {
    "STALL": (("AIRSPEED_STALL", 1.0),),
    "MIN": (("AIRSPEED_MIN", 1.0), ("ARSPD_FBW_MIN", 1.0)),
    "TRIM": (("AIRSPEED_CRUISE", 1.0), ("TRIM_ARSPD_CM", 0.01)),
    "MAX": (("AIRSPEED_MAX", 1.0), ("ARSPD_FBW_MAX", 1.0)),
}
#: Modes of a quadplane in which lift motors carry it: QSTABILIZE to QRTL, QAUTOTUNE, QACRO.
_HOVER_MODES: Final = (17, 18, 19, 20, 21, 22, 23)
#: Message of the lift motors' controller (ArduPilot, log messages): at 25 Hz while they act.
_LIFTING: Final = "QTUN"
#: Silence [s] from which they have stopped.
_QUIET: Final = 1.0
#: Q_FRAME_CLASS of a tailsitter without lift motors.
_TAILSITTER: Final = 10
_POSITIONS: Final = {"imu": ("INS_POS1",), "gps": ("GPS_POS1", "GPS1_POS")}


def is_ardupilot(recording: Recording) -> bool:
    """Return whether ArduPilot wrote a log: its `format` is ``dataflash``, or its telemetry names
    the firmware."""
    return recording.format == "dataflash" or (
        recording.format == "mavlink" and recording.metadata.get("sys_name") in _KINDS
    )


def read_ardupilot(recording: Recording) -> LoggedAircraft:
    """Return what the parameters of an ArduPilot log say; empty for a log without parameters.

    Speeds [m/s], points (3,) [m].
    """
    known = {
        key.removeprefix("param:"): value
        for key, value in recording.metadata.items()
        if key.startswith("param:")
    }
    moved = {
        surface
        for k in range(1, 33)
        for surface in _FUNCTIONS.get(int(known.get(f"SERVO{k}_FUNCTION", -1)), ())
    }
    names = [name for name in ("aileron", "elevator", "rudder") if name in moved]
    kind = _kind(recording, known)
    firmware = str(recording.metadata.get("ver_sw", ""))
    return LoggedAircraft(
        kind=kind,
        surfaces=tuple(LoggedSurface(name, -1, True) for name in names),
        combinations=(),
        airspeeds={
            kind: float(known[name]) * size
            for kind, parameters in _AIRSPEEDS.items()
            for name, size in reversed(parameters)
            if name in known
        },
        points=_points(known),
        notes=(firmware,) if firmware else (),
        rotors=ardupilot_rotors(recording, known) if kind == "multicopter" else FoundRotors(),
    )


def _kind(recording: Recording, known: Mapping[str, Any]) -> str:
    """Kind of vehicle; a plane with Q_ENABLE is a quadplane, or a tailsitter by its parameters."""
    kind = _KINDS.get(str(recording.metadata.get("sys_name", "")), "")
    if kind != "fixed wing" or float(known.get("Q_ENABLE", 0)) < 1:
        return kind
    tailsitter = (
        float(known.get("Q_TAILSIT_ENABLE", 0)) >= 1
        or float(known.get("Q_FRAME_CLASS", 0)) == _TAILSITTER
    )
    return "tailsitter VTOL" if tailsitter else "quadplane VTOL"


def ardupilot_hover(recording: Recording) -> tuple[tuple[float, float], ...]:
    """Return from when to when [s] an ArduPilot log is in a mode in which lift motors carry the
    aircraft, or they do in another one, such as a take-off in AUTO; the last stretch of a mode ends
    with the log."""
    modes = stretches_of(recording, "MODE", ("ModeNum", "Mode"), _HOVER_MODES)
    modes = modes or stretches_of(recording, "HEARTBEAT", ("custom_mode",), _HOVER_MODES)
    found: list[tuple[float, float]] = []
    for start, end in sorted((*modes, *_lifted(recording))):
        if found and start <= found[-1][1]:
            found[-1] = (found[-1][0], max(found[-1][1], end))
        else:
            found.append((start, end))
    return tuple(found)


def _lifted(recording: Recording) -> tuple[tuple[float, float], ...]:
    """From when to when [s] lift motors act: their messages are logged then only."""
    topic = recording.topics.get(_LIFTING)
    if topic is None or len(topic.time) < 2:
        return ()
    ends = np.flatnonzero(np.diff(topic.time) > _QUIET)
    first, last = np.r_[0, ends + 1], np.r_[ends, len(topic.time) - 1]
    return tuple(
        (float(topic.time[a]), float(topic.time[b])) for a, b in zip(first, last, strict=True)
    )


def _points(known: Mapping[str, Any]) -> dict[str, tuple[float, float, float]]:
    found = {}
    for name, prefixes in _POSITIONS.items():
        for prefix in prefixes:
            x, y, z = (float(known.get(f"{prefix}_{axis}", 0.0)) for axis in "XYZ")
            if (x, y, z) != (0.0, 0.0, 0.0):
                found[name] = (x, y, z)
    return found
