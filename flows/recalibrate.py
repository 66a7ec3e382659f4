"""Recalibration flow: calibrate sensors jointly from flights, and recompute what depends on
them."""

from typing import Any

from aerodb.flows.flight import reconstructed
from aerodb.flows.run import Steps, requires
from aerodb.tasks.steps import bind, calibrate, check_consistency, compare_with_version
from aerodb.tasks.workspace_access import access_workspace


@requires("ingest")
def recalibrate_flow(
    steps: Steps,
    *,
    workspace: str,
    run: str,
    vehicle: str,
    flights: list[str],
    reason: str,
    valid_from: str | None = None,
    valid_until: str | None = None,
) -> dict[str, Any]:
    """Calibrate a vehicle's sensors from `flights` (ids), and bind these flights to the result.

    A flight that shares more with some others than with all is bound to that group's calibration.
    Consistency, coefficients and comparison with the released database are recomputed.
    Flights that are processed later are bound to the calibration as well; versions stay as they
    are. Returns the document of `aerodb.tasks.steps.calibration.calibrate` with ``consistency`` and
    ``comparison`` by flight.
    """
    where = {"workspace": workspace, "run": run}
    span = {"valid_from": valid_from, "valid_until": valid_until}
    calibration = steps(calibrate, flights, **where, vehicle=vehicle, reason=reason, **span)
    bound = [
        flight
        for id in dict.fromkeys(calibration["bound"].values())
        for flight in steps.map(
            bind,
            [own for own in calibration["flights"] if calibration["bound"].get(own) == id],
            **where,
            calibration=id,
        )
    ]
    consistency = {entry["flight"]: entry for entry in steps.map(check_consistency, bound, **where)}
    coefficients = reconstructed(steps, consistency, where)
    known = [flight for flight in bound if coefficients[flight]["key"] is not None]
    released = access_workspace(workspace).named(vehicle, "released")
    compared = (
        []
        if released is None
        else steps.map(compare_with_version, known, **where, version=released)
    )
    return {
        **calibration,
        "consistency": consistency,
        "comparison": {entry["flight"]: entry for entry in compared},
    }
