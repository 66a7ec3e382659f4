"""Consistency of a stored flight: reconstructed once per calibration, stored and read back."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from aerodb.consistency import (
    Calibration,
    Consistent,
    Origin,
    StateNoise,
    from_document,
    make_consistent,
    state_noise_from,
    unreadable_document,
)
from aerodb.errors import InputError
from aerodb.flight import Flight
from aerodb.remarks import CONTRADICTS, SUSPECTED, Remark
from aerodb.remarks import from_document as remark_from
from aerodb.storage.catalogue import FlightRow
from aerodb.storage.files import read_results, write_results
from aerodb.storage.workspace_settings import SettingsError
from aerodb.suspicions import limited_document, limits_flight
from aerodb.tasks.steps.conditioning import load_conditioning
from aerodb.tasks.steps.ingest import load_flight
from aerodb.tasks.stored_steps import StoredResult
from aerodb.tasks.workers import cached, confined, file_key, return_freed_memory
from aerodb.tasks.workspace_access import WorkspaceAccess, access_workspace


@dataclass(frozen=True)
class ConsistentFlight:
    """A consistent flight, the document of its reconstruction, and the key of both."""

    flight: Flight
    document: dict[str, Any]
    key: str


def check_consistency(flight: str, *, workspace: str, run: str) -> dict[str, Any]:
    """Reconstruct a flight (its id) under its calibration, and record the verdict.

    A stored result is read back. Returns the document of `aerodb.consistency.whole_flight` with
    flight and key. A flight whose channels cannot be made any more, from its stored log and the
    vehicle's present file, is rejected with the reason and key None: it stops no other flight.

    Raises SettingsError if settings or the vehicle cannot be used: no flight is at fault.
    """
    access = access_workspace(workspace)
    row = access.catalogue.flight(flight)
    key: str | None
    try:
        key, document = confined(
            _consistent,
            flight,
            workspace,
            run,
            workspace=workspace,
            flight=flight,
            what="the consistency step",
            where=access.name_of(row),
        )
    except SettingsError:
        raise
    except InputError as error:
        key, document = None, unreadable_document(error)
    record_verdict(access, row, document)
    return {"flight": flight, "key": key, **document}


def _consistent(flight: str, workspace: str, run: str) -> tuple[str, dict[str, Any]]:
    """Return key and document of a consistent flight; the work of a confined process."""
    access = access_workspace(workspace)
    loaded = load_consistent(access, access.catalogue.flight(flight), run)
    return loaded.key, loaded.document


def record_verdict(
    access: WorkspaceAccess,
    row: FlightRow,
    document: Mapping[str, Any],
    beside: Sequence[Remark] | None = None,
) -> None:
    """Record the verdict on a flight by the document of its consistency and by what contradicts the
    released version.

    beside : remarks of the comparison with it, `CONTRADICTS` or `SUSPECTED`; None: those that the
    flight has stay until it is compared again. UnknownNameError for an unknown flight.
    """
    if beside is None:
        beside = [each for each in row.remarks if each.kind in (CONTRADICTS, SUSPECTED)]
    whole = limited_document(document, [each for each in beside if each.kind == CONTRADICTS])
    remarks = [remark_from(each) for each in whole["verdict_remarks"]]
    suspected = [each for each in beside if each.kind == SUSPECTED]
    access.catalogue.judge_flight(row.id, whole["verdict"], [*remarks, *suspected])


def judged_beside(document: Mapping[str, Any], flight: str, *, workspace: str) -> dict[str, Any]:
    """Return the document of a flight's consistency with the verdict that is recorded: what
    contradicts the released version is among its reasons. UnknownNameError for an unknown flight.
    """
    remarks = access_workspace(workspace).catalogue.flight(flight).remarks
    return limited_document(document, [each for each in remarks if each.kind == CONTRADICTS])


def load_consistent(access: WorkspaceAccess, row: FlightRow, run: str) -> ConsistentFlight:
    """Return a consistent flight, channels (n,) in SI units; reconstruct and store it if needed.

    A flight that is processed for the first time is bound to the newest calibration that is valid
    for it, and stays bound to it until it is recalibrated.
    """
    flight, flight_key = load_flight(access, row, run)
    calibration = _bound(access, row, run)
    inputs = {
        "flight": flight_key,
        "calibration": "none" if calibration is None else calibration.id,
    }
    limits = access.accuracy(row.vehicle)
    settings = {"accuracy": limits} if limits else {}
    result = StoredResult(access, "consistency", "consistency", inputs, settings, flight=row.id)
    path = result.stored()
    if path is not None:
        restored, document = cached(
            file_key(path, flight_key), lambda: _restored(flight, *read_results(path))
        )
        return ConsistentFlight(restored, document, result.key)
    vehicle, _ = access.vehicle(row.vehicle)
    consistent = make_consistent(flight, vehicle, calibration)
    return_freed_memory()
    # as it will be read back: a document does not depend on whether it was just made
    document = json.loads(json.dumps({**consistent.document, "changed": list(consistent.changed)}))
    found, _ = load_conditioning(access, row, flight, flight_key, run)
    suspected = [each.remark for each in found.suspicions if limits_flight(each)]
    document = limited_document(document, suspected)
    table = _table(consistent)
    origins = [flight_key] if calibration is None else [flight_key, calibration.id]
    result.keep(
        run,
        lambda path: write_results(path, table, document),
        inputs=origins,
        settings={},
    )
    restored, document = cached(
        file_key(result.path, flight_key), lambda: _restored(flight, table, document)
    )
    return ConsistentFlight(restored, document, result.key)


def _bound(access: WorkspaceAccess, row: FlightRow, run: str) -> Calibration | None:
    """Return the calibration of a flight; one that was never reconstructed is bound to the newest
    valid."""
    bound = access.catalogue.calibration_of(row.id)
    if bound is not None:
        return from_document(bound.content)
    if access.catalogue.results_of(row.id, "consistency"):
        return None  # reconstructed before there was one
    for candidate in reversed(access.catalogue.calibrations(row.vehicle)):
        calibration = from_document(candidate.content)
        if calibration.valid_at(row.start_utc):
            access.catalogue.bind_flight(row.id, candidate.id, run)
            return calibration
    return None


def _table(consistent: Consistent) -> dict[str, np.ndarray]:
    """Return what reconstruction changed or adds to a flight, as columns; empty if nothing."""
    flight = consistent.flight
    flags = {
        f"flags_{name}": flight.flags[name] for name in consistent.changed if name in flight.flags
    }
    sigma = {f"sigma_{name}": values for name, values in consistent.sigma.items()}
    table = {
        "time": flight.time,
        **{name: flight[name] for name in consistent.changed},
        **consistent.beyond,
        **flags,
        **sigma,
    }
    return table if consistent.changed or sigma else {}


def _restored(
    flight: Flight, table: Mapping[str, np.ndarray], document: dict[str, Any]
) -> tuple[Flight, dict[str, Any]]:
    """Return the flight with its stored corrections, and their document."""
    changed = document["changed"]
    flags = {name: table[f"flags_{name}"] for name in changed if f"flags_{name}" in table}
    corrected = flight.with_channels({name: table[name] for name in changed})
    return replace(
        corrected, flags={**flight.flags, **flags}, notes=(*flight.notes, *document["notes"])
    ), document


def reconstructed_angles(document: Mapping[str, Any]) -> frozenset[str]:
    """Return the flow angles that were reconstructed without a sensor, from a stored document
    (``origins``, as of `Origin`); none for a document without them."""
    origins, motion = document.get("origins", {}), Origin.MOTION.name.lower()
    return frozenset(name for name in ("alpha", "beta") if origins.get(name) == motion)


def unmeasured_angles(document: Mapping[str, Any]) -> frozenset[str]:
    """Return the flow angles whose values are no sensor's, from a stored document: reconstructed
    without one, or without the one that was left out."""
    alone = Origin.MOTION_ALONE.name.lower()
    others = (n for n, origin in document.get("origins", {}).items() if origin == alone)
    return reconstructed_angles(document) | (frozenset(others) & {"alpha", "beta"})


def applied_errors(document: Mapping[str, Any]) -> dict[str, float]:
    """Return parameter -> standard error [SI] of every correction applied, from a stored
    document."""
    return {
        e["parameter"]: e["standard_error"] for e in document.get("estimates", ()) if e["applied"]
    }


def remaining_errors(document: Mapping[str, Any]) -> dict[str, tuple[float, float]]:
    """Return parameter -> error that the channels still have and its standard error [SI], of all
    sensor parameters that reconstruction estimated, from a stored document.

    Nothing is left of a correction but its standard error.
    """
    estimated = [e for e in document.get("estimates", ()) if e["stretch"] is None]
    return {
        e["parameter"]: (0.0 if e.get("applied") else e["value"], e["standard_error"])
        for e in (*document.get("removed", ()), *estimated)
    }


def noise_of(document: Mapping[str, Any]) -> StateNoise | None:
    """Return the error spectrum (`StateNoise`, unit²/Hz) of a consistent flight's channels, from
    its stored document.

    None if the flight was not reconstructed.
    """
    return state_noise_from(document["noise"]) if "noise" in document else None
