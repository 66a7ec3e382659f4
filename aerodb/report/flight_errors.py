"""Errors of single flights, and whether they agree with the stored error of all flights.

Where a report's figures disagree with the stored numbers, it says so.
"""

from collections.abc import Mapping, Sequence
from typing import Any, Final

from aerodb.coefficients import Comparison
from aerodb.report.error_table import by_parts
from aerodb.report.figures import pooled_residual
from aerodb.report.numbers import number
from aerodb.signals import rms

#: Relative difference from the stored error above which flights were processed again.
_SAME: Final = 1e-3


def flight_errors(axis: str, *sides: Mapping[str, Comparison]) -> dict[str, list[float | None]]:
    """Rms of flight - model on `axis` per flight, one entry for each of `sides`.

    sides : flight id -> comparison. Returns flight id -> errors, None where a flight has no usable
    sample or a side lacks it.

    Errors are dimensionless.
    """
    flights = dict.fromkeys(flight for side in sides for flight in side)
    return {flight: [_error(axis, side.get(flight)) for side in sides] for flight in flights}


def _error(axis: str, comparison: Comparison | None) -> float | None:
    if comparison is None or axis not in comparison.usable or not comparison.usable[axis].any():
        return None
    return rms(comparison.residual(axis)[comparison.usable[axis]])


def wrong_sensors(document: Mapping[str, Any]) -> bool:
    """Return whether sensors were found to be wrong: errors are told without what they do."""
    return any(finding["verdict"] == "sensor" for finding in document["findings"])


def disagreements(
    document: Mapping[str, Any], axes: Sequence[str], before: Mapping[str, Comparison]
) -> list[str]:
    """List the axes on which the flights stored now do not reproduce the stored error before.

    Each entry gives both errors. before : flight id -> comparison with the baseline, of the
    validation flights, else of all. Empty where validation was within flights, which leaves nothing
    to compare, and where errors are told without what sensors do that were found to be wrong.
    Errors are rms of coefficients, dimensionless.
    """
    if by_parts(document) or wrong_sensors(document):
        return []
    side = "held_out_rms_before" if document["flights"]["held_out"] else "rms_before"
    sentences = []
    for axis in axes:
        stored, now = document["axes"][axis][side], pooled_residual(axis, before)
        if stored and len(now) and abs(rms(now) - stored) > _SAME * stored:
            sentences.append(f"{axis} {number(rms(now))} where {number(stored)} is stored")
    return sentences
