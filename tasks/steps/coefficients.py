"""Total coefficients of a stored flight, stored in long form: one row per time and axis."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from aerodb.coefficients import Coefficients, bandwidth_of, thrust_share, total_coefficients
from aerodb.errors import CalculationError, InputError, failing_alone
from aerodb.flight import Flight
from aerodb.remarks import of_error
from aerodb.storage.catalogue import FlightRow
from aerodb.storage.files import read_results, write_results
from aerodb.tasks.steps.consistency import load_consistent
from aerodb.tasks.stored_steps import StoredResult
from aerodb.tasks.workers import cached, confined, file_key, return_freed_memory
from aerodb.tasks.workspace_access import WorkspaceAccess, access_workspace
from aerodb.vehicle import Vehicle, cg_positions, with_mass_channels


@dataclass(frozen=True)
class FlightCoefficients:
    """A consistent flight with its mass properties, its total coefficients, and their key."""

    flight: Flight
    coefficients: Coefficients
    key: str


def reconstruct(flight: str, *, workspace: str, run: str) -> dict[str, Any]:
    """Compute and store the total coefficients of a flight (its id).

    Returns a document: flight, key, axes, bandwidth [Hz], notes; or flight, key None and the reason
    if there are none. A flight whose coefficients fail in an unforeseen way is rejected with the
    reason: it stops no other flight, and what has no coefficients does not count as good.

    Reads the consistent flight. Raises UnknownNameError for an unknown id.
    """
    access = access_workspace(workspace)
    row = access.catalogue.flight(flight)
    try:
        return confined(
            _reconstructed,
            flight,
            workspace,
            run,
            workspace=workspace,
            flight=flight,
            what="the coefficient step",
            where=access.name_of(row),
        )
    except InputError as error:
        remark = of_error(error)
        if isinstance(error, CalculationError) and remark not in row.remarks:
            access.catalogue.judge_flight(row.id, "rejected", [*row.remarks, remark])
        return {"flight": flight, "key": None, "reason": str(error), "axes": [], "notes": []}


def _reconstructed(flight: str, workspace: str, run: str) -> dict[str, Any]:
    """Return the document of a flight's coefficients; the work of a confined process."""
    access = access_workspace(workspace)
    loaded = load_coefficients(access, access.catalogue.flight(flight), run)
    coefficients = loaded.coefficients
    return {
        "flight": flight,
        "key": loaded.key,
        "axes": list(coefficients.values),
        "bandwidth": coefficients.bandwidth,
        "notes": list(coefficients.notes),
    }


def load_coefficients(access: WorkspaceAccess, row: FlightRow, run: str) -> FlightCoefficients:
    """Return the total coefficients of a flight; read back if stored, else computed.

    Reads the consistent flight (`load_consistent`). Raises InputError where there are none,
    CalculationError where they fail. Samples (n,), SI.
    """
    consistent = load_consistent(access, row, run)
    flight = consistent.flight
    vehicle, _ = access.vehicle(row.vehicle)
    settings = {
        "bandwidth": bandwidth_of(flight, vehicle),
        "angular_acceleration": "chosen",
    }
    result = StoredResult(
        access, "coefficients", "coefficients", {"flight": consistent.key}, settings, flight=row.id
    )
    path = result.stored()
    if path is not None:
        coefficients = cached(
            file_key(path, consistent.key), lambda: _stored(path, flight, vehicle)
        )
        return FlightCoefficients(with_mass_channels(flight, vehicle), coefficients, result.key)
    with failing_alone("the calculation of coefficients", access.name_of(row)):
        coefficients = total_coefficients(flight, vehicle, angular_acceleration="chosen")
    return_freed_memory()
    result.keep(run, lambda path: _write(path, coefficients, settings))
    coefficients = cached(file_key(result.path, consistent.key), lambda: coefficients)
    return FlightCoefficients(with_mass_channels(flight, vehicle), coefficients, result.key)


def _stored(path: Path, flight: Flight, vehicle: Vehicle) -> Coefficients:
    """Read stored coefficients; a moment reference that is not a fixed point is the CG at each
    sample."""
    table, metadata = read_results(path, ("measured", "sigma", "usable"))
    axes, n, point = metadata["axes"], len(flight.time), metadata["moment_reference"]
    values, sigma, usable = (
        dict(zip(axes, table[name].reshape(-1, n), strict=True))
        for name in ("measured", "sigma", "usable")
    )
    reference = cg_positions(flight, vehicle) if point == "cg" else np.broadcast_to(point, (n, 3))
    limit, notes = metadata["bandwidth"], tuple(metadata["notes"])
    return Coefficients(
        flight.id,
        flight.time,
        values,
        sigma,
        usable,
        np.asarray(reference, dtype=np.float64),
        limit,
        notes,
        thrust_share(flight, vehicle, np.asarray(reference, dtype=np.float64)),
        tuple(metadata["left_out"]),
    )


def _write(path: Path, coefficients: Coefficients, settings: Mapping[str, object]) -> None:
    axes, n = list(coefficients.values), len(coefficients.time)
    table = {
        "time": np.tile(coefficients.time, len(axes)),
        "axis": np.repeat(axes, n),
        "measured": np.concatenate([coefficients.values[axis] for axis in axes]),
        "sigma": np.concatenate([coefficients.sigma[axis] for axis in axes]),
        "usable": np.concatenate([coefficients.usable[axis] for axis in axes]),
    }
    point = coefficients.moment_reference
    fixed = point[0].tolist() if np.ptp(point, axis=0).max() == 0.0 else "cg"
    metadata = {
        "axes": axes,
        "moment_reference": fixed,
        "notes": list(coefficients.notes),
        "left_out": list(coefficients.left_out),
        **settings,
    }
    write_results(path, table, metadata)
