"""Steady values of the flight in the matrices of a linear model, taken from what was recorded.

Entries may name ``U0`` and ``W0`` [m/s], mean velocities along the body's x and z axes, and
``sin_theta0``, ``cos_theta0``, ``tan_theta0`` and ``sec_theta0`` of the mean pitch attitude, as in
``Zq + U0`` or ``-9.80665*cos_theta0``. Those that no ``[[parameter]]`` describes are the record's.

"Aerodynamic Model Update Using Parameter Identification Supporting a Cessna Grand Caravan
Engineering Simulation", eqs. 2 to 5 and tables 1 and 2.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from aerodb.errors import InputError
from aerodb.identification.identification_flight import IdentificationFlight
from aerodb.identification.model_file import ParameterTable, StateSpaceFile
from aerodb.logs import find_columns
from aerodb.recording import Recording
from aerodb.support import Array


@dataclass(frozen=True)
class _Steady:
    """A steady value: the unit, the channels that it needs, any of these sets, and how it follows
    from them, (n,) from (n,)."""

    unit: str
    channels: tuple[tuple[str, ...], ...]
    of: tuple[Callable[..., Array], ...]


_ATTITUDE: Final = (("theta",),)
_STEADY: Final[Mapping[str, _Steady]] = {
    "U0": _Steady(
        "m/s", (("V", "alpha"), ("u",)), (lambda V, alpha: V * np.cos(alpha), lambda u: u)
    ),
    "W0": _Steady(
        "m/s", (("V", "alpha"), ("w",)), (lambda V, alpha: V * np.sin(alpha), lambda w: w)
    ),
    "sin_theta0": _Steady("1", _ATTITUDE, (np.sin,)),
    "cos_theta0": _Steady("1", _ATTITUDE, (np.cos,)),
    "tan_theta0": _Steady("1", _ATTITUDE, (np.tan,)),
    "sec_theta0": _Steady("1", _ATTITUDE, (lambda theta: 1.0 / np.cos(theta),)),
}
#: Gives the channels of a record by their names, (n,) each, or None where it lacks one.
_Find = Callable[[tuple[str, ...]], tuple[Array, ...] | None]


def with_recorded_trim(
    file: StateSpaceFile,
    source: Mapping[str, Recording] | Sequence[IdentificationFlight],
) -> tuple[StateSpaceFile, list[str]]:
    """Return the file with the steady values that it names and does not state, and what they are.

    source : tables by their names, whose columns are found as those of the model are; or flights,
    whose manoeuvres count. Values are means over all samples, in m/s or without unit, and fixed.

    Raises InputError where a record lacks the channels that a value needs.
    """
    described = {each.name for each in file.parameter}
    wanted = [name for name in file.entries if name in _STEADY and name not in described]
    finders: list[tuple[str, _Find]] = (
        [(name, _in_table(each, file)) for name, each in source.items()]
        if isinstance(source, Mapping)
        else [(each.flight.id[:8], _in_flight(each)) for each in source]
    )
    added, notes = [], []
    for name in wanted if finders else ():
        parts = [_series(name, find, where) for where, find in finders]
        value, unit = float(np.mean(np.concatenate(parts))), _STEADY[name].unit
        each = [float(part.mean()) for part in parts]
        span = f" ({min(each):.4g} to {max(each):.4g})" if len(each) > 1 else ""
        added.append(ParameterTable(name=name, value=value, unit=unit, fixed=True))
        notes.append(
            f"{name} = {value:.5g}{'' if unit == '1' else f' {unit}'} is the mean of"
            f" {len(each)} record{'s' * (len(each) > 1)}{span}."
        )
    return file.model_copy(update={"parameter": [*file.parameter, *added]}), notes


def _series(name: str, find: _Find, where: str) -> Array:
    """A steady quantity over one record, (n,)."""
    steady = _STEADY[name]
    for channels, of in zip(steady.channels, steady.of, strict=True):
        found = find(channels)
        if found is not None:
            values = np.asarray(of(*found))
            values = values[np.isfinite(values)]
            if len(values):
                return values
    needed = " or ".join(" and ".join(each) for each in steady.channels)
    raise InputError(
        f"no {needed}, of which {name} is the mean",
        f"record {where}",
        f'state it in the model file ([[parameter]] name = "{name}", value, fixed = true), or name'
        " the columns",
    )


def _in_table(recording: Recording, file: StateSpaceFile) -> _Find:
    def find(names: tuple[str, ...]) -> tuple[Array, ...] | None:
        try:
            found = find_columns(recording, names, file.columns)
        except InputError:
            if any(name in file.columns for name in names):
                raise
            return None
        return tuple(found.values[name] for name in names)

    return find


def _in_flight(each: IdentificationFlight) -> _Find:
    def find(names: tuple[str, ...]) -> tuple[Array, ...] | None:
        flight = each.flight
        if not all(name in flight for name in names):
            return None
        since = flight.time - flight.time[0]
        inside = np.any([(since >= a) & (since <= b) for a, b in each.windows], axis=0)
        good = flight.usable(list(names)) & inside
        return tuple(np.asarray(flight[name])[good] for name in names)

    return find
