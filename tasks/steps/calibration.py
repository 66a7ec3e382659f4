"""Joint calibration of a vehicle's sensors from stored flights, and binding flights to it."""

from datetime import datetime
from typing import Any

from aerodb.consistency import Calibration, joint_calibrations
from aerodb.errors import InputError
from aerodb.storage.workspace_settings import SettingsError
from aerodb.tasks.steps.consistency import load_consistent
from aerodb.tasks.steps.counting import counted_out
from aerodb.tasks.steps.ingest import load_flight
from aerodb.tasks.workspace_access import WorkspaceAccess, access_workspace


def calibrate(
    flights: list[str],
    *,
    workspace: str,
    run: str,
    vehicle: str,
    reason: str,
    valid_from: str | None = None,
    valid_until: str | None = None,
) -> dict[str, Any]:
    """Estimate the sensor parameters that `flights` (ids) share, and store them as calibrations.

    valid_from, valid_until : ISO 8601, UTC. Returns a document: calibration (id), label and
    parameters of what all flights share, the newest of the vehicle, which later flights take;
    flights, skipped; groups: the same of flights that share more; bound: flight -> calibration,
    the group's if it has one.

    Reads consistent flights and the vehicle; raises UnknownNameError for an unknown id.
    """
    access = access_workspace(workspace)
    described, _ = access.vehicle(vehicle)
    loaded, skipped = [], []
    repeats = counted_out(access.catalogue, vehicle)
    for id in flights:
        row = access.catalogue.flight(id)
        why = (
            "retracted"
            if row.retracted_utc
            else row.verdict
            if row.verdict == "rejected"
            else "repetition"
            if id in repeats
            else ""
        )
        if why:
            skipped.append({"flight": id, "reason": why})
            continue
        try:
            checked = load_consistent(access, row, run).document
            flight, _ = load_flight(access, row, run)
        except SettingsError:
            raise
        except InputError as error:
            skipped.append({"flight": id, "reason": str(error)})
            continue
        if checked.get("checked"):
            loaded.append(flight)
        else:
            skipped.append({"flight": id, "reason": "; ".join(checked["reasons"])})
    if not loaded:
        raise InputError(
            "no usable flight",
            f"calibration of {vehicle}",
            "ingest flights that the consistency check can reconstruct and does not reject",
        )
    span = [
        None if text is None else datetime.fromisoformat(text) for text in (valid_from, valid_until)
    ]
    made = [
        _stored(access, each, reason, run) for each in joint_calibrations(loaded, described, *span)
    ]
    used = [flight.id for flight in loaded]
    everyone = next((each for each in made if set(each["flights"]) == set(used)), None)
    groups = [each for each in made if each is not everyone]
    bound = {id: each["calibration"] for each in made for id in each["flights"]}
    bound |= {id: each["calibration"] for each in groups for id in each["flights"]}
    return {
        **(everyone or groups[-1]),
        "flights": used,
        "groups": groups,
        "bound": bound,
        "skipped": skipped,
    }


def _stored(
    access: WorkspaceAccess, calibration: Calibration, reason: str, run: str
) -> dict[str, Any]:
    """Store a calibration, and return its document."""
    row = access.catalogue.add_calibration(
        calibration.id,
        vehicle=calibration.vehicle,
        content=calibration.document(),
        reason=reason,
        run=run,
    )
    return {
        "calibration": row.id,
        "label": row.label,
        "parameters": {
            name: {"value": value, "standard_error": error}
            for name, (value, error) in calibration.by_name.items()
        },
        "flights": list(calibration.flights),
    }


def bind(flight: str, *, workspace: str, run: str, calibration: str) -> str:
    """Bind a flight to a calibration (ids), and return the flight.

    Results that depend on the calibration are recomputed when they are next needed.

    Reads and changes the catalogue only (`Catalogue.bind_flight`). Raises UnknownNameError for an
    unknown flight, InputError for a calibration of another vehicle.
    """
    access_workspace(workspace).catalogue.bind_flight(flight, calibration, run)
    return flight
