"""Section: a strip of a lifting surface, with lift and drag of its local flow.

The velocity at the strip is ``v + w x r``, with the slipstream of an engine, in the plane across
the span: by simple sweep theory the flow along the span does nothing. The downwash turns it. With
its components u and w and its size V, the angle of attack is

    alpha = atan2(w, u) + incidence + sum of tau delta,

and the forces are those of lift and drag across and along this flow:

    X = (rho/2) S V (C_L w - C_D u),    Z = -(rho/2) S V (C_L u + C_D w).

With `separated`, both coefficients go over to those of a flat plate, cl sin(2 alpha) and
cd_min + (cd_max - cd_min) sin(alpha)^2, beyond the stall angle a of either sign: their share is

    sigma = 1 - S(l (alpha + a)) (1 - S(l (alpha - a))),    S(x) = (1 + tanh(x/2))/2.

A flap of the chord ratio E in thin-airfoil theory has the effectiveness
tau = 1 - (theta - sin theta)/pi with cos theta = 2 E - 1, of which a real one reaches a part. That
of a plain or a slotted flap falls with its deflection, by the factor

    eta = 1 - (k/2) (1 + tanh((|delta| - delta_0)/w)).

References
----------
"Aerodynamic Model Update Using Parameter Identification Supporting a Cessna Grand Caravan
Engineering Simulation" (component build-up of sections and sub-sections); McCormick, Aerodynamics,
Aeronautics and Flight Mechanics (1995), sections 3.4 and 8.1; Jones, NACA Report 863 (1947), sweep;
USAF Stability and Control DATCOM (1978), section 6.1.1.1: effectiveness of flaps over deflection,
also in Roskam, Airplane Design, part VI, figures 8.13 and 8.17.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import reduce
from typing import Annotated, Final, Literal

import numpy as np
from pydantic import Discriminator, Field, Tag

from aerodb.errors import InputError, nearest
from aerodb.parts.engine import growth, slipstream
from aerodb.parts.entry import (
    Disc,
    Discs,
    Formula,
    Placed,
    Slipstreamed,
    text_or_table,
    write_loads,
)
from aerodb.parts.frame import Frame, lifting
from aerodb.parts.writing import Writer
from aerodb.quantities import Metres, Radians, in_unit
from aerodb.support import Array, Strict
from aerodb.tables import Call, Expression, Name, Negation, Number, Operation, number, plus, times

Area = Annotated[float, in_unit("m^2"), Field(gt=0)]


@dataclass(frozen=True)
class Measured:
    """What is measured of a type of flap: the `level` of its effectiveness at small deflections, of
    that of thin-airfoil theory, the share that is `lost` at large ones, and the deflection at the
    `middle` of the loss and its `width` [rad]."""

    level: float
    lost: float
    middle: float
    width: float


#: Level of a single slotted flap: mean of .77, .82, .85, .84 and .80 at the chord ratios .15, .2,
#: .25, .3 and .4 of DATCOM's curves of the effectiveness of such flaps (Roskam VI, figure 8.17),
#: as they are tabulated by others: the figures themselves were not at hand.
_SLOTTED_LEVEL: Final = 0.82
#: Level of a plain flap at small deflections: a usual value; no curve of it was at hand.
_PLAIN_LEVEL: Final = 0.80
#: Share lost, middle and width [deg] by least squares of the same curves of slotted flaps over
#: their value at 0, at 0 to 60 deg in steps of 10: rms .026, at most .07, which is how much the
#: curves of single chord ratios differ.
_SLOTTED_FALL: Final = (0.69, 46.2, 18.8)
#: The same of DATCOM's curves of plain flaps at the chord ratios .15, .25 and .3 (Roskam VI, figure
#: 8.13): rms .033, at most .07.
_PLAIN_FALL: Final = (0.482, 24.8, 11.1)
MEASURED: Final = {
    name: Measured(level, lost, math.radians(middle), math.radians(width))
    for name, level, (lost, middle, width) in (
        ("plain", _PLAIN_LEVEL, _PLAIN_FALL),
        ("slotted", _SLOTTED_LEVEL, _SLOTTED_FALL),
    )
}


class Flap(Strict):
    """A control of a section.

    Parameters
    ----------
    effectiveness : d alpha/d delta; or chord_ratio : for that of thin-airfoil theory, with its
        `efficiency`.
    type : the effectiveness is that at small deflections, and falls as is measured of such flaps;
        the efficiency is the measured one where none is given. Without it the flap is linear.
    """

    effectiveness: Formula | None = None
    chord_ratio: float | None = Field(default=None, gt=0, lt=1)
    efficiency: Formula | None = None
    type: Literal["plain", "slotted"] | None = None

    @property
    def part(self) -> str:
        """The efficiency, dimensionless, as a formula."""
        if self.efficiency is not None:
            return self.efficiency
        return "1" if self.type is None else repr(MEASURED[self.type].level)


Control = Mapping[
    str,
    Annotated[
        Annotated[Formula, Tag("text")] | Annotated[Flap, Tag("table")],
        Discriminator(text_or_table),
    ],
]


class Separated(Strict):
    """The flat plate that a section is beyond its stall.

    angle : of the stall [rad]. sharpness : l [1/rad] of the blend. lift : at 45 deg. drag : at 0
    and at 90 deg.
    """

    angle: Radians = Field(gt=0)
    sharpness: float = Field(default=50.0, gt=0)
    lift: Formula = "1"
    drag: tuple[Formula, Formula] = ("0.05", "2")


class Lifting(Slipstreamed):
    """What sections and surfaces share.

    Parameters
    ----------
    lift, drag : coefficients over the section's area, of local names: alpha, V, qbar, u, v, w; the
        drag may use lift.
    moment : coefficient over area and chord, nose up, about the position; 0 where it is not given.
    separated : beyond the stall, lift and drag are those of a flat plate; `lift` and `drag` are
        those of attached flow.
    downwash : [rad], down; names are the aircraft's (alpha) and other parts' (wing_alpha).
    """

    lift: Formula
    drag: Formula = "0"
    moment: Formula | None = None
    separated: Separated | None = None
    downwash: Formula | None = None


class Section(Lifting, Placed):
    """A strip of a lifting surface.

    Parameters
    ----------
    area : [m2]. chord : [m], where there is a moment.
    incidence, dihedral, sweep : leading edge up, tip up, tip aft [rad]; a fin has 90 deg dihedral,
        and its lift is to the left.
    control : deflection -> effectiveness, an expression, or a `Flap`.
    tilt : [rad] by which it turns leading edge up about its span, an expression of inputs: a wing
        that tilts.
    """

    area: Area
    chord: Metres | None = Field(default=None, gt=0)
    incidence: Radians = 0.0
    dihedral: Radians = 0.0
    sweep: Radians = 0.0
    control: Control = {}
    tilt: Formula | None = None


def flap_effectiveness(chord_ratio: float) -> float:
    """Return the effectiveness of a plain flap in thin-airfoil theory, dimensionless.

    chord_ratio : of flap and section, between 0 and 1; ValueError outside.

    >>> round(flap_effectiveness(0.25), 4)
    0.609
    """
    theta = math.acos(2.0 * chord_ratio - 1.0)
    return 1.0 - (theta - math.sin(theta)) / math.pi


def write(entry: Section, writer: Writer, reference_point: Array, discs: Discs) -> None:
    """Write a section.

    reference_point : (3,) [m], where moments are about. discs : of the engines. Raises InputError
    for a formula that cannot be read, a moment without chord and an engine that is not there.
    """
    axes = lifting(writer.side, entry.dihedral, entry.sweep)
    frame = Frame(np.array(entry.position) - reference_point, axes)
    u, v, w = writer.velocity(frame)
    disc = standing_in(entry, writer, discs)
    if disc is not None:
        grown = Number(growth(disc, frame))
        slip = (times(grown, slipstream(disc, frame, k)) for k in range(3))
        u, v, w = (plus(one, other) for one, other in zip((u, v, w), slip, strict=True))
    if entry.downwash is not None:
        u, w = turned_down(u, w, downwash(entry.downwash, writer))
    tilt: Expression | None = None
    if entry.tilt is not None:
        tilt = writer.define("tilt", writer.parsed(entry.tilt, "tilt"), "tilt")
        u, w = turned_down(u, w, Negation(tilt))
    x, z, moment = strip_forces(entry, writer, u, v, w)
    if tilt is not None:
        x, z = turned_down(x, z, tilt)
    writer.act(frame, (x, None, z), (None, moment, None))
    write_loads(entry, writer, frame)


def standing_in(entry: Lifting, writer: Writer, discs: Discs) -> Disc | None:
    """Return the disc of the engine in whose slipstream a part stands; None where in none.

    Raises InputError for an engine that is not there or has no diameter [m].
    """
    if not entry.slipstream:
        return None
    named = writer.text(entry.slipstream)
    if named not in discs:
        raise InputError(
            f"no engine '{named}' with a diameter",
            f"{writer.where} slipstream",
            nearest(named, discs) if discs else 'write a part of kind "engine" with a diameter',
        )
    return discs[named]


def downwash(text: str, writer: Writer) -> Name:
    """Define the downwash angle [rad] of a part; InputError for a formula that cannot be read."""
    return writer.define("downwash", writer.parsed(text, "downwash"), "downwash")


def strip_forces(
    entry: Section, writer: Writer, u: Expression, v: Expression, w: Expression
) -> tuple[Expression, Expression, Expression | None]:
    """Define flow and forces of a strip.

    Parameters
    ----------
    u, v, w : velocity [m/s] along x, along the span, and normal; downwash included.

    Returns
    -------
    Forces along x and z [N] and the moment about the span [N m], None without one. Raises
    InputError as `write` does.
    """
    u, w = writer.define("u", u), writer.define("w", w)
    writer.offer("v", v)
    two = Number(2.0)
    square = plus(Operation("^", u, two), Operation("^", w, two))
    speed = writer.define("V", Call("sqrt", (square,)))
    writer.offer("qbar", times(times(Number(0.5), Name("rho")), Operation("^", speed, two)))
    alpha = writer.define("alpha", _effective(entry, writer, Call("atan2", (w, u))), "control")
    share = None if entry.separated is None else _separated_share(entry.separated, alpha)
    lift = writer.read(entry.lift, "lift")
    if entry.separated is not None and share is not None:
        flat = writer.read(entry.separated.lift, "separated.lift")
        plate = times(flat, Call("sin", (times(Number(2.0), alpha),)))
        lift = _blended(lift, plate, share)
    lift = writer.define("lift", lift, "lift")
    drag = writer.read(entry.drag, "drag")
    if entry.separated is not None and share is not None:
        low, high = (writer.read(text, "separated.drag") for text in entry.separated.drag)
        square = Operation("^", Call("sin", (alpha,)), Number(2.0))
        drag = _blended(drag, plus(low, times(Operation("-", high, low), square)), share)
    x, z = times(lift, w), times(lift, u)
    if drag != Number(0.0):
        drag = writer.define("drag", drag, "drag")
        x, z = Operation("-", x, times(drag, u)), plus(z, times(drag, w))
    scale = times(times(Number(0.5 * entry.area), Name("rho")), speed)
    moment = None
    if entry.moment is not None:
        if entry.chord is None:
            raise InputError(
                "a moment without chord", f"{writer.where} chord", "give the chord of the section"
            )
        own = times(writer.read(entry.moment, "moment"), Number(entry.chord))
        moment = times(times(scale, speed), own)
    return (
        writer.define("x", times(scale, x)),
        writer.define("z", Negation(times(scale, z))),
        moment,
    )


def _separated_share(separated: Separated, alpha: Expression) -> Expression:
    """The share of the flat plate, 0 to 1."""
    half = Number(0.5 * separated.sharpness)

    def smooth(sign: float) -> Expression:
        beyond = plus(alpha, number(sign * separated.angle))
        return Call("tanh", (times(half, beyond),))

    one = Number(1.0)
    inside = times(plus(one, smooth(1.0)), Operation("-", one, smooth(-1.0)))
    return Operation("-", one, times(Number(0.25), inside))


def _blended(attached: Expression, plate: Expression, share: Expression) -> Expression:
    return plus(attached, times(share, Operation("-", plate, attached)))


def turned_down(u: Expression, w: Expression, angle: Expression) -> tuple[Expression, Expression]:
    """Return the velocity (u, w) [m/s] in a flow that is turned down by an angle [rad]."""
    cos, sin = Call("cos", (angle,)), Call("sin", (angle,))
    return (
        plus(times(u, cos), times(w, sin)),
        Operation("-", times(w, cos), times(u, sin)),
    )


def _effective(entry: Section, writer: Writer, flow: Expression) -> Expression:
    """The angle of attack of a strip in a flow, with its incidence and deflections."""
    parts = [flow] if entry.incidence == 0.0 else [flow, number(entry.incidence)]
    for key, value in entry.control.items():
        place = f"control.{key}"
        deflection = writer.parsed(key, place)
        effective = times(_effectiveness(value, writer, place), deflection)
        if isinstance(value, Flap) and value.type is not None:
            effective = times(effective, _remaining(MEASURED[value.type], deflection))
        parts.append(effective)
    return reduce(plus, parts)


def _effectiveness(value: Formula | Flap, writer: Writer, place: str) -> Expression:
    if not isinstance(value, Flap):
        return writer.parsed(value, place)
    if (value.effectiveness is None) == (value.chord_ratio is None):
        raise InputError(
            "it has effectiveness and chord_ratio, or neither",
            f"{writer.where} {place}",
            "give one of the two",
        )
    if value.effectiveness is not None:
        return writer.parsed(value.effectiveness, place)
    plain = number(flap_effectiveness(float(value.chord_ratio or 0.0)))
    return times(writer.parsed(value.part, place), plain)


def _remaining(measured: Measured, deflection: Expression) -> Expression:
    """The share of its effectiveness that a flap has at a deflection [rad]."""
    beyond = Operation("-", Call("abs", (deflection,)), Number(measured.middle))
    half = times(Number(1.0 / measured.width), beyond)
    smooth = plus(Number(1.0), Call("tanh", (half,)))
    return Operation("-", Number(1.0), times(Number(0.5 * measured.lost), smooth))
