"""Check cases: points with the coefficients of a database there, stored with it.

A stored version, or an exported file, is tested against them when it is read: the numbers must be
the same. AIAA S-119 calls them static shots.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from aerodb.support import Array
from aerodb.tables.analysis.nodes import table_grids
from aerodb.tables.database import AeroDatabase

#: Half the range of an input that neither a table nor an envelope bounds, SI: for angles, 11 deg.
_RANGE = 0.2
#: Ranges of inputs that must not be near zero, or whose magnitude is unlike that of an angle; SI.
_KNOWN_RANGES = {
    "V": (20.0, 100.0),
    "qbar": (500.0, 5000.0),
    "rho": (0.5, 1.2),
    "mach": (0.05, 0.4),
    "altitude": (0.0, 5000.0),
    "height_above_ground": (1.0, 500.0),
    "delta_landing_gear": (0.0, 1.0),
    "flow_attachment": (0.0, 1.0),
}
_PRIMES = (2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53, 59, 61, 67, 71)


@dataclass(frozen=True)
class CheckCase:
    """Inputs (SI, rad) and the coefficients there, on all axes of the database."""

    inputs: Mapping[str, float]
    coefficients: Mapping[str, float]


def make_check_cases(database: AeroDatabase, count: int = 25) -> tuple[CheckCase, ...]:
    """Make check cases of `database` at Halton points over its tables and envelopes.

    The points are the same on every machine. Points where a coefficient is not finite are left out,
    so that there may be fewer than `count`.

    Inputs are in SI units, coefficients dimensionless.
    """
    points = _points(database, count)
    values = _at_all(database, points, count)
    cases = [
        CheckCase(
            {n: float(x[k]) for n, x in points.items()},
            {axis: float(values[axis][k]) for axis in database.axes},
        )
        for k in range(count)
    ]
    return tuple(case for case in cases if np.all(np.isfinite(list(case.coefficients.values()))))


def failed_check_cases(
    database: AeroDatabase, cases: Sequence[CheckCase], tolerance: float = 1e-9
) -> tuple[str, ...]:
    """Deviations from the check cases by more than `tolerance` times max(|C|, 1e-3): one sentence
    each; empty when all pass.

    Coefficients are dimensionless.
    """
    if not cases:
        return ()
    first = cases[0].inputs.keys()
    if others := [k for k, case in enumerate(cases) if case.inputs.keys() != first]:
        return tuple(f"check case {k + 1}: its inputs are not those of the first" for k in others)
    points = {name: np.array([case.inputs[name] for case in cases]) for name in cases[0].inputs}
    values = _at_all(database, points, len(cases))
    deviations = []
    for k, case in enumerate(cases):
        for axis, expected in case.coefficients.items():
            value = float(values[axis][k])
            if not abs(value - expected) <= tolerance * max(abs(expected), 1e-3):
                deviations.append(
                    f"check case {k + 1}: {axis} is {value:.9g}, it was {expected:.9g}"
                )
    return tuple(deviations)


def _at_all(database: AeroDatabase, points: Mapping[str, Array], count: int) -> dict[str, Array]:
    """Coefficients at all points, (count,) also where the database has no inputs."""
    values = database.predict(points).coefficients
    return {axis: np.broadcast_to(value, (count,)) for axis, value in values.items()}


def _points(database: AeroDatabase, count: int) -> dict[str, Array]:
    ranges = {name: _KNOWN_RANGES.get(name, (-_RANGE, _RANGE)) for name in database.inputs}
    for grid in table_grids(database).values():
        for name, values in zip(grid.channels, grid.values, strict=True):
            if name in ranges and values[-1] > values[0]:
                ranges[name] = (float(values[0]), float(values[-1]))
    for increment in database.increments:
        for name, interval in increment.envelope.items():
            if name in ranges and interval.high > interval.low:
                ranges[name] = (interval.low - interval.cell, interval.high + interval.cell)
    if "V" in ranges and ranges["V"][0] <= 0.0:
        ranges["V"] = _KNOWN_RANGES["V"]  # dimensionless rates divide by it
    return {
        name: low + (high - low) * _halton(count, _PRIMES[k % len(_PRIMES)], k // len(_PRIMES))
        for k, (name, (low, high)) in enumerate(ranges.items())
    }


def _halton(count: int, base: int, skipped: int) -> Array:
    """(count,) points of van der Corput's sequence in (0, 1), rounded to 6 digits to keep files
    short.

    >>> _halton(3, 2, 0).tolist()
    [0.5, 0.25, 0.75]
    """
    values = []
    for k in range(1 + 100 * skipped, count + 1 + 100 * skipped):
        value, share, rest = 0.0, 1.0, k
        while rest:
            share /= base
            rest, digit = divmod(rest, base)
            value += share * digit
        values.append(round(value, 6))
    return np.array(values)
