"""Models of the API's answers for its description; the answers are the commands' documents."""

from typing import Any

from aerodb.flows.answers import Answer, ListedVehicle


class Fault(Answer):
    """What is wrong, where, and what to do about it."""

    status: int
    what: str
    where: str
    remedy: str


class Refusal(Answer):
    """The answer to a request that cannot be fulfilled."""

    error: Fault


class Vehicle(ListedVehicle):
    """A vehicle and the versions its names point to."""

    versions: int
    names: dict[str, dict[str, str]]


class Along(Answer):
    """One axis along a line."""

    value: list[float | None]
    standard_error: list[float | None]
    place: list[str]


class Sweep(Answer):
    """A version along one input (SI); `factor` converts `values` to the unit in `label`."""

    version: str
    over: str
    at: dict[str, float]
    taken_as_zero: list[str]
    taken_as: dict[str, float]
    values: list[float]
    axes: dict[str, Along]
    faded_below: float | None
    faded_above: float | None
    label: str
    factor: float


class Line(Answer):
    """One line of a record: `time` [s] and `values` (SI); `factor` converts them to the unit in
    `label`; `version` is that of a prediction."""

    name: str
    source: str
    unit: str
    label: str
    factor: float
    flagged: list[list[float]]
    version: str
    time: list[float]
    values: list[float | None]


class Record(Answer):
    """Lines of a flight; `start` and `end` [s] are the flight's own."""

    flight: str
    start: float
    end: float
    series: list[Line]


class Values(Answer):
    """Values (SI) of a channel; `factor` converts them to the unit in `label`."""

    name: str
    source: str
    unit: str
    label: str
    factor: float
    values: list[float | None]


class Pairs(Answer):
    """One channel over another at common `time` [s]."""

    flight: str
    time: list[float]
    x: Values
    y: Values


class Track(Answer):
    """Path over the ground: `time` [s], metres; no `altitude` if the flight has none."""

    flight: str
    time: list[float]
    north: list[float | None]
    east: list[float | None]
    altitude: list[float | None]


class LogContent(Answer):
    """What a log says of itself; `changed_to` of a parameter is its last value in flight."""

    format: str
    firmware: str
    information: dict[str, str | int | float]
    parameters: list[dict[str, str | int | float | None]]
    messages: list[dict[str, str | float]]


class LoggedTopic(Answer):
    """A topic of a log: first and last time [s] on the log's clock, and its fields with units."""

    topic: str
    samples: int
    start: float | None
    end: float | None
    fields: list[dict[str, str]]


class Finding(Answer):
    """An update or a closed loop in one sentence, and as verdict and proof (`outcome`); `reference`
    names its document, null if none is stored."""

    run: str
    flow: str
    vehicle: str | None
    state: str
    started_utc: str
    reference: str | None
    label: str | None
    headline: str
    outcome: list[str]
    verdicts: dict[str, int]


class Ending(Answer):
    """How a log ended: `kind` is stored, duplicate, quarantined, failed, no_room, left or
    waiting."""

    file: str
    vehicle: str
    kind: str
    flight: str | None
    reason: str
    verdict: str | None
    sha256: str


class LookedAt(Answer):
    """The address of the page of a log that was looked at, and the document of ``aerodb log
    inspect``."""

    page: str
    log: dict[str, Any]


class Drafted(Answer):
    """The address of the form of a drafted mapping, and the questions that it leaves open."""

    page: str
    questions: list[str]


class Session(Answer):
    """The token that changes of this session carry."""

    csrf: str


#: Errors that every endpoint may return.
REFUSALS: dict[int | str, dict[str, Any]] = {
    404: {"model": Refusal, "description": "Unknown name"},
    422: {"model": Refusal, "description": "Refused, with the reason"},
    503: {
        "model": Refusal,
        "description": "The catalogue or the store is temporarily unavailable",
    },
}
CONFLICTS: dict[int | str, dict[str, Any]] = {
    403: {"model": Refusal, "description": "The token does not belong to this session"},
    409: {
        "model": Refusal,
        "description": "The gate refused, or the name was moved in the meantime",
    },
}


def answers(model: Any) -> dict[int | str, dict[str, Any]]:
    """Return the description of an address whose document is a `model`."""
    return {200: {"model": model}}
