"""Rows that catalogue queries return: frozen dataclasses, times as UTC datetimes, JSON decoded. No
SQL here."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any, Literal

from aerodb.recording import Damage
from aerodb.remarks import Remark

LogStatus = Literal["stored", "damaged", "quarantined"]
Verdict = Literal["good", "limited", "rejected", "unchecked"]
Role = Literal["identified", "held_out", "excluded"]
How = Literal["server", "ephemeral", "direct"]
InboxKind = Literal["tried", "failed", "stored", "duplicate", "quarantined"]
NoteKind = Literal["comment", "tag", "untag"]
UserRole = Literal["read", "ingest", "release"]
RunState = Literal["running", "completed", "failed", "crashed", "cancelled"]


@dataclass(frozen=True)
class VehicleRow:
    """A vehicle and one text of its file; `sha256` is of that text."""

    name: str
    text: str
    sha256: str
    added_utc: datetime


@dataclass(frozen=True)
class LogRow:
    """A log file by the sha256 of its bytes; `reason` says why it is in quarantine."""

    sha256: str
    name: str
    size: int
    format: str
    status: LogStatus
    reason: str
    damage: tuple[Damage, ...]
    added_utc: datetime


@dataclass(frozen=True)
class FlightRow:
    """A flight as last processed, with its latest verdict; `duration` and `step` in s. Retracted
    when `retracted_utc` is set. `reasons` are the words of the verdict, `remarks` the same as
    data."""

    id: str
    vehicle: str
    name: str | None
    log_sha256: str
    mapping: str
    start_utc: datetime | None
    duration: float
    samples: int
    step: float
    verdict: Verdict
    reasons: tuple[str, ...]
    remarks: tuple[Remark, ...]
    retracted_utc: datetime | None
    retract_reason: str
    retracted_by: str
    added_utc: datetime

    @property
    def label(self) -> str:
        """Name for messages: the flight's name, else the first 12 digits of its id."""
        return self.name or self.id[:12]


@dataclass(frozen=True)
class UserRow:
    """A user, since when with this role and token, and who gave them."""

    name: str
    role: UserRole
    token_sha256: str
    since_utc: datetime
    by: str


@dataclass(frozen=True)
class RepeatedStretch:
    """``start..end`` [s] of a flight are ``original_start..original_end`` of another, each on its
    own clock.

    samples : of the flight. difference : largest rms difference of a channel, relative to its
    motion.
    """

    start: float
    end: float
    original_start: float
    original_end: float
    samples: int
    difference: float


@dataclass(frozen=True)
class RepeatRow:
    """A flight that shares samples with an `original` stored before it (ids); `share` (0..1) of the
    flight's usable samples."""

    flight: str
    original: str
    share: float
    stretches: tuple[RepeatedStretch, ...]


@dataclass(frozen=True)
class InboxEvent:
    """An event of a file of the inbox; `path`, `mtime_ns` [ns] and `size` identify the file."""

    path: str
    vehicle: str
    size: int
    mtime_ns: int
    kind: InboxKind
    sha256: str = ""
    reason: str = ""
    run: str | None = None
    at_utc: datetime | None = None


@dataclass(frozen=True)
class CalibrationRow:
    """A calibration of a vehicle's sensors: its `content` is the document of
    `aerodb.consistency.calibration`."""

    id: str
    vehicle: str
    number: int
    parent: str | None
    content: Mapping[str, Any]
    created_utc: datetime
    run: str | None
    reason: str

    @property
    def label(self) -> str:
        """``c0003``, per vehicle."""
        return f"c{self.number:04d}"


@dataclass(frozen=True)
class ResultRow:
    """A stored result: `path` is relative to the workspace, `inputs` are the hashes that it was
    made from."""

    key: str
    step: str
    kind: str
    flight: str | None
    path: str
    settings: Mapping[str, Any]
    result_version: int
    code_version: str
    inputs: tuple[str, ...]
    created_utc: datetime


@dataclass(frozen=True)
class FlightRole:
    """Role of a flight in a version, with the reason if it was excluded."""

    flight: str
    role: Role
    reason: str = ""


@dataclass(frozen=True)
class VersionRow:
    """A database version without its documents (those are large: ask
    `Catalogue.version_documents`)."""

    id: str
    vehicle: str
    number: int
    parent: str | None
    content_sha256: str
    run: str | None
    created_utc: datetime

    @property
    def label(self) -> str:
        """``v0007``, per vehicle."""
        return f"v{self.number:04d}"


@dataclass(frozen=True)
class VersionDocuments:
    """Documents of a version: the database as JSON text, the settings that produced it, its
    report."""

    content: str
    settings: Mapping[str, Any]
    report: Mapping[str, Any]


@dataclass(frozen=True)
class NoteRow:
    """A comment on a version, or a tag given to it or taken away."""

    version: str
    kind: NoteKind
    text: str
    at_utc: datetime
    user: str


@dataclass(frozen=True)
class NameEvent:
    """One move of a name such as ``released``; `previous` is where it pointed before."""

    sequence: int
    vehicle: str
    name: str
    step: int
    version: str
    previous: str | None
    at_utc: datetime
    user: str
    reason: str


@dataclass(frozen=True)
class RunRow:
    """One run of a flow; `ended_utc` is None while it runs."""

    id: str
    flow: str
    how: How
    started_utc: datetime
    ended_utc: datetime | None
    state: RunState
    parameters: Mapping[str, Any]
    code_version: str
    error: str


@dataclass(frozen=True)
class Impact:
    """A version that depends on a flight, through its own use (`through` is its own id) or that of
    an ancestor."""

    version: VersionRow
    role: Role
    through: str


@dataclass(frozen=True)
class Lineage:
    """Lineage of a version: `line` is the version and its ancestors, newest first; the other fields
    cover the whole line.

    roles : flight -> role. logs : flight -> sha256 of its log. inputs : version -> keys of the
    results it was made from.
    """

    version: VersionRow
    line: tuple[VersionRow, ...]
    roles: Mapping[str, Role]
    logs: Mapping[str, str]
    inputs: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    runs: tuple[RunRow, ...] = ()
