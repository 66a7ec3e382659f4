"""What a new version changes for the pilot: trim and modes, where its flights have been."""

from collections.abc import Sequence
from typing import Any, Final

from aerodb.errors import AeroError
from aerodb.report import display_unit
from aerodb.simulation import Condition
from aerodb.storage.catalogue import VersionRow
from aerodb.tasks.view.channels import envelopes_of
from aerodb.tasks.view.trimming import StatedCondition, glides, modes_document
from aerodb.tasks.workspace_access import WorkspaceAccess
from aerodb.units import shown_units

#: A condition is stated to so much altitude [m] and airspeed [m/s]: a round number is remembered.
_ALTITUDE: Final = 100.0
_AIRSPEED: Final = 1.0


def trim_changes(access: WorkspaceAccess, before: VersionRow, after: VersionRow) -> list[str]:
    """Return in words (angles in degrees) what changes from one version to another in the trim amid
    the flights of the later one, and which of its modes changes most.

    Empty where either cannot be trimmed there, or no flight has airspeed and altitude.
    """
    flights = [use.flight for use in access.catalogue.version_flights(after.id)]
    condition = _amid(access, flights)
    if condition is None:
        return []
    climb = None if glides(access.catalogue, after) else 0.0
    stated = StatedCondition(Condition(V=condition[0], altitude=condition[1], climb=climb))
    try:
        old, new = (modes_document(access.catalogue, row, stated) for row in (before, after))
    except AeroError:
        return []
    units = shown_units()
    where = f"at {units.shown(condition[0], 'm/s')} and {units.shown(condition[1], 'm', 4)}"
    names = ["alpha", *(name for name in new["controls"] if name in old["inputs"])]
    sides = [{**side["channels"], **side["inputs"]} for side in (old, new)]
    moved = [_moved(name, *(side[name] for side in sides)) for name in names]
    return [f"{where}: {', '.join(filter(None, moved))}", _modes(old["modes"], new["modes"])]


def _amid(access: WorkspaceAccess, flights: Sequence[str]) -> tuple[float, float] | None:
    """Airspeed [m/s] and altitude [m] amid the first of the flights that has both."""
    rows = access.catalogue.flights_by_id(flights)
    for flight in flights:
        reach = envelopes_of(access, [rows[flight]])[flight]
        if "V" in reach and "altitude" in reach:
            (slow, fast), (low, high) = reach["V"], reach["altitude"]
            return (
                _AIRSPEED * round(0.5 * (slow + fast) / _AIRSPEED),
                _ALTITUDE * round(0.5 * (low + high) / _ALTITUDE),
            )
    return None


def _moved(name: str, before: float, after: float) -> str:
    """A variable before and after to a tenth of its display unit; empty where both are zero."""
    factor, unit = display_unit(name)
    shown = [round(factor * value, 1) + 0.0 for value in (before, after)]
    name = name.removeprefix("delta_").replace("_", " ")
    return f"{name} {shown[0]} -> {shown[1]} {unit or ''}".rstrip() if any(shown) else ""


def _modes(before: Sequence[dict[str, Any]], after: Sequence[dict[str, Any]]) -> str:
    """Which mode moves most, as a part of its distance from the origin."""
    names = [[mode["name"] for mode in side] for side in (before, after)]
    if names[0] != names[1]:
        return f"modes {', '.join(names[0])} -> {', '.join(names[1])}"
    changes = [
        (abs(_root(new) - _root(old)) / (abs(_root(old)) or 1.0), new["name"])
        for old, new in zip(before, after, strict=True)
    ]
    if not changes:
        return "no modes"
    most, name = max(changes)
    return f"modes as before; the {name} moves most, by {100.0 * most:.2g} %"


def _root(mode: dict[str, Any]) -> complex:
    return complex(mode["real"], mode["imaginary"])
