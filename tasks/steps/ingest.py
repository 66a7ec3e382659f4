"""Ingest of a log: read, map, condition, store; a log that cannot be used is quarantined."""

import hashlib
import os
from dataclasses import asdict, dataclass, replace
from pathlib import Path, PurePath
from typing import Any

from aerodb.conditioning import Conditioning, fingerprint, suspicion_documents, without_wild_points
from aerodb.errors import CalculationError, InputError, StoreError, failing_alone
from aerodb.flight import Flight
from aerodb.logs import Mapping, choose_mapping, usable_flight
from aerodb.recording import Damage, Recording
from aerodb.storage.catalogue import FlightRow, RepeatRow
from aerodb.storage.disk_errors import require_space
from aerodb.storage.files import (
    INDEX,
    is_recording_available,
    open_recording,
    put,
    put_recording,
    read_flight,
    write_flight,
)
from aerodb.storage.inbox import open_log
from aerodb.storage.mappings import builtin_mappings
from aerodb.storage.workspace_settings import SettingsError, load_settings
from aerodb.tasks.steps.admission import inadmissible, usable_mapping
from aerodb.tasks.steps.conditioning import (
    examined,
    keep_conditioning,
    load_conditioning,
    mapping_of,
    suspicions_of,
    write_conditioning,
)
from aerodb.tasks.steps.counting import WHOLE, repeat_documents
from aerodb.tasks.steps.repeats import compare_with_stored, suspects_of
from aerodb.tasks.stored_steps import StoredResult
from aerodb.tasks.workers import Parsed, cached, confined, file_key, parsed_log, return_freed_memory
from aerodb.tasks.workspace_access import WorkspaceAccess, access_workspace


def store_log(
    log: str,
    *,
    workspace: str,
    run: str,
    vehicle: str,
    mapping: str | None = None,
    name: str | None = None,
    strict: bool = False,
) -> dict[str, Any]:
    """Read one log, and store its topics, its flight and the conditioning findings.

    Returns a document: log, sha256, status (``stored``, ``damaged``, ``duplicate``, ``refused``),
    flight (full id or None), what, where, remedy (of a refusal), damage (also of clocks),
    suspicions (likely faults), repeats (stored flights that it shares samples with, and where).
    ``duplicate`` means the same bytes, or another file that repeats stored flights in full: that
    file is stored as well, under its own id, but is never counted with them.

    Raises SettingsError if settings, vehicle or mapping cannot be used, and StoreError if the disk
    or the machine has no room for the log now: neither is the log's fault.
    """
    access, path = access_workspace(workspace), Path(log)
    outcome: dict[str, Any] = {"log": log, "sha256": "", "status": "refused", "flight": None}
    outcome |= {"damage": [], "suspicions": [], "repeats": []}
    sha256 = ""
    limits = load_settings(access.workspace.root).limits
    chosen = usable_mapping(access, vehicle, mapping)
    try:
        with open_log(path, access.workspace.inbox) as file:
            limits.check_size(os.fstat(file.fileno()).st_size, log)
            sha256 = outcome["sha256"] = hashlib.file_digest(file, "sha256").hexdigest()
        known = _known(access, sha256, vehicle, chosen)
        if known is not None:
            outcome |= {"status": "duplicate", "flight": known}
            return outcome | _findings(access, known, run, log)
        refused = inadmissible(access, sha256, vehicle, name)
        if refused is not None:
            return outcome | _refusal(refused, log)
        topics = access.workspace.recording_path(sha256)
        require_space(access.workspace.root, path.stat().st_size, limits.reserve)
        with parsed_log(path, topics, limits) as parsed:
            if parsed.recording.sha256 != sha256:
                what = "the file changed while it was read"
                return outcome | _refusal(
                    InputError(what, log, "ingest it once it is completely written"), log
                )
            return outcome | confined(
                _take_in,
                _Given(parsed.folder, log, sha256, workspace, run, vehicle, chosen, name, strict),
                workspace=workspace,
                flight=sha256,
                what="the conversion into a flight",
                where=log,
            )
    except (StoreError, SettingsError):
        raise
    except OSError as error:
        return outcome | _refusal(
            InputError(error.strerror or "cannot be read", log, "check the path"), log
        )
    except InputError as error:
        if isinstance(error.__cause__, MemoryError):  # the machine's fault, perhaps: tried again
            return outcome | {"sha256": ""} | _refusal(error, log)
        if sha256:
            _quarantine(access, path, sha256, error, vehicle)
        return outcome | _refusal(error, log)


@dataclass(frozen=True)
class _Given:
    """A parsed log whose topics are in the temporary folder `topics`, and what is to become of
    it."""

    topics: Path
    log: str
    sha256: str
    workspace: str
    run: str
    vehicle: str
    mapping: Mapping | None
    name: str | None
    strict: bool


