"""Flights that repeat another: a record that shares samples with a stored flight is not counted
twice.

Reads the catalogue only, so that a query need not import the science.
"""

from collections.abc import Iterable, Mapping
from typing import Any

from aerodb.storage.catalogue import Catalogue, FlightRow, RepeatRow

#: Share of its samples from which a record repeats others in full: the low pass costs the margins
#: of each stretch.
WHOLE = 0.95


def counted_out(catalogue: Catalogue, vehicle: str) -> dict[str, tuple[RepeatRow, ...]]:
    """Return id -> what it repeats (`RepeatRow`, stretches [s]), for flights of a vehicle that do
    not count for that reason.

    A retracted or rejected flight does not count, so a flight that repeats it may. Of a chain of
    repeats, the first counts, the second does not, and the third does unless it also repeats the
    first.
    """
    return _decided(catalogue, catalogue.repeats(vehicle=vehicle))


def repeating(catalogue: Catalogue, flights: Iterable[str]) -> set[str]:
    """Return those of `flights` (ids) that do not count because they repeat another.

    Only the flights that they repeat are read, and what those repeat.
    """
    wanted = set(flights)
    repeats_of_all: set[RepeatRow] = set()
    visited, further = set(wanted), wanted
    while further:
        repeats_of_all |= set(repeats := catalogue.repeats(further))
        further = {row.original for row in repeats} - visited
        visited |= further
    return wanted & _decided(catalogue, tuple(repeats_of_all)).keys()


def _decided(
    catalogue: Catalogue, repeats: tuple[RepeatRow, ...]
) -> dict[str, tuple[RepeatRow, ...]]:
    """Return `counted_out` among `repeats`, which must contain whatever they repeat in turn."""
    rows = catalogue.flights_by_id({id for row in repeats for id in (row.flight, row.original)})
    counting: set[str] = set()
    out: dict[str, tuple[RepeatRow, ...]] = {}
    for row in sorted(rows.values(), key=lambda row: (row.added_utc, row.id)):
        if not _could_count(row):
            continue
        deciding = tuple(
            repeat for repeat in repeats if repeat.flight == row.id and repeat.original in counting
        )
        if deciding:
            out[row.id] = deciding
        else:
            counting.add(row.id)
    return out


def _could_count(row: FlightRow) -> bool:
    return row.retracted_utc is None and row.verdict != "rejected"


def sentence(repeats: tuple[RepeatRow, ...], labels: Mapping[str, str]) -> str:
    """Describe what a flight repeats, stretches in [s] (`RepeatRow`): ``repeats flight a.ulg
    (1a2b3c4d5e6f) from 3 to 20 s``.

    labels : what people call flights (ids), where that is not the start of their id.
    """
    parts = []
    for row in repeats:
        places = " and ".join(
            f"from {stretch.start:.6g} to {stretch.end:.6g} s" for stretch in row.stretches
        )
        id = row.original[:12]
        label = labels.get(row.original, id)
        parts.append(f"flight {id if label == id else f'{label} ({id})'} {places}")
    return f"repeats {', '.join(parts)}"


def repeat_documents(catalogue: Catalogue, flight: str) -> list[dict[str, Any]]:
    """Return what a flight (its id) repeats of flights that are not retracted: shares
    dimensionless, stretches [s].

    ``counts`` says of each whether it counts, so that this flight does not.
    """
    rows = sorted(catalogue.repeats([flight]), key=lambda row: row.stretches[0].start)
    if not rows:
        return []
    beside = {
        row.original
        for row in counted_out(catalogue, catalogue.flight(flight).vehicle).get(flight, ())
    }
    originals = catalogue.flights_by_id(row.original for row in rows)
    return [
        {
            "flight": row.original,
            "label": originals[row.original].label,
            "counts": row.original in beside,
            "share": row.share,
            "stretches": [
                {
                    "start": stretch.start,
                    "end": stretch.end,
                    "original_start": stretch.original_start,
                    "original_end": stretch.original_end,
                    "difference": stretch.difference,
                }
                for stretch in row.stretches
            ],
        }
        for row in rows
        if originals[row.original].retracted_utc is None
    ]
