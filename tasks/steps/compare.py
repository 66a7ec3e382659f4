"""Comparison of a stored flight with a database version."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from aerodb.coefficients import Comparison, compare
from aerodb.conditioning import Suspicion, suspicion_documents, suspicions_from
from aerodb.errors import InputError, failing_alone
from aerodb.exchange import database_document_sha256
from aerodb.flight import Flight
from aerodb.nomenclature import in_order
from aerodb.remarks import CONTRADICTS, SUSPECTED, Remark
from aerodb.storage.catalogue import FlightRow
from aerodb.storage.files import read_results, write_results
from aerodb.suspicions import against_database, limits_flight
from aerodb.tables import AeroDatabase
from aerodb.tasks.result_versions import RELEASED
from aerodb.tasks.steps.coefficients import FlightCoefficients, load_coefficients
from aerodb.tasks.steps.consistency import load_consistent, record_verdict
from aerodb.tasks.stored_steps import StoredResult
from aerodb.tasks.workers import cached, confined
from aerodb.tasks.workspace_access import WorkspaceAccess, access_workspace
from aerodb.vehicle import Vehicle


@dataclass(frozen=True)
class FlightComparison:
    """A consistent flight and its comparison with a database.

    key : of the stored comparison, or of the coefficients if the comparison is not stored.
    suspicions : what in the flight contradicts the database, of a stored comparison.
    """

    flight: Flight
    comparison: Comparison
    key: str
    suspicions: tuple[Suspicion, ...] = ()


def compare_with_version(
    flight: str, *, workspace: str, run: str, version: str, confine: bool = True
) -> dict[str, Any]:
    """Compare a flight (its id) with a version (its id), and store the result.

    confine : in a worker under the limits of the workspace. Not for a flow that then works on the
    flight itself: its process keeps what was loaded, and no worker has to start.
    Returns a document: flight, key, axes (axis -> rms of measured, of residual and of sigma,
    dimensionless), notes, left_out (axes that contain a thrust that the flight lacks), suspicions
    (what contradicts the database beyond what a wind tunnel can have wrong); or flight, key None
    and the reason if no comparison is possible. The flight stays stored in both cases. What
    contradicts the released version limits the verdict on the flight. Raises UnknownNameError for
    an unknown id.
    """
    access = access_workspace(workspace)
    where = access.name_of(access.catalogue.flight(flight))
    try:
        if not confine:
            with failing_alone("the comparison step", where, memory=True):
                return _compared(flight, workspace, run, version)
        return confined(
            _compared,
            flight,
            workspace,
            run,
            version,
            workspace=workspace,
            flight=flight,
            what="the comparison step",
            where=where,
        )
    except InputError as error:
        none: dict[str, Any] = {"axes": {}, "notes": [], "suspicions": []}
        cause = {"what": error.what, "where": error.where, "remedy": error.remedy}
        return {"flight": flight, "key": None, "reason": str(error), "cause": cause, **none}


def _compared(flight: str, workspace: str, run: str, version: str) -> dict[str, Any]:
    """Return the document of a comparison; the work of a confined process."""
    access = access_workspace(workspace)
    loaded = load_comparison(access, flight, version, run)
    comparison = loaded.comparison
    axes = {axis: comparison.summary(axis) for axis in in_order(comparison.usable)}
    row = access.catalogue.flight(flight)
    _judge(access, row, version, loaded.suspicions, run)
    return {
        "flight": flight,
        "key": loaded.key,
        "axes": axes,
        "notes": list(comparison.notes),
        "left_out": list(comparison.left_out),
        "suspicions": suspicion_documents(loaded.suspicions),
    }


def _judge(
    access: WorkspaceAccess,
    row: FlightRow,
    version: str,
    found: tuple[Suspicion, ...],
    run: str,
) -> None:
    """Record the verdict on a flight by its consistency and by the released version; by another
    version nothing is recorded."""
    if version != access.named(row.vehicle, RELEASED):
        return
    label = access.catalogue.version_of_id(version).label
    more = [
        Remark(
            CONTRADICTS if limits_flight(each) else SUSPECTED,
            (label, each.channel),
            each.remark.values,
            each.sentence,
        )
        for each in found
    ]
    record_verdict(access, row, load_consistent(access, row, run).document, more)


def load_comparison(
    access: WorkspaceAccess, flight: str, version: str, run: str
) -> FlightComparison:
    """Return the comparison of a flight with a version (both by id), and store it with what
    contradicts the version.

    Reads coefficients and the version. Raises UnknownNameError for an unknown id, InputError as
    `compare_with_database`.
    """
    row = access.catalogue.flight(flight)
    compared = compare_with_database(access, flight, access.database(version), run)
    comparison = compared.comparison
    inputs = {"coefficients": compared.key, "version": version}
    result = StoredResult(access, "compare", "comparison", inputs, flight=row.id)
    path = result.stored()
    if path is None:
        beside = comparison.beside(compared.flight, access.database(version))
        found = against_database(*beside, access.vehicle(row.vehicle)[0])
        metadata = {
            "notes": list(comparison.notes),
            "version": version,
            "suspicions": suspicion_documents(found),
        }
        result.keep(run, lambda path: write_results(path, _long(comparison), metadata))
    else:
        found = suspicions_from(read_results(path, ())[1]["suspicions"])
    return FlightComparison(compared.flight, comparison, result.key, found)


def compare_with_database(
    access: WorkspaceAccess, flight: str, database: AeroDatabase, run: str
) -> FlightComparison:
    """Return the comparison of a flight (its id) with a database that need not be stored.

    Its key is that of the flight's coefficients.

    Reads the coefficients. Raises UnknownNameError for an unknown id, InputError where
    `load_coefficients` does.
    """
    row = access.catalogue.flight(flight)
    loaded = load_coefficients(access, row, run)
    comparison = compare_loaded(loaded, database, access.vehicle(row.vehicle)[0])
    return FlightComparison(loaded.flight, comparison, loaded.key)


def compare_loaded(
    loaded: FlightCoefficients, database: AeroDatabase, vehicle: Vehicle, select: Sequence[str] = ()
) -> Comparison:
    """Return the comparison of loaded coefficients with a database; cached in memory. select : the
    conditions by which samples of these coefficients are usable.

    Coefficients are (n,). Raises CalculationError where the comparison fails in an unforeseen way,
    as `failing_alone` says.
    """
    with failing_alone(
        f"the comparison with database {database.name}", f"flight {loaded.flight.id}"
    ):
        return cached(
            ("comparison", loaded.key, database_document_sha256(database), tuple(select)),
            lambda: compare(loaded.flight, loaded.coefficients, database, vehicle.reference),
        )


def _long(comparison: Comparison) -> dict[str, np.ndarray]:
    axes, n = in_order(comparison.usable), len(comparison.time)

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
