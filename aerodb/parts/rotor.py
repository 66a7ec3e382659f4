"""Rotor: thrust, drag, torque and rolling moment of a propeller in any flow.

With n revolutions per second, diameter D, the local velocity u along the axis (the direction of the
thrust) and v across it, and the advance ratio J = u/(n D),

    T = rho n |n| D^4 c_T(J) along the axis,      F = -c_D |n| v across it,
    M = -t rho n |n| D^5 c_Q(J) about the axis,   M = -t c_R |n| v about the flow across it,

where t is 1 for a rotor that turns right-handed about its axis. Only a bidirectional rotor has
negative n. A tilting rotor turns its axis about `tilt_axis`.

References
----------
Galliker, Data-Driven Dynamics Modelling Using Flight Logs (2021), eqs. 4.1 to 4.14, derived again:
J is signed here, the unit vector of 4.10 is the turning direction, and the tilt is linear in its
command. The rolling moment acts towards the retreating side.
"""

from collections.abc import Mapping
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from aerodb.errors import InputError
from aerodb.nomenclature import UNNEEDED, is_command
from aerodb.parts.engine import disc_of
from aerodb.parts.entry import Disc, Discs, Formula, Placed, write_loads
from aerodb.parts.frame import Frame, across
from aerodb.parts.writing import Writer
from aerodb.quantities import Metres, Radians
from aerodb.quantities import Number as Share
from aerodb.support import Array
from aerodb.tables import (
    AeroDatabase,
    Call,
    Expression,
    Name,
    Negation,
    Number,
    Operation,
    number,
    plus,
    times,
)

#: Slowest rotor [rev/s] whose advance ratio is that of its speed: below, thrust is nothing.
_STANDING = 1e-3


def _over_advance_ratio(value: Any) -> Any:
    """A pair of formulas is a coefficient that falls linearly with the advance ratio."""
    if isinstance(value, (list, tuple)) and len(value) == 2:
        return f"({value[0]}) - ({value[1]})*J"
    return repr(value) if isinstance(value, (int, float)) and not isinstance(value, bool) else value


Coefficient = Annotated[Formula, BeforeValidator(_over_advance_ratio)]


class Rotor(Placed):
    """A rotor.

    Parameters
    ----------
    speed : [rev/s], an expression of the aircraft's inputs. diameter : [m].
    axis : (3,) body axes, the direction of the thrust. turns : 1 right-handed about it, or -1.
    thrust, torque : coefficients c_T, c_Q: a formula over J, n, u, v, w, or a pair [c0, c1] of
        c0 - c1 J.
    drag : c_D [N/(m/s)/(rev/s)]. roll : c_R [N m/(m/s)/(rev/s)].
    tilt : [rad] about `tilt_axis`, right-handed, an expression of inputs. tilt_limits :
        [rad], where it stops.
    bidirectional : whether it may turn backwards; another stands still at negative `speed`.
    command : lowest and highest value of the inputs of its speed; 0 to 1, or -1 to 1.
    """

    speed: Formula
    diameter: Metres = Field(gt=0)
    thrust: Coefficient
    torque: Coefficient = "0"
    drag: Formula = "0"
    roll: Formula = "0"
    axis: tuple[Share, Share, Share] = (0.0, 0.0, -1.0)
    turns: Literal[-1, 1] = 1
    tilt: Formula | None = None
    tilt_axis: tuple[Share, Share, Share] = (0.0, 1.0, 0.0)
    tilt_limits: tuple[Radians, Radians] | None = None
    bidirectional: bool = False
    command: tuple[float, float] | None = None

    @model_validator(mode="before")
    @classmethod
    def _driven(cls, data: Any) -> Any:
        if isinstance(data, Mapping) and not str(data.get("speed", "")).strip():
            raise InputError(
                "a rotor without speed",
                remedy='write it in rev/s as a formula of its command: speed = "120*command_1"',
            )
        return data

    @model_validator(mode="after")
    def _directed(self) -> "Rotor":
        for key in ("axis", "tilt_axis"):
            if not np.linalg.norm(getattr(self, key)) > 0.0:
                raise InputError(f"{key} has no length", remedy="give a direction in body axes")
        cosine = np.dot(self.axis, self.tilt_axis)
        size = np.linalg.norm(self.axis) * np.linalg.norm(self.tilt_axis)
        if self.tilt is not None and abs(cosine) > 1e-6 * size:
            raise InputError("tilt_axis is not across the axis", remedy="give one at right angles")
        if self.tilt_limits is not None and self.tilt is None:
            raise InputError("tilt_limits without tilt", remedy="write the angle as tilt")
        if self.tilt_limits is not None and not self.tilt_limits[0] < self.tilt_limits[1]:
            raise InputError("tilt_limits without range", remedy="write the smaller angle first")
        if self.command is not None and not self.command[0] < self.command[1]:
            raise InputError("command without range", remedy="write the smaller value first")
        return self


