"""CSV, MAT and NetCDF: exact round trips, readable by other programs, safe against damage."""

import csv
import io
import json
import zipfile
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import RegularGridInterpolator
from scipy.io import loadmat, netcdf_file, savemat

from aerodb.errors import InputError
from aerodb.exchange.arrays import contents as parts
from aerodb.exchange.arrays.comma_separated import export_csv, import_csv
from aerodb.exchange.arrays.mat import export_mat, import_mat
from aerodb.exchange.arrays.netcdf import export_netcdf, import_netcdf
from aerodb.exchange.arrays.one_table import export_csv_table
from aerodb.nomenclature import AXES
from aerodb.tables.analysis.check_cases import CheckCase
from aerodb.tables.analysis.consolidation import consolidate
from aerodb.tables.database import AeroDatabase, Term, Variable
from aerodb.tables.expression import parse
from aerodb.tables.reference import ReferenceGeometry
from aerodb.tables.table import Table
from aerodb.tasks.steps.importing import read_database
from tests.support.generated_databases import equal, generated, points

Exporter, Importer = Callable[..., bytes], Callable[..., AeroDatabase]
FORMATS: dict[str, tuple[Exporter, Importer]] = {
    "csv": (export_csv, import_csv),
    "csv table": (export_csv_table, import_csv),
    "mat": (export_mat, import_mat),
    "netcdf": (export_netcdf, import_netcdf),
}
EACH = pytest.mark.parametrize(("export", "read"), FORMATS.values(), ids=FORMATS)


def with_grid() -> AeroDatabase:
    """A generated database whose first table has three arguments with several breakpoints each."""
    rng = np.random.default_rng(8)
    axes = (np.array([-0.1, 0.0, 0.3]), np.array([-0.2, 0.2]), np.array([0.1, 0.2, 0.7, 0.8]))
    table = Table("T0", ("alpha", "beta", "mach"), axes, rng.normal(size=(3, 2, 4)))
    database = generated(8)
    call = next(term for term in database.terms if "T0" in term.expression.tables)
    others = tuple(term for term in database.terms if term is not call)
    term = replace(call, expression=parse("-2*T0(alpha, beta, mach)"))
    return replace(database, tables={**database.tables, "T0": table}, terms=(term, *others))


@EACH
@settings(deadline=None, max_examples=40)
@given(seed=st.integers(0, 2**32 - 1), increments=st.integers(0, 2), folded=st.booleans())
def test_what_is_exported_comes_back_exactly(
    export: Exporter, read: Importer, seed: int, increments: int, folded: bool
) -> None:
    """Every number to the last bit, every text and expression; and equal databases give equal
    bytes."""
    database = generated(seed, increments)
    database = consolidate(database) if folded else database
    again = read(export(database))
    assert equal(again, database)
    assert export(again) == export(database)
    channels = points(database, seed)
    one, other = database.predict(channels), again.predict(channels)
    assert all(np.array_equal(one.coefficients[axis], other.coefficients[axis]) for axis in AXES)


@EACH
def test_files_are_known_by_their_content(export: Exporter, read: Importer) -> None:
    database = with_grid()
    assert equal(read_database(export(database), "database", {}), database)
    with pytest.raises(InputError, match=r"database\.bin"):
        read_database(export(database)[:1000], "database.bin", {})


def test_csv_is_read_by_other_programs() -> None:
    """pandas and scipy rebuild a table from its file; rows may come back in another order and with
    a byte-order mark."""
    database = with_grid()
    archive = zipfile.ZipFile(io.BytesIO(export_csv(database)))
    frame = pd.read_csv(archive.open("tables/T0.csv"))
    assert list(frame.columns) == ["alpha [rad]", "beta [rad]", "mach [1]", "value"]
    cube = frame.set_index(list(frame.columns[:3]))["value"].unstack().unstack().to_numpy()
    table = database.tables["T0"]
    assert np.sort(cube.ravel()).tolist() == np.sort(table.values.ravel()).tolist()
    axes = [np.unique(frame[column]) for column in frame.columns[:3]]
    grid = RegularGridInterpolator(axes, frame["value"].to_numpy().reshape(3, 2, 4))
    x = np.random.default_rng(0).uniform([-0.1, -0.2, 0.1], [0.3, 0.2, 0.8], (50, 3))
    assert grid(x) == pytest.approx(table.evaluate(*x.T.copy()), abs=1e-14)
    shuffled = "\ufeff" + frame.sample(frac=1.0, random_state=1).to_csv(index=False)
    assert equal(
        import_csv(changed_zip(export_csv(database), {"tables/T0.csv": shuffled})), database
    )


