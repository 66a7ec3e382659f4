"""Answers about logs, flights and calibrations. Times are in [s], quantities in SI units."""

from typing import Any

from aerodb.flows.answers.common import Answer


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


class Flight(Answer):
    """A flight: `duration` [s]."""

    flight: str
    name: str | None
    vehicle: str
    start_utc: str | None
    duration: float
    samples: int
    mapping: str
    verdict: str
    reasons: list[str]
    verdict_remarks: list[dict[str, Any]]
    retracted: str | None


class ListedFlight(Flight):
    """A flight with the file of its log; `counts` unless it was retracted or repeats another."""

    file: str
    counts: bool


class RollPhase(Answer):
    """A phase of a roll, `start` to `end` [s], between two speeds over the ground [m/s]:
    `effective` is its deceleration over that of gravity."""

    start: float
    end: float
    fast: float
    slow: float
    effective: float
    standard_error: float


class Roll(Answer):
    """A roll on the ground from `start` [s] on: `time` [s] and `distance` [m] to its standstill, or
    to the end of what is seen of it."""

    start: float
    time: float
    distance: float
    stands: bool
    phases: list[RollPhase]


class ShownFlight(Flight):
    """A flight with its findings, its results, and the versions based on it."""

    suspicions: list[dict[str, Any]]
    segments: list[Segment]
    delays: list[dict[str, Any]]
    rolls: list[Roll]
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
    """A flight beside a version, by axis; `key` is null where they cannot be compared. `before`:
    the same of the released version, or of the parent of that one; null without."""

    flight: str
    version: str
    label: str
    key: str | None
    axes: dict[str, AxisErrors] = {}
    before: dict[str, Any] | None = None


class Channel(Answer):
    """A channel beside the reconstructed motion: mismatch before and after, and its limit (SI)."""

    channel: str
    before: float
    after: float
    limit: float | None
    verdict: str


class SensorError(Answer):
    """An error of a sensor, in SI units; `applied` where it corrects the flight."""

    parameter: str
    value: float
    standard_error: float
    applied: bool


class Consistency(Answer):
    """The verdict on a flight's sensors."""

    flight: str
    key: str
    verdict: str
    reasons: list[str]
    checked: bool
    channels: list[Channel]
    estimates: list[SensorError]
    calibration: str | None
    notes: list[str]


class Coefficients(Answer):
    """The axes of which coefficients were computed, or `reason` where `key` is null."""

    flight: str
    key: str | None


class Comparison(Answer):
    """A flight beside the released version, by axis; `reason` where `key` is null."""

    flight: str
    key: str | None
    axes: dict[str, AxisErrors] = {}


class Ingested(Answer):
    """What became of a log; `flight` is null where it was refused."""

    log: str
    status: str
    flight: str | None


class IngestedFlight(Ingested):
    """A log that became a flight, or was one before."""

    sha256: str
    damage: list[dict[str, Any]]
    suspicions: list[dict[str, Any]]
    repeats: list[dict[str, Any]]
    consistency: Consistency | None
    coefficients: Coefficients | None
    comparison: Comparison | None


class RefusedLog(Ingested):
    """A log in quarantine."""

    what: str
    where: str
    remedy: str


class SensorValue(Answer):
    """An error of a sensor that a calibration corrects, in SI units."""

    value: float
    standard_error: float


class Calibration(Answer):
    """Errors of sensors from several flights, and the flights that take them (`bound`)."""

    calibration: str
    label: str
    flights: list[str]
    parameters: dict[str, SensorValue]


class ListedCalibration(Calibration):
    """A calibration, with the one that it follows."""

    vehicle: str
    parent: str | None
    reason: str
    created_utc: str
    valid_from: str | None
    valid_until: str | None
    bound: list[str]


class Recalibrated(Calibration):
    """A calibration that was made, and what it makes of each flight."""

    groups: list[Any]
    bound: dict[str, str]
    skipped: list[Any]
    consistency: dict[str, Consistency]
    comparison: dict[str, Comparison]
    rests_on_earlier: list[Any]
