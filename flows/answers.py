"""JSON Schemas of what commands answer with ``--json`` (docs/reference/contract.md, section JSON).

Keys beyond those described may be added; those here stay. Quantities are in SI units.
"""

from collections.abc import Mapping
from typing import Any, Final

from pydantic import BaseModel, ConfigDict, TypeAdapter

from aerodb.errors import UnknownNameError, nearest

#: Axis or name -> number, null where it is not known.
_Numbers = dict[str, float | None]


class Answer(BaseModel):
    """A document; keys beyond these may be there."""

    model_config = ConfigDict(extra="allow")


class Segment(Answer):
    """A manoeuvre or state of a flight, `start` to `end` [s]."""

    start: float
    end: float
    kind: str
    channel: str
    reason: str


class LoggedTopic(Answer):
    """A topic of a log: `rate` [Hz], times [s] on the log's clock."""

    topic: str
    rate: float | None
    samples: int
    start: float | None
    end: float | None
    gaps: int
    longest_gap: float
    fields: list[str]


class Inspection(Answer):
    """A log that was looked at: whether it can be used, what it holds and what follows."""

    source: str
    format: str
    sha256: str
    size: int
    start_utc: str | None
    topics: list[LoggedTopic]
    damage: list[dict[str, Any]]
    mapping: str | None
    channels: list[str]
    missing: list[str]
    zero: list[str]
    empty: list[str]
    prevents: list[str]
    usable: bool
    because: list[str]


class LogsPage(Answer):
    """The page of logs that was written, and what is in its panels."""

    file: str
    size: int
    panels: list[list[str]]
    logs: list[Inspection]


class ListedFlight(Answer):
    """A flight: `duration` [s]; `counts` unless it was retracted or repeats another."""

    flight: str
    name: str | None
    vehicle: str
    start_utc: str | None
    duration: float
    samples: int
    mapping: str
    verdict: str
    reasons: list[str]
    retracted: str | None
    file: str
    counts: bool


class ShownFlight(Answer):
    """A flight with its findings, its results, and the versions based on it."""

    flight: str
    vehicle: str
    duration: float
    verdict: str
    suspicions: list[dict[str, Any]]
    segments: list[Segment]
    delays: list[dict[str, Any]]
    repeats: list[dict[str, Any]]
    consistency: dict[str, Any] | None
    log: dict[str, Any] | None
    results: list[dict[str, Any]]
    versions: list[dict[str, Any]]


class AxisErrors(Answer):
    """Errors of an axis on a flight: dimensionless rms."""

    samples: int
    rms_measured: float | None
    rms_residual: float | None
    noise_floor: float | None
    variation: float | None
    mean_residual: float | None
    of_flown: float | None


class FlightBeside(Answer):
    """A flight beside a version, by axis; `key` is null where they cannot be compared."""

    flight: str
    version: str
    label: str
    key: str | None
    axes: dict[str, AxisErrors] = {}


class ListedVehicle(Answer):
    """A vehicle."""

    vehicle: str
    sha256: str
    added_utc: str


class ShownVehicle(Answer):
    """A vehicle with the text of its file."""

    vehicle: str
    sha256: str
    text: str
    placeholders: list[str]


class ListedVersion(Answer):
    """A version of a database, without its content."""

    version: str
    label: str
    vehicle: str
    parent: str | None
    content_sha256: str
    created_utc: str
    names: list[str]
    axes: list[str]
    tags: list[Any]
    comments: list[Any]


class ShownVersion(Answer):
    """A version with its report; `stale` says why it should be made once more."""

    version: str
    label: str
    vehicle: str
    parent: str | None
    content_sha256: str
    created_utc: str
    stale: list[str]
    report: dict[str, Any]


class Move(Answer):
    """A move of a name."""

    at_utc: str
    name: str
    to: str
    user: str
    reason: str


class Evaluated(Answer):
    """A version at a point (SI), by axis; standard errors are null where they are not known."""

    version: str
    at: dict[str, float]
    taken_as_zero: list[str]
    taken_as: dict[str, float]
    coefficients: _Numbers
    standard_errors: _Numbers
    places: dict[str, str]
    outside_tables: bool
    outside_of: list[str]
    outside_envelope: list[str]
    extrapolated: _Numbers | None


class Trimmed(Answer):
    """A steady flight of a version (SI)."""

    version: str
    channels: _Numbers
    inputs: _Numbers
    standard_errors: _Numbers | None
    controls: list[str]
    notes: list[str]


class Mode(Answer):
    """A mode of motion: its eigenvalue [1/s] and figures; null is infinite."""

    name: str
    real: float
    imaginary: float
    figures: _Numbers
    standard_errors: _Numbers | None
    participation: _Numbers
    note: str


