"""A stored flight beside a version of the database."""

from typing import Any

import numpy as np

from aerodb.comparison import Comparison, compare
from aerodb.errors import InputError
from aerodb.estimation.statistics import rms
from aerodb.flight import Flight
from aerodb.identity import result_key
from aerodb.nomenclature import AXES
from storage.flights import write_results
from tasks.coefficients import load_coefficients
from tasks.open import Stores, stores
from tasks.provenance import code_version
from tasks.settings import RESULT_VERSION


def compare_with_version(flight: str, *, workspace: str, run: str, version: str) -> dict[str, Any]:
    """Compares a flight (its id) with a version (its id) and stores the result.

    Returns a document: flight, key, axes (axis -> rms of measured, of residual and of sigma), notes; or, where the
    comparison is not possible, flight, key None and the reason. That is no failure of the flight: it stays stored.
    """
    opened = stores(workspace)
    try:
        _, comparison, key = load_comparison(opened, flight, version, run)
    except InputError as error:
        return {"flight": flight, "key": None, "reason": str(error), "axes": {}, "notes": []}
    axes = {axis: _summary(comparison, axis) for axis in AXES if axis in comparison.usable}
    return {"flight": flight, "key": key, "axes": axes, "notes": list(comparison.notes)}


def load_comparison(opened: Stores, flight: str, version: str, run: str) -> tuple[Flight, Comparison, str]:
    """A flight, its comparison with a version (both by id), and the comparison's key; stored when it is not yet."""
    row = opened.catalogue.flight(flight)
    channels, coefficients, coefficients_key = load_coefficients(opened, row, run)
    vehicle, _ = opened.vehicle(row.vehicle)
    comparison = compare(channels, coefficients, opened.database(version), vehicle.reference)
    inputs = {"coefficients": coefficients_key, "version": version}
    key = result_key(inputs, {}, "compare", RESULT_VERSION["compare"])
    if opened.catalogue.result(key) is None:
        path = opened.workspace.result_path(key)
        write_results(path, _long(comparison), {"notes": list(comparison.notes), "version": version})
        opened.catalogue.add_result(
            key,
            step="compare",
            kind="comparison",
            flight=row.id,
            path=opened.workspace.relative(path),
            result_version=RESULT_VERSION["compare"],
            code_version=code_version(),
            inputs=inputs.values(),
            run=run,
        )
    return channels, comparison, key


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
