"""CSV: a whole database as one table, for pandas, R and spreadsheets.

Each row is one item, and its column ``kind`` says what: ``node`` (a node of the table ``name``: one
column per argument, and ``value``), ``term`` and ``variable`` (their expressions), ``increment``
(estimate and standard error of a regressor), ``covariance`` (of the regressors ``expression`` and
``other``), ``envelope`` (``low``, ``high`` and ``cell`` of a variable), ``check input`` and ``check
output`` (of the case ``name``), and, last, ``manifest`` (everything else, JSON in pieces: axes,
signs, units and moment reference in words). Increments are numbered from 1 in ``name``; a column
that no row fills is left out.

    rows = pandas.read_csv("my-glider.csv")
    lift = rows[(rows.kind == "node") & (rows.name == "CL")].dropna(axis="columns")

Texts that a spreadsheet would take for a formula (`-beta`, but not `-0.5`) are written after an
apostrophe, as in the archive of `comma_separated`: a program that reads them removes it.
"""

import json
from collections.abc import Iterable, Sequence
from typing import Any, Final

import numpy as np

from aerodb.errors import InputError, UnknownNameError
from aerodb.exchange.arrays.contents import (
    ENVELOPE,
    TERM_TEXTS,
    VARIABLE_TEXTS,
    CaseNumbers,
    Contents,
    IncrementNumbers,
    argument_units,
    case_axes,
    from_contents,
    parse_manifest,
    to_contents,
)
from aerodb.exchange.arrays.csv_texts import as_numbers, csv_rows, csv_text, from_text, grid_of
from aerodb.nomenclature import channel
from aerodb.support import Array
from aerodb.tables import AeroDatabase, CheckCase

COLUMNS: Final = (
    "kind", "name", "axis", "expression", "unit", "description", "other", *ENVELOPE, "value",
    "standard error",
)  # fmt: skip
_KIND: Final = "CSV table"
_PIECE: Final = 30_000  # characters that a cell of a spreadsheet holds
#: How such a table begins.
CSV_HEAD: Final = ",".join(COLUMNS[:3]).encode()
Row = dict[str, Any]


def export_csv_table(
    database: AeroDatabase, check_cases: Sequence[CheckCase] | None = None
) -> bytes:
    """Return `database` as one CSV table.

    check_cases : written as rows; by default 25 cases made from the database.

    Numbers are in SI units and radians, as `conventions` says.
    """
    contents = to_contents(database, _KIND, check_cases)
    arguments = _argument_columns(database)
    named = dict.fromkeys(name for names in arguments.values() for name in names)
    columns = [*COLUMNS[:7], *named, *COLUMNS[7:]]
    contents.manifest["columns"] = arguments
    text = json.dumps(contents.manifest, ensure_ascii=True)  # one line
    pieces = [text[k : k + _PIECE] for k in range(0, len(text), _PIECE)]
    rows: list[Row] = [{"kind": "term", **entry} for entry in contents.terms]
    rows += [{"kind": "variable", **entry} for entry in contents.variables]
    for name, (axes, values) in contents.tables.items():
        mesh = np.column_stack([x.ravel() for x in np.meshgrid(*axes, indexing="ij")]).tolist()
        for node, value in zip(mesh, values.ravel().tolist(), strict=True):
            point = dict(zip(arguments[name], node, strict=True))
            rows.append({"kind": "node", "name": name, **point, "value": value})
    for k, numbers in enumerate(contents.increments):
        entry = contents.manifest["database"]["increments"][k]
        rows += _increment_rows({"name": str(k + 1), "axis": entry["axis"]}, entry, numbers)
    rows += _case_rows(contents.cases)
    rows = [_with_unit(row, database) for row in rows]
    rows += [{"kind": "manifest", "description": piece} for piece in pieces]
    filled = {name for row in rows for name, value in row.items() if value not in ("", None)}
    columns = [name for name in columns if name in filled or name in COLUMNS[:3]]
    return csv_text(columns, [[row.get(each) for each in columns] for row in rows]).encode("utf-8")


def from_one_table(data: bytes, where: str) -> AeroDatabase:
    """Return the database of a table of `export_csv_table`; its numbers may have been edited.

    Raises InputError for a damaged table, for nodes that are missing or repeated, and as
    `from_contents` does.
    """
    try:
        header, cells = csv_rows(data.decode("utf-8-sig"), where)
        by_kind: dict[str, list[Row]] = {}
        for each in cells:
            row = {"unit": "", **dict(zip(header, map(from_text, each), strict=True))}
            by_kind.setdefault(row["kind"], []).append(row)
        pieces = [row["description"] for row in by_kind.get("manifest", [])]
        manifest = parse_manifest("".join(pieces), where)
        contents = Contents(
            manifest,
            [{key: row[key] for key in TERM_TEXTS} for row in by_kind.get("term", [])],
            [{key: row[key] for key in VARIABLE_TEXTS} for row in by_kind.get("variable", [])],
            _tables(manifest["columns"], by_kind.get("node", []), where),
            [
                _increment(by_kind, str(k + 1), entry, where)
                for k, entry in enumerate(manifest["database"]["increments"])
            ],
            _cases(by_kind, where),
        )
    except (AttributeError, KeyError, TypeError, UnicodeDecodeError) as error:
        raise InputError(
            f"the rows do not match the manifest ({error!r})", where, "export the database again"
        ) from error
    return from_contents(contents, _KIND, where)


