"""Conditioning findings of a stored flight: likely faults, segments and delays."""

from aerodb.conditioning import Conditioning, Suspicion, from_document, to_document
from aerodb.flight import Flight
from aerodb.logs import Mapping, mapped_clock_suspicions
from aerodb.storage.catalogue import FlightRow, StoredFile
from aerodb.storage.files import read_recording, read_results, write_results
from aerodb.suspicions import examine, start_suspicions
from aerodb.tasks.stored_steps import StoredResult
from aerodb.tasks.workspace_access import WorkspaceAccess


def mapping_of(access: WorkspaceAccess, row: FlightRow) -> Mapping:
    """Return the mapping that a stored flight was last made with.

    Reads the settings of `ingest`. Raises IndexError where none has this mapping.
    """
    stated = [
        result.settings["mapping"] for result in access.catalogue.results_of(row.id, "ingest")
    ]
    return Mapping.model_validate([entry for entry in stated if entry["name"] == row.mapping][-1])


def examined(access: WorkspaceAccess, flight: Flight, mapping: Mapping) -> Conditioning:
    """Return the findings on a conditioned flight and on its recording, whose topics are stored.

    Reads the stored topics (`read_recording`). Raises InputError where they are damaged,
    UnknownNameError for an unknown vehicle.
    """
    # Where the mapping takes time from a field, fields are needed; else the stamps will do.
    recording = read_recording(access.topics_of(flight.log_sha256), fields=mapping.time is not None)
    vehicle, _ = access.vehicle(flight.vehicle)
    return examine(flight, mapped_clock_suspicions(recording, mapping), vehicle)


def load_conditioning(
    access: WorkspaceAccess, row: FlightRow, flight: Flight, flight_key: str, run: str
) -> tuple[Conditioning, str]:
    """Return the findings on a flight and their key; compute and store them if needed.

    flight, flight_key : as `aerodb.tasks.steps.ingest.load_flight` returns them.

    Reads the stored topics where nothing is stored: `examined`, whose errors it raises. Times [s].
    """
    result = _result(access, row.id, flight_key)
    path = result.stored()
    if path is not None:
        return from_document(read_results(path)[1]), result.key
    conditioning = examined(access, flight, mapping_of(access, row))
    return conditioning, keep_conditioning(
        access,
        row.id,
        flight_key,
        write_conditioning(access, row.id, flight_key, conditioning),
        run,
    )


def suspicions_of(row: FlightRow, conditioning: Conditioning) -> tuple[Suspicion, ...]:
    """Return the likely faults of a stored flight: those found in its log, and that of a start
    later than the moment (UTC) at which it was taken in (`start_suspicions`); figures in SI
    units."""
    return (*conditioning.suspicions, *start_suspicions(row.start_utc, row.added_utc))


def stored_suspicions(access: WorkspaceAccess, row: FlightRow) -> tuple[Suspicion, ...]:
    """Return the likely faults of a flight as they were found when it was last processed; none
    where they are not stored (`from_document`); figures in SI units."""
    stored = access.catalogue.results_of(row.id, "conditioning")
    path = access.path_of(stored[-1].key) if stored else None
    return () if path is None else from_document(read_results(path, ())[1]).suspicions


def write_conditioning(
    access: WorkspaceAccess, flight: str, flight_key: str, conditioning: Conditioning
) -> StoredFile | None:
    """Write the findings on a flight (its id and key), and return their object-store entry, if any.
    JSON with times [s], see docs/reference/conventions.md, section "Stored files"; StoreError on a
    full disk."""
    return _result(access, flight, flight_key).write(
        lambda path: write_results(path, {}, to_document(conditioning))
    )


def keep_conditioning(
    access: WorkspaceAccess, flight: str, flight_key: str, stored: StoredFile | None, run: str
) -> str:
    """Add the row of findings that were written (flight by id and key), and return their key
    (sha256). Raises UnknownNameError for an unknown flight or run; see `Catalogue.add_result`."""
    result = _result(access, flight, flight_key)
    result.add(run, stored)
    return result.key


def _result(access: WorkspaceAccess, flight: str, flight_key: str) -> StoredResult:
    return StoredResult(
        access, "conditioning", "conditioning", {"flight": flight_key}, flight=flight
    )
