"""Gazebo's motor model of multicopters: a plugin of gz-sim for each rotor, written and read back.

With the rotational velocity w [rad/s] of the joint, the direction a of the thrust (the z axis of
the rotor's link), t = 1 for `ccw` (right-handed about a) and -1 for `cw`, and the velocity **v**
through the air across a, MulticopterMotorModel computes

    T = motorConstant w |w| along a,        F = -rotorDragCoefficient |w| v,
    M = -t momentConstant T about a,        M = -rollingMomentCoefficient |w| v.

Our rotor (`aerodb.parts.rotor`) turns with n = w/(2 pi), so that in still air

    motorConstant            rho D^4 c_T(0)/(2 pi)^2   [N/(rad/s)^2]
    momentConstant           D c_Q(0)/c_T(0)           [m]
    rotorDragCoefficient     c_D/(2 pi)                [N/((m/s)(rad/s))]
    rollingMomentCoefficient t c_R/(2 pi)              [N m/((m/s)(rad/s))]

Its traps: no density and no advance ratio are in it; its rolling moment does not know the turning
direction, so that ours is negative for `cw`; what a file leaves out has values of the plugin's own.

Source: gz-sim, `MulticopterMotorModel`, parameters and formulas.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from lxml import etree

from aerodb.errors import InputError
from aerodb.exchange.aero_codes.lines import MAX_BYTES
from aerodb.exchange.native_parts import made_of
from aerodb.exchange.xml_elements import parsed
from aerodb.support import Array
from aerodb.tables import AeroDatabase, ReferenceGeometry

_TURN: Final = 2.0 * math.pi
_TURNS: Final = {1: "ccw", -1: "cw"}
_LIBRARY: Final = {
    "filename": "gz-sim-multicopter-motor-model-system",
    "name": "gz::sim::systems::MulticopterMotorModel",
}
#: Element of the plugin -> field of `Motor`.
_NUMBERS: Final = {
    "motorConstant": "thrust",
    "momentConstant": "moment",
    "rotorDragCoefficient": "drag",
    "rollingMomentCoefficient": "roll",
    "maxRotVelocity": "fastest",
}


@dataclass(frozen=True)
class Motor:
    """What the plugin knows of a rotor.

    name : of the rotor. position : (3,) [m] from the datum, axis : (3,) direction of the thrust,
    both body axes. turns : 1 right-handed about it, or -1. thrust : [N/(rad/s)^2]. moment : [m].
    drag : [N/((m/s)(rad/s))]. roll : [N m/((m/s)(rad/s))]. fastest : [rad/s]. lag : [s]; None where
    it is not known.
    """

    name: str
    position: tuple[float, float, float]
    axis: tuple[float, float, float]
    turns: int
    thrust: float
    moment: float
    drag: float
    roll: float
    fastest: float
    lag: float | None = None


def motor_database(
    motors: Sequence[Motor], name: str, reference: ReferenceGeometry | None = None
) -> AeroDatabase:
    """Return the loads of motors [N, N m] by the plugin's formulas. Its inputs ``motor_<k>`` are
    velocities over maxRotVelocity. reference : lengths and moment point; 1 m and the datum."""
    reference = reference or ReferenceGeometry(1.0, 1.0, 1.0, (0.0, 0.0, 0.0))
    inputs = {f"motor_{k}": "rotational velocity over maxRotVelocity" for k in range(len(motors))}
    parts: dict[str, Any] = {
        each.name: {
            "kind": "rotor",
            "position": list(each.position),
            "axis": list(each.axis),
            "turns": each.turns,
            "diameter": 1.0,
            "bidirectional": True,
            "speed": f"{each.fastest / _TURN!r}*min(motor_{k}, 1)",
            "thrust": f"{each.thrust * _TURN**2!r}/rho",
            "torque": f"{each.moment * each.thrust * _TURN**2!r}/rho",
            "drag": repr(each.drag * _TURN),
            "roll": repr(each.turns * each.roll * _TURN),
        }
        for k, each in enumerate(motors)
    }
    variables, terms = made_of(parts, reference, inputs)
    return AeroDatabase(
        name,
        reference,
        variables,
        terms=terms,
        free_inputs=inputs,
        source="Gazebo MulticopterMotorModel",
        parts=parts,
    )


def export_motors(motors: Sequence[Motor], name: str, notes: Sequence[str] = ()) -> bytes:
    """Return the SDF model with the plugin and the place of each rotor. notes : comments."""
    root = etree.Element("sdf", version="1.9")
    model = etree.SubElement(root, "model", name=name)
    for note in notes:
        model.append(etree.Comment(f" {note.replace('--', '- -')} "))
    for each in motors:
        frame = etree.SubElement(model, "frame", name=f"{each.name}_place", attached_to="base_link")
        (x, y, z), (ax, ay, az) = each.position, each.axis
        # The frame's z axis is along the thrust; SDF has x forward, y left, z up.
        angles = (math.asin(max(-1.0, min(1.0, ay))), math.atan2(ax, -az), 0.0)
        _add(frame, "pose", " ".join(repr(c + 0.0) for c in (x, -y, -z, *angles)))
    for k, each in enumerate(motors):
        plugin = etree.SubElement(model, "plugin", **_LIBRARY)
        _add(plugin, "jointName", f"{each.name}_joint")
        _add(plugin, "linkName", each.name)
        _add(plugin, "turningDirection", _TURNS[each.turns])
        if each.lag is not None:
            _add(plugin, "timeConstantUp", repr(each.lag))
            _add(plugin, "timeConstantDown", repr(each.lag))
        _add(plugin, "maxRotVelocity", repr(each.fastest))
        _add(plugin, "motorConstant", repr(each.thrust))
        _add(plugin, "momentConstant", repr(each.moment))
        _add(plugin, "commandSubTopic", "command/motor_speed")
        _add(plugin, "motorNumber", str(k))
        _add(plugin, "rotorDragCoefficient", repr(each.drag))
        _add(plugin, "rollingMomentCoefficient", repr(each.roll))
        _add(plugin, "motorType", "velocity")
    etree.indent(root)
    return bytes(etree.tostring(root, pretty_print=True))


def read_motors(data: bytes, name: str) -> AeroDatabase:
    """Return the database (`motor_database`) of a file of `export_motors`. Raises InputError for
    what is no such file."""
    root = parsed(data, name, MAX_BYTES)
    places = {each.get("name"): each for each in root.iter("frame")}
    motors: dict[int, Motor] = {}
    for plugin in root.iter("plugin"):
        own = plugin.findtext("linkName") or ""
        where = f"{name}, line {plugin.sourceline}"
        if f"{own}_place" not in places:
            raise InputError(f"no <frame> {own}_place", where, "give the place of the rotor")
        x, y, z, *turned = _numbers(places[f"{own}_place"].findtext("pose"), 6, where)
        roll, pitch = turned[:2]
        axis = (
            math.sin(pitch) * math.cos(roll),
            math.sin(roll),
            -math.cos(pitch) * math.cos(roll),
        )
        values = {
            field: _numbers(plugin.findtext(key), 1, f"{where}, <{key}>")[0]
            for key, field in _NUMBERS.items()
        }
        turns = {said: t for t, said in _TURNS.items()}.get(plugin.findtext("turningDirection"))
        if turns is None:
            raise InputError("no <turningDirection>", where, "write cw or ccw")
        number = int(_numbers(plugin.findtext("motorNumber"), 1, where)[0])
        motors[number] = Motor(own, (x, -y, -z), axis, turns, **values)
    if sorted(motors) != list(range(len(motors))) or not motors:
        raise InputError("motors are not numbered 0, 1, 2 ...", name, "correct <motorNumber>")
    return motor_database([motors[k] for k in sorted(motors)], name)


def shares_of(motors: Sequence[Motor], turning: Mapping[str, Array]) -> dict[str, Array]:
    """Return the inputs ``motor_<k>`` at which motors turn, name -> (n,) [rev/s]."""
    return {
        f"motor_{k}": _TURN * turning[each.name] / each.fastest for k, each in enumerate(motors)
    }


def _numbers(text: str | None, count: int, where: str) -> list[float]:
    try:
        found = [float(cell) for cell in (text or "").split()]
    except ValueError:
        found = []
    if len(found) != count or not np.all(np.isfinite(found)):
        raise InputError(f"'{(text or '')[:40]}' is not {count} numbers", where, "write them")
    return found


def _add(parent: Any, key: str, text: str) -> None:
    etree.SubElement(parent, key).text = text