class LinearModel(Answer):
    """A linear model about a trim, with the standard errors of A and B."""

    states: list[str]
    inputs: list[str]
    outputs: list[str]
    units: dict[str, str]
    A: list[list[float]]
    B: list[list[float]]
    C: list[list[float]]
    D: list[list[float]]
    A_standard_errors: list[list[float | None]]
    B_standard_errors: list[list[float | None]]


class Modes(Trimmed):
    """A steady flight of a version with its modes and linear model."""

    modes: list[Mode]
    linear: LinearModel


class SweptPoint(Answer):
    """A point of a sweep (SI), with `reason` where there is no trim."""

    value: float


class Swept(Answer):
    """Trims of a version along a variable."""

    version: str
    variable: str
    points: list[SweptPoint]


class GateCheck(Answer):
    """A check of the gate: what it measured, and why it failed."""

    label: str
    passed: bool
    reasons: list[str]
    measures: list[dict[str, Any]]


class Gate(Answer):
    """What the gate would say of a version; `acceptable` is null where a reason cannot be
    accepted."""

    vehicle: str
    version: str
    label: str
    released: dict[str, Any] | None
    passed: bool
    checks: list[GateCheck]
    acceptable: list[str] | None
    accepted: list[str]
    notes: list[str]
    derivatives: list[dict[str, Any]]


class Diff(Answer):
    """What differs between two versions."""

    before: str
    after: str
    terms: list[dict[str, Any]]
    tables: dict[str, Any]
    nodes: list[dict[str, Any]]
    edited_tables: list[str]
    unchanged_tables: int
    curve: dict[str, Any] | None


class Impact(Answer):
    """The versions that are based on a flight."""

    flight: str
    versions: list[dict[str, Any]]


class Inputs(Answer):
    """The inputs of a version, and those that flights lack."""

    inputs: list[str]
    flights: int
    lacking: list[Any]
    required: list[Any]
    written: dict[str, Any]
    proposals: dict[str, Any]


class AxisUpdate(Answer):
    """Errors of an axis before and after an update: dimensionless rms."""

    rms_before: float | None
    rms_after: float | None
    held_out_rms_before: float | None
    held_out_rms_after: float | None
    noise_floor: float | None
    outcome: str


class Roles(Answer):
    """The flights of an update, by what they were used for."""

    identified: list[str]
    held_out: list[str]
    excluded: list[dict[str, str]]


class RemarkData(Answer):
    """What was noticed: of what, and with which values, each with its unit."""

    kind: str
    subjects: list[str]
    values: dict[str, list[float | str | None]]
    text: str


class Update(Answer):
    """What `update` and `close-loop` answer; `candidate` is null where nothing was added."""

    vehicle: str
    baseline: str
    candidate: str | None
    flights: Roles
    validation: dict[str, Any]
    axes: dict[str, AxisUpdate]
    increments: list[dict[str, Any]]
    findings: list[dict[str, Any]]
    not_found: list[dict[str, Any]]
    next_flight: list[str]
    remarks: list[str]
    remark_data: list[RemarkData]


class Status(Answer):
    """What waits, runs, and has failed; `todo` is what a person should do."""

    serve: dict[str, Any]
    waiting: list[Any]
    running: list[Any]
    failed: list[Any]
    quarantined: dict[str, Any]
    vehicles: list[dict[str, Any]]
    undelivered: list[Any]
    free_bytes: int
    todo: list[Any]


#: Command -> what it answers.
ANSWERS: Final[Mapping[str, Any]] = {
    "vehicle list": list[ListedVehicle],
    "vehicle show": ShownVehicle,
    "database inputs": Inputs,
    "log inspect": Inspection,
    "log show": LogsPage,
    "flight list": list[ListedFlight],
    "flight show": ShownFlight,
    "flight compare": FlightBeside,
    "version list": list[ListedVersion],
    "version show": ShownVersion,
    "version history": list[Move],
    "version impact": Impact,
    "version diff": Diff,
    "version evaluate": Evaluated,
    "version trim": Trimmed,
    "version modes": Modes,
    "version sweep": Swept,
    "version gate": Gate,
    "update": Update,
    "close-loop": Update,
    "status": Status,
}


def schema_of(command: str) -> dict[str, Any]:
    """Return the JSON Schema (draft 2020-12) of what a command answers; UnknownNameError for a
    command that has none. Quantities are in SI units."""
    if command not in ANSWERS:
        raise UnknownNameError(f"no schema of '{command[:80]}'", "", nearest(command, ANSWERS))
    schema = TypeAdapter(ANSWERS[command]).json_schema()
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": f"aerodb {command} --json",
        **{key: value for key, value in schema.items() if key != "title"},
    }
