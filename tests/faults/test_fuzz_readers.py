"""Readers on randomly damaged files: a Recording that accounts for the loss, or a refusal; never a
traceback, never unreported loss."""

import gzip
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pytest
from scipy.io import savemat

from aerodb.errors import InputError
from aerodb.recording import Recording
from aerodb.storage.limits import Limits
from aerodb.storage.readers.any_format import read_log
from aerodb.storage.readers.dataflash import framed
from aerodb.storage.readers.ulog_framing import survey
from aerodb.storage.writers.ulog import write_ulog
from aerodb.tasks.workers import parsed_log
from tests.storage.readers.test_dataflash import written
from tests.storage.readers.test_dataflash_text import written as written_text
from tests.storage.readers.test_mavlink import flown
from tests.storage.readers.test_mcap import write_flight
from tests.storage.readers.test_packed import zipped
from tests.storage.readers.test_rosbag import bag_1, bag_2
from tests.storage.readers.test_ulog import example_topics, messages

Change = Callable[[bytes, np.random.Generator], bytes]
pytestmark = pytest.mark.heavy


@pytest.fixture(scope="module")
def count(trials: Callable[[int, int], int]) -> int:
    return trials(60, 3000)


def outcome(path: Path, data: bytes) -> Recording | None:
    """What reading gives: a Recording with its topics looked into, or None for a refusal with place
    and reason."""
    path.write_bytes(data)
    found: Recording | InputError
    try:
        found = read_log(path)
    except InputError as refusal:
        found = refusal
    if isinstance(found, InputError):
        assert found.what
        assert str(path) in found.where
        return None
    for topic in found.topics.values():
        assert all(len(values) == len(topic.time) for values in topic.fields.values())
    return found


def flip(data: bytes, rng: np.random.Generator) -> bytes:
    changed = bytearray(data)
    for at in rng.integers(0, len(data), rng.integers(1, 6)):
        changed[at] ^= 1 << int(rng.integers(8))
    return bytes(changed)


def scramble(data: bytes, rng: np.random.Generator) -> bytes:
    """Overwrites a stretch with noise, or takes it out."""
    at, n = int(rng.integers(len(data))), int(rng.integers(1, 600))
    noise = rng.bytes(n) if rng.random() < 0.5 else b""
    return data[:at] + noise + data[at + n :]


@pytest.fixture(scope="module")
def damages(ulog: bytes, count: int, trials: Callable[[int, int], int]) -> int:
    """How often a ULog is damaged: in the suite less often where it is long."""
    return count if len(ulog) < 100_000 else trials(15, 3000)


@pytest.fixture(scope="module", params=["generated", "measured"])
def ulog(
    request: pytest.FixtureRequest,
    tmp_path_factory: pytest.TempPathFactory,
    measured: Callable[[str], Path],
) -> bytes:
    if request.param == "measured":
        return measured("px4_ulog/sample_log_small.ulg").read_bytes()
    path = tmp_path_factory.mktemp("fuzz") / "a.ulg"
    write_ulog(path, example_topics(), metadata={"sys_name": "PX4"}, parameters={"A": 1, "B": 2.0})
    return path.read_bytes()


def test_cut_ulog_accounts_for_every_byte(ulog: bytes, damages: int, tmp_path: Path) -> None:
    """Every message before the cut is read; the rest of the file is a reported loss, unless the cut
    is between messages."""
    found, rng = messages(ulog), np.random.default_rng(2)
    samples = {end for _, end, kind in found if kind == ord("D")}
    ends = np.array([16, *(end for _, end, _ in found)])
    for cut in rng.integers(0, len(ulog), damages):
        recording = outcome(tmp_path / "a.ulg", ulog[:cut])
        whole = sum(end <= cut for end in samples)
        if recording is None:
            assert whole == 0
            continue
        boundary = int(ends[ends <= cut].max())
        assert sum(len(topic.time) for topic in recording.topics.values()) == whole
        lost = [damage.bytes_lost for damage in recording.damage if damage.kind == "lost_tail"]
        assert lost == ([cut - boundary] if cut > boundary else [])


