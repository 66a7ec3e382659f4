"""Whether a database has values at all: at points such as flights have, and with inputs held at
zero."""

from collections.abc import Collection
from typing import Final

import numpy as np

from aerodb.coefficients.inputs import with_held_inputs
from aerodb.errors import InputError
from aerodb.nomenclature import CHANNELS, channel, is_surface
from aerodb.support import Array
from aerodb.tables import AeroDatabase, Call, Expression, Operation

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
    """Return the coefficients that are not finite at one or more of some points within usual
    flight; empty where all have values everywhere."""
    with np.errstate(all="ignore"):
        found = database.predict(_points(database)).coefficients
    return tuple(name for name, values in found.items() if not np.all(np.isfinite(values)))


def divisors(database: AeroDatabase, names: Collection[str]) -> tuple[str, ...]:
    """Return those of these inputs that, held at zero, leave a coefficient without a value that it
    has otherwise, or make a divisor zero, alone or all of them together. A table takes an infinite
    argument for its end, so that the coefficient alone may not show it."""
    before, found = set(without_values(database)), _zero_divisors(database, names)
    for name in names:
        try:
            held = with_held_inputs(database, [name])
        except InputError:
            continue  # it cannot be held at all
        if set(without_values(held)) - before:
            found.add(name)
    return tuple(name for name in names if name in found)


def _zero_divisors(database: AeroDatabase, names: Collection[str]) -> set[str]:
    """The inputs among `names` without which a divisor is zero, each alone and all together."""
    expressions = _divisors_of(database)
    definitions = {name: each.expression for name, each in database.variables.items()}
    program = database.compiled(expressions, definitions, {**database.tables, **database.scattered})
    points = _points(database, program.inputs)

    def zero(held: Collection[str]) -> set[int]:
        at = {n: np.zeros(_POINTS) if n in held else values for n, values in points.items()}
        with np.errstate(all="ignore"):
            values = program.run(at).values
        return {k for k, each in enumerate(values) if not np.any(each)}

    before, own = zero(()), [name for name in names if name in program.inputs]
    alone = {name for name in own if zero([name]) - before}
    found, together = set(alone), zero(own) - before
    for name in own:
        if together - zero([each for each in own if each != name]):
            found.add(name)
    return found


def _divisors_of(database: AeroDatabase) -> list[Expression]:
    """What terms and variables divide by; not in branches, which may be there to avoid a zero."""
    pending = [term.expression for term in database.terms]
    pending += [each.expression for each in database.variables.values()]
    found = []
    while pending:
        node = pending.pop()
        if isinstance(node, Call) and node.function == "piecewise":
            continue
        if isinstance(node, Operation) and node.operator == "/":
            found.append(node.right)
        pending.extend(node.children)
    return found


def _points(database: AeroDatabase, names: Collection[str] = ()) -> dict[str, Array]:
    """Input -> values (64,) [SI] within usual flight."""
    rng = np.random.default_rng(_SEED)
    return {name: _values(name, rng) for name in (*database.inputs, *names)}


def _values(name: str, rng: np.random.Generator) -> Array:
    unit = channel(name).unit if name in CHANNELS or is_surface(name) else ""
    low, high = _OWN.get(name, _RANGES.get(unit, (0.1, 1.0)))
    return rng.uniform(low, high, _POINTS)
