"""Surface: a lifting surface of several strips between two ends of its quarter-chord line.

Each strip is a section (`aerodb.parts.section`) at the middle of its part of the line, with chord
and incidence there; dihedral and sweep are those of the line. A control acts on the strips, or
parts of strips, that its region of the span covers.
"""

from collections.abc import Mapping
from typing import Annotated

import numpy as np
from pydantic import Discriminator, Field, Tag, model_validator

from aerodb.errors import InputError
from aerodb.parts.engine import growth, slipstream
from aerodb.parts.entry import Discs, Formula, text_or_table, write_loads
from aerodb.parts.frame import Frame, combination, lifting
from aerodb.parts.section import (
    Flap,
    Lifting,
    Section,
    downwash,
    standing_in,
    strip_forces,
    turned_down,
)
from aerodb.parts.writing import Writer
from aerodb.quantities import Metres, Point, Radians
from aerodb.support import Array
from aerodb.tables import Expression, Number, Operation, summed, times


class Region(Flap):
    """A control of a surface: a `Flap` over the part `span` of the half span, 0 at the root."""

    span: tuple[float, float] = (0.0, 1.0)

    @model_validator(mode="after")
    def _inside(self) -> "Region":
        if not 0.0 <= self.span[0] < self.span[1] <= 1.0:
            raise InputError(f"span {list(self.span)}", remedy="from 0 at the root to 1 at the tip")
        return self


class Surface(Lifting):
    """A lifting surface of strips.

    Parameters
    ----------
    root, tip : ends of the quarter-chord line [m], body axes from the vehicle's datum. root_chord,
        tip_chord : [m]; the tip's is the root's where it is not given.
    incidence : at the root, leading edge up; twist : what the tip has more [rad].
    strips : their number. control : deflection -> effectiveness over the whole span, or a `Region`.

    Formulas may use ``station``, 0 at the root and 1 at the tip, and ``chord`` [m] of the strip.
    """

    root: Point
    tip: Point
    root_chord: Metres = Field(gt=0)
    tip_chord: Metres | None = Field(default=None, gt=0)
    incidence: Radians = 0.0
    twist: Radians = 0.0
    strips: int = Field(ge=1, le=200)
    control: Mapping[
        str,
        Annotated[
            Annotated[Formula, Tag("text")] | Annotated[Region, Tag("table")],
            Discriminator(text_or_table),
        ],
    ] = {}

    @model_validator(mode="after")
    def _extended(self) -> "Surface":
        if np.hypot(self.tip[1] - self.root[1], self.tip[2] - self.root[2]) == 0.0:
            raise InputError("root and tip are not apart across the flow", remedy="move the tip")
        return self


