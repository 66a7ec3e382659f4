"""What a PX4 log says of its aircraft: kind, control surfaces, airspeeds, positions of sensors.

Parameters: docs.px4.io, "Parameter Reference" (CA_AIRFRAME, CA_SV_CS*_TYPE, CA_SV_CS*_TRQ_*,
FW_AIRSPD_*, EKF2_IMU_POS_*, SENS_BOARD_ROT, SYS_AUTOSTART) and MAVLink's MAV_TYPE. In PX4 a
positive command turns a horizontal surface up and a rudder to the right ("Actuator Configuration");
here trailing edge down and left are positive, so that scales are negative unless the torques say
otherwise.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from aerodb.logs.rotors import FoundRotors, rotors_of
from aerodb.recording import Recording
from aerodb.signals import runs

#: Kind whose rotors that lift it and that pull it are different ones, all fixed.
STANDARD_VTOL: Final = "standard VTOL"
_AIRFRAMES: Final = {
    0: "multicopter",
    1: "fixed wing",
    2: STANDARD_VTOL,
    3: "tiltrotor VTOL",
    4: "tailsitter VTOL",
    5: "rover",
    6: "rover",
    7: "multicopter",
    8: "multicopter",
    10: "helicopter",
    11: "helicopter",
    12: "helicopter",
}
#: MAV_TYPE of MAVLink.
_TYPES: Final = {
    1: "fixed wing",
    2: "quadrotor",
    3: "helicopter",
    4: "helicopter",
    10: "rover",
    11: "boat",
    12: "submarine",
    13: "hexarotor",
    14: "octorotor",
    15: "tricopter",
    **dict.fromkeys(range(19, 26), "VTOL"),
    29: "dodecarotor",
    35: "decarotor",
}
#: Kinds that fixed rotors carry.
_CARRIED: Final = frozenset(
    [
        *("multicopter", "quadrotor", "hexarotor", "octorotor", "tricopter", "dodecarotor"),
        "decarotor",
    ]
)
#: Kinds without a wing.
WINGLESS: Final = _CARRIED | {"helicopter", "rover", "boat", "submarine"}
#: CA_SV_CS*_TYPE -> surface, axis of its torque, and the sign of the torque of a deflection that is
#: positive here; 0: the torque does not say.
_SURFACES: Final = {
    1: ("aileron_left", "R", 1),
    2: ("aileron_right", "R", -1),
    3: ("elevator", "P", -1),
    4: ("rudder", "Y", -1),
    5: ("elevon_left", "P", -1),
    6: ("elevon_right", "P", -1),
    7: ("vtail_left", "P", -1),
    8: ("vtail_right", "P", -1),
    9: ("flap_left", "P", 0),
    10: ("flap_right", "P", 0),
    11: ("airbrake", "P", 0),
    13: ("atail_left", "P", -1),
    14: ("atail_right", "P", -1),
    15: ("aileron", "R", -1),
    17: ("spoiler_left", "P", 0),
    18: ("spoiler_right", "P", 0),
}
_PAIRS: Final = {
    "aileron": (("aileron", "asymmetric"),),
    "elevon": (("elevator", "symmetric"), ("aileron", "asymmetric")),
    "vtail": (("elevator", "symmetric"), ("rudder", "asymmetric")),
    "atail": (("elevator", "symmetric"), ("rudder", "asymmetric")),
    "flap": (("flap", "symmetric"),),
    "spoiler": (("spoiler", "symmetric"),),
}


@dataclass(frozen=True)
class LoggedSurface:
    """A control surface as the autopilot commands it.

    sign : of the deflection that a positive command gives, here. stated : whether the autopilot's
    torques say so. topic, field : of the command; '' where the mapping knows them.
    """

    name: str
    sign: int
    stated: bool
    topic: str = ""
    field: str = ""


@dataclass(frozen=True)
class LoggedAircraft:
    """What a log says of its aircraft.

    kind : in words; '' where it does not say. airspeeds : STALL, MIN, TRIM, MAX [m/s].
    combinations : name, kind, right and left surface. points : imu and gps -> position from the CG
    [m], body axes. notes : further parameters, one sentence each. rotors : of one without a wing,
    and of one with a wing whose log only hovers.
    """

    kind: str
    surfaces: tuple[LoggedSurface, ...]
    combinations: tuple[tuple[str, str, str, str], ...]
    airspeeds: Mapping[str, float]
    points: Mapping[str, tuple[float, float, float]]
    notes: tuple[str, ...]
    rotors: FoundRotors = field(default_factory=FoundRotors)

    @property
    def described(self) -> bool:
        """Whether wings or logged rotors may be described; True also where the log does not say."""
        return self.has_wing or self.rotors.logged

    @property
    def has_wing(self) -> bool:
        """False for what flies or drives without a wing; True also where the log does not say."""
        return self.kind not in WINGLESS


def wingless_sentence(aircraft: LoggedAircraft) -> str:
    """Return what it means that a log is of an aircraft without wings whose rotors it does not
    tell."""
    if aircraft.rotors.rotors:
        still = [each.name for each in aircraft.rotors.rotors if not each.topic]
        which = f"rotor {', '.join(still[:3])}{' and more' if len(still) > 3 else ''}"
        return f"the log is of a {aircraft.kind}: no command of {which} is logged that ever moves"
    return f"the log is of a {aircraft.kind}: it tells neither wing nor rotors to describe"


def hover_sentence(kind: str, hover: Sequence[tuple[float, float]] = ()) -> str:
    """Return what it means that a log is of an aircraft that also hovers; '' for others.

    hover : from when to when [s] it does, by modes and lift motors; empty where the log does not
    say.

    >>> hover_sentence("fixed wing"), hover_sentence("quadplane VTOL", [(5.0, 20.0)])[-31:]
    ('', 'by its modes from 5.0 to 20.0 s')
    """
    if "VTOL" not in kind:
        return ""
    turned = " with its axes turned" if "tailsitter" in kind else ""
    times = " and ".join(f"from {start:.1f} to {end:.1f} s" for start, end in hover[:3])
    more = f" and {len(hover) - 3} more times" if len(hover) > 3 else ""
    left = f"left out by its modes {times}{more}" if hover else "leave them out"
    return f"hover and transition{turned} are no wing-borne flight of a {kind}: {left}"


def stretches_of(
    recording: Recording, topic: str, fields: Sequence[str], states: Collection[int]
) -> tuple[tuple[float, float], ...]:
    """Return from when to when [s] a topic's number, the first of these fields, is one of the
    states; it holds until the next message, the last until the log ends."""
    found = recording.topics.get(topic)
    number = next(
        (found.fields[n] for n in fields if found is not None and n in found.fields), None
    )
    if found is None or number is None or not len(found.time):
        return ()
    values = np.asarray(number)
    if values.dtype.kind not in "fiub":
        return ()
    last = max(float(each.time[-1]) for each in recording.topics.values() if len(each.time))
    ends = [*(float(time) for time in found.time[1:]), last]
    inside = np.isin(values.astype(np.int64), list(states))
    return tuple((float(found.time[a]), ends[b]) for a, b in runs(inside))


_Times = tuple[tuple[float, float], ...]
#: vehicle_vtol_state of PX4: transition to and from the wing, and rotors alone.
_HOVER_STATES: Final = (1, 2, 3)
#: The same: transition to and from the wing, and the wing alone.
_WING_STATES: Final = (1, 2, 4)
_STATUS: Final = "vtol_vehicle_status"
_FORMER_STATUS: Final = ("vtol_in_rw_mode", "in_rw_mode")


def px4_hover(recording: Recording) -> tuple[tuple[float, float], ...]:
    """Return from when to when [s] rotors carry a VTOL of PX4, transitions included and what stands
    on the ground not."""
    hover = stretches_of(recording, _STATUS, ("vehicle_vtol_state",), _HOVER_STATES)
    hover = hover or stretches_of(recording, _STATUS, _FORMER_STATUS, (1,))
    landed = stretches_of(recording, "vehicle_land_detected", ("landed",), (1,))
    return _without(hover, landed)


def only_hovers(recording: Recording) -> bool:
    """Return whether a log is of a VTOL of PX4 with fixed rotors that carry it whenever it flies,
    by its modes."""
    known = _known(recording)
    if _AIRFRAMES.get(int(known.get("CA_AIRFRAME", -1))) != STANDARD_VTOL:
        return False
    winged = stretches_of(recording, _STATUS, ("vehicle_vtol_state",), _WING_STATES)
    winged = winged or stretches_of(recording, _STATUS, _FORMER_STATUS, (0,))
    return bool(px4_hover(recording)) and not winged


def _without(stretches: _Times, others: _Times) -> _Times:
    """What is left of stretches [s] outside others.

    >>> _without(((0.0, 9.0),), ((1.0, 2.0), (8.0, 12.0)))
    ((0.0, 1.0), (2.0, 8.0))
    """
    for first, last in others:
        stretches = tuple(
            (a, b)
            for start, end in stretches
            for a, b in ((start, min(end, first)), (max(start, last), end))
            if b > a
        )
    return stretches


def read_px4(recording: Recording) -> LoggedAircraft:
    """Return what the parameters of a PX4 log say; empty for a log without parameters.

    Speeds [m/s], points (3,) [m].
    """
    known = _known(recording)
    carried = _kind(known) in _CARRIED or only_hovers(recording)
    surfaces = _allocated(known, recording) or _controls(recording, _kind(known))
    return LoggedAircraft(
        kind=_kind(known),
        surfaces=surfaces,
        combinations=_combinations({surface.name for surface in surfaces}),
        airspeeds={
            name: float(known[f"FW_AIRSPD_{name}"])
            for name in ("STALL", "MIN", "TRIM", "MAX")
            if f"FW_AIRSPD_{name}" in known
        },
        points=_points(known),
        notes=_notes(known),
        rotors=rotors_of(recording, known) if carried else FoundRotors(),
    )


def _known(recording: Recording) -> dict[str, Any]:
    """Parameters by name."""
    return {
        key.removeprefix("param:"): value
        for key, value in recording.metadata.items()
        if key.startswith("param:")
    }


def _kind(known: Mapping[str, Any]) -> str:
    of_type = _TYPES.get(int(known.get("MAV_TYPE", -1)), "")
    airframe = _AIRFRAMES.get(int(known.get("CA_AIRFRAME", -1)), "")
    if airframe == "multicopter" and of_type:
        return of_type  # CA_AIRFRAME is 0 also where nobody set it
    return airframe or of_type


def _allocated(known: Mapping[str, Any], recording: Recording) -> tuple[LoggedSurface, ...]:
    """Surfaces of the control allocator (v1.13 and later), in the order of its servos."""
    found, taken = [], set()
    for k in range(int(known.get("CA_SV_CS_COUNT", 0))):
        name, axis, sign = _SURFACES.get(int(known.get(f"CA_SV_CS{k}_TYPE", 0)), ("", "R", 0))
        name = name if name and name not in taken else f"{name or 'surface'}_{k}"
        taken.add(name)
        torque = float(known.get(f"CA_SV_CS{k}_TRQ_{axis}", 0.0)) * sign
        stated = torque != 0.0
        is_logged = f"control[{k}]" in _fields(recording, "actuator_servos")
        found.append(
            LoggedSurface(
                name,
                (1 if torque > 0 else -1) if stated else -1,
                stated,
                "actuator_servos" if is_logged else "",
                f"control[{k}]" if is_logged else "",
            )
        )
    return tuple(found)


def _controls(recording: Recording, kind: str) -> tuple[LoggedSurface, ...]:
    """Surfaces of former releases: what the mixer was asked for about roll, pitch and yaw.

    A VTOL asks its wing in the second group.
    """
    topic = "actuator_controls_1" if "VTOL" in kind else "actuator_controls_0"
    if "control[2]" not in _fields(recording, topic):
        return ()
    return tuple(
        LoggedSurface(name, -1, False, topic, f"control[{k}]")
        for k, name in enumerate(("aileron", "elevator", "rudder"))
    )


def _fields(recording: Recording, topic: str) -> tuple[str, ...]:
    found = recording.topics.get(topic)
    return tuple(found.fields) if found is not None else ()


def _combinations(names: set[str]) -> tuple[tuple[str, str, str, str], ...]:
    found: dict[str, tuple[str, str, str, str]] = {}
    for pair, combined_of in _PAIRS.items():
        right, left = f"{pair}_right", f"{pair}_left"
        for combined, kind in combined_of if {right, left} <= names else ():
            if combined not in names:
                found.setdefault(combined, (combined, kind, right, left))
    return tuple(found.values())


def _points(known: Mapping[str, Any]) -> dict[str, tuple[float, float, float]]:
    found = {}
    for name in ("IMU", "GPS"):
        x, y, z = (float(known.get(f"EKF2_{name}_POS_{axis}", 0.0)) for axis in "XYZ")
        if (x, y, z) != (0.0, 0.0, 0.0):
            found[name.lower()] = (x, y, z)
    return found


def _notes(known: Mapping[str, Any]) -> tuple[str, ...]:
    notes = []
    if "SYS_AUTOSTART" in known:
        notes.append(f"SYS_AUTOSTART {int(known['SYS_AUTOSTART'])} (airframe reference of PX4)")
    if int(known.get("SENS_BOARD_ROT", 0)):
        turned = int(known["SENS_BOARD_ROT"])
        notes.append(f"SENS_BOARD_ROT {turned}: the board is turned; the log is in body axes")
    offsets = [float(known.get(f"SENS_BOARD_{axis}_OFF", 0.0)) for axis in "XYZ"]
    if any(offsets):
        shown = ", ".join(f"{value:.2f}" for value in offsets)
        notes.append(f"SENS_BOARD_*_OFF {shown} deg: fine rotation, in the log already")
    if "ASPD_SCALE_1" in known or "ASPD_SCALE" in known:
        scale = float(known.get("ASPD_SCALE_1", known.get("ASPD_SCALE", 1.0)))
        notes.append(f"airspeed scale {scale:g}: of indicated to calibrated airspeed, in the log")
    return tuple(notes)
