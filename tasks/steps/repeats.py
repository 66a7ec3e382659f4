"""Find stored flights that share samples with a record.

`aerodb.tasks.steps.counting` decides which of them count.
"""

from aerodb.conditioning import FEWEST_MARKS, Shared, shared_samples
from aerodb.flight import Flight
from aerodb.storage.catalogue import RepeatedStretch, RepeatRow
from aerodb.storage.files import read_flight
from aerodb.tasks.workspace_access import WorkspaceAccess


def suspects_of(access: WorkspaceAccess, flight: Flight, marks: frozenset[int]) -> set[str]:
    """Return ids of the vehicle's flights, not retracted, that share enough marks to be
    compared."""
    counts = access.catalogue.flights_with_marks(marks, flight.vehicle)
    suspects = [id for id, count in counts.items() if count >= FEWEST_MARKS and id != flight.id]
    return {
        row.id
        for row in access.catalogue.flights_by_id(suspects).values()
        if row.retracted_utc is None
    }


def compare_with_stored(access: WorkspaceAccess, flight: Flight, other: str) -> RepeatRow | None:
    """Return what a flight shares with a stored one (its id), or None; the later one is the repeat.
    Stretches are in [s], shares dimensionless (`RepeatRow`)."""
    stored = read_flight(access.file_of(access.catalogue.results_of(other, "ingest")[-1].path))
    rows = access.catalogue.flights_by_id([flight.id, other])
    first = flight.id in rows and (rows[flight.id].added_utc, flight.id) < (
        rows[other].added_utc,
        other,
    )
    later, earlier = (stored, flight) if first else (flight, stored)
    shared = shared_samples(later, earlier)
    if not shared:
        return None
    usable = int(later.usable(shared[0].channels).sum())
    share = min(1.0, sum(stretch.samples for stretch in shared) / max(usable, 1))
    return RepeatRow(later.id, earlier.id, share, tuple(_stretch(stretch) for stretch in shared))


def _stretch(shared: Shared) -> RepeatedStretch:
    return RepeatedStretch(
        shared.start_a,
        shared.end_a,
        shared.start_b,
        shared.end_b,
        shared.samples,
        shared.difference,
    )
