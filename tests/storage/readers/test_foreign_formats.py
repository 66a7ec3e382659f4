"""Files of other programs are named by their first bytes, whatever they are called, with the way
out; what only looks like one is read as before."""

import io
import zipfile
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from aerodb.errors import InputError
from aerodb.storage.readers.any_format import read_log


def archive(*names: str) -> bytes:
    held = io.BytesIO()
    with zipfile.ZipFile(held, "w") as made:
        for name in names:
            made.writestr(name, "content")
    return held.getvalue()


FILES = {
    "flight.bag": (b"#ROSBAG V1.2\n" + bytes(64), "a bag of ROS 1", "rosbag fix"),
    "flight.ulg": (b"ULogEnc\x01" + bytes(64), "encrypted log of PX4", "decrypt"),
    "flight.zip": (archive("logs/a.ulg", "logs/b.ulg"), "holds 2 logs", "unzip"),
    "table.xlsx": (archive("[Content_Types].xml", "xl/workbook.xml"), "Excel", "CSV"),
    "broken.zip": (archive("a")[:20], "damaged archive", "unpack"),
    "flight.bbl": (b"H Product:Blackbox flight data recorder\n", "blackbox", "blackbox_decode"),
    "track.txt": (b"$GPGGA,142210.00,4707.1,N,00830.4,E,1,08,0.9,545.4,M\n", "NMEA", "autopilot"),
    "flight.mf4": (b"MDF     4.10" + bytes(60), "MDF", "CSV"),
}


@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize("suffix", ["", ".csv", ".bin"])
def test_a_file_of_another_program_is_named(tmp_path: Path, name: str, suffix: str) -> None:
    content, what, way = FILES[name]
    path = tmp_path / (name + suffix)
    path.write_bytes(content)
    with pytest.raises(InputError) as refusal:
        read_log(path)
    assert what in refusal.value.what
    assert way in refusal.value.remedy
    assert name in refusal.value.where


@pytest.mark.parametrize("name", ["a.igc", "a.GPX", "a.fit", "DJIFlightRecord_2024-03-12.txt"])
def test_a_file_of_another_program_is_named_by_its_name(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(b"AXXX001\x01\x02\nHFDTE120324\n")
    with pytest.raises(InputError, match="not read"):
        read_log(tmp_path / name)


def test_a_table_that_begins_with_like_words_is_read(tmp_path: Path) -> None:
    for number, head in enumerate(("PKx,b", "H Product,b", "MDF,b", "FMT,b", "SQLite,b")):
        path = tmp_path / f"{number}.csv"
        path.write_text(f"{head}\n1,2\n3,4\n")
        assert list(read_log(path).topics["table"].fields) == head.split(",")


def test_no_first_bytes_raise_anything_else(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    for name, (content, _, _) in FILES.items():
        for _ in range(40):
            data = bytearray(content)
            for at in rng.integers(0, len(data), 3):
                data[at] ^= 1 << int(rng.integers(8))
            path = tmp_path / name
            path.write_bytes(data[: int(rng.integers(1, len(data) + 1))])
            with suppress(InputError):  # anything else fails
                assert read_log(path).topics is not None
