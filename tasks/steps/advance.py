"""When a vehicle's database is taken further by itself: enough flights are new since the last
time."""

from dataclasses import dataclass
from typing import Any, Final

from aerodb.errors import InputError
from aerodb.storage.workspace_settings import Loop
from aerodb.tasks.result_versions import RELEASED
from aerodb.tasks.workspace_access import WorkspaceAccess

#: What the settings call a way to take a database further, and the flow that does it.
FLOWS: Final = {"close-loop": "close_loop_flow", "update": "update_flow"}


@dataclass(frozen=True)
class Due:
    """How many of the newest flights of a vehicle are `new` since a flow ran last, and on which
    `flights` (ids) it would run.

    baseline : id of the released version, None while there is none.
    """

    new: int
    after: int
    flights: tuple[str, ...]
    baseline: str | None

    @property
    def is_due(self) -> bool:
        return self.baseline is not None and self.new >= self.after


def due(access: WorkspaceAccess, vehicle: str, loop: Loop, way: str) -> Due:
    """Whether a vehicle's database is to be taken further in this way. What it costs does not grow
    with the flights stored: the newest are looked at, and which of them the last run of the flow
    was given."""
    rows = access.catalogue.newest_flights(vehicle, loop.newest)
    usable = [row.id for row in rows if row.retracted_utc is None and row.verdict != "rejected"]
    repeating = {repeat.flight for repeat in access.catalogue.repeats(usable)}
    last = access.catalogue.last_completed(FLOWS[way], vehicle)
    used = set(last.parameters.get("flights", ())) if last is not None else set()
    new = [id for id in usable if id not in used and id not in repeating]
    return Due(len(new), loop.after, tuple(usable), access.named(vehicle, RELEASED))


def parameters_of(
    access: WorkspaceAccess, vehicle: str, loop: Loop, way: str, asked: Due
) -> dict[str, Any]:
    """The parameters of the flow; InputError where the model file that an update needs cannot be
    read."""
    given: dict[str, Any] = {
        "vehicle": vehicle,
        "baseline": asked.baseline,
        "flights": list(asked.flights),
    }
    if way == "close-loop":
        return given
    try:
        path = access.workspace.resolve(loop.model)
        return {**given, "model": path.read_text(encoding="utf-8")}
    except (OSError, ValueError) as error:
        raise InputError(
            f"cannot be read: {error}", loop.model, "put the model file into the workspace"
        ) from error
