"""Hostile logs: refused with a remedy, whatever they do to the process that parses them, and
nothing else changed."""

import os
import signal
import threading
import time
import zlib
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from aerodb.errors import InputError
from aerodb.flows.flight import flight_flow
from aerodb.flows.run import run_flow
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.limits import Limits
from aerodb.storage.upkeep.verification import verify
from aerodb.storage.workspace_settings import SettingsError, load_settings
from aerodb.storage.writers.ulog import write_ulog
from aerodb.tasks.workers import parsed_log
from tests.faults.test_fuzz_readers import flip, scramble
from tests.storage.readers.test_mcap import write_flight
from tests.storage.readers.test_ulog import example_topics
from tests.support.glider_runs import prepared, rows
from tests.support.small_glider import (
    NAME,
    channels,
    state_of,
    write_csv,
    write_files,
    write_parquet,
)

pytestmark = pytest.mark.skipif(os.name == "nt", reason="no fork, no limits")
LIMITS = Limits(memory=300_000_000, processor=60.0, wall=600.0)


def refusal(path: Path, limits: Limits = LIMITS) -> InputError:
    """How a log is refused; nothing of it stays."""
    place = path.parent / "topics"
    with pytest.raises(InputError) as caught, parsed_log(path, place, limits):
        pass
    assert not list(path.parent.glob(".topics.*"))
    assert not place.exists()
    assert caught.value.where
    assert caught.value.remedy
    return caught.value


# What is declared, and what is nested


def growing_parquet(path: Path) -> None:
    """1.2e8 equal numbers: a gigabyte in a few kilobytes."""
    column = pa.DictionaryArray.from_arrays(
        pa.array(np.zeros(10_000_000, np.int8)), pa.array([1.5])
    )
    with pq.ParquetWriter(path, pa.schema([("x", column.type)]), compression="zstd") as writer:
        for _ in range(12):
            writer.write_table(pa.table([column], names=["x"]), row_group_size=10_000_000)


def declared_hdf5(path: Path) -> None:
    """Ten gigabytes declared, none there."""
    with h5py.File(path, "w", userblock_size=512) as file:
        file.create_dataset("x", shape=(1_300_000_000,), dtype="f8", chunks=(1_000_000,))


_MAT = b"MATLAB 5.0 MAT-file".ljust(124) + (0x0100).to_bytes(2, "little") + b"IM"


def growing_mat(path: Path) -> None:
    """A MAT file whose only element, of half a gigabyte, is deflated to half a megabyte."""
    squeeze = zlib.compressobj(1)
    head = _words(14, 500_000_000)
    body = (
        squeeze.compress(head)
        + b"".join(squeeze.compress(bytes(1 << 24)) for _ in range(30))
        + squeeze.flush()
    )
    path.write_bytes(_MAT + _words(15, len(body)) + body)


def nested_mat(path: Path) -> None:
    """A cell in a cell in a cell, 20,000 deep, each with the length that it needs."""
    depth = 20_000
    path.write_bytes(
        _MAT
        + b"".join(
            _words(14, 48 + 56 * (depth - k - 1), 6, 8, 1, 0, 5, 8, 1, 1, 1, 0, 0, 0)
            for k in range(depth)
        )
    )


def _words(*numbers: int) -> bytes:
    return b"".join(number.to_bytes(4, "little") for number in numbers)


def declared_chunk(path: Path) -> None:
    """An MCAP file whose only chunk declares ten gigabytes."""
    write_flight(path, samples=60, chunk=1 << 20)
    data = bytearray(path.read_bytes())
    at = next(
        k
        for k in range(8, len(data))
        if data[k] == 6 and 0 < int.from_bytes(data[k + 1 : k + 9], "little") < len(data) - k
    )
    data[at + 25 : at + 33] = (10_000_000_000).to_bytes(8, "little")
    path.write_bytes(data)