def _take_in(given: _Given) -> dict[str, Any]:
    """Map, condition and store a parsed log, and return what is to be added to the document of
    `store_log`; the work of a confined process.

    Raises InputError for a log that cannot be used.
    """
    access, log = access_workspace(given.workspace), given.log
    recording = replace(open_recording(given.topics), source=log)
    broken = broken_parts(recording)
    if given.strict and broken:
        raise InputError(
            broken[0].what, recording.source, "ingest without --strict to keep what is intact"
        )
    with failing_alone("mapping", log, memory=True):
        layout = given.mapping or choose_mapping(recording, builtin_mappings().values())
        flight = _mapped(access, recording, layout, given.vehicle, given.sha256)
    return_freed_memory()
    # Two files with the same bytes may be ingested at once.
    Parsed(given.topics, recording).keep(access.workspace.recording_path(given.sha256))
    with failing_alone("conditioning", log, memory=True):
        conditioning = examined(access, flight, layout)
        marks = fingerprint(flight)
    return_freed_memory()
    try:
        _keep(access, recording, flight, conditioning, marks, layout, given.run, given.name)
    except CalculationError:
        raise
    except InputError as error:  # of the catalogue, a name taken meanwhile: no fault of the log
        return _refusal(error, log)
    _remembered(_result(access, given.sha256, given.vehicle, layout).path, flight)
    repeats = repeat_documents(access.catalogue, given.sha256)
    whole = sum(entry["share"] for entry in repeats if entry["counts"]) > WHOLE
    return {
        "status": "damaged" if broken else "duplicate" if whole else "stored",
        "flight": given.sha256,
        "damage": [asdict(entry) for entry in flight.damage],
        "suspicions": suspicion_documents(
            suspicions_of(access.catalogue.flight(given.sha256), conditioning)
        ),
        "repeats": repeats,
    }


def _findings(access: WorkspaceAccess, flight: str, run: str, log: str) -> dict[str, Any]:
    """Return the findings on a flight (its id) that is already stored; without suspicions, but with
    what and remedy, if it cannot be read any more: the log stays stored."""
    row = access.catalogue.flight(flight)
    found: dict[str, Any] = {"repeats": repeat_documents(access.catalogue, flight)}
    try:
        suspicions = confined(
            _suspicions,
            flight,
            str(access.workspace.root),
            run,
            workspace=str(access.workspace.root),
            flight=flight,
            what="conditioning",
            where=access.name_of(row),
        )
    except SettingsError:
        raise
    except InputError as error:
        return found | _refusal(error, log)
    return found | {"suspicions": suspicions}


def _suspicions(flight: str, workspace: str, run: str) -> list[dict[str, Any]]:
    """Return the likely faults of a stored flight; the work of a confined process."""
    access = access_workspace(workspace)
    row = access.catalogue.flight(flight)
    conditioning, _ = load_conditioning(access, row, *load_flight(access, row, run), run)
    return suspicion_documents(suspicions_of(row, conditioning))


def broken_parts(recording: Recording) -> list[Damage]:
    """Return damage of the file itself, times [s] and sizes [bytes] (docs/reference/conventions.md,
    section "Damage").

    A dropout is not damage: the logger reported that it could not keep up, and the gap is flagged.
    """
    return [entry for entry in recording.damage if entry.kind != "dropout"]


def _refusal(error: InputError, log: str) -> dict[str, str]:
    return {
        "what": error.what,
        "where": error.where or log,
        "remedy": error.remedy or "aerodb log inspect shows its contents",
    }


def load_flight(access: WorkspaceAccess, row: FlightRow, run: str) -> tuple[Flight, str]:
    """Return a stored flight, channels (n,) in SI units, under the vehicle's present file, and its
    key.

    The flight is mapped again from the stored topics if the vehicle's file changed. Stored values
    are as measured; wild points are bridged here, so that no later step smears them over other
    samples.
    """
    mapping = mapping_of(access, row)
    result = _result(access, row.log_sha256, row.vehicle, mapping)
    key, path = result.key, result.stored()
    if path is not None:
        return cached(file_key(path), lambda: without_wild_points(read_flight(path))), key
    recording = open_recording(access.topics_of(row.log_sha256))
    flight = _mapped(access, recording, mapping, row.vehicle, row.id)
    found, marks = examined(access, flight, mapping), fingerprint(flight)
    _keep(access, recording, flight, found, marks, mapping, run, row.name)
    return _remembered(result.path, flight), key


def flight_as_measured(access: WorkspaceAccess, row: FlightRow, run: str) -> Flight:
    """Return a stored flight as `load_flight`, with wild points (n,) in SI units as measured.

    Raises InputError as `load_flight`.
    """
    flight, _ = load_flight(access, row, run)
    path = _result(access, row.log_sha256, row.vehicle, mapping_of(access, row)).stored()
    return flight if path is None else read_flight(path)


