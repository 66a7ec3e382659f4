"""Wake: the vortex pair of another aircraft, which all other parts feel at their own places.

The channels V, alpha and beta are those of the air at the centre of gravity, or where `measured_at`
says. What the air does elsewhere in the wake is that less the velocity there:

    velocity through the air at a part = v + w x r - (a(place of the part) - a(measured_at)),

with a of `aerodb.physics.VortexPair`. So wings that reach into a core roll, tail and wing feel
different air, and nothing of it is said twice. Places are those of parts from the moment reference
of the database, with the channels north, east, altitude, phi, theta and psi.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from pydantic import model_validator

from aerodb.errors import InputError
from aerodb.parts.entry import Discs, Entry, Formula
from aerodb.parts.frame import Frame, combination
from aerodb.parts.writing import Writer
from aerodb.physics import LAMB_OSEEN_EXPONENT, Core
from aerodb.quantities import Point, Radians
from aerodb.support import Array
from aerodb.tables import (
    Call,
    Expression,
    Name,
    Negation,
    Number,
    Operation,
    number,
    parse,
    plus,
    substituted,
    times,
)

#: Unit vectors to the right of an axis, ahead along it when it is level, and down, in body axes;
#: `aside` is the heading of the aircraft less that of the axis.
_RIGHT: Final = (
    "cos(theta)*sin(aside)",
    "sin(phi)*sin(theta)*sin(aside) + cos(phi)*cos(aside)",
    "cos(phi)*sin(theta)*sin(aside) - sin(phi)*cos(aside)",
)
_AHEAD: Final = (
    "cos(theta)*cos(aside)",
    "sin(phi)*sin(theta)*cos(aside) - cos(phi)*sin(aside)",
    "cos(phi)*sin(theta)*cos(aside) + sin(phi)*sin(aside)",
)
_DOWN: Final = ("-sin(theta)", "sin(phi)*cos(theta)", "cos(phi)*cos(theta)")
#: Smallest square of a distance from a vortex over that of its core radius: there is no 0/0.
_SMALLEST: Final = 1e-12


class Wake(Entry):
    """A vortex pair, as `aerodb.physics.VortexPair`.

    Parameters
    ----------
    circulation, core_radius, spacing : [m2/s], [m], [m]; formulas, such as parameters.
    point : north, east, altitude [m] of a point of its axis. right, below : by how much the axis is
        beside it [m]; formulas.
    heading, slope : of its axis [rad]. core : law of the velocity about a vortex.
    measured_at : where V, alpha and beta are those of the air, body axes from the vehicle's datum
        [m]; the moment reference where it is not given.
    """

    circulation: Formula
    core_radius: Formula
    spacing: Formula
    point: Point
    right: Formula = "0"
    below: Formula = "0"
    heading: Radians
    slope: Radians = 0.0
    core: Core = "burnham_hallock"
    measured_at: Point | None = None

    @model_validator(mode="after")
    def _is_air(self) -> "Wake":
        if self.mirror or self.load:
            raise InputError("a wake with mirror or load", remedy="leave these out")
        return self


@dataclass(frozen=True, eq=False)
class MovingAir:
    """Air of a wake, by the names of its variables: axes right and below in body axes, and where
    the moment reference is across the axis [m]; `there` is what channels hold of it [m/s]."""

    entry: Wake
    right: tuple[Name, ...]
    below: tuple[Name, ...]
    place: tuple[Name, Name]
    strength: Name
    core: Name
    half: Name
    there: tuple[Name, Name] | None = None

    def across(self, arm: Array, writer: Writer, end: str = "") -> tuple[Name, Name]:
        """Define the velocity of the air right and below [m/s] at an arm (3,) [m] from the moment
        reference, for a part."""
        y, z = (
            writer.define(
                f"wake_{name}{end}", plus(at, combination(arm.tolist(), axes)) if arm.any() else at
            )
            for name, at, axes in zip("yz", self.place, (self.right, self.below), strict=True)
        )
        to_right, to_below = [], []
        for side in (1.0, -1.0):
            dy = combination([1.0, -side], [y, self.half])
            square = plus(times(dy, dy), times(z, z))
            over = times(number(side), times(self.strength, self._over_square(square)))
            to_right.append(times(over, z))
            to_below.append(Negation(times(over, dy)))
        return (
            writer.define(f"wake_right{end}", plus(*to_right)),
            writer.define(f"wake_below{end}", plus(*to_below)),
        )

    def felt(self, frame: Frame, writer: Writer) -> list[Expression]:
        """Return the velocity of the air [m/s] along the axes of a part beyond what the channels
        hold."""
        air = self.across(frame.arm, writer)
        assert self.there is not None
        moved = [Operation("-", one, other) for one, other in zip(air, self.there, strict=True)]
        total = []
        for k in range(3):
            shares = [
                combination(frame.axes[:, k].tolist(), axes) for axes in (self.right, self.below)
            ]
            total.append(plus(*(times(a, b) for a, b in zip(shares, moved, strict=True))))
        return total

    def _over_square(self, square: Expression) -> Expression:
        """Velocity over (G/2 pi) and over r, by the square of r."""
        core = times(self.core, self.core)
        if self.entry.core == "burnham_hallock":
            return Operation("/", Number(1.0), plus(core, square))
        square = Call("max", (square, times(Number(_SMALLEST), core)))
        decayed = Call("exp", (Operation("/", times(number(-LAMB_OSEEN_EXPONENT), square), core),))
        return Operation("/", Operation("-", Number(1.0), decayed), square)


def write(entry: Wake, writer: Writer, reference_point: Array, discs: Discs) -> MovingAir:
    """Write a wake; returns its air, for the parts.

    reference_point : (3,) [m], where arms are from. Raises InputError for a formula that cannot be
    read.
    """
    del discs
    aside = writer.define("aside", parse(f"psi - {entry.heading!r}"))
    right = [substituted(parse(text), {"aside": aside}) for text in _RIGHT]
    up, flat = float(np.sin(entry.slope)), float(np.cos(entry.slope))
    below = [
        combination([up, flat], [substituted(parse(ahead), {"aside": aside}), parse(down)])
        for ahead, down in zip(_AHEAD, _DOWN, strict=True)
    ]
    axes = [
        tuple(writer.define(f"{of}_{k}", each) for k, each in zip("xyz", three, strict=True))
        for of, three in (("right", right), ("below", below))
    ]
    north, east, altitude = entry.point
    away = (
        parse(f"north - {north!r}"), parse(f"east - {east!r}"), parse(f"{altitude!r} - altitude"),
    )  # fmt: skip
    c, s = float(np.cos(entry.heading)), float(np.sin(entry.heading))
    beside = [writer.parsed(getattr(entry, key), key) for key in ("right", "below")]
    place = tuple(
        writer.define(f"away_{of}", Operation("-", combination(values, away), moved), of)
        for of, values, moved in (
            ("right", (-s, c, 0.0), beside[0]),
            ("below", (c * up, s * up, flat), beside[1]),
        )
    )
    circulation = writer.parsed(entry.circulation, "circulation")
    strength = writer.define("strength", times(Number(0.5 / np.pi), circulation), "circulation")
    core = writer.define("core", writer.parsed(entry.core_radius, "core_radius"), "core_radius")
    spacing = writer.parsed(entry.spacing, "spacing")
    half = writer.define("half", times(Number(0.5), spacing), "spacing")
    air = MovingAir(entry, axes[0], axes[1], (place[0], place[1]), strength, core, half)
    point = reference_point if entry.measured_at is None else np.array(entry.measured_at)
    there = air.across(point - reference_point, writer, "_there")
    return MovingAir(entry, axes[0], axes[1], (place[0], place[1]), strength, core, half, there)
