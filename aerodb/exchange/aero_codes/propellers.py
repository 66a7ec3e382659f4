"""JSBSim's propellers of the rotors of a database: a ``<propulsion>`` section, written and read.

With n revolutions per second, diameter D and the velocity u along the axis, the propeller computes

    J = u/(n D),   T = rho n^2 D^4 C_THRUST(J),   Q = rho n^2 D^5 C_POWER(J)/(2 pi) about the axis.

So our rotor (`aerodb.parts.rotor`) has C_THRUST = c_T and C_POWER = 2 pi c_Q over the same J, by
tables that are linear between their rows and held outside. Its traps:

- Nothing acts across the axis but by ``<p_factor>``: rotor drag and rolling moment are lost.
- The speed is not told but found: an ``<electric_engine>`` gives its power times the throttle, so
  that the speed in still air goes with the cube root of the throttle.
- ``<ixx>`` makes the lag of the speed, and a gyroscopic moment that the database has not.
- Places are structural: x aft, y right, z up. ``<orient>`` turns the x axis into the thrust.

Source: JSBSim, `FGPropeller`, `FGElectric` and `FGForce`, parameters and formulas.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from lxml import etree

from aerodb.errors import InputError
from aerodb.exchange.aero_codes.lines import MAX_BYTES
from aerodb.exchange.aero_codes.motors import Rotors, compared, rotors_in, speeds_of, still
from aerodb.exchange.native_parts import made_of
from aerodb.exchange.xml_elements import parsed
from aerodb.support import Array
from aerodb.tables import AeroDatabase, ReferenceGeometry, Table

_TURN: Final = 2.0 * math.pi
#: Rows of a table: a coefficient linear in J is exact with two.
_ROWS: Final = 41
#: Lag [s] that is written where the vehicle file states none, and is said: of small motors.
_LAG: Final = 0.05
#: Blades that are written: JSBSim's steady loads do not depend on them.
_BLADES: Final = "2"
#: Places of the numbers of an engine.
_NUMBERS: Final = (
    *(f"thruster/location/{axis}" for axis in "xyz"),
    "thruster/orient/pitch",
    "thruster/orient/yaw",
    "thruster/sense",
    "thruster/propeller/diameter",
    "thruster/propeller/ixx",
    "thruster/propeller/maxrpm",
    "electric_engine/power",
)


@dataclass(frozen=True)
class Propeller:
    """What JSBSim knows of a rotor.

    name : of the rotor. position : (3,) [m] from the datum, axis : (3,) direction of the thrust,
    both body axes. turns : 1 right-handed about it, or -1. diameter : [m]. ratios : (k,) advance
    ratios; thrust, power : (k,) coefficients there. fastest : [rev/s] in still air of full
    throttle. watts : [W] that it takes there. inertia : [kg m^2] about the axis.
    """

    name: str
    position: tuple[float, float, float]
    axis: tuple[float, float, float]
    turns: int
    diameter: float
    ratios: Array
    thrust: Array
    power: Array
    fastest: float
    watts: float
    inertia: float


@dataclass(frozen=True)
class PropellerModel:
    """Propellers of a version by their number, and how far they are from it.

    largest : load axis -> largest difference [N, N m]. notes : sentences on what is not held.
    """

    propellers: tuple[Propeller, ...]
    largest: Mapping[str, float]
    notes: tuple[str, ...]


def project_propellers(
    database: AeroDatabase,
    flown: tuple[str, Mapping[str, Array]] | None = None,
    lag_of: Callable[[str], float | None] = lambda _name: None,
) -> PropellerModel:
    """Return the propellers of a database with rotors, at the middle of the commands.

    flown : a flight's name and its channels, each (n,) [SI], which differences are over; a grid of
        flow without. lag_of : name of a rotor's command -> its lag [s], None if not known.

    Raises InputError for a rotor that tilts, stands, or takes no torque.
    """
    rotors = rotors_in(database, flown, "JSBSim's propeller")
    lags = {name: lag_of(rotors.command(name).removeprefix("command_")) for name in rotors.entries}
    made = tuple(_propeller(rotors, name, lags[name] or _LAG) for name in rotors.entries)
    model = propeller_database(made, rotors.database.name, rotors.database.reference)
    largest, held = compared(
        rotors,
        model,
        lambda speeds: {f"motor_{k}": speeds[x.name] / x.fastest for k, x in enumerate(made)},
        "the propellers",
        "that are not of their advance ratio",
    )
    notes = [
        "put it into the aircraft: <propulsion file=.../>; speeds in still air go with the cube"
        " root of the throttle",
        *held,
    ]
    if not all(lags.values()):
        notes.append(
            f"<ixx> is that of a lag of {_LAG:g} s; state `lag` of the rotors in the vehicle file"
        )
    order = ", ".join(f"{k} is {each.name}" for k, each in enumerate(made))
    notes.append(f"engine numbers, in the order of the commands: {order}")
    return PropellerModel(made, largest, tuple(notes))


def _propeller(rotors: Rotors, name: str, lag: float) -> Propeller:
    entry, axis = rotors.entries[name], rotors.axis(name)
    calm = still(rotors, rotors.point)
    n = float(speeds_of(rotors.database, [name], calm)[name][0])
    if not n > 0.0:
        raise InputError(
            f"{n:.3g} rev/s at the middle of its commands",
            f"part {name}",
            "JSBSim's propeller turns one way; export the version as jsbsim or daveml",
        )
    flow = rotors.channels
    axes = (
        np.cos(flow["alpha"]) * np.cos(flow["beta"]),
        np.sin(flow["beta"]),
        np.sin(flow["alpha"]) * np.cos(flow["beta"]),
    )
    along = flow["V"] * sum(a * x for a, x in zip(axis, axes, strict=True))
    # Down to half the speed at the middle of the commands.
    scale = 2.0 / (n * entry.diameter)
    low, high = scale * min(along.min(), 0.0), scale * max(along.max(), 0.0)
    ratios = np.unique(np.append(np.linspace(low, high, _ROWS), 0.0))
    flows = axis[:, None] * ratios * n * entry.diameter
    force, moment = rotors.about_itself(name, still(rotors, rotors.point, flows))
    size = rotors.rho * n**2 * entry.diameter**4
    thrust, torque = axis @ force / size, -entry.turns * (axis @ moment) / (size * entry.diameter)
    calm_power = float(_TURN * torque[ratios == 0.0][0])
    if not calm_power > 0.0:
        raise InputError(
            "a rotor without torque in still air",
            f"part {name}",
            "JSBSim finds its speed by the power that it takes: state `torque` of the part",
        )
    fastest = rotors.fastest(name)
    # The speed n of a given power P falls back by dn/dt = (P/w - Q)/I: three times its damping.
    slowing = 3.0 * calm_power / _TURN * size * entry.diameter / (_TURN * n)
    return Propeller(
        name,
        entry.position,
        (float(axis[0]), float(axis[1]), float(axis[2])),
        entry.turns,
        entry.diameter,
        ratios,
        thrust,
        _TURN * torque,
        fastest,
        calm_power * rotors.rho * fastest**3 * entry.diameter**5,
        slowing * lag,
    )


def propeller_database(
    propellers: Sequence[Propeller], name: str, reference: ReferenceGeometry | None = None
) -> AeroDatabase:
    """Return the loads of propellers [N, N m] by JSBSim's formulas. Its inputs ``motor_<k>`` are
    speeds over the fastest. reference : lengths and moment point; 1 m and the datum."""
    reference = reference or ReferenceGeometry(1.0, 1.0, 1.0, (0.0, 0.0, 0.0))
    inputs = {f"motor_{k}": "speed over the fastest" for k in range(len(propellers))}
    tables = {
        f"{kind}_of_{each.name}": Table(
            f"{kind}_of_{each.name}", ("J",), (each.ratios,), getattr(each, kind)
        )
        for each in propellers
        for kind in ("thrust", "power")
    }
    parts: dict[str, Any] = {
        each.name: {
            "kind": "rotor",
            "position": list(each.position),
            "axis": list(each.axis),
            "turns": each.turns,
            "diameter": each.diameter,
            "speed": f"{each.fastest!r}*motor_{k}",
            "thrust": f"thrust_of_{each.name}(J)",
            "torque": f"power_of_{each.name}(J)/{_TURN!r}",
        }
        for k, each in enumerate(propellers)
    }
    variables, terms = made_of(parts, reference, {**inputs, **dict.fromkeys(tables, "a table")})
    return AeroDatabase(
        name,
        reference,
        variables,
        tables=tables,
        terms=terms,
        free_inputs=inputs,
        source="JSBSim propeller",
        parts=parts,
    )


def export_propellers(
    propellers: Sequence[Propeller], name: str, notes: Sequence[str] = ()
) -> bytes:
    """Return the ``<propulsion>`` section, an engine with its propeller each. notes : comments."""
    root = etree.Element("propulsion", name=name)
    for note in notes:
        root.append(etree.Comment(f" {note.replace('--', '- -')} "))
    for each in propellers:
        engine = etree.SubElement(root, "engine", name=each.name)
        motor = etree.SubElement(engine, "electric_engine", name=f"{each.name}_motor")
        _add(motor, "power", repr(each.watts), unit="WATTS")
        _place(engine, each)
        thruster = etree.SubElement(engine, "thruster")
        propeller = etree.SubElement(thruster, "propeller", name=each.name, version="1.1")
        _add(propeller, "ixx", repr(each.inertia), unit="KG*M2")
        _add(propeller, "diameter", repr(each.diameter), unit="M")
        _add(propeller, "numblades", _BLADES)
        _add(propeller, "gearratio", "1")
        _add(propeller, "maxrpm", repr(60.0 * each.fastest))
        for key, values in (("C_THRUST", each.thrust), ("C_POWER", each.power)):
            table = etree.SubElement(propeller, "table", name=key, type="internal")
            rows = zip(each.ratios.tolist(), values.tolist(), strict=True)
            _add(table, "tableData", "".join(f"\n{x!r} {y!r}" for x, y in rows) + "\n")
        _add(thruster, "sense", str(each.turns))
        _place(thruster, each)
        x, y, z = each.axis
        turned = etree.SubElement(thruster, "orient", unit="RAD")
        _add(turned, "pitch", repr(math.asin(max(-1.0, min(1.0, -z)))))
        _add(turned, "yaw", repr(math.atan2(y, x)))
    etree.indent(root)
    return bytes(etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True))


def _place(parent: Any, each: Propeller) -> None:
    x, y, z = each.position
    place = etree.SubElement(parent, "location", unit="M")
    for key, value in (("x", -x), ("y", y), ("z", -z)):
        _add(place, key, repr(value + 0.0))


def _add(parent: Any, key: str, text: str, **attributes: str) -> None:
    etree.SubElement(parent, key, **attributes).text = text


def read_propellers(data: bytes, name: str) -> AeroDatabase:
    """Return the database (`propeller_database`) of a file of `export_propellers`. Raises
    InputError for what is no such file."""
    root = parsed(data, name, MAX_BYTES)
    made = []
    for engine in root.iter("engine"):
        where = f"{name}, line {engine.sourceline}"
        x, y, z, pitch, yaw, turns, diameter, inertia, most, watts = (
            float(_numbers(engine.findtext(path), f"{where}, {path}", 1)[0]) for path in _NUMBERS
        )
        if turns not in (-1.0, 1.0):
            raise InputError(f"<sense> {turns:g}", where, "write 1 or -1")
        columns = {}
        for kind in ("C_THRUST", "C_POWER"):
            text = engine.findtext(f"thruster/propeller/table[@name='{kind}']/tableData")
            columns[kind] = _numbers(text, f"{where}, {kind}").reshape(-1, 2).T
        if not np.array_equal(columns["C_THRUST"][0], columns["C_POWER"][0]):
            raise InputError("tables of different advance ratios", where, "give both the same rows")
        ratios, thrust = columns["C_THRUST"]
        axis = (
            math.cos(pitch) * math.cos(yaw),
            math.cos(pitch) * math.sin(yaw),
            -math.sin(pitch),
        )
        made.append(
            Propeller(
                engine.get("name", ""), (-x, y, -z), axis, int(turns), diameter, ratios,
                thrust, columns["C_POWER"][1], most / 60.0, watts, inertia,
            )
        )  # fmt: skip
    if not made:
        raise InputError("no <engine>", name, "write one for each rotor")
    return propeller_database(made, name)


def _numbers(text: str | None, where: str, count: int | None = None) -> Array:
    try:
        found = np.array([float(cell) for cell in (text or "").split()])
    except ValueError:
        found = np.array([])
    right = len(found) == count if count else len(found) > 0 and len(found) % 2 == 0
    if not right or not np.all(np.isfinite(found)):
        raise InputError(f"'{(text or '')[:40]}' is no such number", where, "write it")
    return found
