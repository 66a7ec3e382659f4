"""Labels of MAT matrices, MATLAB's objects, and columns of Parquet that are no plain numbers: read
as the numbers that were written, or named with the way out."""

import struct
from decimal import Decimal
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io

from aerodb.errors import InputError
from aerodb.storage.readers.tabular import read_tabular
from tests.support.command import asked

TIME = np.arange(100) * 0.02
MATRIX = np.column_stack([np.arange(100.0), TIME * 1e6, 20.0 * np.sin(TIME), 3.0 * np.cos(TIME)])
LABELS = ["LineNo", "TimeUS", "Roll", "Pitch"]


def cell(texts: list[str]) -> np.ndarray:
    made = np.empty((len(texts), 1), dtype=object)
    made[:, 0] = texts
    return made


def hdf5(path: Path, labels: list[str]) -> Path:
    """As MATLAB writes version 7.3: a cell is a dataset of references to its texts."""
    with h5py.File(path, "w") as file:
        file["ATT"] = MATRIX.T
        texts = file.create_group("#refs#")
        references = []
        for number, label in enumerate(labels):
            place = texts.create_dataset(
                f"t{number}", data=np.array([[ord(k)] for k in label], "u2")
            )
            place.attrs["MATLAB_class"] = np.bytes_("char")
            references.append(place.ref)
        made = file.create_dataset("ATT_label", (1, len(labels)), dtype=h5py.ref_dtype)
        made[0] = references
        made.attrs["MATLAB_class"] = np.bytes_("cell")
    return path


def mat(path: Path, **content: Any) -> Path:
    scipy.io.savemat(path, content)
    return path


@pytest.mark.parametrize("form", ["label", "labels", "struct", "bare", "v7.3"])
def test_labels_name_the_columns_of_a_matrix(tmp_path: Path, form: str) -> None:
    path, topic = tmp_path / "x.mat", "ATT"
    if form == "v7.3":
        hdf5(path, LABELS)
    elif form == "struct":
        mat(path, log={"data": MATRIX, "names": cell(LABELS)})
        topic = "log.data"
    elif form == "bare":
        mat(path, data=MATRIX, names=cell(LABELS), units=cell(["", "us", "deg", "deg"]))
        topic = "data"
    else:
        mat(path, **{"ATT": MATRIX, f"ATT_{form}": cell(LABELS)})
    recording = read_tabular(path)
    fields = recording.topics[topic].fields
    assert list(fields) == LABELS
    np.testing.assert_array_equal(np.column_stack(list(fields.values())), MATRIX)
    assert "skipped" not in recording.metadata
    stated = {"TimeUS": "us", "Roll": "deg", "Pitch": "deg"}
    if form == "struct":  # by no name a message of ArduPilot
        stated = {"TimeUS": "us"}
    assert dict(recording.topics[topic].units) == stated


def test_the_clock_of_a_labelled_matrix_is_no_counter(tmp_path: Path) -> None:
    path = mat(tmp_path / "x.mat", ATT=MATRIX, ATT_label=cell(LABELS))
    document = asked(tmp_path, "mapping", "init", str(path), "--output", str(tmp_path / "m.toml"))
    assert (document["clock"]["field"], document["clock"]["unit"]) == ("TimeUS", "us")
    assert {g["channel"]: (g["field"], g["unit"]) for g in document["guesses"]} == {
        "phi": ("Roll", "deg"),
        "theta": ("Pitch", "deg"),
    }


@pytest.mark.parametrize("ending", ["", "_0"])
def test_a_converted_log_of_ardupilot_is_read_as_that_log(tmp_path: Path, ending: str) -> None:
    attitude = np.column_stack([MATRIX, 90.0 + 0 * TIME])
    motion = np.column_stack([MATRIX[:, :2], *[0.1 * np.sin(TIME + k) for k in range(6)]])
    sensors = ["GyrX", "GyrY", "GyrZ", "AccX", "AccY", "AccZ"]
    path = mat(
        tmp_path / "x.mat",
        **{
            "ATT": attitude,
            "ATT_label": cell([*LABELS, "Yaw"]),
            f"IMU{ending}": motion,
            f"IMU{ending}_label": cell([*LABELS[:2], *sensors]),
            "IMU_1": 2.0 * motion,
            "IMU_1_label": cell([*LABELS[:2], *sensors]),
        },
    )
    recording = read_tabular(path)
    assert recording.format == "dataflash"
    assert set(recording.topics) == {"ATT", "IMU", "IMU.1"}
    np.testing.assert_allclose(recording.topics["ATT"].time, TIME)
    document = asked(tmp_path, "mapping", "init", str(path), "--output", str(tmp_path / "m.toml"))
    found = {g["channel"]: (f"{g['topic']}.{g['field']}", g["unit"]) for g in document["guesses"]}
    assert found["phi"] == ("ATT.Roll", "deg")
    assert found["p"] == ("IMU.GyrX", "rad/s")
    assert document["questions"] == []


