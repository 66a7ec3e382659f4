"""What conditioning found in a stored flight, kept beside it: likely faults, segments, delays."""

from aerodb.conditioning import (
    Conditioning,
    Suspicion,
    clock_suspicions,
    examine,
    from_document,
    to_document,
)
from aerodb.errors import InputError
from aerodb.flight import Flight
from aerodb.logs import Mapping, with_mapped_clock
from aerodb.recording import Recording
from aerodb.storage.catalogue import FlightRow, StoredFile
from aerodb.storage.files import read_recording, read_results, write_results
from aerodb.tasks.stored_steps import StoredResult
from aerodb.tasks.workspace_access import WorkspaceAccess


def mapping_of(access: WorkspaceAccess, row: FlightRow) -> Mapping:
    """The mapping that a stored flight was made with last."""
    stated = [
        result.settings["mapping"] for result in access.catalogue.results_of(row.id, "ingest")
    ]
    return Mapping.model_validate([entry for entry in stated if entry["name"] == row.mapping][-1])


def clocks_of(recording: Recording, mapping: Mapping) -> tuple[Suspicion, ...]:
    """Topics of a recording whose time stamps do not meet those of the others; none where the
    mapping finds no time."""
    try:
        return clock_suspicions(with_mapped_clock(recording, mapping))
    except InputError:
        return ()


def examined(access: WorkspaceAccess, flight: Flight, mapping: Mapping) -> Conditioning:
    """What there is to say of a conditioned flight and of the recording that it was made from,
    whose topics are stored."""
    # Where the mapping takes time from a field, fields are needed; else the stamps will do.
    recording = read_recording(access.topics_of(flight.log_sha256), fields=mapping.time is not None)
    return examine(flight, clocks_of(recording, mapping))


def load_conditioning(
    access: WorkspaceAccess, row: FlightRow, flight: Flight, flight_key: str, run: str
) -> tuple[Conditioning, str]:
    """The findings on a flight (as `tasks.ingest.load_flight` gives it, with its key), and their
    key; stored when not yet."""
    result = _result(access, row.id, flight_key)
    path = result.stored()
    if path is not None:
        return from_document(read_results(path)[1]), result.key
    found = examined(access, flight, mapping_of(access, row))
    return found, keep_conditioning(
        access, row.id, flight_key, write_conditioning(access, row.id, flight_key, found), run
    )


def write_conditioning(
    access: WorkspaceAccess, flight: str, flight_key: str, found: Conditioning
) -> StoredFile | None:
    """Writes the findings on a flight (its id, and the key of its channels); returns what is in the
    object store of them."""
    return _result(access, flight, flight_key).write(
        lambda path: write_results(path, {}, to_document(found))
    )


def keep_conditioning(
    access: WorkspaceAccess, flight: str, flight_key: str, stored: StoredFile | None, run: str
) -> str:
    """Adds the findings on a flight (its id, and the key of its channels) that were written;
    returns their key."""
    result = _result(access, flight, flight_key)
    result.add(run, stored)
    return result.key


def _result(access: WorkspaceAccess, flight: str, flight_key: str) -> StoredResult:
    return StoredResult(
        access, "conditioning", "conditioning", {"flight": flight_key}, flight=flight
    )
