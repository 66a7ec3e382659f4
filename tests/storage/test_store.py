"""Stored flights: exact round trip, identical bytes when written twice, and never half a file."""

import hashlib
import json
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from aerodb.errors import InputError, UnknownNameError
from aerodb.flight import Flight
from aerodb.nomenclature import FLAGS, channel
from aerodb.recording import Damage, Recording, Topic
from aerodb.storage.files import topics as stored_topics
from aerodb.storage.files.flights import (
    open_recording,
    read_flight,
    read_recording,
    read_results,
    write_flight,
    write_results,
    write_topics,
)
from aerodb.storage.workspace import Workspace, write_atomically
from tests.support.paths import ROOT

DAMAGE = (
    Damage("lost_tail", "4711 bytes after the last record", bytes_lost=4711),
    Damage("dropout", "12 ms", "imu", 1.5, 1.512),
)
HOSTILE_NAMES = [
    "",
    "time",
    "../../etc/passwd",
    "Robert'); DROP TABLE flights;--",
    "a.b[0]",
    "käse",
    "\ud800",
    "x" * 5000,
    "field 8",
]


def a_flight() -> Flight:
    n, rng = 1000, np.random.default_rng(7)
    values = {name: rng.normal(size=n) for name in ("alpha", "q", "az", "delta_elevator")}
    values["alpha"][[3, 5, 8]] = np.nan, np.inf, -0.0
    flags = {"alpha": np.zeros(n, np.uint8), "flight": np.zeros(n, np.uint8)}
    flags["alpha"][3] = FLAGS["gap"] | FLAGS["wild_point"]
    flags["flight"][:10] = FLAGS["on_ground"]
    return Flight(
        id="f1",
        vehicle="twin-otter",
        time=np.arange(n) * 0.02 + 17.3,
        channels=values,
        flags=flags,
        missing=("beta", "thrust"),
        notes=("CG assumed at 25 % chord", "Nüchtern: \ud800"),
        damage=DAMAGE,
        start_utc=datetime(2026, 3, 4, 5, 6, 7, 891011, UTC),
        log_sha256="ab" * 32,
        mapping="sidpac_fdata",
    )


def a_recording() -> Recording:
    n = 5000
    microseconds = np.cumsum(np.random.default_rng(1).integers(900, 1100, n)).astype(np.uint64)
    structured = np.zeros(n, dtype=[("x", "<f4"), ("y", "<i2"), ("ok", "?")])
    structured["x"] = np.random.default_rng(2).normal(size=n)
    imu = {
        "timestamp_sample": microseconds,
        "x": structured["x"],
        "y": structured["y"],
        "ok": structured["ok"],
        "big_endian": np.arange(n, dtype=">f8"),
        "half": np.arange(n).astype(np.float16),
        "mode": np.array(["AUTO", "MANUAL"])[np.arange(n) % 2],
        "remark": np.array(["", "zu schnell"], dtype=object)[np.arange(n) % 2],
        "raw": np.array([b"ab", b"c"])[np.arange(n) % 2],
    }
    hostile = {name: np.full(3, k, np.int64) for k, name in enumerate(HOSTILE_NAMES)}
    topics = {
        "imu": Topic("imu", microseconds / 1e6, imu, {"x": "m/s^2"}),
        "gps.1": Topic("gps.1", microseconds * 1e-6, {"lat": microseconds.astype(float)}),
        "../../outside": Topic(
            "../../outside", np.array([0.1, np.nan, 0.3]), hostile, {"": "deg", "\ud800": "m"}
        ),
        "empty": Topic(
            "empty", np.empty(0), {"a": np.empty(0, np.float32), "b": np.empty(0, "<U3")}
        ),
        "bare": Topic("bare", np.array([1.0 / 3.0]), {}),
    }
    metadata = {"uuid": 2**63 + 11, "nan": float("nan"), "name": "\x00quoted'\""}
    return Recording(
        "log.ulg",
        "ulog",
        "cd" * 32,
        12345,
        topics,
        metadata,
        DAMAGE,
        datetime(2026, 1, 2, tzinfo=UTC),
        "px4",
    )


def same_bits(a: np.ndarray, b: np.ndarray) -> bool:
    return (
        a.dtype == b.dtype
        and a.shape == b.shape
        and (a.tolist() == b.tolist() if a.dtype == object else a.tobytes() == b.tobytes())
    )


def assert_same(a: Mapping[str, np.ndarray], b: Mapping[str, np.ndarray]) -> None:
    assert list(a) == list(b)
    assert [name for name in a if not same_bits(a[name], b[name])] == []


