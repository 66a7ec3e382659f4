"""NetCDF: classic format (64-bit offset), read and written by scipy. Every NetCDF reader opens it.

A database is a few megabytes of float64 arrays. It needs neither the groups nor the compression of
NetCDF-4, which would require HDF5 and a second package; scipy has a pure-Python implementation of
the classic format.

``table_<name>`` has dimensions ``breakpoints_<name>_<k>``, whose coordinate variables of the same
name hold the breakpoints; further variables are ``increment_<n>_estimates``, ``_covariance`` and
``_envelope``, ``check_inputs`` and ``check_coefficients``. The global attribute ``manifest`` is
JSON with terms and everything else, including axes, signs, units and moment reference.
"""

import io
from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from aerodb.errors import InputError
from aerodb.exchange.arrays.contents import (
    VARIABLE_TEXTS,
    CaseNumbers,
    Contents,
    IncrementNumbers,
    argument_units,
    case_axes,
    check_size,
    from_contents,
    parse_manifest,
    to_contents,
)
from aerodb.nomenclature import AXES
from aerodb.support import Array
from aerodb.tables import AeroDatabase, CheckCase

_KIND: Final = "NetCDF"


def export_netcdf(database: AeroDatabase, check_cases: Sequence[CheckCase] | None = None) -> bytes:
    """Return `database` as the bytes of a NetCDF file.

    check_cases : written to the file; by default 25 cases made from the database.

    Numbers are in SI units and radians, as `conventions` says.
    """
    from scipy.io import netcdf_file  # slow to import

    contents = to_contents(database, _KIND, check_cases)
    document = contents.manifest["database"]
    rest = document.get("terms") or [{}] * len(contents.terms)
    document["terms"] = [
        {**texts, **more} for texts, more in zip(contents.terms, rest, strict=True)
    ]
    for texts in contents.variables:
        document["variables"][texts["name"]] |= {key: texts[key] for key in VARIABLE_TEXTS[1:]}
    contents.manifest["check_inputs"] = list(contents.cases.names)
    if contents.cases.axes != AXES:
        contents.manifest["check_axes"] = list(contents.cases.axes)
    written = io.BytesIO()
    file: Any = netcdf_file(written, "w", version=2)
    file.title = b"aerodynamic database"
    file.manifest = contents.manifest_text.encode("ascii")
    units = argument_units(database)
    for name, (axes, values) in contents.tables.items():
        arguments = database.tables[name].arguments
        dimensions = [f"breakpoints_{name}_{k}" for k in range(len(axes))]
        for dimension, argument, unit, axis in zip(
            dimensions, arguments, units[name], axes, strict=True
        ):
            _write(file, dimension, [dimension], axis, long_name=argument, units=unit)
        _write(file, f"table_{name}", dimensions, values, long_name=name)
    for k, numbers in enumerate(contents.increments, start=1):
        one, other, bounds = (
            f"increment_{k}_regressor",
            f"increment_{k}_with",
            f"increment_{k}_variable",
        )
        _write(file, f"increment_{k}_estimates", [one], numbers.estimates)
        _write(file, f"increment_{k}_covariance", [one, other], numbers.covariance)
        _write(file, f"increment_{k}_envelope", [bounds, "low_high_cell"], numbers.envelope)
    _write(file, "check_inputs", ["check_case", "check_input"], contents.cases.inputs)
    _write(
        file,
        "check_coefficients",
        ["check_case", f"axis_{'_'.join(contents.cases.axes)}"],
        contents.cases.coefficients,
    )
    file.flush()
    return written.getvalue()


def import_netcdf(data: bytes, where: str = "NetCDF file") -> AeroDatabase:
    """Return the database of a NetCDF file that `export_netcdf` wrote.

    Its numbers may have been edited.

    Raises InputError for damaged or too large files, missing variables, and check cases that fail.
    """
    check_size(data, where)
    arrays, text = _read(data, where)
    manifest = parse_manifest(text, where)
    try:
        document = manifest["database"]
        terms = [dict(entry) for entry in document.pop("terms")]
        named = [
            {"name": name, **{key: entry.pop(key) for key in VARIABLE_TEXTS[1:]}}
            for name, entry in document["variables"].items()
        ]
        tables = {
            name: _table(name, len(entry["arguments"]), arrays)
            for name, entry in document["tables"].items()
        }
        increments = [
            _increment(k, len(entry["envelope"]), arrays)
            for k, entry in enumerate(document["increments"], start=1)
        ]
        names = tuple(map(str, manifest.get("check_inputs", ())))
        axes = case_axes(tuple(map(str, manifest.get("check_axes", AXES))), where)
        cases = arrays.get("check_coefficients", np.empty((0, len(axes))))
        inputs = arrays.get("check_inputs", np.empty((len(cases), len(names))))
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise InputError(
            f"the manifest does not match the variables ({error!r})", where, "export it again"
        ) from error
    contents = Contents(
        manifest, terms, named, tables, increments, CaseNumbers(names, inputs, cases, axes)
    )
    return from_contents(contents, _KIND, where)


def _write(
    file: Any, name: str, dimensions: Sequence[str], values: Array, **attributes: str
) -> None:
    """Write a float64 variable unless it is empty.

    In this format a length of 0 means "unlimited".
    """
    if values.size == 0:
        return
    for dimension, size in zip(dimensions, values.shape, strict=True):
        if dimension not in file.dimensions:
            file.createDimension(dimension, size)
    variable = file.createVariable(name, "d", tuple(dimensions))
    variable[:] = values
    for key, text in attributes.items():
        if text:
            setattr(variable, key, text.encode("ascii", "backslashreplace"))


class _Metered(io.BytesIO):
    """A file that limits the bytes read from it.

    Headers can point many large variables at the same bytes.
    """

    def __init__(self, data: bytes) -> None:
        super().__init__(data)
        self._left = 2 * len(data)

    def read(self, size: int | None = -1, /) -> bytes:
        content = super().read(size)
        self._left -= len(content)
        if self._left < 0:
            raise ValueError("variables overlap")
        return content


def _read(data: bytes, where: str) -> tuple[dict[str, Array], str]:
    """All float64 variables and the text of the manifest."""
    from scipy.io import netcdf_file

    try:
        file: Any = netcdf_file(_Metered(data), "r", mmap=False)
        arrays = {
            name: np.array(v.data, dtype=np.float64)
            for name, v in file.variables.items()
            if v.data.dtype.kind in "fi"
        }
        return arrays, bytes(file.manifest).decode("utf-8")
    except Exception as error:  # damaged bytes make scipy raise any error
        raise InputError(
            f"not a NetCDF file with a manifest: {error!r}", where, "export the database again"
        ) from error


def _table(name: str, dimensions: int, arrays: dict[str, Array]) -> tuple[list[Array], Array]:
    return [arrays[f"breakpoints_{name}_{k}"] for k in range(dimensions)], arrays[f"table_{name}"]


def _increment(k: int, bounds: int, arrays: dict[str, Array]) -> IncrementNumbers:
    envelope = arrays[f"increment_{k}_envelope"] if bounds else np.empty((0, 3))
    return IncrementNumbers(
        arrays[f"increment_{k}_estimates"], arrays[f"increment_{k}_covariance"], envelope
    )
