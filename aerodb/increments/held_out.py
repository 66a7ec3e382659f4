"""The error of a version on flights that did not identify it, as one number before and after."""

import math
from collections.abc import Mapping
from typing import Any, Final

from aerodb.nomenclature import ROLL_OUTPUTS, in_order
from aerodb.support import MINUTE

#: An error that changed by less than this fraction counts as unchanged.
UNCHANGED: Final = MINUTE
#: An error within this factor of the noise floor is at it: the floor is known to a quarter.
NEAR_FLOOR: Final = 1.25


def held_out_error(report: Mapping[str, Any]) -> dict[str, Any]:
    """Return how well a version predicts flights that were held out.

    report : that it was made with (docs/reference/contract.md).

    Keys: kind (``held-out``; ``cross-validated``, where each flight was left out in turn; ``within
    flights``, where only parts of flights were; ``not held out``), axes: body axes whose rms error
    changes by more than the fraction `UNCHANGED`, the most improved first, each with the rms before
    and after; before and after: errors beyond the noise floor, in noise floors, pooled over the
    body axes as by the gate (None where they are not known).
    """
    validation = report.get("validation", {})
    entries = validated(report.get("axes", {}))
    if not entries:
        return {"kind": "not held out", "axes": {}, "before": None, "after": None}
    kind = "within flights" if validation.get("within_flights") else validation.get("kind", "")
    errors = {
        axis: [entry["held_out_rms_before"], entry["held_out_rms_after"]]
        for axis, entry in entries.items()
        if entry.get("held_out_rms_before") and entry.get("held_out_rms_after") is not None
    }
    changed = {
        axis: pair for axis, pair in errors.items() if abs(pair[1] / pair[0] - 1.0) > UNCHANGED
    }
    return {
        "kind": kind,
        "axes": dict(sorted(changed.items(), key=lambda entry: entry[1][1] / entry[1][0])),
        "before": pooled(entries, "excess_before"),
        "after": pooled(entries, "excess_after"),
    }


def validated(axes: Mapping[str, Mapping[str, Any]]) -> dict[str, Mapping[str, Any]]:
    """Return the axes, or outputs of rolls, that flights which were held out measure: those
    with `excess_before`, an rms error in the unit of the axis."""
    return {
        axis: axes[axis]
        for axis in (*in_order(axes), *ROLL_OUTPUTS)
        if axis in axes and axes[axis].get("excess_before") is not None
    }


def pooled(axes: Mapping[str, Mapping[str, Any]], key: str) -> float:
    """Return the root mean square over axes, each in units of its noise floor, or of its error
    before where no floor is known."""
    units = [entry["noise_floor"] or entry["held_out_rms_before"] or 1.0 for entry in axes.values()]
    squares = [(entry[key] / unit) ** 2 for entry, unit in zip(axes.values(), units, strict=True)]
    return math.sqrt(math.fsum(squares) / len(squares))