def test_a_flight_comes_back_bit_for_bit(tmp_path: Path) -> None:
    flight = a_flight()
    write_flight(tmp_path / "f.parquet", flight)
    read = read_flight(tmp_path / "f.parquet")
    assert_same({"time": flight.time, **flight.channels}, {"time": read.time, **read.channels})
    assert_same(flight.flags, read.flags)
    plain = {"time": np.empty(0), "channels": {}, "flags": {}}
    assert replace(read, **plain).__dict__.keys() == replace(flight, **plain).__dict__.keys()
    for name in set(flight.__dict__) - set(plain):
        assert getattr(read, name) == getattr(flight, name), name


@settings(
    max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(values=hnp.arrays(np.float64, st.integers(2, 40), elements=st.floats(allow_nan=True)))
def test_any_float_survives(tmp_path: Path, values: np.ndarray) -> None:
    flight = Flight("f", "v", np.arange(len(values)) * 0.1, {"p": values})
    write_flight(tmp_path / "f.parquet", flight)
    assert same_bits(read_flight(tmp_path / "f.parquet")["p"], values)


def test_named_channels_bring_their_flags(tmp_path: Path) -> None:
    write_flight(tmp_path / "f.parquet", a_flight())
    read = read_flight(tmp_path / "f.parquet", ["q"])
    assert (list(read.channels), list(read.flags)) == (["q"], ["flight"])
    assert list(read_flight(tmp_path / "f.parquet", ["az", "alpha"]).flags) == ["alpha", "flight"]
    with pytest.raises(UnknownNameError, match="did you mean 'alpha'"):
        read_flight(tmp_path / "f.parquet", ["alhpa"])


def test_a_stored_file_explains_itself_and_has_the_chosen_encodings(tmp_path: Path) -> None:
    write_flight(tmp_path / "f.parquet", a_flight())
    file = pq.ParquetFile(tmp_path / "f.parquet")
    for field in file.schema_arrow:
        assert field.metadata[b"unit"].decode() == channel(field.name).unit
        assert field.metadata[b"description"].decode() == channel(field.name).description
    group = file.metadata.row_group(0)
    stored = {group.column(k).path_in_schema: group.column(k) for k in range(group.num_columns)}
    assert {c.compression for c in stored.values()} == {"ZSTD"}
    assert "BYTE_STREAM_SPLIT" in stored["alpha"].encodings
    assert not any("DICTIONARY" in e for c in stored.values() for e in c.encodings)
    assert json.loads(file.schema_arrow.metadata[b"aerodb"])["log_sha256"] == "ab" * 32


def store_recording(folder: Path, recording: Recording) -> None:
    write_atomically(folder, lambda temporary: write_topics(temporary, recording))


def test_timestamps_are_stored_as_differences(tmp_path: Path) -> None:
    store_recording(tmp_path / "r", a_recording())
    group = pq.ParquetFile(tmp_path / "r" / "0000.parquet").metadata.row_group(0)
    stored = {group.column(k).path_in_schema: group.column(k) for k in range(group.num_columns)}
    for name in ("time", "timestamp_sample"):
        assert (stored[name].physical_type, "DELTA_BINARY_PACKED" in stored[name].encodings) == (
            "INT64",
            True,
        )
        assert stored[name].total_compressed_size < 0.4 * 8 * 5000


def test_the_same_flight_gives_the_same_bytes_in_another_process(tmp_path: Path) -> None:
    write_flight(tmp_path / "a.parquet", a_flight())
    code = (
        "import sys, pathlib, tests.storage.test_store as t;"
        " t.write_flight(pathlib.Path(sys.argv[1]), t.a_flight())"
    )
    here = ROOT
    subprocess.run(
        [sys.executable, "-c", code, str(tmp_path / "b.parquet")], check=True, cwd=here, timeout=600
    )
    a, b = ((tmp_path / f"{name}.parquet").read_bytes() for name in "ab")
    assert hashlib.sha256(a).digest() == hashlib.sha256(b).digest()


def test_a_recording_comes_back_with_types_order_and_hostile_names(tmp_path: Path) -> None:
    recording = a_recording()
    store_recording(tmp_path / "r", recording)
    assert sorted(p.name for p in (tmp_path / "r").iterdir()) == [
        *(f"000{k}.parquet" for k in range(5)),
        "recording.json",
    ]
    assert [p.name for p in tmp_path.iterdir()] == ["r"]
    read = read_recording(tmp_path / "r")
    assert list(read.topics) == list(recording.topics)
    for name, topic in recording.topics.items():
        assert same_bits(read.topics[name].time, topic.time), name
        assert_same(topic.fields, read.topics[name].fields)
        assert (read.topics[name].name, read.topics[name].units) == (topic.name, topic.units)
    assert list(read.metadata) == list(recording.metadata)
    assert read.metadata["uuid"] == 2**63 + 11
    assert np.isnan(read.metadata["nan"])
    for name in ("source", "format", "sha256", "size", "damage", "start_utc", "layout"):
        assert getattr(read, name) == getattr(recording, name)
    assert list(read_recording(tmp_path / "r", ["gps.1"]).topics) == ["gps.1"]
    with pytest.raises(UnknownNameError, match="did you mean 'imu'"):
        read_recording(tmp_path / "r", ["imv"])


def test_all_columns_of_a_topic_take_one_look_into_its_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fields = {f"c{k}": np.array([k, k + 0.5]) for k in range(300)}
    topic = Topic("t", np.array([0.0, 0.1]), fields)
    store_recording(tmp_path / "r", Recording("", "tabular", "00" * 32, 0, {"t": topic}))
    stored = open_recording(tmp_path / "r").topics["t"].fields
    assert np.array_equal(stored["c7"], fields["c7"])
    looks: list[object] = []
    read = stored_topics.read_columns

    def counted(*given: Any) -> Any:
        looks.append(given)
        return read(*given)

    monkeypatch.setattr(stored_topics, "read_columns", counted)
    for _ in range(2):
        found = {name: values.tolist() for name, values in stored.items()}
        assert found == {name: values.tolist() for name, values in fields.items()}
    assert len(looks) == 1


def test_topics_longer_than_a_row_group(tmp_path: Path) -> None:
    n = (1 << 17) + 3
    words = np.array(["A", "B", "C"])[np.arange(n) * 3 // n]
    topic = Topic("t", np.arange(n) / 1e6, {"word": words, "value": np.arange(n, dtype=np.float32)})
    store_recording(tmp_path / "r", Recording("", "ulog", "00" * 32, 0, {"t": topic}))
    read = read_recording(tmp_path / "r").topics["t"]
    assert pq.ParquetFile(tmp_path / "r" / "0000.parquet").num_row_groups == 2
    assert_same({"time": topic.time, **topic.fields}, {"time": read.time, **read.fields})


def test_a_recording_with_values_that_no_column_holds_is_refused(tmp_path: Path) -> None:
    for values in (np.zeros(1, complex), np.array([{}]), np.array(["\ud800"])):
        topic = Topic("t", np.zeros(1), {"x": values})
        with pytest.raises(InputError, match="x: "):
            store_recording(tmp_path / "r", Recording("", "tabular", "00" * 32, 0, {"t": topic}))
    with pytest.raises(ValueError, match="shape"):
        store_recording(
            tmp_path / "r",
            Recording(
                "", "ulog", "00" * 32, 0, {"t": Topic("t", np.zeros(2), {"x": np.zeros((2, 2))})}
            ),
        )
    assert list(tmp_path.iterdir()) == []


def test_results_in_long_form(tmp_path: Path) -> None:
    axis = np.repeat(["CX", "Cm"], 50)
    table = {
        "time": np.tile(np.arange(50.0), 2),
        "axis": axis,
        "residual": np.linspace(0, 1, 100),
        "usable": axis == "CX",
    }
    write_results(tmp_path / "r.parquet", table, {"version": "ab" * 32, "rms": {"CX": 0.1}})
    read, metadata = read_results(tmp_path / "r.parquet")
    assert_same(table, read)
    assert metadata == {"version": "ab" * 32, "rms": {"CX": 0.1}}
    assert list(read_results(tmp_path / "r.parquet", ["residual"])[0]) == ["residual"]
    assert (
        pq.read_schema(tmp_path / "r.parquet").field("residual").metadata[b"description"]
        == b"measured - predicted"
    )


def test_what_is_not_in_the_glossary_is_not_stored(tmp_path: Path) -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'residual'"):
        write_results(tmp_path / "r.parquet", {"residuum": np.zeros(3)}, {})
    channels = {"alpha": np.zeros(3)}
    flight = Flight("f", "v", np.arange(3.0), channels)
    channels["aoa_sensor_2"] = np.zeros(3)
    with pytest.raises(UnknownNameError, match="aoa_sensor_2"):
        write_flight(tmp_path / "f.parquet", flight)
    with pytest.raises(ValueError, match="shape"):
        write_results(tmp_path / "r.parquet", {"time": np.zeros(3), "residual": np.zeros(4)}, {})
    assert list(tmp_path.iterdir()) == []


def test_files_that_are_absent_damaged_or_of_another_kind_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "f.parquet"
    with pytest.raises(InputError, match="missing"):
        read_flight(path)
    write_flight(path, a_flight())
    with pytest.raises(InputError, match="not a stored result"):
        read_results(path)
    content = path.read_bytes()
    rng = np.random.default_rng(3)
    for size in rng.integers(0, len(content) - 1, 20):
        path.write_bytes(content[:size])
        with pytest.raises(InputError, match="cannot be read"):
            read_flight(path)
    with pytest.raises(InputError, match="no stored recording"):
        read_recording(tmp_path)


def test_an_error_or_an_interrupt_while_writing_leaves_nothing_and_the_old_file_stands(
    tmp_path: Path,
) -> None:
    path = tmp_path / "f.parquet"
    path.write_bytes(b"old")
    for error in (OSError("disk full"), KeyboardInterrupt()):

        def fail(temporary: Path, error: BaseException = error) -> None:
            temporary.write_bytes(b"half")
            raise error

        with pytest.raises(type(error)):
            write_atomically(path, fail)
    assert ([p.name for p in tmp_path.iterdir()], path.read_bytes()) == (["f.parquet"], b"old")
    write_atomically(path, lambda temporary: temporary.write_bytes(b"new") and None)
    assert ([p.name for p in tmp_path.iterdir()], path.read_bytes()) == (["f.parquet"], b"new")


def test_a_recording_replaces_the_one_before_it_as_a_whole(tmp_path: Path) -> None:
    store_recording(tmp_path / "r", a_recording())
    store_recording(tmp_path / "r", Recording("b", "ulog", "00" * 32, 0, {}))
    assert [p.name for p in (tmp_path / "r").iterdir()] == ["recording.json"]
    assert [p.name for p in tmp_path.iterdir()] == ["r"]


def test_a_workspace_can_be_opened_again_and_moved(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no workspace here"):
        Workspace.open(tmp_path / "w", create=False)
    workspace = Workspace.open(tmp_path / "w")
    path = workspace.result_path("ab" * 32)
    assert workspace.resolve(workspace.relative(path)) == path
    (tmp_path / "w").rename(tmp_path / "moved")
    assert (
        Workspace.open(tmp_path / "moved").resolve("results/ab")
        == tmp_path / "moved" / "results" / "ab"
    )
    for outside in ("../x", "/etc/passwd", "results/../../x", ""):
        with pytest.raises(ValueError, match="inside the workspace"):
            workspace.resolve(outside)
    for key in ("../../x", "AB" * 32, "ab" * 32 + "\n"):
        with pytest.raises(ValueError, match="sha256"):
            workspace.flight_path(key)
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="cannot be used as a workspace"):
        Workspace.open(tmp_path / "file")


def test_quarantine_copies_a_users_log_and_takes_one_from_the_inbox(tmp_path: Path) -> None:
    workspace = Workspace.open(tmp_path / "w")
    sha = hashlib.sha256(b"broken").hexdigest()
    mine = tmp_path / "..;rm -rf.ULG"
    mine.write_bytes(b"broken")
    held = workspace.quarantine(mine, sha, "no topic could be read")
    assert (held.name, held.read_bytes(), mine.exists()) == ("log.ulg", b"broken", True)
    waiting = workspace.inbox / "glider" / "a.bin"
    waiting.parent.mkdir()
    waiting.write_bytes(b"broken")
    assert workspace.quarantine(waiting, sha, "again") == held
    assert not waiting.exists()
    assert sorted(p.name for p in held.parent.iterdir()) == ["log.ulg", "reason.json"]
    note = json.loads((held.parent / "reason.json").read_text())
    assert (note["reason"], note["name"], note["size"]) == ("again", "a.bin", 6)


def test_quarantine_of_a_link_in_the_inbox_leaves_its_target_alone(tmp_path: Path) -> None:
    workspace = Workspace.open(tmp_path / "w")
    target = tmp_path / "target.ulg"
    target.write_bytes(b"broken")
    link = workspace.inbox / "link.ulg"
    link.symlink_to(target)
    workspace.quarantine(link, hashlib.sha256(b"broken").hexdigest(), "a link")
    assert (link.is_symlink(), target.read_bytes()) == (False, b"broken")


def test_quarantine_refuses_a_file_that_changed(tmp_path: Path) -> None:
    workspace = Workspace.open(tmp_path / "w")
    log = workspace.inbox / "growing.ulg"
    log.write_bytes(b"more bytes than were hashed")
    with pytest.raises(InputError, match="changed while it was read"):
        workspace.quarantine(log, "00" * 32, "incomplete")
    assert log.exists()


def test_a_flipped_bit_is_an_error_and_never_another_number(tmp_path: Path) -> None:
    flight, path = a_flight(), tmp_path / "f.parquet"
    write_flight(path, flight)
    content, rng, refused = path.read_bytes(), np.random.default_rng(11), 0
    for position in rng.integers(0, len(content), 300):
        flipped = bytearray(content)
        flipped[position] ^= 1 << int(rng.integers(8))
        path.write_bytes(flipped)
        try:
            read = read_flight(path)
        except InputError:
            refused += 1
        else:
            assert_same(
                {"time": flight.time, **flight.channels}, {"time": read.time, **read.channels}
            )
            assert (read.id, read.notes, read.damage) == (flight.id, flight.notes, flight.damage)
    assert refused > 200
