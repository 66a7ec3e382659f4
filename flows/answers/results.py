"""Answers of updates, loops and estimates, and of versions flown over flights. SI units."""

from typing import Any, Literal

from aerodb.flows.answers.common import Answer, Theil
from aerodb.flows.answers.versions import Gate


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


class HeldOrFree(Answer):
    """What `update --all-free` says: held-out errors by axis, the terms that were free, the variant
    to keep, and why."""

    axes: dict[str, dict[str, float]]
    terms: dict[str, list[str]]
    keep: Literal["held", "free"]
    because: str


class Update(Answer):
    """What `update` and `close-loop` answer; `candidate` is null where nothing was added, as is
    `gate`, what the gate says of the candidate."""

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
    gate: Gate | None
    held_or_free: HeldOrFree | None = None
    select: list[str] | None = None


class MethodEstimate(Answer):
    """What one method estimated."""

    method: str
    kind: str
    assumes: list[str]
    converged: bool
    notes: list[str]
    estimates: list[dict[str, Any]]


class ComparedParameter(Answer):
    """A parameter by method; `agree` where the methods do."""

    parameter: str
    estimates: dict[str, Any]
    spread: float | None
    furthest: list[Any]
    agree: bool | None


class Estimated(Answer):
    """Estimates by several methods; `believe` is the method to take, null where there is none."""

    flights: list[str]
    methods: list[MethodEstimate]
    parameters: list[ComparedParameter]
    believe: str | None
    preferred: str | None
    reasons: list[str]
    reserved: bool


class Band(Answer):
    """The largest deviation (null: none could be measured) and the limit of a response, in its SI
    unit; `of` names a figure of an oscillation, else it is empty."""

    channel: str
    of: str
    deviation: float | None
    limit: float | None


class StretchCheck(Answer):
    """A check of a stretch: the share of the time inside its bands, and the share required."""

    check: str
    test: str
    share: float
    required: float | None
    passed: bool
    bands: list[Band] | None


class Response(Answer):
    """Rms of a channel in flight and of the error, in its SI unit."""

    channel: str
    rms_flown: float
    rms_error: float
    theil: Theil


class Stretch(Answer):
    """A part of a flight [s]."""

    since: float
    until: float
    kind: str


class FlownStretch(Stretch):
    """A part that was flown until `ended` [s], with the feedback that was closed (gains)."""

    ended: float
    controls: list[str]
    feedback: dict[str, float]
    responses: list[Response]
    checks: list[StretchCheck]
    notes: list[str]


class StretchNotFlown(Stretch):
    """A part that was not flown, and why."""

    reason: str


class Flown(Answer):
    """A version flown over the manoeuvres of a flight."""

    flight: str
    version: str
    key: str
    tolerances: str
    standard: dict[str, Any] | None
    stretches: list[FlownStretch | StretchNotFlown]


class FlownManoeuvre(Answer):
    """A version flown through a described manoeuvre; `responses` are trim, least and greatest,
    `air` least and greatest of gust [m/s] and rotation of the air [rad/s] in body axes."""

    manoeuvre: str
    ended: float
    responses: dict[str, list[float]]
    notes: list[str]
    standstill: dict[str, float] | None = None
    air: dict[str, list[float]] | None = None


class CheckCount(Answer):
    """In how many manoeuvres a check passed, and the share of the time inside."""

    check: str
    manoeuvres: int
    passed: int
    share: float | None
    before: dict[str, Any] | None


class QualificationCase(Answer):
    """A check of a manoeuvre, as a row of the qualification table."""

    flight: str
    name: str
    since: float
    until: float
    kind: str
    check: str
    test: str
    share: float
    required: float | None
    passed: bool
    bands: list[Band] | None
    before: dict[str, Any] | None


class Feedback(Answer):
    """What feedback did: largest correction [rad], checks that pass without it, and the doubling
    time [s] of the fastest motion."""

    correction: float
    checks: int
    passed: int
    doubling_time: float | None