def _with_unit(row: Row, database: AeroDatabase) -> Row:
    """A row with the unit of its numbers, where they are those of a channel."""
    name = row.get("expression", "")
    if row["kind"] not in ("check input", "envelope") or name in database.free_inputs:
        return row
    try:
        return {**row, "unit": channel(name).unit}
    except UnknownNameError:
        return row  # of a formula


def _argument_columns(database: AeroDatabase) -> dict[str, list[str]]:
    """Columns of the arguments of each table: label and unit; distinct within a table."""
    units, columns = argument_units(database), dict[str, list[str]]()
    for name in database.tables:
        taken: list[str] = []
        for label, unit in zip(database.tables[name].arguments, units[name], strict=True):
            column = f"{label} [{unit}]" if unit else label
            while column in (*COLUMNS, *taken):
                column += "'"
            taken.append(column)
        columns[name] = taken
    return columns


def _increment_rows(which: Row, entry: Row, numbers: IncrementNumbers) -> Iterable[Row]:
    errors, names = np.sqrt(np.diag(numbers.covariance)).tolist(), entry["regressors"]
    for k, (name, estimate) in enumerate(zip(names, numbers.estimates.tolist(), strict=True)):
        known = {"expression": name, "value": estimate, "standard error": errors[k]}
        yield {"kind": "increment", **which, **known}
    for name, line in zip(names, numbers.covariance.tolist(), strict=True):
        for other, value in zip(names, line, strict=True):
            yield {
                "kind": "covariance",
                **which,
                "expression": name,
                "other": other,
                "value": value,
            }
    for name, bounds in zip(entry["envelope"], numbers.envelope.tolist(), strict=True):
        limits = dict(zip(ENVELOPE, bounds, strict=True))
        yield {"kind": "envelope", **which, "expression": name, **limits}


def _case_rows(cases: CaseNumbers) -> Iterable[Row]:
    for kind, names, table in (
        ("check input", cases.names, cases.inputs),
        ("check output", cases.axes, cases.coefficients),
    ):
        for k, line in enumerate(table.tolist(), start=1):
            for name, value in zip(names, line, strict=True):
                yield {"kind": kind, "name": str(k), "expression": name, "value": value}


def _tables(
    columns: dict[str, list[str]], rows: Sequence[Row], where: str
) -> dict[str, tuple[list[Array], Array]]:
    nodes: dict[str, list[list[str]]] = {name: [] for name in columns}
    for row in rows:
        nodes[row["name"]].append([row[each] for each in (*columns[row["name"]], "value")])
    tables = {}
    for name, cells in nodes.items():
        place = f"{where}: table {name}"
        tables[name] = grid_of(as_numbers(cells, len(columns[name]) + 1, place), place)
    return tables


def _increment(
    by_kind: dict[str, list[Row]], number: str, entry: Row, where: str
) -> IncrementNumbers:
    place, k = f"{where}: increment {number}", len(entry["regressors"])

    def numbers(kind: str, columns: Sequence[str]) -> Array:
        rows = [row for row in by_kind.get(kind, []) if row["name"] == number]
        return as_numbers([[row[each] for each in columns] for row in rows], len(columns), place)

    estimates, covariance = numbers("increment", ["value"]), numbers("covariance", ["value"])
    if len(estimates) != k or len(covariance) != k * k:
        raise InputError("its rows are incomplete", place, "export the database again")
    return IncrementNumbers(
        estimates[:, 0], covariance.reshape(k, k), numbers("envelope", ENVELOPE)
    )


def _cases(by_kind: dict[str, list[Row]], where: str) -> CaseNumbers:
    """The check cases; none if their rows were removed."""
    place = f"{where}: check cases"

    def block(kind: str) -> tuple[tuple[str, ...], Array]:
        rows = by_kind.get(kind, [])
        names = tuple(dict.fromkeys(row["expression"] for row in rows))
        values = as_numbers([[row["value"]] for row in rows], 1, place)
        if len(rows) % max(len(names), 1):
            raise InputError("they are incomplete", place, "export the database again")
        return names, values.reshape(-1, len(names)) if names else np.empty((0, 0))

    (names, inputs), (axes, coefficients) = block("check input"), block("check output")
    if not axes:
        return CaseNumbers((), np.empty((0, 0)), np.empty((0, 6)))
    if not names:
        inputs = np.empty((len(coefficients), 0))  # a database without inputs
    return CaseNumbers(names, inputs, coefficients, case_axes(axes, place))
