"""Stored normal equations of flights: one Parquet file each, with the matrices flattened into
columns and everything else in the metadata."""

from pathlib import Path
from typing import Any

import numpy as np

from aerodb.storage.files.flights import read_results, write_results
from aerodb.tracing import FlightNormalEquations, normal_equations_from_arrays

#: The matrices, and the registered columns that hold them.
_MATRICES = {"matrix": "product", "noisy": "product_noisy"}


def write_normal_equations(path: Path, equations: FlightNormalEquations) -> None:
    """Store the normal equations of a flight.

    Matrices (k, k), flattened by rows; `read_normal_equations` reads them.
    """
    arrays = equations.to_arrays()
    present = {name: arrays[name] for name in _MATRICES if arrays[name].size}
    rest = {name: values.tolist() for name, values in arrays.items() if name not in _MATRICES}
    write_results(
        path, {_MATRICES[name]: values.ravel() for name, values in present.items()}, {"gram": rest}
    )


def read_normal_equations(path: Path) -> FlightNormalEquations:
    """Stored normal equations; InputError when they are missing, damaged or of another form.

    Matrices (k, k); absent ones are (0, 0).
    """
    table, metadata = read_results(path)
    arrays: dict[str, Any] = {name: np.array(values) for name, values in metadata["gram"].items()}
    size = round(np.sqrt(len(table["product"])))
    for name, column in _MATRICES.items():
        arrays[name] = table[column].reshape(size, size) if column in table else np.zeros((0, 0))
    return normal_equations_from_arrays(arrays)
