"""Flights as documents: answers of `aerodb flight list` and `show`, and of the console's API."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

from aerodb.recording import Damage
from aerodb.remarks import NEVER_AIRBORNE
from aerodb.storage.catalogue import FlightRow, ResultRow
from aerodb.tasks.result_versions import NAMES, RELEASED

# A list of flights reads the catalogue alone, and does not wait for what reads files; a log that is
# only inspected does not wait for the catalogue.
if TYPE_CHECKING:
    from aerodb.storage.catalogue import Catalogue
    from aerodb.tasks.workspace_access import WorkspaceAccess


def flight_document(row: FlightRow) -> dict[str, Any]:
    """Return a flight as the catalogue has it (`FlightRow`): duration [s], start in UTC (ISO
    8601)."""
    return {
        "flight": row.id,
        "name": row.name,
        "vehicle": row.vehicle,
        "start_utc": row.start_utc.isoformat() if row.start_utc else None,
        "duration": row.duration,
        "samples": row.samples,
        "mapping": row.mapping,
        "verdict": row.verdict,
        "reasons": list(row.reasons),
        "retracted": row.retract_reason or None,
        "verdict_remarks": [remark.document() for remark in row.remarks],
    }


#: Shortest time on the ground [s] that is searched for a roll: as long as a roll that counts.
_SHORTEST_ROLL: Final = 5.0
#: Step -> what it makes, where its name does not say so.
_STEP_WORDS: Final = {"gram": "normal equations"}


def step_words(step: str) -> str:
    """Return the name of a step for people.

    >>> step_words("gram"), step_words("frequency_response")
    ('normal equations', 'frequency response')
    """
    return _STEP_WORDS.get(step, step.replace("_", " "))


def flights_document(catalogue: "Catalogue", rows: Sequence[FlightRow]) -> list[dict[str, Any]]:
    """Return flights, each with the name of its log's file, and whether it counts: not retracted,
    and not a repeat of another."""
    from aerodb.tasks.steps import repeating

    again = repeating(catalogue, [row.id for row in rows])
    files = catalogue.log_names(row.log_sha256 for row in rows)
    return [
        {
            **flight_document(row),
            "file": files.get(row.log_sha256, "").rpartition("/")[2],
            "counts": not (row.retracted_utc or row.id in again),
        }
        for row in rows
    ]


def flight_details(access: "WorkspaceAccess", row: FlightRow) -> dict[str, Any]:
    """Return a flight with its log, findings, consistency, results, and the versions based on it:
    times [s], figures in SI units. InputError where a stored file is damaged."""
    from aerodb.tasks.steps import repeat_documents

    catalogue = access.catalogue
    log, results = catalogue.log(row.log_sha256), catalogue.results_of(row.id)
    return {
        **flight_document(row),
        **(found := _conditioning(access, row, results)),
        "rolls": _rolls(access, results, found["segments"]),
        "repeats": repeat_documents(catalogue, row.id),
        "consistency": _consistency(access, row, results),
        "log": {
            "name": log.name,
            "status": log.status,
            "damage": [damage_document(d) for d in log.damage],
        }
        if log
        else None,
        "results": [
            {"key": r.key, "step": r.step, "created_utc": r.created_utc.isoformat()}
            for r in results
        ],
        "versions": [
            {"version": use.version.id, "label": use.version.label, "role": use.role}
            for use in catalogue.impact(row.id)
        ],
    }


def damage_document(entry: Damage) -> dict[str, Any]:
    """Return one damaged part of a log: times [s], sizes [bytes] (docs/reference/conventions.md,
    section "Damage")."""
    return {
        "kind": entry.kind,
        "what": entry.what,
        "topic": entry.topic,
        "start": entry.start,
        "end": entry.end,
        "bytes_lost": entry.bytes_lost,
    }


def _conditioning(
    access: "WorkspaceAccess", row: FlightRow, results: Sequence[ResultRow]
) -> dict[str, Any]:
    """Return the conditioning findings of the last time the flight was processed, and a start that
    cannot be."""
    from aerodb.conditioning import suspicion_documents  # slow to import
    from aerodb.storage.files import read_results  # slow to import
    from aerodb.suspicions import start_suspicions

    stored = [result for result in results if result.step == "conditioning"]
    conditioning = read_results(access.file_of(stored[-1].path))[1] if stored else {}
    found = {name: conditioning.get(name, []) for name in ("suspicions", "segments", "delays")}
    start = suspicion_documents(start_suspicions(row.start_utc, row.added_utc))
    return {**found, "suspicions": [*found["suspicions"], *start]}


def _rolls(
    access: "WorkspaceAccess", results: Sequence[ResultRow], segments: Sequence[Mapping[str, Any]]
) -> list[dict[str, Any]]:
    """Return what is seen of the flight's rolls on the ground (`aerodb.identification.SeenRoll`):
    times [s], distances [m], and phases with speeds [m/s] and decelerations over gravity's."""
    stored = [result for result in results if result.step == "ingest"]
    if not stored or not any(
        each["kind"] == "on_ground" and each["end"] - each["start"] >= _SHORTEST_ROLL
        for each in segments
    ):
        return []
    from aerodb.identification import seen_rolls  # slow to import
    from aerodb.storage.files import read_flight

    return [
        {
            "start": roll.start,
            "time": roll.time,
            "distance": roll.distance,
            "stands": roll.stands,
            "phases": [
                {
                    "start": each.start,
                    "end": each.end,
                    "fast": each.fast,
                    "slow": each.slow,
                    "effective": each.effective,
                    "standard_error": each.effective_error,
                }
                for each in roll.phases
            ],
        }
        for roll in seen_rolls(read_flight(access.file_of(stored[-1].path)))
    ]


def roll_command(access: "WorkspaceAccess", row: FlightRow) -> str:
    """Return the closed loop of the rolls of a flight, as a command; empty where it has no roll,
    lacks what the legs of the vehicle's version are by, and where there are none."""
    versions = access.catalogue.versions(row.vehicle)
    if not versions:
        return ""
    from aerodb.identification import ground_rolls, leg_parameters  # slow to import
    from aerodb.simulation import flight_model
    from aerodb.storage.files import read_flight

    released = access.named(row.vehicle, RELEASED)
    friction = access.named(row.vehicle, NAMES["friction"][RELEASED])
    database = access.database(released or versions[-1].id)
    beside = "" if released else f" --baseline {versions[-1].label}"
    if friction and not leg_parameters(database) and not database.line:
        database = access.flown_database(released or versions[-1].id, friction)
        beside += f" --with {NAMES['friction'][RELEASED]}"
    stored = [r for r in access.catalogue.results_of(row.id) if r.step == "ingest"]
    if not stored or database.line or not leg_parameters(database):
        return ""
    flight = read_flight(access.file_of(stored[-1].path))
    if not all(name in flight for name in flight_model(database).inputs):
        return ""
    if not ground_rolls(flight):
        return ""
    flew = NEVER_AIRBORNE not in (remark.kind for remark in row.remarks)
    return f"aerodb close-loop --vehicle {row.vehicle}{beside}{' --on-ground' if flew else ''}"


def _consistency(
    access: "WorkspaceAccess", row: FlightRow, results: Sequence[ResultRow]
) -> Mapping[str, Any] | None:
    """Return the consistency document under the flight's present calibration; None if there is
    none."""
    from aerodb.storage.files import read_results  # slow to import

    bound = access.catalogue.calibration_of(row.id)
    for result in reversed([entry for entry in results if entry.step == "consistency"]):
        document = read_results(access.file_of(result.path), ())[1]
        if document.get("calibration") == (None if bound is None else bound.id):
            return document
    return None
