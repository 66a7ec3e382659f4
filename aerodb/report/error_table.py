"""The table of errors per axis of an update or a closed loop, and which axes it tells."""

import math
from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from aerodb.increments import UNCHANGED
from aerodb.nomenclature import AXES, FORCE_AXES, ROLL_OUTPUTS
from aerodb.report.former_documents import former_within_flights
from aerodb.report.numbers import for_people
from aerodb.tables import WIND_AXES
from aerodb.units import UnitSystem

#: Axes in the usual order, and what rolls on the ground have in their place.
_ORDER: Final = (*AXES, *WIND_AXES, *ROLL_OUTPUTS)
_WHOLE: Final = {
    "held-out": "on {n} held-out flight{s}",
    "cross-validated": "with each flight predicted from the others",
    "not validated": "on the identification flights themselves, without validation",
}

#: The side force along the body and the wind axes, either way: close to the same.
_SAME: Final = (("CY", "C_side"), ("C_side", "CY"))


def excluded_sizes(entry: Mapping[str, Any], units: UnitSystem | None = None) -> dict[str, Any]:
    """Return what a hypothesis that was not found may still be, in display units: ``upper_bound``
    and ``minimum_detectable``, each None where it lies beyond every believable size and so says
    nothing, ``believable`` (None in older documents, of which undecided hypotheses have no bound)
    and ``unit``."""
    factor, unit = for_people(entry["unit"], units)
    believable = entry.get("believable")
    if believable is not None:
        most = max(map(abs, believable))
    else:
        most = math.inf if entry["verdict"] == "not_detected" else 0.0
    sizes = {key: entry[key] for key in ("upper_bound", "minimum_detectable")}
    return {
        **{
            key: factor * size if size is not None and size <= most else None
            for key, size in sizes.items()
        },
        "believable": [factor * end for end in believable] if believable else None,
        "unit": unit,
    }


def changed_axes(document: Mapping[str, Any]) -> set[str]:
    """Return the axes that an update or a closed loop changes: those of its increments; where it
    corrects parameters, those on which the error (dimensionless) is another."""
    changed = {entry["axis"] for entry in document["increments"]}
    if document.get("parameters"):
        changed |= {
            axis
            for axis, error in document["axes"].items()
            if axis not in WIND_AXES and error["rms_before"] != error["rms_after"]
        }
    return changed


def shown_axes(document: Mapping[str, Any]) -> list[str]:
    """Return the axes in which a document is told: forces along the body axes or along the wind
    axes, as its hypotheses and increments are written, and the moments. The other forces are the
    same ones once more."""
    changed = changed_axes(document)
    asked = [
        *changed,
        *(
            axis
            for entry in (*document["findings"], *document["not_found"])
            for axis in written_on(entry)
        ),
    ]
    along_wind = sum(axis in WIND_AXES for axis in asked) > sum(
        axis in FORCE_AXES for axis in asked
    )
    other = {*FORCE_AXES} if along_wind else {*WIND_AXES}
    other |= {own for own, same in _SAME if same in changed and own not in changed}
    return [
        axis
        for axis in sorted(document["axes"], key=_place)
        if axis in changed or axis not in other
    ]


def _place(axis: str) -> tuple[int, str]:
    """Key that sorts axes in the usual order, hinge moments last."""
    return _ORDER.index(axis) if axis in _ORDER else len(_ORDER), axis


def written_on(finding: Mapping[str, Any]) -> list[str]:
    """The axes that a hypothesis names."""
    axes: str = finding["hypothesis"].partition("@")[2].partition(":")[0]
    return axes.split("+")


def best_and_worse(document: Mapping[str, Any]) -> tuple[dict[str, Any], list[str]] | None:
    """Return the row (`error_rows`, dimensionless) of the changed axis that gained most, and the
    changed axes whose error grew; None where no changed axis could be compared."""
    touched = changed_axes(document)
    rows = [
        row
        for row in error_rows(document)
        if row["axis"] in touched and row["before"] and row["after"] is not None
    ]
    if not rows:
        return None
    best = min(rows, key=lambda row: row["after"] / row["before"])
    worse = [
        row["axis"]
        for row in rows
        if row["after"] > (1 + UNCHANGED) * row["before"] and row is not best
    ]
    return best, worse


def on_which(document: Mapping[str, Any]) -> str:
    """Return a phrase on which flights the errors were computed (docs/reference/conventions.md,
    section Hold-out)."""
    if by_parts(document):
        return "with the first and last parts of the flights predicted from the rest"
    n = len(document["flights"]["held_out"])
    return _WHOLE[document["validation"]["kind"]].format(n=n, s="" if n == 1 else "s")


def by_parts(document: Mapping[str, Any]) -> bool:
    """Return whether validation was within flights: parts of them predicted from the rest."""
    stated = document["validation"].get("within_flights")
    return former_within_flights(document) if stated is None else bool(stated)


def error_rows(document: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return rows of the error table in the usual axis order, errors dimensionless, of rolls on the
    ground in display units.

    Each row has the axis, its ``label`` with the unit, the error before and after (held-out where
    there is one), the error on the identification flights, without constants, the noise floor, the
    error in parts of what the axis varied in flight, the outcome and Theil's fit.
    """
    rows = []
    for axis in sorted(document["axes"], key=_place):
        entry = document["axes"][axis]
        held = "held_out_" if entry["held_out_rms_after"] is not None else ""
        factor, unit = for_people(entry["unit"]) if "unit" in entry else (1.0, "")
        entry = {
            key: value * factor if _is_error(key, value) else value for key, value in entry.items()
        }
        after, floor = entry[f"{held}rms_after"], entry["noise_floor"]
        explained = entry["explained"]
        rows.append(
            {
                "axis": axis,
                "label": f"{axis} [{unit}]" if unit else axis,
                "before": entry[f"{held}rms_before"],
                "after": after,
                "used_before": entry["rms_before"],
                "used_after": entry["rms_after"],
                "shape_before": entry["held_out_without_constant_before"],
                "shape_after": entry["held_out_without_constant_after"],
                "floor": floor,
                "times_floor": after / floor if after is not None and floor else None,
                "of_flown": float(np.sqrt(1.0 - explained)) if explained <= 1.0 else None,
                "fit": entry["theil"]["fit_percent"] if entry["theil"] else None,
                "outcome": entry["outcome"],
            }
        )
    return rows


def _is_error(key: str, value: Any) -> bool:
    """Whether an entry of an axis is an error in its unit."""
    return isinstance(value, float) and key != "explained"