def test_one_csv_table_is_what_pandas_reads() -> None:
    """A table of the database, its terms and an increment are rows of one data frame; edited and
    written by pandas, it comes back."""
    database = replace(with_grid(), increments=generated(3, 1).increments)
    frame = pd.read_csv(io.BytesIO(export_csv_table(database)))
    nodes = frame[(frame.kind == "node") & (frame.name == "T0")].dropna(axis="columns")
    assert list(nodes.columns)[2:] == ["alpha [rad]", "beta [rad]", "mach [1]", "value"]
    x = nodes[["alpha [rad]", "beta [rad]", "mach [1]"]].to_numpy()
    table = database.tables["T0"]
    assert table.evaluate(*x.T.copy()).tolist() == nodes["value"].tolist()
    assert frame[frame.kind == "term"]["name"].tolist() == [t.name for t in database.terms]
    increment = database.increments[0]
    found = frame[frame.kind == "increment"]
    assert found["value"].tolist() == increment.estimates.tolist()
    errors = np.sqrt(np.diag(increment.covariance))
    assert found["standard error"].to_numpy() == pytest.approx(errors)
    raw = pd.read_csv(io.BytesIO(export_csv_table(database)), dtype=str, keep_default_na=False)
    shuffled = pd.concat([raw[raw.kind != "node"], raw[raw.kind == "node"].sample(frac=1.0)])
    text = "\ufeff" + shuffled.to_csv(index=False)
    assert equal(import_csv(text.encode()), database)
    raw.loc[raw.kind == "node", "value"] = "0.5"
    with pytest.raises(InputError, match="check values differ"):
        import_csv(raw.to_csv(index=False).encode(), "edited.csv")
    edited = import_csv(raw[~raw.kind.str.startswith("check")].to_csv(index=False).encode())
    assert np.all(edited.tables["T0"].values == 0.5)
    for kind in ("manifest", "covariance", "term"):
        with pytest.raises(InputError):
            import_csv(raw[raw.kind != kind].to_csv(index=False).encode())
    with pytest.raises(InputError, match="T0"):
        import_csv(raw.drop(nodes.index[3]).to_csv(index=False).encode())


@pytest.mark.parametrize(
    "text", ["=cmd|'/C calc'!A1", "@SUM(A1)", "-1+2", "+1", "\t=1", "'=1", "''"]
)
def test_no_text_in_csv_is_a_formula(text: str) -> None:
    """Spreadsheets run what begins with one of ``= + - @``, tab and carriage return."""
    database = with_grid()
    terms = [replace(term, description=text) for term in database.terms]
    database = replace(database, terms=tuple(terms))
    archive = zipfile.ZipFile(io.BytesIO(export_csv(database)))
    for name in archive.namelist():
        if name.endswith(".csv"):
            for row in csv.reader(io.StringIO(archive.read(name).decode(), newline="")):
                for cell in row:
                    assert not cell.startswith(("=", "@", "\t", "\r"))
                    assert not cell.startswith(("+", "-")) or float(cell)
    assert equal(import_csv(export_csv(database)), database)
    rows = list(csv.DictReader(io.StringIO(export_csv_table(database).decode(), newline="")))
    written = [row["description"] for row in rows if row["kind"] == "term"]
    assert written == [f"'{text}"] * len(database.terms)
    assert equal(import_csv(export_csv_table(database)), database)