def write(entry: Rotor, writer: Writer, reference_point: Array, discs: Discs) -> Disc:
    """Write a rotor; returns its disc.

    reference_point : (3,) [m], where moments are about. discs : those of others, of which a rotor
    uses none. Raises InputError for a formula that cannot be read.
    """
    del discs
    frame = Frame(np.array(entry.position) - reference_point, across(entry.axis, entry.tilt_axis))
    u, v, w = writer.velocity(frame)
    tilt: Name | None = None
    if entry.tilt is not None:
        told = writer.parsed(entry.tilt, "tilt")
        if entry.tilt_limits is not None:
            low, high = (number(each) for each in entry.tilt_limits)
            told = writer.define("tilt_told", told, "tilt")
            told = Call("max", (low, Call("min", (high, told))))
        tilt = writer.define("tilt", told, "tilt")
        u, w = _turned(u, w, Negation(tilt))
    u, v, w = (writer.define(name, each) for name, each in zip("uvw", (u, v, w), strict=True))
    speed = writer.parsed(entry.speed, "speed")
    if not entry.bidirectional:
        speed = Call("max", (speed, Number(0.0)))
    n = writer.define("n", speed, "speed")
    size = Call("abs", (n,)) if entry.bidirectional else n
    square = Call("max", (times(n, n), Number(_STANDING**2)))
    writer.define(
        "J", Operation("/", times(u, n), times(Number(entry.diameter), square))
    )  # finite where the rotor stands
    scale = times(times(Name("rho"), n), size)
    diameter = Number(entry.diameter**4)
    own = times(scale, times(diameter, writer.read(entry.thrust, "thrust")))
    thrust = writer.define("thrust", own, "thrust")
    drag = Negation(times(writer.read(entry.drag, "drag"), size))
    roll = times(number(-float(entry.turns)), times(writer.read(entry.roll, "roll"), size))
    torque = times(number(-entry.turns * entry.diameter**5), writer.read(entry.torque, "torque"))
    x, y, z = thrust, times(drag, v), times(drag, w)
    mx, my, mz = times(scale, torque), times(roll, v), times(roll, w)
    fx: Expression = x
    if tilt is not None:
        fx, z = _turned(x, z, tilt)
        mx, mz = _turned(mx, mz, tilt)
    writer.act(frame, (fx, y, z), (mx, my, mz))
    write_loads(entry, writer, frame)
    return disc_of(writer, frame, 0.5 * entry.diameter, thrust, u, tilt)


def _turned(x: Expression, z: Expression, angle: Expression) -> tuple[Expression, Expression]:
    """Components in axes that stay, of those in axes turned about y by an angle [rad]."""
    cos, sin = Call("cos", (angle,)), Call("sin", (angle,))
    return plus(times(x, cos), times(z, sin)), Operation("-", times(z, cos), times(x, sin))


def beyond_tilt(database: AeroDatabase, channels: Mapping[str, Array]) -> dict[str, str]:
    """Return rotor -> a sentence on the angle furthest beyond its limits of tilt, for channels (n,)
    [SI]; empty where all stay within. Raises InputError for a channel that is missing."""
    end = "_tilt_told"
    names = [name.removesuffix(end) for name in database.variables if name.endswith(end)]
    trees = [
        database.variables[f"{name}{each}"].expression for name in names for each in ("_tilt", end)
    ]
    definitions = {name: variable.expression for name, variable in database.variables.items()}
    program = database.compiled(trees, definitions, {**database.tables, **database.scattered})
    values = program.run(database.resolved(program.inputs, channels)).values
    found = {}
    for k, name in enumerate(names):
        stops, told = np.broadcast_arrays(*np.atleast_1d(*values[2 * k : 2 * k + 2]))
        over = np.where(np.isfinite(told), np.abs(told - stops), 0.0)
        worst = int(np.argmax(over))
        if over[worst] > 0.0:
            reached, limit = np.rad2deg(told[worst]), np.rad2deg(stops[worst])
            found[name] = (
                f"the tilt of {name} is told to be {reached:.4g} deg, beyond its limit of"
                f" {limit:.4g} deg, where it stops. Correct `tilt` or `tilt_limits` of the part, or"
                " the calibration of its command"
            )
    return found


def command_ranges(database: AeroDatabase) -> dict[str, tuple[float, float]]:
    """Return lowest and highest value of each free input or command (`command_<name>`) that the
    speed of a rotor is of, in its unit."""
    found: dict[str, tuple[float, float]] = {}
    for name, part in database.parts.items():
        if part.get("kind") != "rotor":
            continue
        usual = (-1.0 if part.get("bidirectional") else 0.0, 1.0)
        low, high = part.get("command") or usual
        for side in (name, f"{name}_right", f"{name}_left"):
            pending, seen = {f"{side}_n"} & database.variables.keys(), set[str]()
            rates = database.rates
            while pending:
                name = pending.pop()
                tree = rates[name].rate if name in rates else database.variables[name].expression
                used = tree.names - seen
                seen |= used
                pending |= used & (database.variables.keys() | rates.keys())
            free = database.free_inputs.keys() - rates.keys()
            inputs = {n for n in seen - {*UNNEEDED} if n in free or is_command(n)}
            found |= dict.fromkeys(inputs, (float(low), float(high)))
    return found