def wide_csv(path: Path, columns: int = 500_000, rows: int = 1) -> None:
    """Half a million columns, which would take a minute to read."""
    names = ",".join(f"c{k}" for k in range(columns))
    path.write_text(names + "\n" + (",".join(["1"] * columns) + "\n") * rows)


def slow_csv(path: Path) -> None:
    """As many columns as are read, which takes some ten seconds."""
    wide_csv(path, 20_000, 60)


@pytest.mark.parametrize(
    ("name", "make", "what"),
    [
        ("a.parquet", growing_parquet, "needs more than 300 MB of memory"),
        ("a.mat", declared_hdf5, ""),
        ("b.mat", growing_mat, "needs more than 300 MB of memory"),
        ("c.mat", nested_mat, ""),
        ("a.mcap", declared_chunk, "no message can be read"),
        ("a.csv", wide_csv, "more than 20000 columns"),
        ("a.csv", slow_csv, "stopped after 3 s of processor time"),
    ],
)
def test_what_declares_or_becomes_too_much_is_refused(
    tmp_path: Path, name: str, make: Any, what: str
) -> None:
    path = tmp_path / name
    make(path)
    assert path.stat().st_size < 10_000_000
    limits = Limits(processor=3.0) if "3 s" in what else LIMITS
    assert what in refusal(path, limits).what


def test_size_and_time_are_limited(tmp_path: Path) -> None:
    log = write_csv(tmp_path / "a.csv", channels(1, seconds=400.0))
    size = log.stat().st_size
    assert "the limit is 1 MB" in refusal(log, Limits(size=1_000_000)).what
    assert "stopped after 0.001 s" in refusal(log, Limits(wall=0.001)).what
    with parsed_log(log, tmp_path / "topics", Limits(size=size)) as parsed:
        parsed.keep(tmp_path / "topics")
    assert (tmp_path / "topics" / "recording.json").is_file()


def test_limits_stand_in_the_settings(tmp_path: Path) -> None:
    """In units that people write; and a log is held to them."""
    (tmp_path / "settings.toml").write_text('[limits]\nsize = 1000\nprocessor = "2 min"\n')
    found = load_settings(tmp_path).limits
    assert (found.size, found.processor, found.memory) == (1000, 120.0, Limits().memory)
    workspace = prepared(tmp_path / "w", write_files(tmp_path / "files", 1)[0].parent)
    (workspace.root / "settings.toml").write_text("[limits]\nsize = 1000\n")
    given = {"logs": [str(tmp_path / "files" / "flight1.csv")], "vehicle": NAME}
    (refused,) = run_flow(flight_flow, given, workspace, "direct")
    assert refused["status"] == "refused"
    assert "raise [limits] size" in refused["remedy"]
    (workspace.root / "settings.toml").write_text("[limits]\nsise = 1000\n")
    with pytest.raises(
        SettingsError, match=r"unknown key 'limits.sise'\ndid you mean 'size'"
    ):  # no fault of the log
        run_flow(flight_flow, given, workspace, "direct")
    (workspace.root / "settings.toml").unlink()
    assert run_flow(flight_flow, given, workspace, "direct")[0]["status"] == "stored"


def _children(process: int) -> list[int]:
    try:
        return [
            int(text)
            for text in Path(f"/proc/{process}/task/{process}/children").read_text().split()
        ]
    except OSError:
        return []


def _descendants(process: int) -> list[list[int]]:
    """Children, and the children's children."""
    first = _children(process)
    return [first, [grandchild for child in first for grandchild in _children(child)]]


