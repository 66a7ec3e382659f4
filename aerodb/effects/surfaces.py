"""Control surfaces of a vehicle and their roles, which decide the axes of their hypotheses."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from aerodb.nomenclature import is_surface
from aerodb.support import Array
from aerodb.vehicle import Vehicle

Role = Literal["pitch", "roll", "yaw", "speed_brake", "body_flap", "flap", "landing_gear", "other"]

#: Of a deflection [rad]: (n,), or a number.
Change = Array | float

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

#: A surface whose deflection varies by less than this part of its travel (rms) stands still: what
#: moves is its pick-off, which is linear to a thousandth of its range at best (half of it, rms).
_STILL: Final = 5e-4
#: Travel [rad] of a surface whose limits the vehicle file does not state.
_TRAVEL: Final = float(np.deg2rad(50.0))
#: So does one that varies by less than this many sigmas of its stated noise: half of the variance
#: or more is noise.
_NOISE: Final = float(np.sqrt(2.0))


@dataclass(frozen=True)
class Deflection:
    """A deflection ``delta_<name>``, what it is for, and the right and left surface that it is made
    of, if it is: their mean, or with `opposed` half of right less left."""

    name: str
    role: Role
    right: str = ""
    left: str = ""
    opposed: bool = False

    @property
    def channel(self) -> str:
        return f"delta_{self.name}"

    def with_sides(self, change: Change) -> dict[str, Change]:
        """Return the changes of all deflections, (n,) or numbers, that a `change` of this one
        means: databases read the combination, or its surfaces."""
        signs = (1.0, -1.0 if self.opposed else 1.0)
        sides = {side: sign * change for side, sign in zip(self.sides, signs, strict=False)}
        return {self.channel: change, **sides}

    @property
    def sides(self) -> tuple[str, ...]:
        """Channels of the surfaces that it is made of, (2,) or empty."""
        return tuple(f"delta_{side}" for side in (self.right, self.left) if side)

    @property
    def words(self) -> str:
        """Name for use in a sentence: `name` with spaces."""
        return self.name.replace("_", " ")


def role_of(name: str) -> Role:
    """Role of a surface, from its name.

    >>> role_of("elevon_left"), role_of("speedbrake"), role_of("flap"), role_of("strake")
    ('pitch', 'speed_brake', 'flap', 'other')
    """
    return next((role for pattern, role in _ROLES if re.search(pattern, name)), "other")


def surfaces_of(vehicle: Vehicle, channels: Iterable[str]) -> tuple[Deflection, ...]:
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
        opposed = combination.kind == "asymmetric"
        surfaces.append(Deflection(name, role, combination.right, combination.left, opposed))
    single = names - members - {surface.name for surface in surfaces}
    surfaces += [Deflection(name, role_of(name)) for name in single]
    return tuple(sorted(surfaces, key=lambda surface: surface.name))


def surfaces_at_rest(vehicle: Vehicle, channels: Mapping[str, Array]) -> frozenset[str]:
    """Return the deflections among `channels` (name -> (n,), rad) whose surface stands still in a
    flight: nothing can be claimed of it, however well its noise fits the residual."""
    resting = set()
    for surface in surfaces_of(vehicle, channels):
        moving = [surface.right, surface.left] if surface.right else [surface.name]
        limits = [vehicle.surfaces[name].limits for name in moving if name in vehicle.surfaces]
        travel = min((high - low for low, high in limits), default=_TRAVEL)
        stated = [vehicle.sensors.get(f"delta_{name}") for name in moving]
        noise = max((sensor.noise for sensor in stated if sensor), default=0.0)
        values = channels[surface.channel]
        known = values[np.isfinite(values)]
        if len(known) and float(known.std()) < max(_STILL * travel, _NOISE * noise):
            resting.add(surface.channel)
    return frozenset(resting)