class Validated(Answer):
    """A version and its baseline flown over flights; `independent` where it has not seen them."""

    version: str | None
    baseline: str | None
    independent: bool
    flights: list[str]
    tolerances: str | None
    manoeuvres: int
    stabilised: int
    checks: list[CheckCount]
    responses: list[dict[str, Any]]
    oscillations: list[dict[str, Any]]
    failed: list[dict[str, Any]]
    not_flown: list[dict[str, Any]]
    passed: bool
    standard: dict[str, Any] | None
    cases: list[QualificationCase]
    not_covered: list[dict[str, Any]]
    feedback: Feedback | None


class ResponsePoint(Answer):
    """A point of a frequency response: `omega` [rad/s], `phase` [rad], coherence, its random error,
    and whether a fit used it."""

    omega: float
    magnitude: float
    phase: float
    coherence: float
    random_error: float
    used: bool


class FrequencyResponse(Answer):
    """The response of a channel to an input, and what was fitted to it."""

    input: str
    output: str
    frequencies: list[ResponsePoint]
    estimates: list[dict[str, Any]]
    notes: list[str]


class Limits(Answer):
    """An estimate with its 95 % limits; null where the flight gives none."""

    value: float | None
    low: float | None
    high: float | None


class GustComponent(Answer):
    """Turbulence in one component of the gust: `intensity` and `noise` [m/s], `scale` [m];
    `likelihood_gain` is over the other form."""

    name: str
    intensity: Limits
    scale: Limits
    noise: float
    likelihood_gain: float


class WakeEncountered(Answer):
    """An encounter: least and greatest velocity of the air [m/s], and the vortex pair; `wake` is
    null where none is claimed."""

    flight: str
    since: float
    until: float
    air: dict[str, list[float]]
    wake: dict[str, Any] | None
    notes: list[str]


class WakeVersion(Answer):
    """A wake that was kept: id and label of its version, and the name that it now has."""

    version: str
    label: str
    name: str


class Wakes(Answer):
    """Wakes that flights met, in their order; null for fewer than two wakes. versions : those that
    were kept."""

    encounters: list[WakeEncountered]
    circulation_falls: bool | None
    core_grows: bool | None
    versions: list[WakeVersion]


class Turbulence(Answer):
    """Turbulence that a flight met; `wind` is the mean velocity of the air north, east, down
    [m/s]."""

    form: str
    speed: float
    duration: float
    highest: float
    wind: list[float]
    components: list[GustComponent]
    not_measured: list[str]
    notes: list[str]


class Status(Answer):
    """What waits, runs, and has failed; `todo` is what a person should do. `reader_reach` is what
    the process that reads a log could reach beside it on this system, empty where nothing."""

    serve: dict[str, Any]
    waiting: list[Any]
    running: list[Any]
    failed: list[Any]
    quarantined: dict[str, Any]
    vehicles: list[dict[str, Any]]
    undelivered: list[Any]
    free_bytes: int
    reader_reach: str
    todo: list[Any]


class Derivative(Answer):
    """A derivative of a linear model, or a parameter of a tail."""

    name: str
    value: float
    standard_error: float


class Converted(Answer):
    """Derivatives that were converted, and what they say of the tails."""

    derivatives: list[Derivative]
    tails: list[Derivative]


class OnlineParameter(Answer):
    """A parameter while the log arrives; null where nothing is known yet."""

    axis: str
    parameter: str
    value: float | None
    standard_error: float | None
    standing: str
    reason: str


class EstimatedOnline(Answer):
    """Estimates at `time` [s] of the log, `behind` [s] its newest record; `lost` in bytes."""

    time: float
    samples: int
    behind: float
    lost: int
    method: str
    assumes: list[str]
    notes: list[str]
    parameters: list[OnlineParameter]


class Demonstrated(Update):
    """The closed loop of the demo, beside the errors that were hidden (`truth`)."""

    truth: list[dict[str, Any]]
    agreement: list[str]
    truth_floor: dict[str, dict[str, float]]
    truth_lags: list[dict[str, Any]]
    responses: Validated | None