@pytest.mark.parametrize("change", [flip, scramble])
def test_damaged_ulog_is_read_or_refused_and_no_byte_is_unaccounted(
    ulog: bytes, damages: int, tmp_path: Path, change: Change
) -> None:
    """What is followed and what is lost cover the file without overlap, and every loss stands in
    the recording."""
    rng, path, read = np.random.default_rng(3), tmp_path / "a.ulg", 0
    for _ in range(damages):
        data = change(ulog, rng)
        recording = outcome(path, data)
        if recording is None:
            continue
        read += 1
        with path.open("rb") as handle:
            found = survey(handle, len(data))
        pieces = sorted([*found.intact, *((lost.start, lost.end) for lost in found.lost)])
        assert [pieces[0][0], *(end for _, end in pieces)] == [
            *(start for start, _ in pieces),
            len(data),
        ]
        reported = sum(damage.bytes_lost for damage in recording.damage if not damage.topic)
        assert reported == sum(lost.end - lost.start for lost in found.lost)
        kept = sum(len(topic.time) for topic in recording.topics.values())
        undecoded = sum(
            int(d.what.split()[0])
            for d in recording.damage
            if d.what.endswith(("damaged", "timestamp"))
        )
        assert kept + undecoded == int(found.count.sum())
    assert read > 0.9 * damages


