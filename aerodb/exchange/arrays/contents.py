"""Content of a database file in a format that holds arrays and texts (CSV, MAT, NetCDF).

Each item is stored once. The numbers of tables, increments and check cases are arrays of the
format, where its users expect them and may change them. Definitions are texts. Everything else is
in the manifest (JSON). Nothing can therefore be lost silently or contradict itself.

`to_contents` makes the content of a database; `from_contents` rebuilds the database and evaluates
the check cases of the file.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from aerodb.errors import InputError
from aerodb.exchange.native import from_document, to_document
from aerodb.nomenclature import AXES, axis_description, channel, in_order, is_hinge_axis
from aerodb.support import Array
from aerodb.tables import (
    AeroDatabase,
    CheckCase,
    channel_of,
    failed_check_cases,
    make_check_cases,
    table_calls,
)

FORMAT: Final = 1
MAX_BYTES: Final = 200_000_000  # of a file, packed and unpacked
TERM_TEXTS: Final = ("name", "axis", "expression", "description")
VARIABLE_TEXTS: Final = ("name", "expression", "unit", "description")
ENVELOPE: Final = ("low", "high", "cell")


@dataclass(frozen=True)
class IncrementNumbers:
    """Numbers of one increment.

    estimates : (k,). covariance : (k, k). envelope : (m, 3), low, high and cell of the variables
    that the manifest names.
    """

    estimates: Array
    covariance: Array
    envelope: Array


@dataclass(frozen=True)
class CaseNumbers:
    """Numbers of the check cases.

    inputs : (n, len(names)), in the order of `names`. coefficients : (n, len(axes)), in the order
    of `axes`: CX CY CZ Cl Cm Cn, then those of hinge moments.
    """

    names: tuple[str, ...]
    inputs: Array
    coefficients: Array
    axes: tuple[str, ...] = AXES


@dataclass(frozen=True)
class Contents:
    """Content of a database file.

    manifest : everything that is neither text nor array. terms, variables : their texts. tables :
    name -> breakpoints per axis, and values.
    """

    manifest: dict[str, Any]
    terms: list[dict[str, str]]
    variables: list[dict[str, str]]
    tables: dict[str, tuple[list[Array], Array]]
    increments: list[IncrementNumbers]
    cases: CaseNumbers

    @property
    def manifest_text(self) -> str:
        """The manifest as JSON in ASCII."""
        return json.dumps(self.manifest, indent=1, ensure_ascii=True)


def to_contents(
    database: AeroDatabase, kind: str, check_cases: Sequence[CheckCase] | None = None
) -> Contents:
    """Return the content of a file of `kind` for `database`.

    check_cases : written to the file; by default 25 cases made from the database.

    Raises InputError for text that the formats cannot hold.
    """
    document = to_document(database)
    if "\\u0000" in json.dumps(document):
        raise InputError(
            "a text contains the character NUL", f"database {database.name}", "remove it"
        )
    tables = {}
    for name, entry in document["tables"].items():
        axes = [np.array(axis, dtype=np.float64) for axis in entry.pop("breakpoints")]
        tables[name] = (axes, np.array(entry.pop("values"), dtype=np.float64))
    increments = []
    for entry in document["increments"]:
        bounds = [[interval[key] for key in ENVELOPE] for interval in entry["envelope"].values()]
        entry["envelope"] = list(entry["envelope"])
        estimates, covariance = (
            np.array(entry.pop(key), dtype=np.float64) for key in ("estimates", "covariance")
        )
        increments.append(
            IncrementNumbers(
                estimates, covariance, np.array(bounds, dtype=np.float64).reshape(-1, 3)
            )
        )
    terms = [{key: entry.pop(key) for key in TERM_TEXTS} for entry in document["terms"]]
    variables = [
        {"name": name, **{key: entry.pop(key) for key in VARIABLE_TEXTS[1:]}}
        for name, entry in document["variables"].items()
    ]
    if not any(document["terms"]):
        # The texts hold everything about a term: rows may be added there.
        del document["terms"]
    manifest = {
        "file": f"aerodb {kind}",
        "version": FORMAT,
        "conventions": conventions(database),
        "database": document,
    }
    cases = make_check_cases(database) if check_cases is None else tuple(check_cases)
    return Contents(manifest, terms, variables, tables, increments, _case_numbers(cases))


def from_contents(contents: Contents, kind: str, where: str) -> AeroDatabase:
    """Return the database of `contents`, tested against its check cases.

    contents : read from a file of `kind`.

    Raises InputError if the contents are inconsistent, are not of this format, or fail a check
    case.
    """
    document = _document(contents, kind, where)
    try:
        for name, (axes, values) in contents.tables.items():
            document["tables"][name] |= {
                "breakpoints": [axis.tolist() for axis in axes],
                "values": values.tolist(),
            }
        for entry, numbers in zip(document["increments"], contents.increments, strict=True):
            bounds = [dict(zip(ENVELOPE, row, strict=True)) for row in numbers.envelope.tolist()]
            entry["envelope"] = dict(zip(entry["envelope"], bounds, strict=True))
            entry |= {
                "estimates": numbers.estimates.tolist(),
                "covariance": numbers.covariance.tolist(),
            }
        document["terms"] = [
            {**texts, **rest}
            for texts, rest in zip(
                contents.terms, document.get("terms") or [{}] * len(contents.terms), strict=True
            )
        ]
        rest = document.get("variables") or {}
        document["variables"] = {
            texts["name"]: (
                {key: texts[key] for key in VARIABLE_TEXTS[1:]} | rest.get(texts["name"], {})
            )
            for texts in contents.variables
        }
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise InputError(
            f"the manifest does not match the data ({error!r})", where, "export the database again"
        ) from error
    database = from_document(document, where)
    try:
        differences = failed_check_cases(database, _cases(contents.cases, where))
    except InputError as error:
        raise InputError(f"check cases: {error.what}", where, error.remedy) from error
    if differences:
        remedy = (
            "the file was changed or damaged; if the change is intended, remove its check cases"
        )
        raise InputError(f"{len(differences)} check values differ: {differences[0]}", where, remedy)
    return database


def parse_manifest(text: str, where: str) -> dict[str, Any]:
    """Return the manifest of a file (JSON, RFC 8259). Raises InputError if it is not a JSON
    object."""
    try:
        manifest = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(
            f"the manifest is not JSON: {error}", where, "export the database again"
        ) from error
    if not isinstance(manifest, dict):
        raise InputError("the manifest is not a JSON object", where, "export the database again")
    return manifest


def check_size(data: bytes, where: str) -> None:
    """Raise InputError for a file of more than `MAX_BYTES`."""
    if len(data) > MAX_BYTES:
        raise InputError(f"{len(data)} bytes", where, f"at most {MAX_BYTES}")


def conventions(database: AeroDatabase) -> dict[str, Any]:
    """Return what a reader needs to use the numbers (docs/reference/conventions.md, section "Axes,
    signs, units").

    Axes and signs, units of the inputs, reference lengths and the moment reference point.
    """
    reference = database.reference
    point = ", ".join(f"{x:g}" for x in reference.moment_reference)
    return {
        "units": "SI and radians; coefficients have none",
        "axes": {
            axis: axis_description(axis) for axis in (*database.axes, "C_lift", "C_drag", "C_side")
        },
        "moments": (
            f"about ({point}) m from the vehicle's datum, body axes: x forward, y right, z down"
        ),
        "coefficients": (
            f"forces over qbar S with S = {reference.area!r} m^2; Cl and Cn over qbar S b with b = "
            f"{reference.span!r} m; Cm over qbar S c with c = {reference.chord!r} m"
        ),
        "inputs": {name: _input(name, database) for name in database.inputs},
        "tables": (
            "multilinear between breakpoints and held outside, unless a table says otherwise; the"
            " last argument varies fastest"
        ),
        "envelope": (
            "beyond low..high a regressor's variables are held. Its weight is 1 for one cell beyond"
            " and falls to 0 over one further cell, for its own variables and alpha, beta, mach"
        ),
    }


def argument_units(database: AeroDatabase) -> dict[str, list[str]]:
    """Return the SI units of the arguments of each table.

    A unit is known only for an argument that is a channel itself; for a formula it is empty
    (`channel_of`).
    """
    units: dict[str, list[str]] = {
        name: [""] * len(table.arguments) for name, table in database.tables.items()
    }
    for call in table_calls(database):
        for k, argument in enumerate(call.arguments if call.table in units else ()):
            name = channel_of(argument, database)
            if name is not None and name not in database.free_inputs:
                units[call.table][k] = channel(name).unit
    return units


def _input(name: str, database: AeroDatabase) -> str:
    if name in database.free_inputs:
        return database.free_inputs[name]
    entry = channel(name)
    return f"[{entry.unit}] {entry.description}"


def _document(contents: Contents, kind: str, where: str) -> dict[str, Any]:
    """Copy the manifest's document and check that the arrays have its tables and increments."""
    manifest = contents.manifest
    if manifest.get("file") != f"aerodb {kind}" or manifest.get("version") != FORMAT:
        written_by = f"{manifest.get('file')!r}, version {manifest.get('version')!r}"
        raise InputError(
            f"the manifest is for {written_by}",
            where,
            f"this version reads 'aerodb {kind}', version {FORMAT}",
        )
    document = manifest.get("database")
    if not isinstance(document, dict):
        raise InputError("the manifest holds no database", where, "export the database again")
    document = json.loads(json.dumps(document))
    tables, increments = document.get("tables"), document.get("increments")
    if not isinstance(tables, dict) or tables.keys() != contents.tables.keys():
        listed = (
            sorted(tables.keys() ^ contents.tables.keys()) if isinstance(tables, dict) else "all"
        )
        raise InputError(
            f"tables of the manifest and of the data differ: {listed}",
            where,
            "export the database again",
        )
    if not isinstance(increments, list) or len(increments) != len(contents.increments):
        raise InputError(
            "increments of the manifest and of the data differ", where, "export the database again"
        )
    return dict(document)


def case_axes(given: Sequence[str], where: str, what: str = "the outputs") -> tuple[str, ...]:
    """Return the axes of check cases (n, axes) as a file has them; InputError unless they are CX CY
    CZ Cl Cm Cn and those of hinge moments. what : that has them, for the message."""
    axes = tuple(given)
    if axes[:6] != AXES or not all(map(is_hinge_axis, axes[6:])):
        raise InputError(
            f"{what} are not CX CY CZ Cl Cm Cn, then hinge moments (Ch_<surface>)",
            where,
            "export the database again",
        )
    return axes


def _case_numbers(cases: Sequence[CheckCase]) -> CaseNumbers:
    names = tuple(sorted(cases[0].inputs)) if cases else ()
    inputs = np.array([[case.inputs[name] for name in names] for case in cases], dtype=np.float64)
    axes = in_order(cases[0].coefficients) if cases else AXES
    values = np.array(
        [[case.coefficients[axis] for axis in axes] for case in cases], dtype=np.float64
    )
    return CaseNumbers(
        names, inputs.reshape(len(cases), len(names)), values.reshape(len(cases), len(axes)), axes
    )


def _cases(numbers: CaseNumbers, where: str) -> tuple[CheckCase, ...]:
    n = len(numbers.coefficients)
    complete = (n, len(numbers.names)), (n, len(numbers.axes))
    if (numbers.inputs.shape, numbers.coefficients.shape) != complete:
        raise InputError("the check cases are incomplete", where, "export the database again")
    return tuple(
        CheckCase(_named(numbers.names, x), _named(numbers.axes, c))
        for x, c in zip(numbers.inputs.tolist(), numbers.coefficients.tolist(), strict=True)
    )


def _named(names: Sequence[str], values: Sequence[float]) -> Mapping[str, float]:
    return dict(zip(names, values, strict=True))