def write(entry: Surface, writer: Writer, reference_point: Array, discs: Discs) -> None:
    """Write a surface: ``<part>_1`` is the strip at the root.

    Velocities are linear along the line, and so are the arms of forces: both are computed at the
    root and by the distance from it, once for all strips.

    reference_point : (3,) [m], where moments are about. discs : of the engines. Raises InputError
    as sections do.
    """
    sections = strips(entry)
    first = sections[0]
    line = np.array(entry.tip) - np.array(entry.root)
    axes = lifting(writer.side, first.dihedral, first.sweep)
    root = Frame(np.array(entry.root) - reference_point, axes)
    tip = Frame(line, axes)
    disc = standing_in(entry, writer, discs)
    angle = None if entry.downwash is None else downwash(entry.downwash, writer)
    flows: dict[str, list[Expression]] = {
        "root": [root.velocity(k) for k in range(3)],
        "tip": [tip.rotation(k) for k in range(3)],
    }
    if disc is not None:
        flows["slip"] = [slipstream(disc, root, k) for k in range(3)]
    for of, (u, v, w) in flows.items():
        if angle is not None:
            u, w = turned_down(u, w, angle)
        flows[of] = [
            writer.define(f"{of}_{name}", each) for name, each in zip("uvw", (u, v, w), strict=True)
        ]
    forces: list[tuple[Expression, Expression]] = []
    moments: list[Expression] = []
    for k, strip in enumerate(sections):
        own = Writer(writer.part, f"{writer.name}_{k + 1}", writer.where, writer.side)
        place = (k + 0.5) / entry.strips
        own.local |= {"station": Number(place), "chord": Number(strip.chord or 0.0)}
        shares = {"root": 1.0, "tip": place}
        if disc is not None:
            shares["slip"] = growth(disc, Frame(root.arm + place * line, axes))
        velocity = [
            combination(list(shares.values()), [flows[of][j] for of in shares]) for j in range(3)
        ]
        if writer.air is not None:
            felt = writer.air.felt(Frame(root.arm + place * line, axes), own)
            if angle is not None:
                felt[0], felt[2] = turned_down(felt[0], felt[2], angle)
            velocity = [Operation("-", a, b) for a, b in zip(velocity, felt, strict=True)]
        x, z, moment = strip_forces(strip, own, velocity[0], velocity[1], velocity[2])
        forces.append((x, z))
        moments += [] if moment is None else [moment]
        writer.variables |= own.variables
        writer.keys |= own.keys
    x, z = (summed([force[k] for force in forces]) for k in range(2))
    moment = summed(moments) if moments else None
    places = [Number((k + 0.5) / entry.strips) for k in range(entry.strips)]
    out_x, out_z = (
        summed([times(at, force[k]) for at, force in zip(places, forces, strict=True)])
        for k in range(2)
    )
    total = [writer.define(name, each) for name, each in (("x", x), ("z", z))]
    outer = [writer.define(name, each) for name, each in (("x_arm", out_x), ("z_arm", out_z))]
    writer.act(root, (total[0], None, total[1]), (None, moment, None))
    writer.act(tip, (outer[0], None, outer[1]), end="_arm", only_moments=True)
    write_loads(entry, writer, root)


def strips(entry: Surface) -> list[Section]:
    """Return the strips of a surface as sections, from its root; lengths in m, angles in rad."""
    root, tip = np.array(entry.root), np.array(entry.tip)
    line = tip - root
    across = float(np.hypot(line[1], line[2]))
    tip_chord = entry.root_chord if entry.tip_chord is None else entry.tip_chord
    found = []
    for k in range(entry.strips):
        ends = k / entry.strips, (k + 1) / entry.strips
        middle = 0.5 * (ends[0] + ends[1])
        chord = entry.root_chord + middle * (tip_chord - entry.root_chord)
        found.append(
            Section(
                kind="section",
                position=tuple((root + middle * line).tolist()),
                area=chord * across / entry.strips,
                chord=chord,
                incidence=entry.incidence + middle * entry.twist,
                dihedral=float(np.arctan2(-line[2], abs(line[1]))),
                sweep=float(np.arctan2(-line[0], across)),
                control=_controls(entry.control, ends),
                separated=entry.separated,
                **entry.model_dump(include={"lift", "drag", "moment", "downwash", "slipstream"}),
            )
        )
    return found


def _controls(
    control: Mapping[str, Formula | Region], ends: tuple[float, float]
) -> dict[str, Formula | Flap]:
    """The controls of a strip between two places of the span, each by its share of the strip."""
    found: dict[str, Formula | Flap] = {}
    for name, value in control.items():
        if not isinstance(value, Region):
            found[name] = value
            continue
        covered = min(ends[1], value.span[1]) - max(ends[0], value.span[0])
        share = min(covered / (ends[1] - ends[0]), 1.0)
        if share <= 1e-9:
            continue
        part = value.model_dump(exclude={"span"})
        if share < 1.0 - 1e-9 and value.effectiveness is not None:
            part["effectiveness"] = f"{share!r}*({value.effectiveness})"
        elif share < 1.0 - 1e-9:
            part["efficiency"] = f"{share!r}*({value.part})"
        found[name] = Flap(**part)
    return found
