"""Everything that is stored is in the glossary, with its unit; every built-in mapping leads
there."""

from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from aerodb.errors import InputError, UnknownNameError
from aerodb.flows.flight import flight_flow
from aerodb.flows.importing import import_flow
from aerodb.flows.run import run_flow
from aerodb.logs.derivations import METHODS
from aerodb.nomenclature import (
    AXES,
    CHANNELS,
    FLAGS,
    RESULT_COLUMNS,
    axis_description,
    channel,
    is_surface,
)
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.mappings import builtin_mappings
from aerodb.storage.workspace import Workspace
from aerodb.tables.reference import WIND_AXES
from aerodb.units import conversion, quantity
from tests.support import small_glider
from tests.support.small_glider import NAME, channels, write_csv, write_parquet


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two flights, one of them with a gap in a channel, so that there are flags too."""
    folder = tmp_path_factory.mktemp("files")
    (folder / "database.toml").write_text(small_glider.DATABASE)
    gappy = channels(2)
    gappy["delta_elevator"] = np.where(np.arange(300) // 20 == 6, np.nan, gappy["delta_elevator"])
    logs = [write_csv(folder / "a.csv", channels(1)), write_parquet(folder / "b.parquet", gappy)]
    opened = Workspace.open(tmp_path_factory.mktemp("w"))
    with Catalogue.open(opened.catalogue) as catalogue:
        catalogue.add_vehicle(NAME, small_glider.VEHICLE)
    database = {"file": str(folder / "database.toml"), "vehicle": NAME, "bindings": {}}
    run_flow(import_flow, database, opened, "direct")
    outcomes = run_flow(
        flight_flow, {"logs": [str(log) for log in logs], "vehicle": NAME}, opened, "direct"
    )
    assert all(outcome["comparison"]["key"] for outcome in outcomes)
    return opened.root


def _stored(root: Path, folder: str) -> list[Path]:
    return sorted(
        path for path in (root / folder).rglob("*.parquet") if ".topics" not in path.parent.name
    )


def test_every_column_of_a_stored_flight_is_registered_with_its_unit(workspace: Path) -> None:
    files = _stored(workspace, "flights")
    assert len(files) == 2
    names = set()
    for file in files:
        for field in pq.read_schema(file):
            entry = channel(field.name)
            assert field.metadata[b"unit"].decode() == entry.unit, (file, field.name)
            assert field.metadata[b"description"].decode() == entry.description, (file, field.name)
            names.add(field.name)
    assert {"time", "alpha", "rho", "delta_elevator", "flags_delta_elevator"} <= names


def test_every_column_of_a_stored_result_is_registered_with_its_unit(workspace: Path) -> None:
    files = _stored(workspace, "results")
    assert len(files) == 8, "conditioning, consistency, coefficients and comparison of two flights"
    for file in [file for file in files if len(pq.read_schema(file))]:
        for field in pq.read_schema(file):
            entry = (
                RESULT_COLUMNS[field.name] if field.name in RESULT_COLUMNS else channel(field.name)
            )
            assert field.metadata[b"unit"].decode() == entry.unit, (file, field.name)
        for axis in set(pq.read_table(file, columns=["axis"])["axis"].to_pylist()):
            assert axis_description(axis)


def test_stored_topics_say_their_unit_in_words_of_the_log(workspace: Path) -> None:
    topics = sorted((workspace / "flights").rglob("*.topics/*.parquet"))
    assert len(topics) == 2
    assert all(b"unit" in field.metadata for file in topics for field in pq.read_schema(file))


@pytest.mark.parametrize("name", sorted(builtin_mappings()))
def test_every_mapping_leads_to_registered_channels_in_convertible_units(name: str) -> None:
    mapping = builtin_mappings()[name]
    for entry in mapping.channel:
        target = channel(entry.name)
        for source in entry.sources:
            if source.unit is not None and not (entry.command and source.unit in ("", "1", "-")):
                scale, _ = conversion(source.unit, target.unit)
                assert scale != 0.0, (entry.name, source)
    for derived in mapping.derived:
        method = METHODS[derived.method]
        unit = method.input_unit or channel(derived.channels[0]).unit
        assert all(
            conversion(source.unit, unit)[0]
            for source in derived.sources
            if source.unit is not None
        ), derived.channels
        if method.outputs:
            assert {channel(c).unit for c in derived.channels} == {
                channel(o).unit for o in method.outputs
            }
    if mapping.time is not None and mapping.time.unit is not None:
        assert conversion(mapping.time.unit, "s")[0] > 0.0


@pytest.mark.parametrize("name", sorted(CHANNELS) + sorted(RESULT_COLUMNS))
def test_every_entry_says_what_it_is_in_si(name: str) -> None:
    entry = CHANNELS.get(name) or RESULT_COLUMNS[name]
    assert entry.name == name
    assert len(entry.description) > 3
    if entry.unit:
        assert conversion(entry.unit, entry.unit) == (1.0, 0.0)
        derived = {"Pa": "kg/m/s^2", "N": "kg m/s^2", "V": "kg m^2/s^3/A"}
        base = derived.get(entry.unit, entry.unit)
        assert set(base.replace("^2", "").replace("^3", "").replace("/", " ").split()) <= {
            "1",
            "s",
            "m",
            "kg",
            "K",
            "A",
            "rad",
        }


def test_axes_are_values_and_never_columns() -> None:
    assert {len(axis_description(axis)) > 5 for axis in (*AXES, *WIND_AXES)} == {True}
    assert not {name.lower() for name in (*AXES, *WIND_AXES)} & {
        name.lower() for name in (*CHANNELS, *RESULT_COLUMNS)
    }


def test_flags_fit_two_bytes_and_do_not_overlap() -> None:
    assert sum(FLAGS.values()) == np.bitwise_or.reduce(list(FLAGS.values())) < 65536


def test_surfaces_follow_the_rule_and_other_names_are_refused_with_the_nearest() -> None:
    assert channel("delta_spoiler_left").unit == "rad"
    assert channel("flags_delta_spoiler_left").unit == ""
    assert is_surface("delta_elevator")
    for wrong, near in (
        ("alhpa", "alpha"),
        ("Qbar", "qbar"),
        ("Delta_x", "Delta_x"),
        ("flags_none", "flags_none"),
        ("delta_", "delta_"),
    ):
        with pytest.raises(UnknownNameError, match=near):
            channel(wrong)
    with pytest.raises(UnknownNameError, match="did you mean 'Cm'"):
        axis_description("CM")


def test_a_number_beyond_all_floats_is_no_quantity() -> None:
    with pytest.raises(InputError, match="a number of 401 digits is no quantity"):
        quantity(10**400, "s")
