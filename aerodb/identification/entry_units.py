"""Units of the parameters of a linear state-space model, from where they stand in its matrices."""

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Final

import numpy as np

from aerodb.errors import UnknownNameError
from aerodb.estimation import affine_matrix
from aerodb.nomenclature import channel

Row = Sequence[float | str]

#: Unit of a parameter whose own is not known.
UNKNOWN: Final = "SI"
_FACTOR: Final = re.compile(r"(?P<over>/?)(?P<unit>[A-Za-z]+)(?:\^(?P<power>\d+))?")

Powers = dict[str, int]


def entry_units(
    matrices: Iterable[tuple[Sequence[Row], Sequence[str], Sequence[str], bool]],
) -> dict[str, str]:
    """SI units of the parameters in matrices, by name; `UNKNOWN` where a row or column is no
    channel, where a parameter is multiplied by a number, which may have a unit, and where it is in
    entries of different units.

    matrices : entries, the channels of the rows and of the columns (none: one column without unit),
    and whether the rows are rates of change of those channels.

    >>> entry_units([([["Lp"]], ["p"], ["p"], True), ([["Lda"]], ["p"], ["delta_aileron"], True)])
    {'Lp': '1/s', 'Lda': '1/s^2'}
    >>> entry_units([([["CY", "2*k"]], ["ay"], ["beta", "r"], False)])
    {'CY': 'm/s^2/rad', 'k': 'SI'}
    """
    found: dict[str, set[str]] = {}
    for rows, of_rows, of_columns, rates in matrices:
        for name, slopes in affine_matrix(rows, "state space").slopes.items():
            for i, j in zip(*np.nonzero(slopes), strict=True):
                row, column = of_rows[i], of_columns[j] if of_columns else None
                plain = abs(float(slopes[i, j])) == 1.0
                unit = _quotient(row, column, rates) if plain else None
                found.setdefault(name, set()).add(unit or UNKNOWN)
    return {name: units.pop() if len(units) == 1 else UNKNOWN for name, units in found.items()}


def _quotient(row: str, column: str | None, rates: bool) -> str | None:
    """Unit of a channel (its rate of change: per second) per unit of another; None if unknown."""
    try:
        units = [channel(name).unit for name in (row, column) if name is not None]
    except UnknownNameError:
        return None
    above = _powers(units[0])
    below: Mapping[str, int] = _powers(units[1]) if len(units) > 1 else {}
    for unit, power in (*below.items(), *([("s", 1)] if rates else [])):
        above[unit] = above.get(unit, 0) - power
    numerator = [_raised(unit, power) for unit, power in above.items() if power > 0]
    divisors = [f"/{_raised(unit, -power)}" for unit, power in above.items() if power < 0]
    if not numerator and not divisors:
        return "1"
    return (" ".join(numerator) or "1") + "".join(divisors)


def _powers(unit: str) -> Powers:
    """Powers of the units in ``rad/s^2``."""
    powers: Powers = {}
    for part in _FACTOR.finditer(unit):
        power = int(part["power"] or 1)
        name = part["unit"]
        powers[name] = powers.get(name, 0) + (-power if part["over"] else power)
    return powers


def _raised(unit: str, power: int) -> str:
    return unit if power == 1 else f"{unit}^{power}"
