"""Rotors of a multicopter as its log states them: places, turning, and what was told to them.

Sources: docs.px4.io, "Parameter Reference" (CA_ROTOR*_PX/PY/PZ/AX/AY/AZ/KM/CT, PWM_*_FUNC*,
PWM_*_MIN*, PWM_*_MAX*, THR_MDL_FAC), "Control Allocation" and "Airframe Reference"; ardupilot.org/
copter, "Connect ESCs and Motors" (order and turning by FRAME_CLASS and FRAME_TYPE), MOT_PWM_MIN,
MOT_PWM_MAX. In PX4 a positive KM turns anticlockwise, seen from above: right-handed about an axis
that points up.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from aerodb.recording import Recording, Topic
from aerodb.support import Array
from aerodb.vehicle import FULL

#: Frame -> bearing [deg] and turning of each motor in order; 1 is anticlockwise from above.
FRAMES: Final[Mapping[str, tuple[tuple[float, int], ...]]] = {
    "quad x": ((45, 1), (-135, 1), (-45, -1), (135, -1)),
    "quad plus": ((90, 1), (-90, 1), (0, -1), (180, -1)),
    "hexa x": ((90, -1), (-90, 1), (-30, -1), (150, 1), (30, 1), (-150, -1)),
    "hexa plus": ((0, -1), (180, 1), (-120, -1), (60, 1), (-60, 1), (120, -1)),
    "octo x": (
        (22.5, -1), (-157.5, -1), (67.5, 1), (157.5, 1), (-22.5, 1), (-112.5, 1), (-67.5, -1),
        (112.5, -1),
    ),
    "octo plus": (
        (0, -1), (180, -1), (45, 1), (135, 1), (-45, 1), (-135, 1), (-90, -1), (90, -1),
    ),
}  # fmt: skip
#: MAV_TYPE of MAVLink -> PX4's usual frame.
_OF_TYPE: Final = {2: "quad x", 13: "hexa x", 14: "octo x"}
#: FRAME_CLASS and FRAME_TYPE of ArduPilot.
_CLASSES: Final = {1: "quad", 2: "hexa", 3: "octo"}
_TYPES: Final = {0: "plus", 1: "x"}
#: Distance [m] of rotors from the centre where no parameter states it: a placeholder.
ARM: Final = 0.25
#: Moment over thrust of a rotor [m] where no parameter states it: PX4's default.
_MOMENT_RATIO: Final = 0.05
#: Function of an output that drives the first motor: of PX4, of ArduPilot.
_MOTOR_PX4, _MOTOR_ARDUPILOT = 101, 33
#: Pulses [us] of commands 0 and 1 where no parameter states them.
_PULSES: Final = (1000.0, 2000.0)
#: Outputs of PX4 by the prefix of their parameters.
_OUTPUTS: Final = ("PWM_MAIN", "PWM_AUX", "SIM_GZ_EC", "UAVCAN_EC")
#: CA_AIRFRAME whose rotors are fixed: multicopter, standard VTOL.
_FIXED: Final = (0, 2)
#: Least share of its thrust that a rotor which lifts has upwards: within 60 deg.
_UPWARDS: Final = 0.5
#: Revolutions per minute to which the fastest logged speed is rounded up.
_ROUND: Final = 100.0


@dataclass(frozen=True)
class FoundRotor:
    """A rotor as a log states it.

    position : (3,) [m] from the CG. axis : (3,), direction of the thrust. turns : 1 right-handed
    about it, or -1. moment_ratio : moment over thrust [m]. strength : thrust over that of the first
    rotor, at the same command. topic, field : what is logged of it, '' where nothing is; `low` and
    `high` : values that are commands of 0 and 1. fastest : speed [rev/s] of command 1; 0 where only
    commands are logged. usual, largest : command of most of the
    flight, and the 98th percentile of it in flight.
    """

    name: str
    position: tuple[float, float, float]
    axis: tuple[float, float, float]
    turns: int
    moment_ratio: float
    strength: float = 1.0
    topic: str = ""
    field: str = ""
    low: float = 0.0
    high: float = 1.0
    fastest: float = 0.0
    usual: float = 0.5
    largest: float = 1.0

    @property
    def lifts(self) -> bool:
        """Whether it lifts; another pulls or pushes."""
        return -self.axis[2] > _UPWARDS * float(np.linalg.norm(self.axis))

    @property
    def reached(self) -> str:
        """What is logged of the largest command and the range that is stated, in words and in the
        unit of the log."""
        at_most = self.low + self.largest * (self.high - self.low)
        return (
            f"{self.topic} {self.field} of rotor {self.name} reaches {at_most:.4g}, beyond"
            f" {self.low:g} to {self.high:g}, which the log's parameters state"
        )


@dataclass(frozen=True)
class FoundRotors:
    """Rotors of a log, in the order of the autopilot's motors.

    placed : whether parameters state where they are; else they are a frame's, at `ARM`. frame : its
    name, '' for the allocator's own. thrust_factor : share of the command's square in what the
    autopilot takes for thrust (THR_MDL_FAC), which it has made up for in the logged commands.
    """

    rotors: tuple[FoundRotor, ...] = ()
    placed: bool = True
    frame: str = ""
    thrust_factor: float = 0.0

    @property
    def logged(self) -> bool:
        """Whether command or speed of every rotor is logged."""
        return bool(self.rotors) and all(each.topic for each in self.rotors)

    @property
    def lifting(self) -> tuple[FoundRotor, ...]:
        """Rotors that lift."""
        return tuple(each for each in self.rotors if each.lifts)

    @property
    def beyond(self) -> tuple[FoundRotor, ...]:
        """Rotors whose logged commands leave the range that parameters state."""
        return tuple(each for each in self.rotors if each.largest > FULL)


def rotors_of(recording: Recording, known: Mapping[str, Any]) -> FoundRotors:
    """Return the rotors of a PX4 log; none for a vehicle without. One that does not lift and
    stands still is left out. known : its parameters."""
    count = int(known.get("CA_ROTOR_COUNT", 0))
    if count and int(known.get("CA_AIRFRAME", 0)) in _FIXED:
        told = tuple(_allocated(known, number) for number in range(count))
        placed = len({each.position for each in told}) == len(told)
        found = FoundRotors(told) if placed else FoundRotors()
    else:
        found = FoundRotors()
    if not found.rotors:
        frame = _OF_TYPE.get(int(known.get("MAV_TYPE", -1)), "")
        found = _of_frame(frame) if frame else found
    if not found.rotors:
        return found
    speeds, commands = recording.topics.get("esc_status"), recording.topics.get("actuator_motors")
    made, factor = [], 0.0
    for number, rotor in enumerate(found.rotors):
        if (rpm := _moving(speeds, f"esc[{number}].esc_rpm")) is not None:
            high = _ROUND * float(np.ceil(np.max(rpm) / _ROUND))
            each = _told(rotor, "esc_status", f"esc[{number}].esc_rpm", (0.0, high), rpm, high / 60)
        elif (told_ := _moving(commands, f"control[{number}]")) is not None:
            factor = float(known.get("THR_MDL_FAC", 0.0))
            each = _told(rotor, "actuator_motors", f"control[{number}]", (0.0, 1.0), told_)
        else:
            each = _pulsed(recording, known, rotor, number)
        made += [each] if each.topic or each.lifts else []
    return FoundRotors(tuple(made), found.placed, found.frame, factor)


def ardupilot_rotors(recording: Recording, known: Mapping[str, Any]) -> FoundRotors:
    """Return the rotors of an ArduPilot copter's log; none for another frame than quad, hexa and
    octo, x and plus. known : its parameters."""
    shape = _CLASSES.get(int(known.get("FRAME_CLASS", 0)), "")
    form = _TYPES.get(int(known.get("FRAME_TYPE", -1)), "")
    found = _of_frame(f"{shape} {form}") if shape and form else FoundRotors()
    pulses = tuple(
        float(known.get(name, usual))
        for name, usual in zip(("MOT_PWM_MIN", "MOT_PWM_MAX"), _PULSES, strict=True)
    )
    channel = {
        int(known[f"SERVO{k}_FUNCTION"]) - _MOTOR_ARDUPILOT: k
        for k in range(1, 15)
        if f"SERVO{k}_FUNCTION" in known
    }
    made = []
    for number, rotor in enumerate(found.rotors):
        field = f"C{channel.get(number, number + 1)}"
        told = _moving(recording.topics.get("RCOU"), field)
        low, high = pulses if pulses[0] < pulses[1] else _PULSES
        made.append(rotor if told is None else _told(rotor, "RCOU", field, (low, high), told))
    return FoundRotors(tuple(made), found.placed, found.frame)


def _allocated(known: Mapping[str, Any], number: int) -> FoundRotor:
    """A rotor of PX4's control allocator."""

    def value(name: str, usual: float) -> float:
        return float(known.get(f"CA_ROTOR{number}_{name}", usual))

    ratio = value("KM", _MOMENT_RATIO)
    first = float(known.get("CA_ROTOR0_CT", 6.5)) or 6.5
    axis = (value("AX", 0.0), value("AY", 0.0), value("AZ", -1.0))
    return FoundRotor(
        str(number + 1),
        (value("PX", 0.0), value("PY", 0.0), value("PZ", 0.0)),
        axis if any(axis) else (0.0, 0.0, -1.0),
        1 if ratio > 0.0 else -1,
        abs(ratio),
        value("CT", 6.5) / first,
    )


