"""What flight-path reconstruction can estimate: names, natural sizes, scope, and the vector that is solved for.

Names: ``<channel>_bias``, ``_scale``, ``_delay`` of a sensor; ``wind_north _east _down`` of a flight; ``air_data_x _y _z``,
the air-data point from the CG; ``initial_<state>`` of a record. A sensor shows ``(1 + scale) true(t - delay) + bias``.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from aerodb.consistency.kinematics import INPUTS, STATES
from aerodb.errors import UnknownNameError, nearest

Array = NDArray[np.float64]

OUTPUTS: Final = (
    "V", "alpha", "beta", "qbar", "phi", "theta", "psi", "velocity_north", "velocity_east", "velocity_down",
    "north", "east", "altitude",
)  # fmt: skip

#: Size of error that a serviceable sensor may have: below it an estimate says something, beyond it it says nothing.
_SIZE: Final[Mapping[str, float]] = {
    **dict.fromkeys(("ax", "ay", "az"), 0.5),
    **dict.fromkeys(("p", "q", "r"), 0.02),
    **dict.fromkeys(("alpha", "beta", "phi", "theta", "psi"), 0.03),
    **dict.fromkeys(("V", "velocity_north", "velocity_east", "velocity_down"), 3.0),
    **dict.fromkeys(("u", "v", "w"), 3.0),
    **dict.fromkeys(("north", "east", "altitude"), 20.0),
    "qbar": 200.0,
}
_SCALE, _DELAY, _WIND, _ARM = 0.2, 0.2, 10.0, 1.0


@dataclass(frozen=True)
class Parameter:
    """One unknown: `kind` of correction (bias, scale, delay, wind, arm, initial) of `subject`; `scope` is empty for what all
    records share, else the flight (wind) or record (initial states) that it belongs to; `size` is its natural size."""

    name: str
    kind: str
    subject: str
    scope: str
    size: float

    @property
    def label(self) -> str:
        """Name with its scope, unique in one reconstruction."""
        return f"{self.name}[{self.scope}]" if self.scope else self.name


def parameter(name: str, scope: str = "") -> Parameter:
    """The parameter of that name; UnknownNameError with the nearest name otherwise.

    >>> parameter("alpha_scale").kind
    'scale'
    """
    head, _, tail = name.rpartition("_")
    if tail in ("bias", "scale") and head in (*INPUTS, *OUTPUTS):
        return Parameter(name, tail, head, scope, _SIZE[head] if tail == "bias" else _SCALE)
    if tail == "delay" and head in OUTPUTS:
        return Parameter(name, tail, head, scope, _DELAY)
    if head == "wind" and tail in ("north", "east", "down"):
        return Parameter(name, "wind", tail, scope, _WIND if tail != "down" else 0.2 * _WIND)
    if head == "air_data" and tail in ("x", "y", "z"):
        return Parameter(name, "arm", tail, scope, _ARM)
    if name.startswith("initial_") and name[8:] in STATES:
        return Parameter(name, "initial", name[8:], scope, _SIZE[name[8:]])
    raise UnknownNameError(f"unknown reconstruction parameter '{name}'", remedy=nearest(name, known_names()))


def known_names() -> tuple[str, ...]:
    """Every parameter name."""
    sensors = [f"{channel}_{kind}" for channel in (*INPUTS, *OUTPUTS) for kind in ("bias", "scale")]
    delays = [f"{channel}_delay" for channel in OUTPUTS]
    winds = ["wind_north", "wind_east", "wind_down", "air_data_x", "air_data_y", "air_data_z"]
    return (*sensors, *delays, *winds, *(f"initial_{state}" for state in STATES))


def unknowns(names: Sequence[str], flights: Sequence[str], records: Sequence[str]) -> tuple[Parameter, ...]:
    """The parameters of a joint reconstruction: winds once per flight, initial states once per record, all others shared."""
    found: list[Parameter] = []
    for name in dict.fromkeys(names):
        kind = parameter(name).kind
        scopes = tuple(dict.fromkeys(flights)) if kind == "wind" else tuple(records) if kind == "initial" else ("",)
        found += [parameter(name, scope) for scope in scopes]
    return tuple(found)