@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="no /proc")
@pytest.mark.parametrize("number", [signal.SIGSEGV, signal.SIGKILL])
def test_a_reader_that_dies_refuses_its_log_and_nothing_else(
    tmp_path: Path, number: signal.Signals
) -> None:
    """The signal is a real one, sent to the process that parses, while it parses."""
    log = write_csv(tmp_path / "big.csv", channels(1, seconds=4000.0, rate=50.0))
    workspace = prepared(tmp_path / "w", write_files(tmp_path / "files", 1)[0].parent)
    before, counted = state_of(workspace.root), rows(workspace)
    stop = threading.Event()
    idle = set(_descendants(os.getpid())[1])

    def kill() -> None:
        while not stop.is_set():
            for parser in set(_descendants(os.getpid())[1]) - idle:
                command = Path(f"/proc/{parser}/cmdline").read_text(errors="replace")
                if "aerodb.tasks.workers.server" in command:
                    time.sleep(0.05)
                    os.kill(parser, number)
                    return
            time.sleep(0.002)

    killer = threading.Thread(target=kill)
    killer.start()
    (bad,) = run_flow(flight_flow, {"logs": [str(log)], "vehicle": NAME}, workspace, "direct")
    stop.set()
    killer.join()
    (good,) = run_flow(
        flight_flow,
        {"logs": [str(tmp_path / "files" / "flight1.csv")], "vehicle": NAME},
        workspace,
        "direct",
    )
    assert (bad["status"], good["status"]) == ("refused", "stored")
    assert ("killed by the system" if number == signal.SIGKILL else number.name) in bad["what"]
    assert bad["where"] == str(log)
    assert bad["remedy"]
    held = workspace.root / "quarantine" / bad["sha256"]
    assert sorted(path.name for path in held.iterdir()) == ["log.csv", "reason.json"]
    with Catalogue.open(workspace.catalogue) as catalogue:
        assert verify(workspace, catalogue).problems == []
        assert [row.sha256 for row in catalogue.logs("quarantined")] == [bad["sha256"]]
    assert set(state_of(workspace.root)) - set(before), "the good log was taken in"
    assert rows(workspace)["flights"] == counted["flights"] + 1


def test_fuzzed_logs_and_hostile_names_end_where_they_belong(tmp_path: Path) -> None:
    """Damaged at random, and a good one whose name is a path and a statement: stored or refused,
    and nothing else is touched."""
    files = write_files(tmp_path / "files", 1)
    workspace = prepared(tmp_path / "w", tmp_path / "files")
    write_ulog(tmp_path / "a.ulg", example_topics(), metadata={"sys_name": "PX4"})
    write_flight(tmp_path / "a.mcap", samples=60, chunk=2048)
    write_parquet(tmp_path / "a.parquet", channels(7))
    rng, logs = np.random.default_rng(8), []
    for kind in ("ulg", "mcap", "parquet", "csv"):
        data = (files[0] if kind == "csv" else tmp_path / f"a.{kind}").read_bytes()
        for k in range(6):
            log = tmp_path / f"fuzzed{k}.{kind}"
            log.write_bytes((flip, scramble)[k % 2](data, rng))
            logs.append(log)
    hostile = tmp_path / "..;DROP TABLE flights;--$(touch pwned)<b>.csv"
    write_csv(hostile, channels(9))
    outside = {
        path: path.read_bytes()
        for path in tmp_path.rglob("*")
        if path.is_file() and "w" not in path.relative_to(tmp_path).parts
    }
    given = {"logs": [str(log) for log in [*logs, hostile]], "vehicle": NAME}
    outcomes = run_flow(flight_flow, given, workspace, "direct")
    assert {outcome["status"] for outcome in outcomes} <= {
        "stored",
        "damaged",
        "duplicate",
        "refused",
    }
    assert outcomes[-1]["status"] == "stored"
    for outcome in outcomes:
        if outcome["status"] == "refused":
            assert outcome["what"]
            assert outcome["remedy"]
            assert (workspace.root / "quarantine" / outcome["sha256"] / "reason.json").is_file()
    assert {path: path.read_bytes() for path in outside} == outside
    assert {path.name for path in tmp_path.iterdir()} == {"w", "files"} | {
        path.name for path in outside if path.parent == tmp_path
    }
    with Catalogue.open(workspace.catalogue) as catalogue:
        assert verify(workspace, catalogue).problems == []
