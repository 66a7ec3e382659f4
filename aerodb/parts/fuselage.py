"""Fuselage: forces of its local flow, and the moments that potential flow puts on a slender body.

With the local velocity u, v, w and its size V, over the area S,

    X = (rho/2) S V (C_L w - C_D u),  Z = -(rho/2) S V (C_L u + C_D w),
    Y = (rho/2) S V (C_Y V - C_D v),

and for a volume Q whose apparent masses across and along it differ by the factor k,

    M = rho k Q u w,  N = -rho k Q u v.

References
----------
Munk, NACA Report 184 (1924): the moment (k2 - k1) Q qbar sin(2 alpha) of a slender body.
"""

from typing import Annotated

import numpy as np
from pydantic import Field

from aerodb.errors import InputError
from aerodb.parts.body import flow
from aerodb.parts.entry import Discs, Formula, Placed, write_loads
from aerodb.parts.frame import Frame
from aerodb.parts.writing import Writer
from aerodb.quantities import Metres, in_unit
from aerodb.support import Array
from aerodb.tables import Expression, Name, Negation, Number, Operation, plus, times


class Fuselage(Placed):
    """A fuselage, nacelle or pod, along body x.

    Parameters
    ----------
    area : [m2]. lift, drag, sideforce : coefficients over it, of local names: alpha, beta, V, qbar,
        u, v, w.
    length : [m]. roll, pitch, yaw : coefficients over area and length, about the position.
    volume : [m3]; `inertia_factor` : k, 1 for a very slender body (.9 for a fineness of 8).
    """

    area: Annotated[float, in_unit("m^2"), Field(gt=0)]
    drag: Formula
    lift: Formula = "0"
    sideforce: Formula = "0"
    length: Metres | None = Field(default=None, gt=0)
    roll: Formula | None = None
    pitch: Formula | None = None
    yaw: Formula | None = None
    volume: Annotated[float, in_unit("m^3"), Field(ge=0)] = 0.0
    inertia_factor: Formula = "1"


def write(entry: Fuselage, writer: Writer, reference_point: Array, discs: Discs) -> None:
    """Write a fuselage.

    reference_point : (3,) [m], where moments are about. Raises InputError for a formula that cannot
    be read, and for a moment without length.
    """
    del discs
    frame = Frame(np.array(entry.position) - reference_point, np.eye(3))
    u, v, w, square = flow(writer, frame)
    speed = writer.define("V", writer.offered.pop("V"))
    drag, lift, side = (
        writer.define(name, writer.read(text, name), name)
        for name, text in (
            ("drag", entry.drag),
            ("lift", entry.lift),
            ("sideforce", entry.sideforce),
        )
    )
    scale = times(times(Number(0.5 * entry.area), Name("rho")), speed)
    forces = (
        writer.define("x", times(scale, Operation("-", times(lift, w), times(drag, u)))),
        writer.define("y", times(scale, Operation("-", times(side, speed), times(drag, v)))),
        writer.define("z", Negation(times(scale, plus(times(lift, u), times(drag, w))))),
    )
    texts = {"roll": entry.roll, "pitch": entry.pitch, "yaw": entry.yaw}
    moments = [_moment(entry, writer, name, text, square) for name, text in texts.items()]
    if entry.volume > 0.0:
        factor = writer.read(entry.inertia_factor, "inertia_factor")
        apparent = times(times(Number(entry.volume), Name("rho")), times(factor, u))
        moments[1] = _added(moments[1], times(apparent, w))
        moments[2] = _added(moments[2], Negation(times(apparent, v)))
    writer.act(frame, forces, (moments[0], moments[1], moments[2]))
    write_loads(entry, writer, frame)


def _moment(
    entry: Fuselage, writer: Writer, name: str, text: str | None, square: Expression
) -> Expression | None:
    """A moment [N m] of its coefficient; None without one."""
    if text is None:
        return None
    if entry.length is None:
        raise InputError(
            f"{name} without length", f"{writer.where} length", "give the length of the fuselage"
        )
    scale = times(times(Number(0.5 * entry.area * entry.length), Name("rho")), square)
    return times(scale, writer.read(text, name))


def _added(one: Expression | None, other: Expression) -> Expression:
    return other if one is None else plus(one, other)