def test_a_negative_number_as_a_text_is_one_in_csv() -> None:
    database = with_grid()
    terms = [replace(term, description="-2.5e-3") for term in database.terms]
    database = replace(database, terms=tuple(terms))
    rows = list(csv.DictReader(io.StringIO(export_csv_table(database).decode(), newline="")))
    assert {row["description"] for row in rows if row["kind"] == "term"} == {"-2.5e-3"}
    assert equal(import_csv(export_csv_table(database)), database)


def test_mat_is_a_plain_struct() -> None:
    database = with_grid()
    loaded = loadmat(io.BytesIO(export_mat(database)), simplify_cells=True)["aerodb"]
    table = next(entry for entry in loaded["tables"] if entry["name"] == "T0")
    assert table["values"].shape == (3, 2, 4)
    assert np.array_equal(table["values"], database.tables["T0"].values)
    assert [axis.tolist() for axis in table["breakpoints"]] == [
        axis.tolist() for axis in database.tables["T0"].breakpoints
    ]
    assert [term["expression"] for term in loaded["terms"]] == [
        str(term.expression) for term in database.terms
    ]
    assert np.array_equal(loaded["increments"][0]["covariance"], database.increments[0].covariance)
    saved = io.BytesIO()  # as MATLAB saves what it has loaded: another header, no compression
    savemat(
        saved,
        {"aerodb": loadmat(io.BytesIO(export_mat(database)))["aerodb"]},
        long_field_names=True,
    )
    assert equal(import_mat(saved.getvalue()), database)


def test_netcdf_has_coordinates() -> None:
    database = with_grid()
    file = netcdf_file(io.BytesIO(export_netcdf(database)), mmap=False)
    variable = file.variables["table_T0"]
    assert variable.dimensions == ("breakpoints_T0_0", "breakpoints_T0_1", "breakpoints_T0_2")
    assert np.array_equal(variable.data, database.tables["T0"].values)
    for dimension, axis, unit in zip(
        variable.dimensions, database.tables["T0"].breakpoints, (b"rad", b"rad", b"1"), strict=True
    ):
        assert np.array_equal(file.variables[dimension].data, axis)
        assert file.variables[dimension].units == unit
    manifest = json.loads(file.manifest)
    assert manifest["database"]["terms"][0]["expression"] == str(database.terms[0].expression)


@EACH
def test_the_file_says_axes_units_signs_and_moment_reference(
    export: Exporter, read: Importer
) -> None:
    database = with_grid()
    text = parts.to_contents(database, "CSV").manifest_text
    point = ", ".join(f"{x:g}" for x in database.reference.moment_reference)
    for said in (
        "positive nose up",
        "positive down",
        "[rad] angle of attack",
        "SI and radians",
        f"about ({point}) m",
        "a number",
    ):
        assert said in text
    assert isinstance(read(export(database)), AeroDatabase)


def test_units_are_stated_where_they_are_known() -> None:
    """A table asked at alpha in degrees is labelled alpha; its file must not say rad."""
    database = AeroDatabase(
        "degrees",
        ReferenceGeometry(1.0, 1.0, 1.0, (0.0, 0.0, 0.0)),
        {"a": Variable(parse("alpha"))},
        {
            name: Table(
                name, ("alpha", "x"), (np.array([0.0, 9.0]), np.array([1.0])), np.ones((2, 1))
            )
            for name in ("D", "R")
        },
        (Term("d", "CZ", parse("D(57.3*alpha, x)")), Term("r", "CZ", parse("R(a, x)"))),
        free_inputs={"x": "somebody's ratio"},
    )
    archive = zipfile.ZipFile(io.BytesIO(export_csv(database)))
    heads = {
        name: archive.read(f"tables/{name}.csv").decode().splitlines()[0] for name in ("D", "R")
    }
    assert heads == {"D": "alpha,x,value", "R": "alpha [rad],x,value"}
    assert equal(import_csv(export_csv(database)), database)


@EACH
def test_check_cases_travel_along_and_are_verified(export: Exporter, read: Importer) -> None:
    database = with_grid()
    inputs = dict.fromkeys(database.inputs, 0.1)
    good = {axis: float(x[0]) for axis, x in database.predict(inputs).coefficients.items()}
    assert equal(read(export(database, [CheckCase(inputs, good)])), database)
    assert equal(read(export(database, [])), database)
    wrong = {**good, "Cm": good["Cm"] + 1e-6}
    with pytest.raises(
        InputError,
        match=r"here: 1 check values differ: check case 1: Cm is .*\n.*if the change is intended",
    ):
        read(export(database, [CheckCase(inputs, wrong)]), "here")


