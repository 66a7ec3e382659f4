"""Comparison of a stored flight with a database version."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from aerodb.coefficients import Comparison, compare
from aerodb.errors import InputError, failing_alone
from aerodb.estimation import rms
from aerodb.exchange import database_document_sha256
from aerodb.flight import Flight
from aerodb.nomenclature import AXES
from aerodb.storage.files import write_results
from aerodb.tables import AeroDatabase
from aerodb.tasks.confined import confined
from aerodb.tasks.memory_cache import cached
from aerodb.tasks.steps.coefficients import FlightCoefficients, load_coefficients
from aerodb.tasks.stored_steps import StoredResult
from aerodb.tasks.workspace_access import WorkspaceAccess, access_workspace
from aerodb.vehicle import Vehicle


@dataclass(frozen=True)
class FlightComparison:
    """A consistent flight and its comparison with a database.

    key : of the stored comparison, or of the coefficients if the comparison is not stored.
    """

    flight: Flight
    comparison: Comparison
    key: str


def compare_with_version(flight: str, *, workspace: str, run: str, version: str) -> dict[str, Any]:
    """Compare a flight (its id) with a version (its id), and store the result.

    Returns a document: flight, key, axes (axis -> rms of measured, of residual and of sigma),
    notes, left_out (axes that contain a thrust that the flight lacks); or flight, key None and the
    reason if no comparison is possible. The flight stays stored in both cases.
    """
    access = access_workspace(workspace)
    try:
        return confined(
            _compared,
            flight,
            workspace,
            run,
            version,
            workspace=workspace,
            flight=flight,
            what="the comparison step",
            where=access.name_of(access.catalogue.flight(flight)),
        )
    except InputError as error:
        return {"flight": flight, "key": None, "reason": str(error), "axes": {}, "notes": []}


def _compared(flight: str, workspace: str, run: str, version: str) -> dict[str, Any]:
    """Return the document of a comparison; the work of a confined process."""
    loaded = load_comparison(access_workspace(workspace), flight, version, run)
    comparison = loaded.comparison
    axes = {axis: _summary(comparison, axis) for axis in AXES if axis in comparison.usable}
    return {
        "flight": flight,
        "key": loaded.key,
        "axes": axes,
        "notes": list(comparison.notes),
        "left_out": list(comparison.left_out),
    }


def load_comparison(
    access: WorkspaceAccess, flight: str, version: str, run: str
) -> FlightComparison:
    """Return the comparison of a flight with a version (both by id), and store it."""
    row = access.catalogue.flight(flight)
    compared = compare_with_database(access, flight, access.database(version), run)
    comparison = compared.comparison
    inputs = {"coefficients": compared.key, "version": version}
    result = StoredResult(access, "compare", "comparison", inputs, flight=row.id)
    if not result.is_stored():
        metadata = {"notes": list(comparison.notes), "version": version}
        result.keep(run, lambda path: write_results(path, _long(comparison), metadata))
    return FlightComparison(compared.flight, comparison, result.key)


def compare_with_database(
    access: WorkspaceAccess, flight: str, database: AeroDatabase, run: str
) -> FlightComparison:
    """Return the comparison of a flight (its id) with a database that need not be stored.

    Its key is that of the flight's coefficients.
    """
    row = access.catalogue.flight(flight)
    loaded = load_coefficients(access, row, run)
    comparison = compare_loaded(loaded, database, access.vehicle(row.vehicle)[0])
    return FlightComparison(loaded.flight, comparison, loaded.key)


def compare_loaded(
    loaded: FlightCoefficients, database: AeroDatabase, vehicle: Vehicle
) -> Comparison:
    """Return the comparison of loaded coefficients with a database; cached in memory."""
    with failing_alone(
        f"the comparison with database {database.name}", f"flight {loaded.flight.id}"
    ):
        return cached(
            ("comparison", loaded.key, database_document_sha256(database)),
            lambda: compare(loaded.flight, loaded.coefficients, database, vehicle.reference),
        )


def _long(comparison: Comparison) -> dict[str, np.ndarray]:
    axes, n = [axis for axis in AXES if axis in comparison.usable], len(comparison.time)

    def stacked(values: Any) -> np.ndarray:
        return np.concatenate([values[axis] for axis in axes])

    return {
        "time": np.tile(comparison.time, len(axes)),
        "axis": np.repeat(axes, n),
        "measured": stacked(comparison.measured),
        "predicted": stacked(comparison.predicted),
        "residual": np.concatenate([comparison.residual(axis) for axis in axes]),
        "usable": stacked(comparison.usable),
    }


def _summary(comparison: Comparison, axis: str) -> dict[str, float]:
    good = comparison.usable[axis]
    return {
        "samples": int(good.sum()),
        "rms_measured": rms(comparison.measured[axis][good]),
        "rms_residual": rms(comparison.residual(axis)[good]),
        "noise_floor": rms(comparison.sigma[axis][good]),
    }
