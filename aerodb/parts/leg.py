"""Leg: a wheel of the landing gear on a level runway, with spring, damping, rolling and side force.

With the height h of the centre of gravity above ground and the attitude (bank phi, pitch theta),
the contact point r (from the centre of gravity, the leg unloaded) is below the ground by the
compression c. In level axes that have the aircraft's heading, the wheel moves at (u, v) over the
ground along and across itself, and

    c = r_down - h,         N = max(k c + d dc/dt, 0) where c > 0,
    F_x = -mu_x N tanh(u/u_0),      F_y = -mu_y N,      tau = atan2(v, max(|u|, v_0)),
    mu_y = mu_max (phi - 4/27 phi^3),       phi = clip(mu_lin tau/mu_max, -1.5, 1.5).

tanh(u/u_0) is the sign of u, smooth within u_0; v_0 does the same for the slip angle. So a force is
finite at a standstill, where it resists any motion. A castering wheel turns into its motion: it has
no side force.

References
----------
Friction: Data Analysis of Phoenix Reusable Launch Vehicle Demonstrator Flight Test, eqs. 8 to 11,
where 4/27 is printed .148.
"""

from collections.abc import Sequence
from typing import Final

import numpy as np
from pydantic import model_validator

from aerodb.errors import InputError
from aerodb.parts.entry import Discs, Formula, Placed, write_loads
from aerodb.parts.frame import Frame, combination
from aerodb.parts.writing import Writer
from aerodb.support import Array, validated
from aerodb.tables import (
    AeroDatabase,
    Call,
    Expression,
    Name,
    Negation,
    Number,
    Operation,
    number,
    parse,
    plus,
    times,
)

#: Speed [m/s] within which rolling friction changes its sign, and with which a run stands still.
STANDING: Final = 0.05
#: Slowest rolling speed [m/s] of a slip angle: the side force of a slower wheel fades with v.
_SLOWEST: Final = 0.5
#: Smallest largest side force coefficient, so that a wheel without any has a finite phi.
_SMALLEST: Final = 1e-6
#: Body axes in level axes that have the aircraft's heading: rows forward, right, down.
_LEVEL: Final = tuple(
    tuple(parse(text) for text in row)
    for row in (
        ("cos(theta)", "sin(theta)*sin(phi)", "sin(theta)*cos(phi)"),
        ("0", "cos(phi)", "-sin(phi)"),
        ("-sin(theta)", "cos(theta)*sin(phi)", "cos(theta)*cos(phi)"),
    )
)
_OVER_GROUND: Final = (
    parse("cos(psi)*velocity_north + sin(psi)*velocity_east"),
    parse("cos(psi)*velocity_east - sin(psi)*velocity_north"),
    Name("velocity_down"),
)


class Leg(Placed):
    """A leg with a wheel.

    Parameters
    ----------
    position : (3,) [m], where its unloaded wheel touches the ground.
    spring : [N/m]. damping : [N s/m]. Both act along the vertical; formulas may use `compression`
        [m] and `closing`, its rate [m/s].
    along : rolling friction coefficient: a formula over inputs, `u`, `compression` and `load` [N].
    cornering : slope of the side force coefficient over the slip angle [1/rad].
    side_limit : largest side force coefficient; a formula as `along`. Both, or none of the two.
    steering : [rad], nose right, an expression of inputs.
    castering : whether the wheel turns into its motion.
    """

    spring: Formula
    damping: Formula = "0"
    along: Formula = "0"
    cornering: Formula | None = None
    side_limit: Formula | None = None
    steering: Formula | None = None
    castering: bool = False

    @model_validator(mode="after")
    def _stands(self) -> "Leg":
        for key in ("spring", "damping"):
            try:
                value = float(getattr(self, key))
            except ValueError:
                continue  # a formula
            if not (value > 0.0 or (key == "damping" and value == 0.0)):
                raise InputError(f"{key} is {value:g}", remedy="give it above zero, in SI units")
        if (self.cornering is None) != (self.side_limit is None):
            raise InputError(
                "cornering and side_limit belong together", remedy="give both, or neither of them"
            )
        if self.castering and not (self.cornering is None and self.steering is None):
            raise InputError(
                "a castering wheel with steering or cornering", remedy="leave these out"
            )
        return self


