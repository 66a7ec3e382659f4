"""CSV: a ZIP of plain CSV files, one per table, with a manifest. Every spreadsheet opens them.

One file per kind of thing is what people edit and compare; `one_table` writes the same content as
one table for programs. The archive has:

- ``tables/<name>.csv``: a row per node, one column per argument, then ``value``; rows may be in any
  order;
- ``terms.csv``, ``variables.csv``: how tables become coefficients; ``check_cases.csv``: inputs and
  coefficients;
- ``increments/<n>_<axis>.csv``: estimate and covariance per regressor, and ``..._envelope.csv``;
- ``manifest.json``: everything else, with axes, signs, units and moment reference in words.

Floats are written in their shortest form that reads back exactly. A text that a spreadsheet would
take for a formula is written after an apostrophe.
"""

import io
import zipfile
from codecs import BOM_UTF8
from collections.abc import Sequence
from typing import Final

import numpy as np

from aerodb.errors import InputError
from aerodb.exchange.arrays.contents import (
    ENVELOPE,
    MAX_BYTES,
    TERM_TEXTS,
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
from aerodb.exchange.arrays.csv_texts import as_numbers, csv_rows, csv_text, from_text, grid_of
from aerodb.exchange.arrays.one_table import CSV_HEAD, from_one_table
from aerodb.nomenclature import AXES
from aerodb.support import Array
from aerodb.tables import AeroDatabase, CheckCase

MAX_FILES: Final = 10_000
_KIND: Final = "CSV"
_EPOCH: Final = (1980, 1, 1, 0, 0, 0)  # equal databases give equal bytes


def export_csv(database: AeroDatabase, check_cases: Sequence[CheckCase] | None = None) -> bytes:
    """Return `database` as a ZIP of CSV files.

    check_cases : written to the archive; by default 25 cases made from the database.

    Numbers are in SI units and radians, as `conventions` says.
    """
    contents = to_contents(database, _KIND, check_cases)
    files = {
        "manifest.json": contents.manifest_text,
        "terms.csv": csv_text(
            TERM_TEXTS, ([entry[key] for key in TERM_TEXTS] for entry in contents.terms)
        ),
        "variables.csv": csv_text(
            VARIABLE_TEXTS, ([entry[key] for key in VARIABLE_TEXTS] for entry in contents.variables)
        ),
    }
    units = argument_units(database)
    for name, (axes, values) in contents.tables.items():
        arguments = database.tables[name].arguments
        header = [
            f"{label} [{unit}]" if unit else label
            for label, unit in zip(arguments, units[name], strict=True)
        ]
        mesh = [x.ravel() for x in np.meshgrid(*axes, indexing="ij")]
        files[f"tables/{name}.csv"] = csv_text(
            [*header, "value"], np.column_stack([*mesh, values.ravel()]).tolist()
        )
    for k, numbers in enumerate(contents.increments):
        entry, stem = contents.manifest["database"]["increments"][k], _stem(k, contents)
        rows = zip(
            entry["regressors"],
            numbers.estimates.tolist(),
            numbers.covariance.tolist(),
            strict=True,
        )
        header = [
            "regressor",
            "estimate",
            *[f"covariance with {j + 1}" for j in range(len(numbers.estimates))],
        ]
        files[f"{stem}.csv"] = csv_text(header, ([text, value, *row] for text, value, row in rows))
        bounds = zip(entry["envelope"], numbers.envelope.tolist(), strict=True)
        files[f"{stem}_envelope.csv"] = csv_text(
            ["variable", *ENVELOPE], ([name, *row] for name, row in bounds)
        )
    cases = np.hstack([contents.cases.inputs, contents.cases.coefficients]).tolist()
    files["check_cases.csv"] = csv_text([*contents.cases.names, *contents.cases.axes], cases)
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in files.items():
            archive.writestr(
                zipfile.ZipInfo(name, _EPOCH), text.encode("utf-8"), zipfile.ZIP_DEFLATED
            )
    return packed.getvalue()


def import_csv(data: bytes, where: str = "CSV file") -> AeroDatabase:
    """Return the database of a ZIP that `export_csv` wrote, or of one table of `export_csv_table`;
    its tables may have been edited.

    Raises InputError that names the file in the archive: for damaged or too large files, grids with
    missing or repeated nodes, text in place of numbers, and check cases that fail.
    """
    check_size(data, where)
    if data.removeprefix(BOM_UTF8).startswith(CSV_HEAD):
        return from_one_table(data, where)
    files = _unpacked(data, where)
    manifest = parse_manifest(_file(files, "manifest.json", where), where)
    document = manifest.get("database")
    listed = document.get("increments") if isinstance(document, dict) else None
    tables = {
        name.removeprefix("tables/").removesuffix(".csv"): _grid(text, f"{where}: {name}")
        for name, text in files.items()
        if name.startswith("tables/")
    }
    named = _texts(files, "variables.csv", VARIABLE_TEXTS, where)
    terms = _texts(files, "terms.csv", TERM_TEXTS, where)
    contents = Contents(manifest, terms, named, tables, [], _case_table(files, where))
    increments = listed if isinstance(listed, list) else []
    contents.increments.extend(
        _increment(files, _stem(k, contents), entry, where) for k, entry in enumerate(increments)
    )
    return from_contents(contents, _KIND, where)


def _stem(k: int, contents: Contents) -> str:
    entry = contents.manifest["database"]["increments"][k]
    axis = entry.get("axis", "") if isinstance(entry, dict) else ""
    return f"increments/{k + 1:02d}_{axis}"


def _unpacked(data: bytes, where: str) -> dict[str, str]:
    """Texts of the archive's files; at most `MAX_BYTES`, whatever size the archive states."""
    files, left = dict[str, str](), MAX_BYTES
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            members = [info for info in archive.infolist() if not info.is_dir()]
            if len(members) > MAX_FILES:
                raise InputError(f"{len(members)} files", where, f"at most {MAX_FILES}")
            for info in members:
                with archive.open(info) as member:
                    content = member.read(left + 1)
                left -= len(content)
                if left < 0:
                    raise InputError(
                        "its content is too large", where, f"at most {MAX_BYTES} bytes"
                    )
                files[info.filename] = content.decode("utf-8-sig")
    except InputError:
        raise
    except Exception as error:  # damaged bytes make zipfile raise any error
        raise InputError(
            f"not a ZIP of UTF-8 texts: {error}", where, "export the database again as CSV"
        ) from error
    return files


def _file(files: dict[str, str], name: str, where: str) -> str:
    if name not in files:
        raise InputError(
            f"no {name} in the archive", where, "keep all files of the export together"
        )
    return files[name]


def _grid(text: str, where: str) -> tuple[list[Array], Array]:
    """Breakpoints and values of a table from the text of its file."""
    header, rows = csv_rows(text, where)
    if len(header) < 2:
        raise InputError(
            f"{len(header)} column", where, "give one column per argument, then the value"
        )
    return grid_of(as_numbers(rows, len(header), where), where)


def _texts(
    files: dict[str, str], name: str, keys: Sequence[str], where: str
) -> list[dict[str, str]]:
    header, rows = csv_rows(_file(files, name, where), f"{where}: {name}")
    if header != list(keys):
        raise InputError(
            f"columns {', '.join(header)}", f"{where}: {name}", f"they must be {', '.join(keys)}"
        )
    return [dict(zip(keys, map(from_text, row), strict=True)) for row in rows]


def _increment(
    files: dict[str, str], stem: str, entry: dict[str, object], where: str
) -> IncrementNumbers:
    place = f"{where}: {stem}.csv"
    header, rows = csv_rows(_file(files, f"{stem}.csv", where), place)
    regressors = [from_text(row[0]) for row in rows]
    if not isinstance(entry, dict) or entry.get("regressors") != regressors:
        raise InputError(
            "regressors differ from the manifest's",
            place,
            "keep the regressors that were fitted",
        )
    numbers = as_numbers([row[1:] for row in rows], len(header) - 1, place)
    place = f"{where}: {stem}_envelope.csv"
    header, rows = csv_rows(_file(files, f"{stem}_envelope.csv", where), place)
    if [from_text(row[0]) for row in rows] != entry.get("envelope") or header[1:] != list(ENVELOPE):
        raise InputError("variables differ from the manifest's", place, "export the database again")
    return IncrementNumbers(
        numbers[:, 0], numbers[:, 1:], as_numbers([row[1:] for row in rows], 3, place)
    )


def _case_table(files: dict[str, str], where: str) -> CaseNumbers:
    """The check cases; none if the file was removed from the archive."""
    if "check_cases.csv" not in files:
        return CaseNumbers((), np.empty((0, 0)), np.empty((0, 6)))
    place = f"{where}: check_cases.csv"
    header, rows = csv_rows(files["check_cases.csv"], place)
    first = header.index(AXES[0]) if AXES[0] in header else 0
    axes = case_axes(header[first:], place, "the last columns")
    numbers = as_numbers(rows, len(header), place)
    return CaseNumbers(tuple(header[:first]), numbers[:, :first], numbers[:, first:], axes)