def _of_frame(frame: str) -> FoundRotors:
    made = []
    for number, (bearing, turns) in enumerate(FRAMES[frame]):
        angle = np.deg2rad(bearing)
        x, y = (float(np.round(ARM * f(angle), 4)) + 0.0 for f in (np.cos, np.sin))
        made.append(
            FoundRotor(str(number + 1), (x, y, 0.0), (0.0, 0.0, -1.0), turns, _MOMENT_RATIO)
        )
    return FoundRotors(tuple(made), False, frame)


def _moving(topic: Topic | None, field: str) -> Array | None:
    """Values (n,) of a field that moves; None where it is not there or stands still."""
    if topic is None or field not in topic.fields:
        return None
    values = np.asarray(topic.fields[field], dtype=np.float64)
    values = values[np.isfinite(values)]
    return values if len(values) and np.ptp(values) > 0.0 else None


def _pulsed(
    recording: Recording, known: Mapping[str, Any], rotor: FoundRotor, number: int
) -> FoundRotor:
    """The rotor with the output that drives it; of former releases, the output of its number."""
    places = [
        (prefix, k)
        for prefix in _OUTPUTS
        for k in range(1, 17)
        if int(known.get(f"{prefix}_FUNC{k}", 0)) == _MOTOR_PX4 + number
    ]
    prefix, k = places[0] if places else ("PWM_MAIN", number + 1)
    instance = 1 if prefix == "PWM_AUX" and any(f"PWM_MAIN_FUNC{j}" in known for j in (1, 2)) else 0
    topic = "actuator_outputs" if instance == 0 else f"actuator_outputs.{instance}"
    told = _moving(recording.topics.get(topic), f"output[{k - 1}]")
    if told is None:
        return rotor
    ends = tuple(
        _stated(known, (f"{prefix}_{end}{k}", f"{prefix}_{end}", f"PWM_{end}"), usual)
        for end, usual in zip(("MIN", "MAX"), _PULSES, strict=True)
    )
    low, high = ends if ends[0] < ends[1] else _PULSES
    return _told(rotor, topic, f"output[{k - 1}]", (low, high), told)