def write(entry: Leg, writer: Writer, reference_point: Array, discs: Discs) -> None:
    """Write a leg.

    reference_point : (3,) [m], where moments are about. Raises InputError for a formula that cannot
    be read.
    """
    del discs
    frame = Frame(np.array(entry.position) - reference_point, np.eye(3))
    arm = [_from_cg(at, axis) for at, axis in zip(entry.position, "xyz", strict=True)]
    turning = [_crossed(arm, k) for k in range(3)]
    forward, right, down = (
        plus(speed, _product(row, turning)) for speed, row in zip(_OVER_GROUND, _LEVEL, strict=True)
    )
    below = _product(_LEVEL[2], arm)
    height = Name("height_above_ground")
    compression = writer.define("compression", Operation("-", below, height))
    closing = writer.define("closing", down)
    spring, damping = (writer.read(getattr(entry, key), key) for key in ("spring", "damping"))
    pushed = plus(times(spring, compression), times(damping, closing))
    touching = Call("step", (compression,))
    load = writer.define("load", times(touching, Call("max", (pushed, Number(0.0)))), "spring")
    angle: Name | None = None
    if entry.steering is not None:
        angle = writer.define("steering", writer.read(entry.steering, "steering"), "steering")
        forward, right = _turned(forward, right, angle)
    u = writer.local["u"] = writer.define("rolling", forward)
    v = writer.local["v"] = writer.define("sliding", right)
    friction = writer.define("friction", writer.read(entry.along, "along"), "along")
    x, y = _tyre(entry, writer, load, friction, u, v)
    fx: Expression = writer.define("x", x)
    fy: Expression = writer.define("y", y)
    if angle is not None:
        fx, fy = _turned(fx, fy, Negation(angle))
    # The ground is nearer than the unloaded wheel by the compression.
    depth = times(touching, compression)
    level = (fx, fy, Negation(load)), (times(depth, fy), Negation(times(depth, fx)), Number(0.0))
    columns = [[row[k] for row in _LEVEL] for k in range(3)]
    force, moment = ([_product(column, each) for column in columns] for each in level)
    writer.act(frame, tuple(force), tuple(moment))
    write_loads(entry, writer, frame)


def _tyre(
    entry: Leg, writer: Writer, load: Name, friction: Name, u: Name, v: Name
) -> tuple[Expression, Expression]:
    """Forces [N] along and across the wheel."""
    rubbed = times(friction, load)
    if entry.castering:
        speed = Call("sqrt", (plus(times(u, u), times(v, v)),))
        share = Operation(
            "/",
            Call("tanh", (Operation("/", speed, Number(STANDING)),)),
            Call("max", (speed, Number(1e-3 * STANDING))),
        )
        pulled = Negation(times(rubbed, share))
        return times(pulled, u), times(pulled, v)
    x = Negation(times(rubbed, Call("tanh", (Operation("/", u, Number(STANDING)),))))
    if entry.cornering is None or entry.side_limit is None:
        return x, Number(0.0)
    rolling = Call("max", (Call("abs", (u,)), Number(_SLOWEST)))
    slip = writer.define("slip", Call("atan2", (v, rolling)))
    limit = writer.read(entry.side_limit, "side_limit")
    largest = writer.define("side_limit", Call("max", (limit, Number(_SMALLEST))), "side_limit")
    ratio = Operation("/", times(writer.read(entry.cornering, "cornering"), slip), largest)
    phi = writer.define("saturation", Call("clip", (ratio, number(-1.5), Number(1.5))), "cornering")
    cube = Operation("^", phi, Number(3.0))
    share = Operation("-", phi, times(Number(4.0 / 27.0), cube))
    return x, Negation(times(times(largest, share), load))


def contact_points(database: AeroDatabase) -> Array:
    """Return (k, 3) [m], body axes from the vehicle's datum: where the legs of a database touch the
    ground unloaded."""
    points = []
    for name, part in database.parts.items():
        if part.get("kind") == "leg":
            entry = validated(Leg, part, f"[parts.{name}]")
            x, y, z = entry.position
            points += [(x, y, z), (x, -y, z)] if entry.mirror else [(x, y, z)]
    return np.array(points).reshape(-1, 3)


def _from_cg(position: float, axis: str) -> Expression:
    """A coordinate [m] from the centre of gravity, of one from the vehicle's datum."""
    own = Name(f"cg_{axis}")
    return Operation("-", number(position), own) if position else Negation(own)


def _crossed(arm: Sequence[Expression], k: int) -> Expression:
    """Component `k` of ``(p, q, r) x arm``."""
    rates = [Name(rate) for rate in "pqr"]
    i, j = (k + 1) % 3, (k + 2) % 3
    return Operation("-", times(rates[i], arm[j]), times(rates[j], arm[i]))


def _product(row: Sequence[Expression], values: Sequence[Expression]) -> Expression:
    """Sum of products, without those that are zero."""
    products = [
        times(factor, value)
        for factor, value in zip(row, values, strict=True)
        if Number(0.0) not in (factor, value)
    ]
    return combination([1.0] * len(products), products)


def _turned(
    forward: Expression, right: Expression, angle: Expression
) -> tuple[Expression, Expression]:
    """Components along and across a wheel that is turned nose right by an angle [rad]."""
    cos, sin = Call("cos", (angle,)), Call("sin", (angle,))
    return (
        plus(times(forward, cos), times(right, sin)),
        Operation("-", times(right, cos), times(forward, sin)),
    )
