"""Modes of versions beside those of a linear model of flights: figures and errors in per cent."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

#: Figures that are compared, with words and unit.
COMPARED: Final[Mapping[str, tuple[str, str]]] = {
    "omega": ("natural frequency", "rad/s"),
    "zeta": ("damping ratio", ""),
    "time_constant": ("time constant", "s"),
}


def mode_table(
    flown: Sequence[Mapping[str, Any]], sides: Mapping[str, Sequence[Mapping[str, Any]]]
) -> list[dict[str, Any]]:
    """Return a row for each figure of each mode of the flights: ``mode``, ``figure``, ``flown``,
    ``standard_error``, ``values`` and ``errors`` (label -> value, and per cent of that of the
    flights; None where a side lacks the mode), and ``worse``: whether the last side is farther off
    than the first.

    flown : modes of an estimate's document, SI. sides : label -> modes of a version's document, in
    order. Modes are paired by name; of several of one name, the first.

    References
    ----------
    "Aerodynamic Model Update Using Parameter Identification Supporting a Cessna Grand Caravan
    Engineering Simulation", tables 3 to 6.
    """
    rows = []
    for mode in flown:
        for figure in COMPARED:
            if figure not in mode["figures"]:
                continue
            value = mode["figures"][figure]
            values = {label: _figure(modes, mode["name"], figure) for label, modes in sides.items()}
            errors = {label: _error(own, value) for label, own in values.items()}
            known = [error for error in errors.values() if error is not None]
            rows.append(
                {
                    "mode": mode["name"],
                    "figure": figure,
                    "flown": value,
                    "standard_error": (mode["standard_errors"] or {}).get(figure),
                    "values": values,
                    "errors": errors,
                    "worse": len(known) > 1
                    and len(known) == len(sides)
                    and abs(known[-1]) > abs(known[0]),
                }
            )
    return rows


def mode_words(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return what the table says, in sentences (errors in per cent): what came nearer, what is
    farther off, and which modes a side lacks."""
    said = []
    for title, wanted in (("Nearer to the flights", False), ("Farther off", True)):
        found = [
            f"{COMPARED[row['figure']][0]} of the {row['mode']} {_from_to(row)}"
            for row in rows
            if len(row["errors"]) > 1
            and None not in row["errors"].values()
            and row["worse"] == wanted
        ]
        if found:
            said.append(f"{title}: {'; '.join(found)}.")
    lacking = dict.fromkeys(
        f"{label} has no {row['mode']}"
        for row in rows
        for label, value in row["values"].items()
        if value is None
    )
    return [*said, *(f"{each}." for each in lacking)]


def _from_to(row: Mapping[str, Any]) -> str:
    errors = list(row["errors"].values())
    return f"{errors[0]:+.1f} to {errors[-1]:+.1f} %"


def _figure(modes: Sequence[Mapping[str, Any]], name: str, figure: str) -> float | None:
    for mode in modes:
        if mode["name"] == name and figure in mode["figures"]:
            found: float | None = mode["figures"][figure]
            return found
    return None


def _error(value: float | None, flown: float | None) -> float | None:
    """Per cent of the figure of the flights."""
    return None if value is None or not flown else 100.0 * (value - flown) / flown