def test_a_changed_table_is_noticed_and_taken_when_it_is_meant() -> None:
    database = with_grid()
    data = export_csv(database)
    text = zipfile.ZipFile(io.BytesIO(data)).read("tables/T0.csv").decode()
    value = repr(float(database.tables["T0"].values[1, 1, 1]))
    changed = text.replace(value, "0.125")
    assert changed != text
    with pytest.raises(InputError, match="check values differ"):
        import_csv(changed_zip(data, {"tables/T0.csv": changed}))
    taken = import_csv(changed_zip(data, {"tables/T0.csv": changed, "check_cases.csv": None}))
    assert taken.tables["T0"].values[1, 1, 1] == 0.125


def changed_zip(data: bytes, changes: dict[str, str | None]) -> bytes:
    """The archive with files replaced, added, or left out (None)."""
    written = io.BytesIO()
    with (
        zipfile.ZipFile(io.BytesIO(data)) as old,
        zipfile.ZipFile(written, "w", zipfile.ZIP_DEFLATED) as new,
    ):
        files: dict[str, Any] = {name: old.read(name) for name in old.namelist()} | changes
        for name, content in files.items():
            if content is not None:
                new.writestr(name, content)
    return written.getvalue()


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("tables/T0.csv", "alpha,value\n0,1\n0,2\n", "tables/T0.csv: 2 rows for a grid of 1 nodes"),
        (
            "tables/T0.csv",
            "alpha,beta,value\n0,0,1\n0,0,2\n1,1,3\n1,0,4\n",
            "some of them repeated",
        ),
        ("tables/T0.csv", "alpha,value\n0,1\n1,x\n", "could not convert string to float: 'x'"),
        ("tables/T0.csv", "alpha,value\n0,1\n1,nan\n", "numbers that are not finite"),
        ("tables/T0.csv", "alpha,value\n0,1\n1\n", "row 3 has 1 columns, the header 2"),
        ("tables/T0.csv", "", "tables/T0.csv: empty"),
        ("tables/T0.csv", None, "differ: \\['T0'\\]"),
        ("tables/T9.csv", "alpha,value\n0,1\n", "differ: \\['T9'\\]"),
        ("tables/T0.csv", "a,b,c,value\n0,0,0,1\n", "."),
        ("terms.csv", None, "no terms.csv in the archive"),
        ("terms.csv", "name,axis\n", "they must be name, axis, expression, description"),
        (
            "terms.csv",
            "name,axis,expression,description\nx,CZ,__import__('os'),\n",
            "term x: unexpected ''' at position 12",
        ),
        ("manifest.json", "{", "the manifest is not JSON"),
        ("manifest.json", "[" * 100_000, "the manifest is not JSON"),
        ("manifest.json", "[1]", "not a JSON object"),
        ("manifest.json", '{"file": "aerodb MAT", "version": 1}', "'aerodb MAT', version 1"),
        ("manifest.json", '{"file": "aerodb CSV", "version": 1}', "holds no database"),
        (
            "manifest.json",
            '{"file": "aerodb CSV", "version": 1, "database": {"tables": {}, "increments": 3}}',
            "differ",
        ),
        ("check_cases.csv", "alpha,CX\n1,2\n", "last columns are not CX CY CZ"),
        ("check_cases.csv", "CX,CY,CZ,Cl,Cm,Cn\n1,2,3,4,5,6\n", "channels missing"),
    ],
)
def test_faulty_csv_is_refused_with_the_file_that_is_wrong(
    name: str, content: str | None, message: str
) -> None:
    with pytest.raises(InputError, match=message) as refusal:
        import_csv(changed_zip(export_csv(with_grid()), {name: content}), "my.zip")
    assert "my.zip" in str(refusal.value)


