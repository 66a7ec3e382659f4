"""DataFlash logs with hostile descriptions: what can be read is read, the rest is said, and nothing
takes long or is printed."""

import struct
import warnings
from pathlib import Path

import numpy as np
import pytest

from aerodb.errors import InputError
from aerodb.recording import Recording
from aerodb.storage.readers.dataflash import read_dataflash

MAGIC = b"\xa3\x95"
N = 200


def described(id_: int, length: int, name: bytes, characters: bytes, labels: bytes) -> bytes:
    return MAGIC + bytes([128]) + struct.pack("<BB4s16s64s", id_, length, name, characters, labels)


FORMAT = described(128, 89, b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns")
LENGTH = 3 + 8 + 12
IMU = described(1, LENGTH, b"IMU", b"Qfff", b"TimeUS,AccX,AccY,AccZ")
UNITS = described(6, 3 + 8 + 1 + 32, b"FMTU", b"QBNN", b"TimeUS,FmtType,UnitIds,MultIds")
FACTORS = described(7, 3 + 8 + 1 + 8, b"MULT", b"Qbd", b"TimeUS,Id,Mult")


def rows(id_: int = 1) -> bytes:
    return b"".join(
        MAGIC + bytes([id_]) + struct.pack("<Qfff", 1_000_000 + 10_000 * k, k, 0.0, -9.8)
        for k in range(N)
    )


def read(tmp_path: Path, content: bytes) -> Recording:
    path = tmp_path / "hostile.bin"
    path.write_bytes(content)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return read_dataflash(path)


@pytest.mark.parametrize("length", [0, 1, 2])
def test_a_record_shorter_than_its_header_stops_nothing(tmp_path: Path, length: int) -> None:
    short = described(2, length, b"ODD", b"Q", b"TimeUS") + (MAGIC + b"\x02") * 50
    found = read(tmp_path, FORMAT + IMU + rows() + short)
    assert found.topics["IMU"].fields["AccX"].tolist() == [*range(N)]
    assert any("ODD" in each.what for each in found.damage)


@pytest.mark.parametrize("length", [3, 255])
def test_a_description_of_descriptions_changes_none(tmp_path: Path, length: int) -> None:
    again = described(128, length, b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns")
    assert len(read(tmp_path, FORMAT + IMU + again + rows()).topics["IMU"].time) == N


def test_a_name_of_two_ids_is_said(tmp_path: Path) -> None:
    other = described(2, LENGTH, b"IMU", b"Qfff", b"TimeUS,AccX,AccY,AccZ")
    alone = read(tmp_path, FORMAT + IMU + other + rows())
    assert not alone.damage, "without records, a second id takes nothing away"
    found = read(tmp_path, FORMAT + IMU + other + rows() + rows(2))
    assert len(found.topics["IMU"].time) == N
    assert ["several ids" in each.what for each in found.damage] == [True]


def test_thousands_of_descriptions_are_said_once_each(tmp_path: Path) -> None:
    many = b"".join(
        described(1 + k % 100, LENGTH, b"A%03d" % (k % 1000), b"Qfff", b"TimeUS,X,Y,Z")
        for k in range(20_000)
    )
    assert len(read(tmp_path, FORMAT + many + rows()).damage) <= 100


@pytest.mark.parametrize("factor", [1e308, float("nan"), float("-inf")])
def test_a_damaged_multiplier_warns_nobody_and_makes_no_number(
    tmp_path: Path, factor: float
) -> None:
    scaled = MAGIC + b"\x07" + struct.pack("<Qbd", 1, ord("x"), factor)
    scaled += MAGIC + b"\x06" + struct.pack("<QB16s16s", 1, 1, b"sooo", b"Fxxx")
    found = read(tmp_path, FORMAT + IMU + UNITS + FACTORS + scaled + rows())
    assert not np.isfinite(found.topics["IMU"].fields["AccZ"]).any()


@pytest.mark.parametrize(
    "layout",
    [
        (b"I\x1b[m", b"Qfff", b"TimeUS,AccX,AccY,AccZ"),
        (b"IMU", b"Qfff", b"TimeUS,../../x,\x1b[2J,a\nb"),
        (b"IMU", b"Qfff", b"TimeUS,AccX,AccX,AccX"),
        (b"IMU", b"Q???", b"TimeUS,AccX,AccY,AccZ"),
        (b"IMU", b"Qfff", b"Foo,AccX,AccY,AccZ"),
    ],
)
def test_names_that_are_none_are_refused(
    tmp_path: Path, layout: tuple[bytes, bytes, bytes]
) -> None:
    with pytest.raises(InputError, match="no data"):
        read(tmp_path, FORMAT + described(1, LENGTH, *layout) + rows())