def test_taken_out_messages_are_the_only_ones_missing(ulog: bytes, tmp_path: Path) -> None:
    """Noise over data messages costs those messages and no others."""
    rng = np.random.default_rng(4)
    found = messages(ulog)
    total = sum(kind == ord("D") for _, _, kind in found)
    for _ in range(40):
        k = int(rng.integers(len(found) // 2, len(found) - 12))
        hit = found[k : k + int(rng.integers(1, 10))]
        noise = rng.bytes(hit[-1][1] - hit[0][0])
        recording = outcome(tmp_path / "a.ulg", ulog[: hit[0][0]] + noise + ulog[hit[-1][1] :])
        assert recording is not None
        lost = sum(damage.bytes_lost for damage in recording.damage if damage.kind == "framing")
        assert lost == len(noise)
        kept = sum(len(topic.time) for topic in recording.topics.values())
        assert kept == total - sum(kind == ord("D") for _, _, kind in hit)


@pytest.mark.parametrize("change", [flip, scramble])
def test_damaged_dataflash_is_read_or_refused_and_no_byte_is_unaccounted(
    count: int, tmp_path: Path, change: Change
) -> None:
    """What is followed and what is lost cover the file without overlap, and every loss stands in
    the recording."""
    log = written(30)
    data, rng, path, read = bytes(log.data), np.random.default_rng(7), tmp_path / "a.bin", 0
    for _ in range(count):
        damaged = change(data, rng)
        recording = outcome(path, damaged)
        if recording is None:
            continue
        read += 1
        kind, start, lost = framed(np.frombuffer(damaged, dtype=np.uint8))
        begins = sorted([*start.tolist(), *lost[:, 0].tolist()])
        assert begins[0] == 0
        assert len(set(begins)) == len(begins)
        assert set(lost[:, 1].tolist()) <= {len(damaged), *start.tolist()}
        assert sum(each.bytes_lost for each in recording.damage) == (lost[:, 1] - lost[:, 0]).sum()
        assert len(kind) >= len(log.ends) - 600 // 3
    assert read > 0.9 * count


@pytest.mark.parametrize("change", [flip, scramble])
def test_a_damaged_text_of_dataflash_is_read_or_refused(
    count: int, tmp_path: Path, change: Change
) -> None:
    """What is left of the records is read; lines that are none any more are reported."""
    _, whole, _ = written_text(tmp_path)
    data, rng, read = (tmp_path / "a.log").read_bytes(), np.random.default_rng(8), 0
    samples = sum(len(topic.time) for topic in whole.topics.values())
    for _ in range(count):
        recording = outcome(tmp_path / "b.log", change(data, rng))
        if recording is None:
            continue
        read += 1
        found = sum(len(topic.time) for topic in recording.topics.values())
        # A stretch that is taken out joins two lines into one, whose end may be another's.
        assert found > samples - 60 or recording.damage
    assert read > 0.8 * count


@pytest.mark.parametrize("change", [flip, scramble])
@pytest.mark.parametrize("form", ["none", "bz2", "lz4", "db3"])
def test_a_damaged_bag_is_read_or_refused(
    count: int, tmp_path: Path, change: Change, form: str
) -> None:
    """Messages that are gone are reported; plain numbers within one have no checksum in a bag."""
    data = bag_2(tmp_path / "own.db3", samples=60) if form == "db3" else bag_1(form, 60, 20)
    rng, read, path = np.random.default_rng(12), 0, tmp_path / "a.bag"
    (tmp_path / "whole.bag").write_bytes(data)
    whole = {name: len(t.time) for name, t in read_log(tmp_path / "whole.bag").topics.items()}
    for _ in range(count):
        recording = outcome(path, change(data, rng))
        if recording is None:
            continue
        read += 1
        kept = {name: len(t.time) for name, t in recording.topics.items()}
        assert recording.damage or kept == whole
    assert read > 0.3 * count


@pytest.mark.parametrize("change", [flip, scramble])
def test_damaged_telemetry_is_read_or_refused(count: int, tmp_path: Path, change: Change) -> None:
    """Messages have checksums: a sample that is read is one that was written."""
    log = flown()
    data, rng, read = bytes(log.data), np.random.default_rng(10), 0
    whole = outcome(tmp_path / "a.tlog", data)
    assert whole is not None
    written_rolls = set(whole.topics["ATTITUDE"].fields["roll"].tolist())
    for _ in range(count):
        recording = outcome(tmp_path / "a.tlog", change(data, rng))
        if recording is None:
            continue
        read += 1
        if "ATTITUDE" in recording.topics:
            assert set(recording.topics["ATTITUDE"].fields["roll"].tolist()) <= written_rolls
    assert read > 0.9 * count


@pytest.mark.parametrize("change", [flip, scramble])
@pytest.mark.parametrize("name", ["a.zip", "a.ulg.gz"])
def test_a_damaged_archive_is_read_or_refused(
    name: str, count: int, tmp_path: Path, change: Change
) -> None:
    """Archives have checksums: what is read is what was packed."""
    log = bytes(written(30).data)
    data = zipped(**{"a.bin": log}) if name == "a.zip" else gzip.compress(log)
    (tmp_path / "a.bin").write_bytes(log)
    whole, rng, refused = read_log(tmp_path / "a.bin"), np.random.default_rng(9), 0
    for _ in range(count):
        recording = outcome(tmp_path / name, change(data, rng))
        if recording is None:
            refused += 1
            continue
        for topic, its in recording.topics.items():
            np.testing.assert_array_equal(its.time, whole.topics[topic].time)
    assert refused > count // 4


@pytest.fixture(scope="module")
def mcap(tmp_path_factory: pytest.TempPathFactory) -> tuple[bytes, Recording]:
    path = tmp_path_factory.mktemp("fuzz") / "a.mcap"
    write_flight(path, samples=60, chunk=2048)
    return path.read_bytes(), read_log(path)


def test_cut_mcap_is_always_reported(
    mcap: tuple[bytes, Recording], count: int, tmp_path: Path
) -> None:
    """Unlike ULog, MCAP ends with a footer: every cut shows. What is read is the beginning of what
    was there."""
    data, whole = mcap
    read = 0
    for cut in np.random.default_rng(5).integers(0, len(data), count):
        recording = outcome(tmp_path / "a.mcap", data[:cut])
        if recording is None:
            continue
        read += 1
        assert [damage.kind for damage in recording.damage if damage.kind == "lost_tail"] == [
            "lost_tail"
        ]
        for name, topic in recording.topics.items():
            np.testing.assert_array_equal(topic.time, whole.topics[name].time[: len(topic.time)])
    assert read > count // 2


@pytest.mark.parametrize("change", [flip, scramble])
def test_damaged_mcap_is_read_or_refused_and_samples_do_not_vanish_silently(
    mcap: tuple[bytes, Recording], count: int, tmp_path: Path, change: Change
) -> None:
    """With chunk and data checksums on, no change of the data goes unnoticed, whether or not it
    costs samples."""
    data, whole = mcap
    rng, read = np.random.default_rng(6), 0
    total = sum(len(topic.time) for topic in whole.topics.values())
    for _ in range(count):
        recording = outcome(tmp_path / "a.mcap", change(data, rng))
        if recording is None:
            continue
        read += 1
        if sum(len(topic.time) for topic in recording.topics.values()) != total:
            assert recording.damage
        for name, topic in recording.topics.items():
            if not recording.damage:
                for field, values in topic.fields.items():
                    np.testing.assert_array_equal(values, whole.topics[name].fields[field])
    assert read > count // 2


def _csv(path: Path, table: pd.DataFrame) -> None:
    table.to_csv(path, index=False)


def _excel_text(path: Path, table: pd.DataFrame) -> None:
    """Decimal commas, dates, a row of units, titles, thousands, remarks and closing lines."""
    stamps = pd.Timestamp("2024-03-12") + pd.to_timedelta(table["time"], unit="s")
    dated = table.assign(time=stamps.dt.strftime("%d.%m.%Y %H:%M:%S,%f"), remark="Nr. 1")
    text = dated.to_csv(index=False, sep=";", decimal=",")
    names, rows = text.split("\n", 1)
    path.write_text(f"sep=;\nFlight test\n\n{names}\n;deg;deg;deg/s;ft msl;\n{rows}END OF DATA\n")


def _labview(path: Path, table: pd.DataFrame) -> None:
    """A header with the step, and a table that writes no times."""
    names = "abcd"
    head = f"LabVIEW Measurement\nSeparator\tTab\nX_Columns\tNo\nChannels\t{len(names)}\n"
    head += "Y_Unit_Label" + "\tdeg" * len(names) + "\nX0" + "\t0" * len(names) + "\n"
    head += "Delta_X" + "\t0.05" * len(names) + "\n***End_of_Header***\n"
    rows = table[[*names]].to_csv(index=False, sep="\t", header=False).splitlines()
    text = "X_Value\t" + "\t".join(names) + "\n" + "\n".join(f"\t{row}" for row in rows)
    path.write_text(head + text + "\n")


def _parquet(path: Path, table: pd.DataFrame) -> None:
    table.to_parquet(path)


def _mat(path: Path, table: pd.DataFrame) -> None:
    savemat(path, {name: table[name].to_numpy() for name in table})


def _hdf5(path: Path, table: pd.DataFrame) -> None:
    with h5py.File(path, "w") as file:
        for name in table:
            file[name] = table[name].to_numpy()


@pytest.mark.parametrize("change", [flip, scramble])
@pytest.mark.parametrize(
    ("suffix", "write"),
    [
        (".csv", _csv),
        (".txt", _excel_text),
        (".lvm", _labview),
        (".parquet", _parquet),
        (".mat", _mat),
        (".h5", _hdf5),
    ],
)
def test_damaged_tables_are_read_or_refused(
    suffix: str,
    write: Callable[[Path, pd.DataFrame], None],
    change: Change,
    trials: Callable[[int, int], int],
    tmp_path: Path,
) -> None:
    """In the process that production reads them in: the libraries behind them are not ours."""
    rng = np.random.default_rng(9)
    time = np.linspace(0.0, 20.0, 400)
    table = pd.DataFrame({"time": time, **{name: rng.normal(size=400) for name in "abcd"}})
    path = tmp_path / f"flight{suffix}"
    write(path, table)
    data, refused, count = path.read_bytes(), list[InputError](), trials(20, 1500)
    damaged = 0
    limits = Limits(memory=1_000_000_000, processor=20.0, wall=40.0)
    for _ in range(count):
        path.write_bytes(change(data, rng))
        try:
            with parsed_log(path, tmp_path / "w", limits) as parsed:
                damaged += bool(parsed.recording.damage)
                for topic in parsed.recording.topics.values():
                    assert all(len(v) == len(topic.time) for v in topic.fields.values())
        except InputError as refusal:
            refused.append(refusal)
    assert all(each.what and path.name in each.where for each in refused)
    print(f"{suffix}: of {count}, {len(refused)} refused, {damaged} read with damage")
    # No format of tables but Parquet has checksums: a flipped bit in a number is another number.
    assert refused or damaged or change is flip
