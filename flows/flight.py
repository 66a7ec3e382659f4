"""The per-flight flow: read, store, reconstruct coefficients, compare with the released database."""

from typing import Any

from flows.run import Steps
from tasks.coefficients import reconstruct
from tasks.compare import compare_with_version
from tasks.ingest import store_log
from tasks.open import stores


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
    """Each log into the store, and each new flight beside the released database. One bad log stops no other.

    Returns one document per log: that of `tasks.ingest.store_log` and, where it became a flight, ``coefficients``
    and ``comparison``, the documents of these steps.
    """
    where = {"workspace": workspace, "run": run}
    outcomes = steps.map(store_log, logs, **where, vehicle=vehicle, mapping=mapping, name=name, strict=strict)
    flights = list(dict.fromkeys(outcome["flight"] for outcome in outcomes if outcome["flight"]))
    coefficients = {entry["flight"]: entry for entry in steps.map(reconstruct, flights, **where)}
    known = [flight for flight in flights if coefficients[flight]["key"] is not None]
    released = stores(workspace).named(vehicle, "released")
    compared: dict[str, Any] = {}
    if released is not None:
        compared = {entry["flight"]: entry for entry in steps.map(compare_with_version, known, **where, version=released)}
    return [
        {**outcome, "coefficients": coefficients.get(outcome["flight"]), "comparison": compared.get(outcome["flight"])}
        for outcome in outcomes
    ]
