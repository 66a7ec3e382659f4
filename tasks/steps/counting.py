"""Records that share samples with a stored flight are that flight once more: kept, said, and never
counted twice.

Looks at the catalogue only: a query must not wait for the science.
"""

from collections.abc import Iterable, Mapping
from typing import Any

from aerodb.storage.catalogue import Catalogue, FlightRow, RepeatRow

#: Share of its samples from which a record repeats others in full: the low pass costs the margins
#: of each stretch.
WHOLE = 0.95


def counted_out(catalogue: Catalogue, vehicle: str) -> dict[str, tuple[RepeatRow, ...]]:
    """Id -> what it repeats, for flights of a vehicle that do not count because flights stored
    before them do.

    A flight that is retracted or rejected does not count, so that what repeats it may. Of a chain,
    the first counts, the second does not, and the third does again unless it repeats the first as
    well.
    """
    return _decided(catalogue, catalogue.repeats(vehicle=vehicle))


def repeating(catalogue: Catalogue, flights: Iterable[str]) -> set[str]:
    """Those of `flights` (ids) that do not count for that reason. Only what they repeat is looked
    at, and what that repeats."""
    wanted = set(flights)
    found: set[RepeatRow] = set()
    seen, further = set(wanted), wanted
    while further:
        found |= set(repeats := catalogue.repeats(further))
        further = {row.original for row in repeats} - seen
        seen |= further
    return wanted & _decided(catalogue, tuple(found)).keys()


def _decided(
    catalogue: Catalogue, repeats: tuple[RepeatRow, ...]
) -> dict[str, tuple[RepeatRow, ...]]:
    """`counted_out` among `repeats`, which must hold whatever is behind them."""
    rows = catalogue.flights_by_id({id for row in repeats for id in (row.flight, row.original)})
    counting: set[str] = set()
    out: dict[str, tuple[RepeatRow, ...]] = {}
    for row in sorted(rows.values(), key=lambda row: (row.added_utc, row.id)):
        if not _could_count(row):
            continue
        found = tuple(
            repeat for repeat in repeats if repeat.flight == row.id and repeat.original in counting
        )
        if found:
            out[row.id] = found
        else:
            counting.add(row.id)
    return out


def _could_count(row: FlightRow) -> bool:
    return row.retracted_utc is None and row.verdict != "rejected"


def sentence(repeats: tuple[RepeatRow, ...], labels: Mapping[str, str]) -> str:
    """What a flight repeats, in words: ``repeats flight a from 3 to 20 s, flight b from 30 to 60
    s``."""
    parts = []
    for row in repeats:
        places = " and ".join(
            f"from {stretch.start:.6g} to {stretch.end:.6g} s" for stretch in row.stretches
        )
        parts.append(f"flight {labels.get(row.original, row.original[:12])} {places}")
    return f"repeats {', '.join(parts)}"


def repeat_documents(catalogue: Catalogue, flight: str) -> list[dict[str, Any]]:
    """What a flight (its id) repeats of flights that are not retracted, as the per-flight run
    answers it.

    ``counts`` says of each whether it does, so that this flight does not.
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