def _remembered(path: Path, flight: Flight) -> Flight:
    """Return a flight that was just written to `path` as later steps use it: they need not read it
    back."""
    return cached(file_key(path), lambda: without_wild_points(flight))


def _mapped(
    access: WorkspaceAccess, recording: Recording, mapping: Mapping, vehicle: str, sha256: str
) -> Flight:
    """Return the conditioned flight of a recording; InputError if no coefficient could be
    computed."""
    return usable_flight(recording, mapping, access.vehicle(vehicle)[0], flight_id=sha256)


def _result(
    access: WorkspaceAccess,
    log_sha256: str,
    vehicle: str,
    mapping: Mapping,
    flight: str | None = None,
) -> StoredResult:
    """Return the stored result for a log's channels under a vehicle and a mapping; flight : its
    id."""
    inputs = {"log": log_sha256, "vehicle": access.catalogue.vehicle(vehicle).sha256}
    settings = {"mapping": mapping.model_dump(mode="json")}
    return StoredResult(access, "ingest", "flight", inputs, settings, flight, folder="flights")


def _known(
    access: WorkspaceAccess, sha256: str, vehicle: str, chosen: Mapping | None
) -> str | None:
    """Return the flight of these bytes if it is stored in full under this vehicle file and
    mapping."""
    if not is_recording_available(access.workspace, access.catalogue, sha256):
        return None
    for row in access.catalogue.flights(vehicle, log_sha256=sha256):
        mappings = [chosen] if chosen else builtin_mappings().values()
        candidates = [mapping for mapping in mappings if mapping.name == row.mapping]
        if any(
            access.catalogue.result(_result(access, sha256, vehicle, mapping).key)
            for mapping in candidates
        ):
            return row.id
    return None


def _index_path(access: WorkspaceAccess, sha256: str) -> Path:
    return access.workspace.recording_path(sha256) / INDEX


def _quarantine(
    access: WorkspaceAccess, path: Path, sha256: str, error: InputError, vehicle: str
) -> None:
    log = access.catalogue.log(sha256)
    if log is not None and log.status != "quarantined":
        return
    # The row first: a file of the inbox that goes into quarantine leaves it, and would else be
    # nowhere if this ended here.
    size = path.stat().st_size if path.exists() else 0
    access.catalogue.add_log(
        sha256, name=path.name, size=size, format="", status="quarantined", reason=str(error)
    )
    named = PurePath(error.where).name == path.name
    what = error.without_place if named else str(error)
    access.workspace.quarantine(path, sha256, str(error), vehicle, what)


def _keep(
    access: WorkspaceAccess,
    recording: Recording,
    flight: Flight,
    conditioning: Conditioning,
    marks: frozenset[int],
    mapping: Mapping,
    run: str,
    name: str | None,
) -> None:
    """Write all files first, then all rows in one transaction: a crash in between leaves no
    trace."""
    result = _result(access, recording.sha256, flight.vehicle, mapping, flight.id)
    key, path = result.key, result.path
    write_flight(path, flight)
    topics = put_recording(access.workspace, access.workspace.recording_path(recording.sha256))
    channels, findings = (
        put(access.workspace, path),
        write_conditioning(access, flight.id, key, conditioning),
    )
    compared: dict[str, RepeatRow | None] = {}
    # Two files of one flight may come at once: a flight enters only when it was compared with all
    # that were there before.
    while True:
        with access.catalogue.transaction():
            suspects = suspects_of(access, flight, marks) - compared.keys()
            if not suspects:
                _add_rows(access, recording, flight, mapping, name)
                access.keep_file(_index_path(access, recording.sha256), topics)
                result.add(run, channels)
                access.catalogue.add_marks(flight.id, marks)
                for repeat in filter(None, compared.values()):
                    access.catalogue.add_repeat(repeat)
                keep_conditioning(access, flight.id, key, findings, run)
                return
        with failing_alone("the comparison with stored flights", recording.source):
            compared |= {
                suspect: compare_with_stored(access, flight, suspect)
                for suspect in sorted(suspects)
            }


def _add_rows(
    access: WorkspaceAccess,
    recording: Recording,
    flight: Flight,
    mapping: Mapping,
    name: str | None,
) -> None:
    """Add the rows of a log and its flight, whose files are written."""
    access.catalogue.add_log(
        recording.sha256,
        name=Path(recording.source).name,
        size=recording.size,
        format=recording.format,
        status="damaged" if broken_parts(recording) else "stored",
        damage=recording.damage,
    )
    access.catalogue.add_flight(
        flight.id,
        vehicle=flight.vehicle,
        name=name,
        log_sha256=recording.sha256,
        mapping=mapping.name,
        start_utc=flight.start_utc,
        duration=float(flight.time[-1] - flight.time[0]),
        samples=len(flight.time),
        step=flight.step,
    )
