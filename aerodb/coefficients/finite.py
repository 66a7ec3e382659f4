"""Whether a database has values at all: at points such as flights have, and with inputs held at
zero."""

from collections.abc import Collection
from typing import Final

import numpy as np

from aerodb.coefficients.inputs import with_held_inputs
from aerodb.errors import InputError
from aerodb.nomenclature import CHANNELS, channel, is_surface
from aerodb.support import Array
from aerodb.tables import AeroDatabase

#: Number of points that are looked at.
_POINTS: Final = 64
_SEED: Final = 5
#: SI unit -> from and to which values of a slow flight near the ground go; other units: 0.1 to 1.
_RANGES: Final = {
    "rad": (-0.2, 0.3),
    "rad/s": (-0.3, 0.3),
    "m/s": (15.0, 90.0),
    "m/s^2": (-10.0, 10.0),
    "m": (5.0, 900.0),
    "Pa": (200.0, 4000.0),
    "kg/m^3": (0.8, 1.22),
    "K": (260.0, 295.0),
    "kg": (5.0, 2000.0),
}
#: Of a channel, where its unit says too little.
_OWN: Final = {"static_pressure": (7e4, 1.01e5), "mach": (0.05, 0.3)}


def without_values(database: AeroDatabase) -> tuple[str, ...]:
    """Return the coefficients that are not finite at any of some points within usual flight; empty
    where all have values."""
    rng = np.random.default_rng(_SEED)
    points = {name: _values(name, rng) for name in database.inputs}
    with np.errstate(all="ignore"):
        found = database.predict(points).coefficients
    return tuple(name for name, values in found.items() if not np.any(np.isfinite(values)))


def divisors(database: AeroDatabase, names: Collection[str]) -> tuple[str, ...]:
    """Return those of these inputs that, held at zero, leave a coefficient without any value that
    it has otherwise."""
    before = set(without_values(database))
    found = []
    for name in names:
        try:
            held = with_held_inputs(database, [name])
        except InputError:
            continue  # it cannot be held at all
        if set(without_values(held)) - before:
            found.append(name)
    return tuple(found)


def _values(name: str, rng: np.random.Generator) -> Array:
    unit = channel(name).unit if name in CHANNELS or is_surface(name) else ""
    low, high = _OWN.get(name, _RANGES.get(unit, (0.1, 1.0)))
    return rng.uniform(low, high, _POINTS)