def _stated(known: Mapping[str, Any], names: tuple[str, ...], usual: float) -> float:
    """The first of these parameters that is set: PX4 writes -1 for one that is not."""
    return next((float(known[n]) for n in names if float(known.get(n, -1)) >= 0.0), usual)


def _told(
    rotor: FoundRotor,
    topic: str,
    field: str,
    ends: tuple[float, float],
    values: Array,
    fastest: float = 0.0,
) -> FoundRotor:
    shares = (values - ends[0]) / (ends[1] - ends[0])
    above = shares[shares > 0.5 * np.quantile(shares, 0.95)]
    return FoundRotor(
        rotor.name, rotor.position, rotor.axis, rotor.turns, rotor.moment_ratio, rotor.strength,
        topic, field, *ends, fastest, float(np.median(above)) if len(above) else 0.5,
        float(np.quantile(above, 0.98)) if len(above) else 1.0,
    )  # fmt: skip


def learnt_of(found: FoundRotors) -> tuple[list[str], list[str]]:
    """Return what flights of these rotors tell, and what they do not tell apart, in short."""
    if not found.logged:
        return [], []
    speeds = all(each.fastest for each in found.rotors)
    by = "speed" if speeds else "command"
    together = ["mass from thrust", "diameter from thrust"]
    together += [] if speeds else ["speed from thrust"]
    learnt = [
        f"thrust per kg over {by}",
        "its loss by climbing",
        "drag of rotors and frame per kg",
        "thrust of single rotors",
    ]
    learnt += ["inertia over mass in roll and pitch"] if found.placed else []
    return learnt, [*together, "yawing inertia from the drag moment of rotors"]
