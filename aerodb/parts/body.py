"""Body: any loads, in axes of the part.

The way out where no other kind fits: a load in N or N m is any expression of the local flow.
"""

import numpy as np
from pydantic import Field

from aerodb.parts.entry import Discs, Load, Placed, write_loads
from aerodb.parts.frame import Frame, turned
from aerodb.parts.writing import Writer
from aerodb.quantities import Radians
from aerodb.support import Array
from aerodb.tables import Call, Expression, Name, Number, Operation, plus, times


class Body(Placed):
    """A part of loads.

    Parameters
    ----------
    axes : roll, pitch and yaw angle by which its axes are turned from the body axes [rad].
    load : at least one; expressions use local names: u, v, w, V, alpha, beta, qbar.
    """

    axes: tuple[Radians, Radians, Radians] = (0.0, 0.0, 0.0)
    load: tuple[Load, ...] = Field(min_length=1)


def write(entry: Body, writer: Writer, reference_point: Array, discs: Discs) -> None:
    """Write a part of loads.

    reference_point : (3,) [m], where moments are about. Raises InputError for a formula that cannot
    be read.
    """
    del discs
    frame = Frame(np.array(entry.position) - reference_point, turned(*entry.axes))
    flow(writer, frame)
    write_loads(entry, writer, frame)


def flow(writer: Writer, frame: Frame) -> tuple[Expression, Expression, Expression, Expression]:
    """Define the local velocity u, v, w [m/s], and offer V, alpha, beta and qbar to formulas.

    Returns u, v, w and the square of V.
    """
    u, v, w = (
        writer.define(name, each) for name, each in zip("uvw", writer.velocity(frame), strict=True)
    )
    two = Number(2.0)
    plane = plus(Operation("^", u, two), Operation("^", w, two))
    square = plus(plane, Operation("^", v, two))
    writer.offer("V", Call("sqrt", (square,)))
    writer.offer("alpha", Call("atan2", (w, u)))
    writer.offer("beta", Call("atan2", (v, Call("sqrt", (plane,)))))
    writer.offer("qbar", times(times(Number(0.5), Name("rho")), square))
    return u, v, w, square
