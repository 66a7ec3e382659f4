"""Per-flight flow: ingest, reconstruct, compute coefficients, compare with the released
database."""

from typing import Any

from aerodb.flows.run import Steps, requires
from aerodb.tasks.steps import (
    check_consistency,
    compare_with_version,
    judged_beside,
    reconstruct,
    store_log,
)
from aerodb.tasks.workspace_access import access_workspace


@requires("ingest")
def flight_flow(
    steps: Steps,
    *,
    workspace: str,
    run: str,
    logs: list[str],
    vehicle: str,
    mapping: str | None = None,
    name: str | None = None,
    strict: bool = False,
) -> list[dict[str, Any]]:
    """Ingest logs and compare each new flight with the released database; one bad log stops no
    other.

    Returns one document per log: that of `aerodb.tasks.steps.ingest.store_log` and, if it became a
    flight, ``consistency``, ``coefficients`` and ``comparison``, the documents of these steps. A
    rejected flight is compared too: the comparison shows why.
    """
    where = {"workspace": workspace, "run": run}
    outcomes = steps.map(
        store_log, logs, **where, vehicle=vehicle, mapping=mapping, name=name, strict=strict
    )
    flights = list(dict.fromkeys(outcome["flight"] for outcome in outcomes if outcome["flight"]))
    documents = _beside_released(steps, flights, vehicle, workspace, run)
    return [
        {**outcome, **{name: step.get(outcome["flight"]) for name, step in documents.items()}}
        for outcome in outcomes
    ]


@requires("ingest")
def again_flow(steps: Steps, *, workspace: str, run: str, flight: str) -> dict[str, Any]:
    """Repeat the per-flight steps on a stored flight (its id); only missing results are
    computed."""
    vehicle = access_workspace(workspace).catalogue.flight(flight).vehicle
    documents = _beside_released(steps, [flight], vehicle, workspace, run)
    return {"flight": flight, **{name: step.get(flight) for name, step in documents.items()}}


@requires("ingest")
def compare_flow(
    steps: Steps,
    *,
    workspace: str,
    run: str,
    flight: str,
    version: str,
    before: str | None = None,
) -> dict[str, Any]:
    """Compare a stored flight with a version, and with another, `before` (ids); see
    `aerodb.tasks.steps.compare`.

    Returns the document of the version; ``before`` in it is that of the other, None without one or
    where the flight cannot be compared with it.
    """
    where = {"workspace": workspace, "run": run}
    result: dict[str, Any] = steps(compare_with_version, flight, **where, version=version)
    if before is None or result["key"] is None:
        return {**result, "before": None}
    other = steps(compare_with_version, flight, **where, version=before)
    return {**result, "before": other if other["key"] is not None else None}


def _beside_released(
    steps: Steps, flights: list[str], vehicle: str, workspace: str, run: str
) -> dict[str, dict[str, Any]]:
    """Return consistency, coefficients and comparison with the released database, by flight
    (ids)."""
    where = {"workspace": workspace, "run": run}
    consistency = {
        entry["flight"]: entry for entry in steps.map(check_consistency, flights, **where)
    }
    coefficients = reconstructed(steps, consistency, where)
    known = [flight for flight in flights if coefficients[flight]["key"] is not None]
    released = access_workspace(workspace).named(vehicle, "released")
    compared: dict[str, Any] = {}
    if released is not None:
        compared = {
            entry["flight"]: entry
            for entry in steps.map(compare_with_version, known, **where, version=released)
        }
    judged = {
        flight: judged_beside(document, flight, workspace=workspace)
        for flight, document in consistency.items()
    }
    return {"consistency": judged, "coefficients": coefficients, "comparison": compared}


def reconstructed(
    steps: Steps, consistency: dict[str, dict[str, Any]], where: dict[str, str]
) -> dict[str, dict[str, Any]]:
    """Return the documents of the coefficients of flights (ids) from those of their consistency.

    No step begins again what the consistency step could not bear.
    """
    able = [flight for flight, document in consistency.items() if document["key"] is not None]
    found = {entry["flight"]: entry for entry in steps.map(reconstruct, able, **where)}
    for flight, document in consistency.items():
        if flight not in found:
            reason = "; ".join(document["reasons"])
            found[flight] = {
                "flight": flight,
                "key": None,
                "reason": reason,
                "axes": [],
                "notes": [],
            }
    return found
