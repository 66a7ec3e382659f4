"""Engine: thrust along a line, and the slipstream of its disc by momentum theory.

The thrust is any expression, such as a table over V, altitude and throttle. A disc of area A with
thrust T at the velocity u along its axis induces, by momentum theory,

    v = (-u + sqrt(u^2 + 2 T/(rho A)))/2,

and at a distance s behind it v (1 + s/sqrt(s^2 + R^2)): twice v far behind, nothing far ahead.

References
----------
McCormick, Aerodynamics of V/STOL Flight (1967), chapter 4, as "Aerodynamic Model Update Using
Parameter Identification Supporting a Cessna Grand Caravan Engineering Simulation" has it.
"""

import math

import numpy as np
from pydantic import Field, model_validator

from aerodb.errors import InputError
from aerodb.parts.entry import Disc, Discs, Formula, Placed, write_loads
from aerodb.parts.frame import Frame, along, combination
from aerodb.parts.writing import Writer
from aerodb.quantities import Metres
from aerodb.quantities import Number as Share
from aerodb.support import Array
from aerodb.tables import Call, Expression, Name, Number, Operation, plus, times


class Engine(Placed):
    """An engine, or a propeller with its engine.

    Parameters
    ----------
    thrust : [N], along `direction`, an expression of the aircraft's names; ``u`` is the velocity
        along the axis, rotation of the aircraft included.
    direction : (3,) body axes. diameter : [m] of the disc, where parts stand in its slipstream.
    torque : [N m] that the engine puts on the aircraft about its axis, right wing down positive.
    """

    thrust: Formula
    direction: tuple[Share, Share, Share] = (1.0, 0.0, 0.0)
    diameter: Metres | None = Field(default=None, gt=0)
    torque: Formula | None = None

    @model_validator(mode="after")
    def _directed(self) -> "Engine":
        if not math.hypot(*self.direction) > 0.0:
            raise InputError("direction has no length", remedy="give the axis of the thrust")
        return self


def write(entry: Engine, writer: Writer, reference_point: Array, discs: Discs) -> Disc | None:
    """Write an engine; returns its disc, if it has one.

    reference_point : (3,) [m], where moments are about. discs : those of other engines, of which an
    engine uses none. Raises InputError for a formula that cannot be read.
    """
    del discs
    frame = Frame(np.array(entry.position) - reference_point, along(entry.direction))
    axial = writer.velocity(frame)[0]
    writer.offer("u", axial)
    thrust = writer.define("thrust", writer.read(entry.thrust, "thrust"), "thrust")
    torque = None if entry.torque is None else writer.read(entry.torque, "torque")
    writer.act(frame, (thrust, None, None), (torque, None, None))
    write_loads(entry, writer, frame)
    if entry.diameter is None:
        return None
    u = writer.local.get("u") or writer.define("u", axial)
    return disc_of(writer, frame, 0.5 * entry.diameter, thrust, u)


def disc_of(
    writer: Writer,
    frame: Frame,
    radius: float,
    thrust: Expression,
    u: Expression,
    tilt: Expression | None = None,
) -> Disc:
    """Return the disc of a propeller, by its radius [m], thrust [N], the velocity along its axis
    [m/s] and the angle [rad] by which the axis is turned about y."""
    induced = writer.define("induced", induced_velocity(thrust, u, math.pi * radius**2))
    return Disc(frame, radius, induced, tilt)


def induced_velocity(thrust: Expression, u: Expression, area: float) -> Expression:
    """Return the velocity [m/s] that a disc induces, of its thrust [N], the velocity along its axis
    [m/s] and its area [m2].

    A thrust so negative that momentum theory has no answer gives the last that it has.

    >>> from aerodb.tables import evaluate, parse
    >>> expression = induced_velocity(parse("T"), parse("u"), 2.0)
    >>> v = float(evaluate(expression, {"T": 490.0, "u": 30.0, "rho": 1.225}))
    >>> round(2.0 * 1.225 * 2.0 * (30.0 + v) * v, 9)
    490.0
    """
    load = Operation("/", times(Number(2.0), thrust), times(Name("rho"), Number(area)))
    square = Call("max", (plus(Operation("^", u, Number(2.0)), load), Number(0.0)))
    return times(Number(0.5), Operation("-", Call("sqrt", (square,)), u))


def slipstream(disc: Disc, frame: Frame, k: int) -> Expression:
    """Return what the slipstream of a disc has along axis k of a part, at the disc [m/s]; further
    back it is `growth` times as large."""
    x, _, z = (float(axis @ frame.axes[:, k]) for axis in disc.frame.axes.T)
    if disc.tilt is None:
        return combination([x], [disc.induced])
    cos, sin = (times(Call(name, (disc.tilt,)), disc.induced) for name in ("cos", "sin"))
    return combination([x, -z], [cos, sin])


def growth(disc: Disc, frame: Frame) -> float:
    """Return the velocity that a disc induces at a part, over that at the disc itself,
    dimensionless: by its distance along the axis.

    >>> from aerodb.tables import Name
    >>> import numpy as np
    >>> disc = Disc(Frame(np.zeros(3), np.eye(3)), 1.0, Name("induced"))
    >>> round(growth(disc, Frame(np.array([-0.75, 0.0, 0.0]), np.eye(3))), 12)
    1.6
    """
    behind = float((disc.frame.arm - frame.arm) @ disc.frame.axes[:, 0])
    return 1.0 + behind / math.hypot(behind, disc.radius)
