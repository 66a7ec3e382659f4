"""One log into the store: read, map, keep. What cannot be used goes to quarantine with its reason; nothing else changes."""

import hashlib
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from aerodb.errors import InputError
from aerodb.flight import Flight
from aerodb.identity import result_key
from aerodb.layout import Mapping
from aerodb.mapping import choose_mapping, map_recording
from aerodb.recording import Damage, Recording
from storage.encoding import FLIGHT_NAME, checked
from storage.flights import read_flight, read_recording, write_flight, write_recording
from storage.mappings import builtin_mappings, load_mapping
from storage.readers import read_log
from storage.rows import FlightRow
from tasks.open import Stores, stores
from tasks.provenance import code_version
from tasks.settings import RESULT_VERSION


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
    """Reads one log and stores its topics and its flight.

    Returns a document: log, sha256, status (``stored``, ``damaged``, ``duplicate``, ``refused``), flight (full id or
    None), what, where, remedy (of a refusal), damage.
    """
    opened, path = stores(workspace), Path(log)
    outcome: dict[str, Any] = {"log": log, "sha256": "", "status": "refused", "flight": None, "damage": []}
    sha256 = ""
    try:
        chosen = load_mapping(mapping) if mapping else None
        with path.open("rb") as file:
            sha256 = outcome["sha256"] = hashlib.file_digest(file, "sha256").hexdigest()
        known = _known(opened, sha256, vehicle, chosen)
        if known is not None:
            return outcome | {"status": "duplicate", "flight": known}
        refused = _inadmissible(opened, sha256, vehicle, name)
        if refused is not None:
            return outcome | _refusal(refused, log)
        recording = read_log(path)
        broken = broken_parts(recording)
        if strict and broken:
            raise InputError(broken[0].what, recording.source, "ingest without --strict to keep what is intact")
        layout = chosen or choose_mapping(recording, builtin_mappings().values())
        flight = _mapped(opened, recording, layout, vehicle, sha256)
    except OSError as error:
        return outcome | _refusal(InputError(error.strerror or "cannot be read", log, "check the path"), log)
    except InputError as error:
        if sha256:
            _quarantine(opened, path, sha256, error)
        return outcome | _refusal(error, log)
    _keep(opened, recording, flight, layout, run, name)
    damage = [asdict(entry) for entry in recording.damage]
    return outcome | {"status": "damaged" if broken else "stored", "flight": sha256, "damage": damage}


def broken_parts(recording: Recording) -> list[Damage]:
    """Damage of the file itself. Dropouts are none: the logger could not keep up, said so, and the gaps are flagged."""
    return [entry for entry in recording.damage if entry.kind != "dropout"]


def _refusal(error: InputError, log: str) -> dict[str, str]:
    return {"what": error.what, "where": error.where or log, "remedy": error.remedy or "aerodb log inspect shows what is in it"}


def _inadmissible(opened: Stores, sha256: str, vehicle: str, name: str | None) -> InputError | None:
    """Why the catalogue would not take these bytes as a flight of this name. The log is not at fault: no quarantine."""
    for row in opened.catalogue.flights(log_sha256=sha256):
        if row.vehicle != vehicle or name not in (None, row.name):
            return InputError(f"already stored for vehicle '{row.vehicle}' as '{row.label}'", "", "use that one")
    if name is None:
        return None
    try:
        checked(name, FLIGHT_NAME, "the name of a flight")
    except InputError as error:
        return error
    taken = [row for row in opened.catalogue.flights(vehicle) if row.name == name]
    return InputError(f"'{name}' is flight {taken[0].id[:12]} already", "", "choose another name") if taken else None


def load_flight(opened: Stores, row: FlightRow, run: str) -> tuple[Flight, str]:
    """A stored flight under the vehicle's present file, and its key; mapped anew from the stored topics when that changed."""
    stated = [result.settings["mapping"] for result in opened.catalogue.results_of(row.id, "ingest")]
    mapping = Mapping.model_validate([entry for entry in stated if entry["name"] == row.mapping][-1])
    key = _key(opened, row.log_sha256, row.vehicle, mapping)
    path = opened.path_of(key)
    if path is not None:
        return read_flight(path), key
    recording = read_recording(opened.workspace.recording_path(row.log_sha256))
    flight = _mapped(opened, recording, mapping, row.vehicle, row.id)
    _keep(opened, recording, flight, mapping, run, row.name)
    return flight, key


def _mapped(opened: Stores, recording: Recording, mapping: Mapping, vehicle: str, sha256: str) -> Flight:
    """The flight of a recording; InputError when no coefficient could ever be computed from it."""
    described, _ = opened.vehicle(vehicle)
    flight = replace(map_recording(recording, mapping, described, flight_id=sha256), log_sha256=recording.sha256)
    motion = ("ax", "ay", "az", "ax_imu", "ay_imu", "az_imu", "p", "q", "r")
    if "qbar" not in flight or not any(name in flight for name in motion):
        what = "no axis can be computed: dynamic pressure with specific force or body rates is needed"
        raise InputError(what, recording.source, f"aerodb log inspect shows what mapping {mapping.name} finds in it")
    return flight


def _key(opened: Stores, log_sha256: str, vehicle: str, mapping: Mapping) -> str:
    inputs = {"log": log_sha256, "vehicle": opened.catalogue.vehicle(vehicle).sha256}
    return result_key(inputs, {"mapping": mapping.model_dump(mode="json")}, "ingest", RESULT_VERSION["ingest"])


def _known(opened: Stores, sha256: str, vehicle: str, chosen: Mapping | None) -> str | None:
    """The flight of these bytes, when they are stored under the vehicle's present file and this mapping."""
    for row in opened.catalogue.flights(vehicle, log_sha256=sha256):
        mappings = [chosen] if chosen else builtin_mappings().values()
        candidates = [mapping for mapping in mappings if mapping.name == row.mapping]
        if any(opened.catalogue.result(_key(opened, sha256, vehicle, mapping)) for mapping in candidates):
            return row.id
    return None


def _quarantine(opened: Stores, path: Path, sha256: str, error: InputError) -> None:
    log = opened.catalogue.log(sha256)
    if log is not None and log.status != "quarantined":
        return
    opened.workspace.quarantine(path, sha256, str(error))
    size = path.stat().st_size if path.exists() else 0
    opened.catalogue.add_log(sha256, name=path.name, size=size, format="", status="quarantined", reason=str(error))


def _keep(opened: Stores, recording: Recording, flight: Flight, mapping: Mapping, run: str, name: str | None) -> None:
    """Files first, then their rows in one transaction: a crash between leaves nothing that anyone can see."""
    key = _key(opened, recording.sha256, flight.vehicle, mapping)
    topics, channels = opened.workspace.recording_path(recording.sha256), opened.workspace.flight_path(key)
    if not topics.exists():
        write_recording(topics, recording, keep=True)  # the same bytes may come under two names at once
    write_flight(channels, flight)
    with opened.catalogue.transaction():
        opened.catalogue.add_log(
            recording.sha256,
            name=Path(recording.source).name,
            size=recording.size,
            format=recording.format,
            status="damaged" if broken_parts(recording) else "stored",
            damage=recording.damage,
        )
        opened.catalogue.add_flight(
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
        opened.catalogue.add_result(
            key,
            step="ingest",
            kind="flight",
            flight=flight.id,
            path=opened.workspace.relative(channels),
            settings={"mapping": mapping.model_dump(mode="json")},
            result_version=RESULT_VERSION["ingest"],
            code_version=code_version(),
            inputs=[recording.sha256, opened.catalogue.vehicle(flight.vehicle).sha256],
            run=run,
        )
