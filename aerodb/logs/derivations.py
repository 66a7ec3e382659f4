"""Named methods that derive channels from the fields of one topic, for mapping files."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from aerodb.physics import euler_321_from_enu_quaternion, euler_321_from_quaternion
from aerodb.support import Array


@dataclass(frozen=True)
class Derivation:
    """A computation on fields of one topic.

    inputs : number of arguments. input_unit : their SI unit. outputs : channels that result. With
    `inputs` 0 and empty `input_unit` and `outputs`: any number of arguments, all in the unit of the
    one resulting channel.
    """

    compute: Callable[..., tuple[Array, ...]]
    inputs: int
    input_unit: str
    outputs: tuple[str, ...]


def _sum(*parts: Array) -> tuple[Array, ...]:
    return (np.sum(parts, axis=0),)


def _mean(*parts: Array) -> tuple[Array, ...]:
    return (np.mean(parts, axis=0),)


def _norm(*parts: Array) -> tuple[Array, ...]:
    return (np.sqrt(np.sum(np.square(parts), axis=0)),)


_ANGLES = ("phi", "theta", "psi")

#: Methods by the name that a mapping file uses.
METHODS: Final[Mapping[str, Derivation]] = {
    "euler_321_from_quaternion": Derivation(euler_321_from_quaternion, 4, "1", _ANGLES),
    "euler_321_from_enu_quaternion": Derivation(euler_321_from_enu_quaternion, 4, "1", _ANGLES),
    "sum": Derivation(_sum, 0, "", ()),
    "mean": Derivation(_mean, 0, "", ()),
    "norm": Derivation(_norm, 0, "", ()),
}
