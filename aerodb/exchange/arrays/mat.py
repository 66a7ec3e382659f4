"""MAT: one struct ``aerodb`` for MATLAB and Octave, written as a version 5 MAT-file by scipy.

``aerodb.tables(k)`` has name, arguments, breakpoints (a cell of columns) and values: ``values(i,
j)`` belongs to ``breakpoints{1}(i)``, ``breakpoints{2}(j)``, the order that ``interpn`` expects.
``aerodb.terms(k)`` and ``aerodb.variables(k)`` have name, axis and expression as text;
``aerodb.increments(k)`` has estimates, covariance and envelope; ``aerodb.check_cases`` has inputs
and coefficients. ``aerodb.manifest`` is JSON (``jsondecode``) with everything else, including axes,
signs, units and moment reference. Where a text is both in the manifest and in a struct of
increments or table arguments, the manifest is read.
"""

import io
import math
from collections.abc import Mapping, Sequence
from typing import Any, Final, cast

import numpy as np

from aerodb.errors import InputError
from aerodb.exchange.arrays.contents import (
    MAX_BYTES,
    TERM_TEXTS,
    VARIABLE_TEXTS,
    CaseNumbers,
    Contents,
    IncrementNumbers,
    case_axes,
    check_size,
    from_contents,
    parse_manifest,
    to_contents,
)
from aerodb.support import Array, MatClass, MatElements, is_mat5
from aerodb.tables import AeroDatabase, CheckCase

_KIND: Final = "MAT"
_HEADER: Final = b"MATLAB 5.0 MAT-file, aerodynamic database (aerodb)".ljust(
    116
)  # no date: equal databases give equal bytes
_MAX_DEPTH: Final = 20  # structs inside each other
_TABLE: Final = ("name", "arguments", "breakpoints", "values")
_INCREMENT: Final = (
    "axis",
    "regressors",
    "estimates",
    "covariance",
    "envelope_variables",
    "envelope",
    "flights",
)


def export_mat(database: AeroDatabase, check_cases: Sequence[CheckCase] | None = None) -> bytes:
    """Return `database` as the bytes of a MAT-file.

    check_cases : written to the file; by default 25 cases made from the database.

    Numbers are in SI units and radians, as `conventions` says.
    """
    from scipy.io import savemat  # slow to import

    contents = to_contents(database, _KIND, check_cases)
    tables = [
        {
            "name": name,
            "arguments": _cell(database.tables[name].arguments),
            "breakpoints": _cell([axis[:, None] for axis in axes]),
            "values": values[:, None] if values.ndim == 1 else values,
        }
        for name, (axes, values) in contents.tables.items()
    ]
    increments = [
        {
            "axis": entry["axis"],
            "regressors": _cell(entry["regressors"]),
            "estimates": numbers.estimates[:, None],
            "covariance": numbers.covariance,
            "envelope_variables": _cell(entry["envelope"]),
            "envelope": numbers.envelope,
            "flights": _cell(entry["flights"]),
        }
        for entry, numbers in zip(
            contents.manifest["database"]["increments"], contents.increments, strict=True
        )
    ]
    cases = contents.cases
    content = {
        "manifest": contents.manifest_text,
        "terms": _structs(TERM_TEXTS, contents.terms),
        "variables": _structs(VARIABLE_TEXTS, contents.variables),
        "tables": _structs(_TABLE, tables),
        "increments": _structs(_INCREMENT, increments),
        "check_cases": {
            "inputs": _cell(cases.names),
            "input_values": cases.inputs,
            "axes": _cell(cases.axes),
            "coefficients": cases.coefficients,
        },
    }
    written, save = io.BytesIO(), cast(Any, savemat)  # its stubs accept file names only
    save(written, {"aerodb": content}, long_field_names=True, do_compression=True)
    return _HEADER + written.getvalue()[len(_HEADER) :]


def import_mat(data: bytes, where: str = "MAT file") -> AeroDatabase:
    """Return the database of a MAT-file that `export_mat` wrote.

    MATLAB may have saved it again (``-v7`` or ``-v6``).

    Raises InputError for damaged or too large files, missing fields, fields of another type, and
    check cases that fail.
    """
    check_size(data, where)
    try:
        (content,) = mat_variables(data)["aerodb"]
        tables = {
            entry["name"]: _table(entry["breakpoints"], entry["values"])
            for entry in content["tables"]
        }
        increments = [
            IncrementNumbers(
                _numbers(entry["estimates"]).ravel(),
                _numbers(entry["covariance"]),
                _numbers(entry["envelope"]).reshape(-1, 3),
            )
            for entry in content["increments"]
        ]
        terms = [{key: _string(entry[key]) for key in TERM_TEXTS} for entry in content["terms"]]
        named = [
            {key: _string(entry[key]) for key in VARIABLE_TEXTS} for entry in content["variables"]
        ]
        manifest = parse_manifest(_string(content["manifest"]), where)
        contents = Contents(manifest, terms, named, tables, increments, _case_numbers(content))
    except InputError:
        raise
    except OverflowError as error:
        raise InputError(str(error), where, f"at most {MAX_BYTES} bytes when expanded") from error
    except (LookupError, TypeError, ValueError) as error:
        raise InputError(
            f"not an exported MAT file with a struct 'aerodb': {error}", where, "export it again"
        ) from error
    return from_contents(contents, _KIND, where)


