"""Mass properties of a vehicle file, and events that change them in flight.

What is dropped at the place p [m] takes mass and inertia of a point with it. With the mass m, the
centre of gravity c and the inertia I about it, and a change dm of the mass,

    m' = m + dm,        c' = (m c + dm p)/m',
    I' = I + m S(c - c') + dm S(p - c'),        S(d) = |d|^2 1 - d d^T (parallel axes).
"""

from collections.abc import Mapping
from typing import Annotated, Final, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from aerodb.errors import InputError
from aerodb.flight import Flight
from aerodb.quantities import Inertia, Kilograms, Point, in_unit
from aerodb.support import Array, Strict

#: Channels of the mass [kg], CG [m, from the datum] and inertia [kg m2].
MASS_CHANNELS: Final = ("mass", "cg_x", "cg_y", "cg_z", "Ixx", "Iyy", "Izz", "Ixz")


class MassEvent(Strict):
    """A mass that leaves, or comes aboard, in one flight.

    flight : the start of the flight's id, six characters at least. time : of the flight's clock
    [s]. mass : change [kg], negative where it leaves. position : of what leaves [m], from the
    datum.
    """

    flight: Annotated[str, Field(min_length=6)]
    time: Annotated[float, in_unit("s")]
    mass: Annotated[float, in_unit("kg")]
    position: Point


class MassProperties(Strict):
    """Mass, CG and inertia: constant, tabulated over fuel mass, or logged.

    ``source = "constant"``: one value each. ``"fuel_table"``: `fuel_mass` increases, all others are
    lists of the same length. ``"channels"``: the log holds them. event : what was dropped or taken
    up in single flights.
    """

    source: Literal["constant", "fuel_table", "channels"] = "constant"
    fuel_mass: tuple[Annotated[float, in_unit("kg"), Field(ge=0)], ...] = ()
    mass: Kilograms | tuple[Kilograms, ...] | None = None
    cg: Point | tuple[Point, ...] | None = None
    Ixx: Inertia | tuple[Inertia, ...] | None = None
    Iyy: Inertia | tuple[Inertia, ...] | None = None
    Izz: Inertia | tuple[Inertia, ...] | None = None
    Ixz: Inertia | tuple[Inertia, ...] | None = None
    event: tuple[MassEvent, ...] = ()

    @model_validator(mode="after")
    def _complete(self) -> Self:
        fields = {name: getattr(self, name) for name in ("mass", "cg", "Ixx", "Iyy", "Izz", "Ixz")}
        if self.source == "channels":
            if self.event:
                raise ValueError("events of mass beside logged masses: leave out one of the two")
            return self
        absent = [name for name, value in fields.items() if value is None]
        if absent:
            raise ValueError(f"mass properties are incomplete: {', '.join(absent)} missing")
        if self.source == "fuel_table":
            if len(self.fuel_mass) < 2 or np.any(np.diff(self.fuel_mass) <= 0):
                raise ValueError("fuel_mass must hold at least two increasing values")
            for name, value in fields.items():
                if np.shape(value)[:1] != (len(self.fuel_mass),):
                    raise ValueError(f"{name} must have one entry per fuel_mass")
        for name in ("Ixx", "Iyy", "Izz"):
            if np.any(np.asarray(fields[name], dtype=float) <= 0):
                raise ValueError(f"{name} must be positive")
        return self


def after_events(
    flight: Flight, known: Mapping[str, Array], events: tuple[MassEvent, ...]
) -> dict[str, Array]:
    """Return mass [kg], CG [m] and inertia [kg m2], (n,) each, with the events of a flight.

    known : the same without them. A sample at the time of an event counts as after it. Events
    change what is at each sample, so that their order does not matter. Raises InputError where more
    leaves than is there.
    """
    now = {name: np.array(values, dtype=np.float64) for name, values in known.items()}
    for event in events:
        if not flight.id.startswith(event.flight):
            continue
        later = flight.time >= event.time
        mass, change = now["mass"][later], event.mass
        total = mass + change
        if np.any(total <= 0.0):
            raise InputError(
                f"{-change:g} kg leave at {event.time:g} s, more than the {mass.min():g} kg aboard",
                f"[[mass.event]] of flight {event.flight}",
                "mass is the change in kg, negative where something is dropped",
            )
        place = np.array(event.position)
        before = np.stack([now[f"cg_{axis}"][later] for axis in "xyz"])
        after = (mass * before + change * place[:, None]) / total
        moved, beside = before - after, place[:, None] - after
        for name, i, j in (("Ixx", 1, 2), ("Iyy", 0, 2), ("Izz", 0, 1)):
            now[name][later] += sum(
                m * (d[i] ** 2 + d[j] ** 2) for m, d in ((mass, moved), (change, beside))
            )
        now["Ixz"][later] += mass * moved[0] * moved[2] + change * beside[0] * beside[2]
        now["mass"][later] = total
        for axis, values in zip("xyz", after, strict=True):
            now[f"cg_{axis}"][later] = values
    return now
