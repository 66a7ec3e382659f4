"""Control surfaces of a vehicle and their roles, which decide the axes of their hypotheses."""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final, Literal

from aerodb.nomenclature import is_surface
from aerodb.vehicle import Vehicle

Role = Literal["pitch", "roll", "yaw", "speed_brake", "body_flap", "flap", "landing_gear", "other"]

#: The first pattern that a surface's name contains says what it is for.
_ROLES: Final[tuple[tuple[str, Role], ...]] = (
    (r"gear", "landing_gear"),
    (r"body_?flap", "body_flap"),
    (r"brake|spoiler", "speed_brake"),
    (r"aileron|flaperon", "roll"),
    (r"flap|slat", "flap"),
    (r"rudder(?!vator)|fin", "yaw"),
    (r"elevator|elevon|stabil|canard|tail|ruddervator", "pitch"),
)


@dataclass(frozen=True)
class Surface:
    """A deflection ``delta_<name>``, what it is for, and the right and left surface that it is made
    of, if it is."""

    name: str
    role: Role
    right: str = ""
    left: str = ""

    @property
    def channel(self) -> str:
        return f"delta_{self.name}"

    @property
    def words(self) -> str:
        """Name for use in a sentence."""
        return self.name.replace("_", " ")


def role_of(name: str) -> Role:
    """Role of a surface, from its name.

    >>> role_of("elevon_left"), role_of("speedbrake"), role_of("flap"), role_of("strake")
    ('pitch', 'speed_brake', 'flap', 'other')
    """
    return next((role for pattern, role in _ROLES if re.search(pattern, name)), "other")


def surfaces_of(vehicle: Vehicle, channels: Iterable[str]) -> tuple[Surface, ...]:
    """Control surfaces among `channels`, sorted by name.

    Combinations replace the surfaces they are made of; surfaces fixed by the vehicle's
    [configuration] are left out.

    A symmetric combination is for pitch unless its name says otherwise, an asymmetric one for roll.
    """
    names = {
        name.removeprefix("delta_")
        for name in channels
        if is_surface(name) and name not in vehicle.configuration
    }
    surfaces, members = [], set[str]()
    for name, combination in vehicle.combinations.items():
        if name not in names:
            continue
        members |= {combination.right, combination.left}
        by_name = role_of(name)
        usual: Role = (
            "roll"
            if combination.kind == "asymmetric"
            else "pitch"
            if by_name in ("roll", "other")
            else by_name
        )
        role = by_name if combination.kind == "asymmetric" and by_name == "yaw" else usual
        surfaces.append(Surface(name, role, combination.right, combination.left))
    single = names - members - {surface.name for surface in surfaces}
    surfaces += [Surface(name, role_of(name)) for name in single]
    return tuple(sorted(surfaces, key=lambda surface: surface.name))
