"""Errors of single flights beside the stored ones of all: what a report draws must agree with what
was stored, or say so."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

from aerodb.coefficients import Comparison
from aerodb.estimation import rms
from aerodb.report.figures import pooled_residual
from aerodb.report.headlines import by_parts
from aerodb.report.page import number

#: The same flights give the stored errors to this share; anything beyond comes from flights that
#: were processed again.
_SAME: Final = 1e-3


def flight_errors(axis: str, *sides: Mapping[str, Comparison]) -> dict[str, list[float | None]]:
    """Per flight, rms of flight - model on `axis` with each of `sides` (id -> comparison); None
    where a flight has no sample.

    An empty side gives None throughout.
    """
    flights = dict.fromkeys(flight for side in sides for flight in side)
    return {flight: [_error(axis, side.get(flight)) for side in sides] for flight in flights}


def _error(axis: str, comparison: Comparison | None) -> float | None:
    if comparison is None or axis not in comparison.usable or not comparison.usable[axis].any():
        return None
    return rms(comparison.residual(axis)[comparison.usable[axis]])


def disagreements(
    document: Mapping[str, Any], axes: Sequence[str], before: Mapping[str, Comparison]
) -> list[str]:
    """Axes on which flights as they are stored now no longer give the stored error before, with
    both; empty: all agree.

    before : flight id -> comparison with the baseline, of those that validate, else of all. Where
    parts of flights were predicted there is nothing to compare.
    """
    if by_parts(document):
        return []
    side = "held_out_rms_before" if document["flights"]["held_out"] else "rms_before"
    found = []
    for axis in axes:
        stored, now = document["axes"][axis][side], pooled_residual(axis, before)
        if stored and len(now) and abs(rms(now) - stored) > _SAME * stored:
            found.append(f"{axis} {number(rms(now))} where {number(stored)} is stored")
    return found
