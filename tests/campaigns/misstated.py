"""What the vehicle file says wrongly of an aircraft whose database is right."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from aerodb.support import Array
from tests.campaigns.fleet import Airframe

Log = Mapping[str, Array]


@dataclass(frozen=True)
class Misstated:
    """One error of the vehicle data. right : hypothesis that names it. value : of its parameter, SI.
    craft : as the vehicle file describes it. log : as its logs state it, channels (n,)."""

    right: str
    value: float
    craft: Callable[[Airframe], Airframe] = lambda craft: craft
    log: Callable[[Log], dict[str, Array]] = dict


def _lowered(size: float) -> Callable[[Airframe], Airframe]:
    def moved(craft: Airframe) -> Airframe:
        x, y, z = craft.point
        return replace(craft, point=(x, y, z + size))

    return moved


def _mass(share: float) -> Misstated:
    """The mass assumed is too large by `share` of the true one; inertia and CG are right."""

    def log(channels: Log) -> dict[str, Array]:
        return {**channels, "mass": (1.0 + share) * channels["mass"]}

    return Misstated("mass_error@all", share / (1.0 + share), log=log)


MISSTATED: Mapping[str, Misstated] = {
    "mass +5 %": _mass(0.05),
    "mass -5 %": _mass(-0.05),
    "thrust line .4 m": Misstated("thrust_line_offset@all:z", 0.4, craft=_lowered(0.4)),
    "thrust line -.4 m": Misstated("thrust_line_offset@all:z", -0.4, craft=_lowered(-0.4)),
}