def test_increments_in_csv_stay_with_their_regressors() -> None:
    data = export_csv(with_grid())
    name = next(
        n
        for n in zipfile.ZipFile(io.BytesIO(data)).namelist()
        if n.startswith("increments/") and "envelope" not in n
    )
    text = zipfile.ZipFile(io.BytesIO(data)).read(name).decode()
    with pytest.raises(InputError, match="regressors differ"):
        import_csv(changed_zip(data, {name: text.replace("\n1,", "\n2,", 1)}))
    with pytest.raises(InputError, match="no increments/01"):
        import_csv(changed_zip(data, {name: None}))
    envelope = name.replace(".csv", "_envelope.csv")
    with pytest.raises(InputError, match="variables differ"):
        import_csv(changed_zip(data, {envelope: "variable,low,high,cell\nalpha,0,1,1\n"}))


@EACH
def test_other_kinds_of_file_and_cut_ones_are_refused(export: Exporter, read: Importer) -> None:
    data = export(with_grid())
    for bad in (
        b"",
        b"hello",
        data[: len(data) // 2],
        data[:130],
        b"\x00" * 500,
        export_csv(with_grid())[:-40],
    ):
        with pytest.raises(InputError, match="here"):
            read(bad, "here")
    for other, reader in FORMATS.values():
        if reader is not read:
            with pytest.raises(InputError, match="here"):
                read(other(with_grid()), "here")


@EACH
@settings(deadline=None, max_examples=150)
@given(seed=st.integers(0, 2**32 - 1))
def test_damaged_bytes_are_refused_or_harmless(export: Exporter, read: Importer, seed: int) -> None:
    """Eight bytes overwritten anywhere: an InputError, or a database (damage may hit a description
    or a spare byte)."""
    rng = np.random.default_rng(seed)
    data = bytearray(export(generated(5, 1)))
    for position in rng.integers(0, len(data), 8):
        data[position] = rng.integers(0, 256)
    try:
        found = read(bytes(data))
    except InputError:
        return
    assert isinstance(found, AeroDatabase)


@pytest.mark.parametrize("name", ["csv", "mat"])
def test_small_files_that_unpack_to_huge_ones_are_refused(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in ("comma_separated", "mat"):
        monkeypatch.setattr(f"aerodb.exchange.arrays.{module}.MAX_BYTES", 3_000_000)
    if name == "csv":
        bomb = changed_zip(export_csv(with_grid()), {"tables/T0.csv": "0" * 30_000_000})
    else:
        written = io.BytesIO()
        savemat(written, {"aerodb": {"manifest": "0" * 30_000_000}}, do_compression=True)
        bomb = written.getvalue()
    assert len(bomb) < 200_000
    with pytest.raises(InputError, match="content is too large"):
        FORMATS[name][1](bomb)


def test_netcdf_variables_that_share_bytes_are_refused() -> None:
    """A header may point a thousand variables at the same megabytes."""
    written = io.BytesIO()
    file: Any = netcdf_file(written, "w", version=2)
    file.createDimension("x", 1000)
    for k in range(50):
        file.createVariable(f"v{k:02d}", "d", ("x",))[:] = float(k)
    file.flush()
    data = bytearray(written.getvalue())
    begin = data.find(b"v00\x00")
    names = [data.find(f"v{k:02d}\0".encode(), begin) for k in range(50)]
    starts = [int.from_bytes(data[name + 28 : name + 36], "big") for name in names]
    assert set(np.diff(starts)) == {8000}, "where the data of each variable begins"
    for name in names:
        data[name + 28 : name + 36] = starts[0].to_bytes(8, "big")
    data = data[: starts[0] + 8000]
    with pytest.raises(InputError, match="variables overlap"):
        import_netcdf(bytes(data))


@EACH
def test_files_beyond_the_limit_and_texts_that_no_format_holds(
    export: Exporter, read: Importer, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(InputError, match="NUL"):
        export(replace(with_grid(), description="a\0b"))
    data = export(with_grid())
    monkeypatch.setattr(parts, "MAX_BYTES", 1000)
    with pytest.raises(InputError, match="at most 1000"):
        read(data)