@pytest.mark.parametrize("labels", [LABELS[:3], ["a", "a", "b", "c"]])
def test_labels_that_do_not_fit_are_left_and_said(tmp_path: Path, labels: list[str]) -> None:
    recording = read_tabular(mat(tmp_path / "x.mat", ATT=MATRIX, ATT_label=cell(labels)))
    assert list(recording.topics["ATT"].fields) == ["1", "2", "3", "4"]
    assert ("skipped" in recording.metadata) == (len(labels) != 4)


def opaque(kind: str) -> bytes:
    """An object of version 7, as MATLAB writes it: flags, name, type system and class."""

    def element(number: int, content: bytes) -> bytes:
        return struct.pack("<II", number, len(content)) + content + bytes(-len(content) % 8)

    parts = [element(6, struct.pack("<II", 17, 0)), element(1, b"flight"), element(1, b"MCOS")]
    body = b"".join([*parts, element(1, kind.encode())])
    return b"MATLAB 5.0 MAT-file".ljust(116) + bytes(8) + b"\x00\x01IM" + element(14, body)


@pytest.mark.parametrize(
    "kind", ["timetable", "table", "datetime", "duration", "timeseries", "own_class"]
)
@pytest.mark.parametrize("version", [7.0, 7.3])
def test_an_object_of_matlab_is_named_with_the_way_out(
    tmp_path: Path, kind: str, version: float
) -> None:
    path = tmp_path / "x.mat"
    if version == 7.0:
        path.write_bytes(opaque(kind))
    else:
        with h5py.File(path, "w") as file:
            made = file.create_dataset("flight", data=np.zeros((1, 6), "u4"))
            made.attrs["MATLAB_class"] = np.bytes_(kind)
            made.attrs["MATLAB_object_decode"] = np.int32(3)
    with pytest.raises(InputError) as refusal:
        read_tabular(path)
    assert f"flight is a MATLAB {kind}, not read: save it as S" in str(refusal.value.remedy)
    assert "flight" in str(refusal.value.remedy).split("save it as")[1]


def test_an_object_beside_a_matrix_is_said(tmp_path: Path) -> None:
    path = hdf5(tmp_path / "x.mat", LABELS)
    with h5py.File(path, "a") as file:
        made = file.create_dataset("when", data=np.zeros((1, 6), "u4"))
        made.attrs["MATLAB_class"] = np.bytes_("datetime")
        made.attrs["MATLAB_object_decode"] = np.int32(3)
    document = asked(tmp_path, "log", "inspect", str(path))
    assert document["not_read"] == ["when (no numbers)"]
    assert "when is a MATLAB datetime" in document["read_as"][0]


def test_columns_of_parquet_that_are_no_plain_numbers(tmp_path: Path) -> None:
    micro = (TIME * 1e6).round().astype("int64")
    columns = {
        "duration": pa.array(micro, pa.duration("us")),
        "of_day": pa.array(micro, pa.time64("us")),
        "decimal": pa.array([Decimal(f"{t:.2f}") for t in TIME], pa.decimal128(10, 2)),
        "text": pa.array([f"{t:.2f}" for t in TIME]),
        "coded": pa.array([f"{t:.2f}" for t in TIME]).dictionary_encode(),
        "stamp": pa.array([f"2024-03-12T14:22:{t:05.2f}Z" for t in TIME]),
        "pilot": pa.array(["Ann"] * 100),
    }
    pq.write_table(pa.table(columns), tmp_path / "x.parquet")
    recording = read_tabular(tmp_path / "x.parquet")
    topic = recording.topics["table"]
    for name in columns.keys() - {"pilot"}:
        values = np.asarray(topic.fields[name])
        np.testing.assert_allclose(values - values[0], TIME, atol=5e-7, err_msg=name)
    assert dict(topic.units) == dict.fromkeys(("duration", "of_day", "stamp"), "s")
    assert recording.metadata["skipped"] == "pilot"
    assert "text: numbers stored as text" in str(recording.metadata["remarks"])
