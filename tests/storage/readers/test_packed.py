"""Logs in archives are the logs; an archive that is damaged, a bomb or no log is refused."""

import gzip
import hashlib
import io
import zipfile
from pathlib import Path

import numpy as np
import pytest

from aerodb.errors import InputError
from aerodb.recording import Topic
from aerodb.storage.readers.any_format import read_log
from aerodb.storage.writers import write_ulog
from tests.support.command import aerodb

TABLE = b"time,q\n" + b"".join(b"%.2f,%.4f\n" % (0.01 * k, np.sin(0.1 * k)) for k in range(500))


def zipped(**files: bytes) -> bytes:
    held = io.BytesIO()
    with zipfile.ZipFile(held, "w", zipfile.ZIP_DEFLATED) as made:
        for name, content in files.items():
            made.writestr(name, content)
    return held.getvalue()


def ulog(folder: Path) -> bytes:
    time = np.arange(1.0, 5.0, 0.01)
    topics = [Topic("vehicle_attitude", time, {"q[0]": np.cos(time), "q[1]": np.sin(time)})]
    write_ulog(folder / "own.ulg", topics)
    return (folder / "own.ulg").read_bytes()


def test_a_packed_log_is_the_log(tmp_path: Path) -> None:
    log = ulog(tmp_path)
    own = read_log(tmp_path / "own.ulg")
    packed = {
        "a.zip": zipped(**{"flights/a.ulg": log, "readme.md": b"x", "__MACOSX/._a.ulg": b"x"}),
        "a.ulg.zip": zipped(**{"a.ulg": log}),
        "a.ulg.gz": gzip.compress(log),
        "b.zip": zipped(**{"noname": log}),
    }
    for name, content in packed.items():
        path = tmp_path / name
        path.write_bytes(content)
        found = read_log(path)
        assert found.format == "ulog"
        assert (found.sha256, found.size) == (hashlib.sha256(content).hexdigest(), len(content))
        assert found.source == str(path)
        for topic, values in own.topics.items():
            np.testing.assert_array_equal(found.topics[topic].time, values.time)
            for field in values.fields:
                np.testing.assert_array_equal(
                    found.topics[topic].fields[field], values.fields[field]
                )


def test_a_packed_table_is_read_by_its_suffix(tmp_path: Path) -> None:
    for name, content in (
        ("a.csv.gz", gzip.compress(TABLE)),
        ("a.zip", zipped(**{"x/flight.csv": TABLE})),
    ):
        (tmp_path / name).write_bytes(content)
        assert list(read_log(tmp_path / name).topics["table"].fields) == ["time", "q"]


REFUSED = {
    "several": (zipped(**{"a.ulg": b"x", "b.ulg": b"x"}), "2 logs: a.ulg, b.ulg"),
    "none": (zipped(**{"a.md": b"x", "b.jpg": b"x"}), "without a log"),
    "empty": (zipped(), ""),
    "excel": (zipped(**{"[Content_Types].xml": b"x", "xl/workbook.xml": b"x"}), "Excel"),
    "nested": (zipped(**{"a.csv": zipped(**{"b.csv": TABLE})}), "within an archive"),
    "cut": (zipped(**{"a.csv": TABLE * 20})[:300], "damaged archive"),
    "cut gzip": (gzip.compress(TABLE)[:-40], "damaged archive"),
    "no numbers": (zipped(**{"a.csv": b"a,b\nx,y\n"}), "the log in it"),
}


@pytest.mark.parametrize("kind", REFUSED)
def test_what_is_no_packed_log_is_refused_with_its_reason(tmp_path: Path, kind: str) -> None:
    content, what = REFUSED[kind]
    path = tmp_path / "flight.zip"
    path.write_bytes(content)
    with pytest.raises(InputError) as refusal:
        read_log(path)
    assert what in refusal.value.what
    assert "flight.zip" in refusal.value.where
    assert refusal.value.remedy


@pytest.mark.parametrize("pack", [gzip.compress, lambda data: zipped(**{"a.csv": data})])
def test_a_bomb_is_not_unpacked(tmp_path: Path, pack) -> None:
    """A hundred megabytes of nothing in a hundred kilobytes, whatever its header says."""
    path = tmp_path / "bomb.zip"
    path.write_bytes(pack(bytes(100_000_000)))
    with pytest.raises(InputError, match="times its own size"):
        read_log(path)


def test_a_size_that_lies_is_not_believed(tmp_path: Path) -> None:
    data = bytearray(zipped(**{"a.csv": bytes(50_000_000)}))
    for mark, at in ((b"PK\x03\x04", 22), (b"PK\x01\x02", 24)):
        place = data.index(mark) + at
        data[place : place + 4] = (1000).to_bytes(4, "little")
    (tmp_path / "a.zip").write_bytes(data)
    with pytest.raises(InputError):
        read_log(tmp_path / "a.zip")


def test_a_name_in_an_archive_leads_nowhere(tmp_path: Path) -> None:
    (tmp_path / "a.zip").write_bytes(zipped(**{"../../outside.csv": TABLE}))
    assert len(read_log(tmp_path / "a.zip").topics["table"].time) == 500
    assert not list(tmp_path.parent.glob("outside*"))


def test_a_packed_log_by_command(tmp_path: Path) -> None:
    (tmp_path / "a.zip").write_bytes(zipped(**{"a.ulg": ulog(tmp_path)}))
    done = aerodb(tmp_path / "w", "log", "inspect", str(tmp_path / "a.zip"))
    assert done.returncode == 0
    assert done.stdout.startswith("a.zip: ")
    assert "ulog" in done.stdout.split("\n")[0]
