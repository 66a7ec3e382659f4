"""Answers about vehicles and versions of databases. Quantities are in SI units."""

from typing import Any

from aerodb.flows.answers.common import Answer, Numbers


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


class Version(Answer):
    """A version of a database, without its content."""

    version: str
    label: str
    vehicle: str
    parent: str | None
    content_sha256: str
    created_utc: str


class ListedVersion(Version):
    """A version of a database, without its content."""

    names: list[str]
    axes: list[str]
    tags: list[Any]
    comments: list[Any]


class ShownVersion(Version):
    """A version with its report; `stale` says why it should be made once more."""

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
    coefficients: Numbers
    standard_errors: Numbers
    places: dict[str, str]
    outside_tables: bool
    outside_of: list[str]
    outside_envelope: list[str]
    extrapolated: Numbers | None


class Trimmed(Answer):
    """A steady flight of a version (SI)."""

    version: str
    channels: Numbers
    inputs: Numbers
    standard_errors: Numbers | None
    controls: list[str]
    notes: list[str]


class Mode(Answer):
    """A mode of motion: its eigenvalue [1/s] and figures; null is infinite."""

    name: str
    real: float
    imaginary: float
    figures: Numbers
    standard_errors: Numbers | None
    participation: Numbers
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
    """A check of the gate: what it measured, and why it failed; `not_judged`: why it does not
    apply."""

    label: str
    passed: bool
    reasons: list[str]
    measures: list[dict[str, Any]]
    not_judged: str = ""


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


class Imported(Inputs):
    """A database that was imported: whether it is released, what its file checked (`file_checks`),
    and what it lacks."""

    version: str
    label: str
    database: str
    released: bool
    replaced: str | None
    file_checks: dict[str, Any] | None
    lacks: list[str]
    unusual: list[Any]
    without_values: list[Any]
    warnings: list[Any]


class Moved(Answer):
    """A name that was moved, or already pointed there (`moved` is false)."""

    vehicle: str
    name: str
    version: str
    label: str
    previous: str | None
    moved: bool


class RolledBack(Moved):
    """A name that went back; `stale` says why what it points to should be made once more."""

    stale: list[str]


class Exported(Answer):
    """A file that was written and read back."""

    version: str
    label: str
    format: str
    file: str
    bytes: int
    check_cases: int
    checked: str


class LineageRun(Answer):
    """A run that made a version."""

    run: str
    flow: str
    how: str
    state: str
    code_version: str


class Lineage(Answer):
    """Where a version comes from: its `line` of versions, flights, files and runs."""

    version: str
    line: list[Version]
    stale: list[str]
    flights: list[dict[str, Any]]
    inputs: dict[str, list[str]]
    runs: list[LineageRun]


class ExpandedPoint(Answer):
    """A value of the variable (SI), and what it violates."""

    value: float
    violations: list[Any]


class Expanded(Answer):
    """The farthest point at which the margins hold (SI), and what stops it."""

    version: str
    variable: str
    value: float
    reached: bool
    stopped_by: list[str]
    points: list[ExpandedPoint]
    known: list[dict[str, Any]]


class ExpectedError(Answer):
    """Standard error of a parameter before a manoeuvre (null: unknown) and after it."""

    parameter: str
    standard_error_before: float | None
    standard_error_after: float


class Designed(Answer):
    """A manoeuvre that was designed: its file as text, what it tells, and what it reaches."""

    version: str
    manoeuvre: str
    parameters: list[ExpectedError]
    separated: dict[str, Any] | None
    reached: dict[str, list[float]]
    tried: int
    within: int
    feedback: dict[str, float]
    alpha: float
    notes: list[str]


class BackedOutParameter(Answer):
    """A parameter of the database from given derivatives; `at_bound` where it could not go on."""

    name: str
    start: float
    value: float
    standard_error: float
    unit: str
    at_bound: bool


class MetDerivative(Answer):
    """A derivative as given, and that of the version before and after."""

    name: str
    given: float
    standard_error: float
    before: float
    after: float


class BackedOut(Answer):
    """Parameters with which a version meets given derivatives."""

    version: str
    parameters: list[BackedOutParameter]
    covariance: list[list[float]]
    derivatives: list[MetDerivative]
    converged: bool


class TableError(Answer):
    """Error of an axis between breakpoints, the span of the axis, and where it is largest."""

    largest: float
    rms: float
    span: float
    at: dict[str, float]


class Tabulated(Answer):
    """A version of tables: breakpoints by input, inputs held, and the error by axis."""

    version: str
    label: str
    parent: str
    over: dict[str, list[float]]
    held: dict[str, float]
    rates: list[str]
    kept: list[str]
    tables: int
    nodes: int
    points: int
    errors: dict[str, TableError]
