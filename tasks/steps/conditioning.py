"""What conditioning found in a stored flight, kept beside it: likely faults, segments, delays."""

from aerodb.conditioning import Conditioning, Suspicion, clock_suspicions, examine, from_document, to_document
from aerodb.errors import InputError
from aerodb.flight import Flight
from aerodb.logs import Mapping, on_mapped_clock
from aerodb.recording import Recording
from aerodb.storage.catalogue import FlightRow, StoredFile
from aerodb.storage.files import put, read_recording, read_results, write_results
from aerodb.support import result_key
from aerodb.tasks.provenance import code_version
from aerodb.tasks.result_versions import RESULT_VERSION
from aerodb.tasks.workspace_access import Stores


def mapping_of(opened: Stores, row: FlightRow) -> Mapping:
    """The mapping that a stored flight was made with last."""
    stated = [result.settings["mapping"] for result in opened.catalogue.results_of(row.id, "ingest")]
    return Mapping.model_validate([entry for entry in stated if entry["name"] == row.mapping][-1])


def clocks_of(recording: Recording, mapping: Mapping) -> tuple[Suspicion, ...]:
    """Topics of a recording whose time stamps do not meet those of the others; none where the mapping finds no time."""
    try:
        return clock_suspicions(on_mapped_clock(recording, mapping))
    except InputError:
        return ()


def examined(opened: Stores, flight: Flight, mapping: Mapping) -> Conditioning:
    """What there is to say of a conditioned flight and of the recording that it was made from, whose topics are stored."""
    # Where the mapping takes time from a field, fields are needed; else the stamps will do.
    recording = read_recording(opened.topics_of(flight.log_sha256), fields=mapping.time is not None)
    return examine(flight, clocks_of(recording, mapping))


def load_conditioning(opened: Stores, row: FlightRow, flight: Flight, flight_key: str, run: str) -> tuple[Conditioning, str]:
    """The findings on a flight (as `aerodb.tasks.steps.ingest.load_flight` gives it, with its key), and their key; stored when not yet."""
    path = opened.path_of(_key(flight_key))
    if path is not None:
        return from_document(read_results(path)[1]), _key(flight_key)
    found = examined(opened, flight, mapping_of(opened, row))
    return found, keep_conditioning(opened, row.id, flight_key, write_conditioning(opened, flight_key, found), run)


def write_conditioning(opened: Stores, flight_key: str, found: Conditioning) -> StoredFile | None:
    """Writes the findings on a flight (the key of its channels); returns what is in the object store of them."""
    path = opened.workspace.result_path(_key(flight_key))
    write_results(path, {}, to_document(found))
    return put(opened.workspace, path)


def keep_conditioning(opened: Stores, flight: str, flight_key: str, stored: StoredFile | None, run: str) -> str:
    """Adds the findings on a flight (its id, and the key of its channels) that were written; returns their key."""
    key = _key(flight_key)
    opened.keep_result(
        key,
        opened.workspace.result_path(key),
        stored,
        step="conditioning",
        kind="conditioning",
        flight=flight,
        result_version=RESULT_VERSION["conditioning"],
        code_version=code_version(),
        inputs=[flight_key],
        run=run,
    )
    return key


def _key(flight_key: str) -> str:
    return result_key({"flight": flight_key}, {}, "conditioning", RESULT_VERSION["conditioning"])