def is_own_mat(data: bytes) -> bool:
    """Return whether a MAT-file may be an own export: it has a variable ``aerodb``, or cannot be
    read."""
    try:
        return "aerodb" in mat_variables(data)
    except (InputError, OverflowError, LookupError, TypeError, ValueError):
        return True


def mat_variables(data: bytes) -> dict[str, Any]:
    """Return the variables of a MAT-file by name, at most MAX_BYTES when expanded.

    Numbers are float64 arrays, text is str, a cell is a flat list, and a struct (of any size) is a
    flat list of dicts.

    Raises ValueError for anything that is not such a file, and OverflowError beyond the limit.
    """
    if data.startswith(b"MATLAB 7.3"):
        raise ValueError("a MAT-file of version 7.3 (in MATLAB: save with -v7)")
    if not is_mat5(data):
        raise ValueError("not a MAT-file of version 5 to 7 (in MATLAB: save with -v7)")
    file, variables, room = MatElements.of_file(data), dict[str, Any](), MAX_BYTES
    while file.at < len(data):
        array = file.array(room)
        room -= len(array.data)
        name, value = _named(array, 0)
        variables[name] = value
    return variables


def _named(array: MatElements, depth: int) -> tuple[str, Any]:
    """Name and value of an array."""
    if depth > _MAX_DEPTH:
        raise ValueError("structs are nested too deeply")
    if not array.data:
        return "", np.empty((0, 0))
    header = array.header()
    count = math.prod(header.shape)
    value: Any
    if header.kind == MatClass.CELL:
        value = [_named(array.array(), depth + 1)[1] for _ in range(count)]
    elif header.kind == MatClass.STRUCT:
        fields = array.fields()
        value = [
            {field: _named(array.array(), depth + 1)[1] for field in fields}
            for _ in range(count if fields else 0)
        ]
    elif header.kind == MatClass.CHAR:
        if header.shape[0] > 1:
            raise ValueError("text of several rows")
        value = array.text()
    elif header.is_number:
        value = np.array(array.shaped(header), dtype=np.float64, order="C")
    else:
        raise ValueError(
            f"an array of class {header.kind}, which is neither struct, cell, text nor numbers"
        )
    return header.name, value


def _cell(items: Sequence[Any]) -> Any:
    cell = np.empty((len(items), 1), dtype=object)
    for k, item in enumerate(items):
        cell[k, 0] = item
    return cell


def _structs(fields: Sequence[str], entries: Sequence[Mapping[str, Any]]) -> Any:
    array = np.empty((len(entries), 1), dtype=[(name, object) for name in fields])
    for k, entry in enumerate(entries):
        for name in fields:
            array[k, 0][name] = entry[name]
    return array


def _string(value: Any) -> str:
    if not isinstance(value, str):
        raise ValueError("text is missing")
    return value


def _numbers(value: Any) -> Array:
    if not isinstance(value, np.ndarray):
        raise ValueError("numbers are missing")
    return value


def _table(breakpoints: Any, values: Any) -> tuple[list[Array], Array]:
    if not isinstance(breakpoints, list):
        raise ValueError("breakpoints are not a cell")
    axes = [_numbers(axis).ravel() for axis in breakpoints]
    return axes, _numbers(values).reshape([axis.size for axis in axes])


def _case_numbers(content: Mapping[str, Any]) -> CaseNumbers:
    """The check cases; none if the field was removed."""
    if "check_cases" not in content:
        return CaseNumbers((), np.empty((0, 0)), np.empty((0, 6)))
    (entry,) = content["check_cases"]
    names = tuple(_string(name) for name in entry["inputs"])
    axes = case_axes([_string(axis) for axis in entry["axes"]], _KIND)
    coefficients = _numbers(entry["coefficients"]).reshape(-1, len(axes))
    inputs = _numbers(entry["input_values"]).reshape(len(coefficients), len(names))
    return CaseNumbers(names, inputs, coefficients, axes)
