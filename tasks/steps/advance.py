"""Decide whether a vehicle's database is due for an update: enough flights are new."""

from dataclasses import dataclass
from typing import Any, Final

from aerodb.errors import InputError
from aerodb.storage.workspace_settings import LoopSettings
from aerodb.tasks.result_versions import RELEASED
from aerodb.tasks.workspace_access import WorkspaceAccess

#: Name of a way to update a database in the settings -> flow that does it.
FLOWS: Final = {"close-loop": "close_loop_flow", "update": "update_flow"}


@dataclass(frozen=True)
class Due:
    """How many of a vehicle's newest flights are `new` since the last run of a flow, and its next
    input.

    flights : ids of the flights on which the flow would run. baseline : id of the released version,
    None if there is none.
    """

    new: int
    after: int
    flights: tuple[str, ...]
    baseline: str | None

    @property
    def is_due(self) -> bool:
        return self.baseline is not None and self.new >= self.after


def due(access: WorkspaceAccess, vehicle: str, loop: LoopSettings, way: str) -> Due:
    """Return whether an update of a vehicle's database is due in this way (a key of `FLOWS`).
    Raises UnknownNameError for an unknown vehicle.

    The cost does not grow with the number of stored flights: only the newest are read, and the
    flights of the flow's last run.
    """
    rows = access.catalogue.newest_flights(vehicle, loop.newest)
    usable = [row.id for row in rows if row.retracted_utc is None and row.verdict != "rejected"]
    repeating = {repeat.flight for repeat in access.catalogue.repeats(usable)}
    last = access.catalogue.last_completed(FLOWS[way], vehicle)
    used = set(last.parameters.get("flights", ())) if last is not None else set()
    new = [id for id in usable if id not in used and id not in repeating]
    return Due(len(new), loop.after, tuple(usable), access.named(vehicle, RELEASED))


def parameters_of(
    access: WorkspaceAccess, vehicle: str, loop: LoopSettings, way: str, state: Due
) -> dict[str, Any]:
    """Return the parameters of the flow, with the text of the model file
    (docs/reference/conventions.md, section "Model file"); InputError if the model file of an update
    cannot be read."""
    given: dict[str, Any] = {
        "vehicle": vehicle,
        "baseline": state.baseline,
        "flights": list(state.flights),
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
