"""Answers of commands that keep, check or note something. Quantities are in SI units."""

from typing import Any

from aerodb.flows.answers.common import Answer


class Verified(Answer):
    """What `verify` checked (name -> count; bytes), and each problem with its place."""

    clean: bool
    checked: dict[str, int]
    pending: int
    chain: str
    problems: list[dict[str, Any]]


class BackedUp(Answer):
    """A backup; `sha256` is that of its manifest, which `restore --sha256` asks for."""

    target: str
    files: int
    bytes: int
    copied: int
    problems: list[Any]
    sha256: str


class Restored(Answer):
    """A workspace that was restored; `left_off` are settings of the backup that are not used."""

    workspace: str
    made_utc: str
    files: int
    bytes: int
    problems: list[Any]
    sha256: str
    left_off: list[Any]


class AddedVehicle(Answer):
    """A vehicle that was stored; `placeholders` are still the template's."""

    vehicle: str
    sha256: str
    placeholders: list[str]


class Guess(Answer):
    """A channel of a drafted mapping: value = scale * field, in `unit`."""

    channel: str
    topic: str
    field: str
    unit: str
    scale: float
    reason: str
    confidence: str


class DraftedMapping(Answer):
    """A drafted mapping, and what it leaves open."""

    file: str
    guesses: list[Guess]
    questions: list[str]
    notes: list[str]
    clock: dict[str, Any] | None


class WrittenReport(Answer):
    """A report that was written; `size` in bytes."""

    file: str
    kind: str
    about: str
    size: int


class Rebuild(Answer):
    """A stale version, and the command that makes it once more; empty: close the loop."""

    version: str
    label: str
    command: str | None


class Retracted(Answer):
    """A flight that was withdrawn, what became stale (ids), and how to make it once more."""

    flight: str
    reason: str
    user: str
    stale: list[str]
    names: dict[str, str]
    rebuild: list[Rebuild]


class Noted(Answer):
    """Tags and comments of a version."""

    version: str
    label: str
    vehicle: str
    tags: list[str]
    comments: list[dict[str, Any]]


class ListedUser(Answer):
    """A user of the workspace."""

    user: str
    role: str
    since_utc: str
    by: str


class AddedUser(Answer):
    """A user with a token, which is shown only now."""

    user: str
    role: str
    token: str


class Dismissed(Answer):
    """A failed run that is listed no more."""

    run: str
    flow: str
    error: str
    reason: str
    user: str


class Retried(Answer):
    """What was tried again, and how it ended."""

    what: str
    kind: str
    outcome: str
    reason: str


class DraftedVehicle(Answer):
    """A vehicle file that was written; from a log also what the log states of the aircraft."""

    file: str
    airframe: str | None = None
    surfaces: list[str] = []


class RemovedUser(Answer):
    """A user who was removed."""

    user: str
    removed: bool


class Transfer(Answer):
    """Files that were moved or removed, and the paths of those that could not be."""

    files: int
    bytes: int
    left: list[str]


class InboxFile(Answer):
    """What became of a file of the inbox: its `kind` of ending, the flight and its verdict."""

    file: str
    vehicle: str
    kind: str
    flight: str | None
    reason: str
    verdict: str | None


class NightlyLoop(Answer):
    """Whether an update of a vehicle was due (`new` flights of `after`), and what it made."""

    vehicle: str
    way: str
    due: bool
    new: int
    after: int
    candidate: str | None
    label: str | None
    error: str


class Night(Answer):
    """A nightly run: the inbox, runs that had crashed, updates, messages and the cache."""

    files: list[InboxFile]
    waiting: list[dict[str, Any]]
    crashed: list[dict[str, Any]]
    loops: list[NightlyLoop]
    undelivered: list[dict[str, Any]]
    trimmed: dict[str, Any]
