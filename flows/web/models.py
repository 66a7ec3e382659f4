"""What the API's description says of its answers. The answers themselves are the documents of the
commands, unchanged."""

from typing import Any

from pydantic import BaseModel, ConfigDict


class _Document(BaseModel):
    """A document; what it has beyond these fields stays."""

    model_config = ConfigDict(extra="allow")


class Fault(_Document):
    """What is wrong, where, and what to do about it."""

    status: int
    what: str
    where: str
    remedy: str


class Refusal(_Document):
    """The answer to what cannot be done."""

    error: Fault


class Flight(_Document):
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


class Version(_Document):
    """A database version without its content."""

    version: str
    label: str
    vehicle: str
    parent: str | None
    content_sha256: str
    created_utc: str


class Vehicle(_Document):
    """A vehicle and the versions at which its names point."""

    vehicle: str
    sha256: str
    added_utc: str
    versions: int
    names: dict[str, dict[str, str]]


class Evaluation(_Document):
    """A version at a point (SI): coefficients, standard errors (null where not known) and places,
    by axis."""

    version: str
    at: dict[str, float]
    taken_as_zero: list[str]
    coefficients: dict[str, float | None]
    standard_errors: dict[str, float | None]
    places: dict[str, str]
    outside_tables: bool
    outside_of: list[str]


class Along(_Document):
    """One axis along a line."""

    value: list[float | None]
    standard_error: list[float | None]
    place: list[str]


class Sweep(_Document):
    """A version along one input (SI); `factor` turns `values` into what `label` says."""

    version: str
    over: str
    at: dict[str, float]
    taken_as_zero: list[str]
    values: list[float]
    axes: dict[str, Along]
    label: str
    factor: float


class Line(_Document):
    """One line of a record: `time` [s] and `values` (SI); `factor` turns these into what `label`
    says."""

    name: str
    source: str
    unit: str
    label: str
    factor: float
    flagged: list[list[float]]
    time: list[float]
    values: list[float | None]


class Record(_Document):
    """Lines of a flight; `start` and `end` [s] are the flight's own."""

    flight: str
    start: float
    end: float
    series: list[Line]


class Finding(_Document):
    """An update or a closed loop in one sentence; `reference` names its document, null where
    nothing was stored."""

    run: str
    flow: str
    vehicle: str | None
    state: str
    started_utc: str
    reference: str | None
    label: str | None
    headline: str
    verdicts: dict[str, int]


class Move(_Document):
    """A move of a name."""

    at_utc: str
    name: str
    to: str
    user: str
    reason: str


class Session(_Document):
    """The token that a change of this session carries."""

    csrf: str


#: What every address may answer beside its own document.
REFUSALS: dict[int | str, dict[str, Any]] = {
    404: {"model": Refusal, "description": "Nothing answers to a name"},
    422: {"model": Refusal, "description": "Refused, with the reason"},
    503: {
        "model": Refusal,
        "description": "The catalogue or the store is out of reach for a moment",
    },
}
CONFLICTS: dict[int | str, dict[str, Any]] = {
    403: {"model": Refusal, "description": "Not of this session"},
    409: {"model": Refusal, "description": "The gate refused, or the name was moved meanwhile"},
}


def answers(model: Any) -> dict[int | str, dict[str, Any]]:
    """The description of an address whose document is a `model`."""
    return {200: {"model": model}}
