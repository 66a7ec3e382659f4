"""Readers of tables: compared with scipy and pandas, on measured files, and on damaged or foreign
files."""

import struct
import zlib
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io

from aerodb.errors import InputError
from aerodb.recording import Recording
from aerodb.storage.readers.tabular import read_tabular

RNG = np.random.default_rng(11)
TABLE = np.column_stack([np.arange(40) * 0.02, RNG.normal(size=(40, 3))])


def _mat(path: Path, compressed: bool = False) -> Path:
    content = {
        "fdata": TABLE,
        "t": TABLE[:, :1],
        "dt": 0.02,
        "pilot": "Ann",
        "info": {"area": 10.3, "counts": np.arange(40, dtype="i2")},
    }
    scipy.io.savemat(path, content, do_compression=compressed)
    return path


def _hdf5(path: Path) -> Path:
    with h5py.File(path, "w", userblock_size=512) as file:
        file["fdata"] = TABLE.T
        file["t"] = TABLE[None, :, 0]
        file.create_dataset("packed", data=TABLE.T, chunks=(2, 20), compression="gzip")
        file["info/area"] = [[10.3]]
        file["pilot"] = np.array([[65], [110], [110]], dtype="u2")
        file["pilot"].attrs["MATLAB_class"] = np.bytes_("char")
    return path


def _parquet(path: Path) -> Path:
    fields = [
        pa.field("time", pa.float64(), metadata={"unit": "s"}),
        pa.field("alpha", pa.float64(), metadata={"unit": "deg"}),
    ]
    pq.write_table(pa.table([TABLE[:, 0], TABLE[:, 1]], schema=pa.schema(fields)), path)
    return path


def _csv(path: Path) -> Path:
    pd.DataFrame(TABLE, columns=["time [s]", "alpha (deg)", "V [ft/s]", "note"]).to_csv(
        path, index=False
    )
    return path


def _ascii(path: Path) -> Path:
    np.savetxt(path, TABLE)
    return path


WRITERS: dict[str, Callable[[Path], Path]] = {
    "plain.mat": _mat,
    "packed.mat": lambda path: _mat(path, compressed=True),
    "v73.mat": _hdf5,
    "t.parquet": _parquet,
    "t.csv": _csv,
    "t.asc": _ascii,
}


@pytest.mark.parametrize("compressed", [False, True])
def test_mat_5_equals_scipy(tmp_path: Path, compressed: bool) -> None:
    recording = read_tabular(_mat(tmp_path / "x.mat", compressed))
    fdata = recording.topics["fdata"]
    assert list(fdata.fields) == ["1", "2", "3", "4"]
    np.testing.assert_array_equal(np.column_stack(list(fdata.fields.values())), TABLE)
    assert set(recording.topics["table"].fields) == {"t", "info.counts"}
    np.testing.assert_array_equal(recording.topics["table"].fields["info.counts"], np.arange(40))
    assert recording.metadata == {"dt": 0.02, "pilot": "Ann", "info.area": 10.3}
    assert recording.damage == ()


@pytest.mark.parametrize(
    "name", ["totter_f1_017_data.mat", "totter_demo_data.mat", "totter_9752ed20_data.mat"]
)
def test_measured_mat_equals_scipy(measured: Callable[[str], Path], name: str) -> None:
    path = measured(f"twin_otter/{name}")
    recording = read_tabular(path)
    expected = scipy.io.loadmat(path)["fdata"]
    np.testing.assert_array_equal(
        np.column_stack(list(recording.topics["fdata"].fields.values())), expected
    )
    assert recording.damage == ()
    assert recording.size == path.stat().st_size


def test_mat_7_3(tmp_path: Path) -> None:
    recording = read_tabular(_hdf5(tmp_path / "x.mat"))
    for name in ("fdata", "packed"):
        np.testing.assert_array_equal(
            np.column_stack(list(recording.topics[name].fields.values())), TABLE
        )
    np.testing.assert_array_equal(recording.topics["table"].fields["t"], TABLE[:, 0])
    assert recording.metadata == {"info.area": 10.3, "pilot": "Ann"}


def test_matrix_with_samples_along_its_rows(tmp_path: Path) -> None:
    scipy.io.savemat(tmp_path / "x.mat", {"velocity": TABLE[:, 1:4].T})
    fields = read_tabular(tmp_path / "x.mat").topics["velocity"].fields
    np.testing.assert_array_equal(fields["2"], TABLE[:, 2])


def test_parquet_units_nulls_and_times(tmp_path: Path) -> None:
    columns = {
        "alpha": pa.array([1.0, None, 3.0]),
        "when": pa.array([0, 500, 1000], pa.timestamp("ms")),
        "flag": pa.array([True, False, True]),
        "name": pa.array(["a", "b", "c"]),
    }
    pq.write_table(pa.table(columns), tmp_path / "x.parquet")
    recording = read_tabular(tmp_path / "x.parquet")
    topic = recording.topics["table"]
    np.testing.assert_array_equal(topic.fields["alpha"], [1.0, np.nan, 3.0])
    np.testing.assert_allclose(topic.fields["when"], [0.0, 0.5, 1.0])
    np.testing.assert_array_equal(topic.fields["flag"], [1.0, 0.0, 1.0])
    assert topic.units == {"when": "s"}
    assert recording.metadata["skipped"] == "name"
    assert read_tabular(_parquet(tmp_path / "y.parquet")).topics["table"].units == {
        "time": "s",
        "alpha": "deg",
    }


def test_csv_header_units(tmp_path: Path) -> None:
    topic = read_tabular(_csv(tmp_path / "x.csv")).topics["table"]
    assert topic.units == {"time": "s", "alpha": "deg", "V": "ft/s"}
    np.testing.assert_array_equal(np.column_stack(list(topic.fields.values())), TABLE)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("1 2\n3 4\n", {"1": [1, 3], "2": [2, 4]}),
        ("  1   2 \n\n 3  4\n", {"1": [1, 3], "2": [2, 4]}),
        ("# made by hand\n# a b\n1 2\n3 4\n", {"a": [1, 3], "b": [2, 4]}),
        ("a;b\n1,5;2\n3,25;4\n", {"a": [1.5, 3.25], "b": [2, 4]}),
        ("a,b\r\n1,2\r\n3,\r\n", {"a": [1, 3], "b": [2, np.nan]}),
        ('"a, left",b\n"1",2\n3,4\n', {"a, left": [1, 3], "b": [2, 4]}),
        ("\ufeffa,b\n1,2\n3,4\n", {"a": [1, 3], "b": [2, 4]}),
        ("  1.0e+000 -2.5e-001\n  3.0e+000  4.0e+000\n", {"1": [1, 3], "2": [-0.25, 4]}),
    ],
)
def test_text_forms(tmp_path: Path, text: str, expected: dict[str, list[float]]) -> None:
    (tmp_path / "x.txt").write_text(text, encoding="utf-8", newline="")
    fields = read_tabular(tmp_path / "x.txt").topics["table"].fields
    assert list(fields) == list(expected)
    for name, values in expected.items():
        np.testing.assert_array_equal(fields[name], values)


def test_measured_text_and_parquet(measured: Callable[[str], Path]) -> None:
    attas = measured("attas/fAttas_qst02.asc")
    fields = read_tabular(attas).topics["table"].fields
    np.testing.assert_array_equal(np.column_stack(list(fields.values())), np.loadtxt(attas))
    citation = measured("citation/flight_2019-03-12.parquet")
    expected = pd.read_parquet(citation)["vane_AOA"].to_numpy()
    np.testing.assert_array_equal(
        read_tabular(citation).topics["table"].fields["vane_AOA"], expected
    )


def test_cut_text_loses_only_its_last_line(tmp_path: Path) -> None:
    path = _csv(tmp_path / "x.csv")
    path.write_bytes(path.read_bytes()[:-7])
    recording = read_tabular(path)
    np.testing.assert_array_equal(recording.topics["table"].fields["alpha"], TABLE[:-1, 1])
    assert [entry.kind for entry in recording.damage] == ["lost_tail"]


@pytest.mark.parametrize("compressed", [False, True])
def test_cut_mat_keeps_what_stands_before(tmp_path: Path, compressed: bool) -> None:
    path = _mat(tmp_path / "x.mat", compressed)
    path.write_bytes(path.read_bytes()[:-40])
    recording = read_tabular(path)
    np.testing.assert_array_equal(recording.topics["fdata"].fields["2"], TABLE[:, 1])
    assert [entry.kind for entry in recording.damage] == ["lost_tail"]


def test_damaged_cells_are_reported(tmp_path: Path) -> None:
    (tmp_path / "x.csv").write_text("a,b\n1,2\n1.#5,3\n4,5\n6,7\n")
    recording = read_tabular(tmp_path / "x.csv")
    np.testing.assert_array_equal(recording.topics["table"].fields["a"], [1, np.nan, 4, 6])
    assert recording.damage[0].kind == "values"
    assert "'a'" in recording.damage[0].what
    assert "row 2" in recording.damage[0].what


@pytest.mark.parametrize(
    ("name", "content", "what"),
    [
        ("empty.csv", b"", "empty"),
        ("picture.mat", b"\x89PNG\r\n\x1a\n" + bytes(300), "not a .mat file"),
        ("picture.csv", b"\x89PNG\r\n\x1a\n" + bytes(300), "not a text file"),
        ("cut.parquet", b"PAR1" + bytes(100), "Parquet"),
        ("cut.h5", b"\x89HDF\r\n\x1a\n" + bytes(100), "HDF5"),
        ("ragged.csv", b"a,b\n1,2\n3,4,5\n6,7\n", "line 3 has 3 fields"),
        ("short.txt", b"# c\n1 2\n3\n4 5\n", "line 3 has 1 fields"),
        ("words.csv", b"a,b\nx,y\nz,w\n", "no column contains numbers"),
        ("header.csv", b"a,b\n", "no rows"),
        ("wider.csv", b"a,b,c\n1,2\n3,4\n", "line 2 has 2 fields, 3 were expected"),
        ("short.mat", b"MATLAB 5.0 MAT-file" + bytes(20), "not a .mat file"),
        ("nothing.mat", b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM", "no table"),
        ("log.xyz", b"1 2\n", "unknown kind"),
    ],
)
def test_unusable_files_are_refused_with_place_and_remedy(
    tmp_path: Path, name: str, content: bytes, what: str
) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError) as refusal:
        read_tabular(tmp_path / name)
    assert what in refusal.value.what
    assert name in refusal.value.where
    assert refusal.value.remedy


def test_absent_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"No such file|cannot be read"):
        read_tabular(tmp_path / "absent.csv")


def _mat_element(kind: int, payload: bytes, declared: int | None = None) -> bytes:
    size = len(payload) if declared is None else declared
    padding = 0 if kind == 15 else -len(payload) % 8
    return struct.pack("<II", kind, size) + payload + bytes(padding)


def _mat_file(*elements: bytes) -> bytes:
    return b"MATLAB 5.0 MAT-file".ljust(116) + bytes(8) + b"\x00\x01IM" + b"".join(elements)


def _variable(
    name: bytes, shape: tuple[int, int], values: bytes, declared: int | None = None
) -> bytes:
    parts = (
        _mat_element(6, struct.pack("<II", 6, 0)),
        _mat_element(5, struct.pack("<ii", *shape)),
        _mat_element(1, name),
        _mat_element(9, values, declared),
    )
    return b"".join(parts)


GOOD = _mat_element(14, _variable(b"good", (2, 2), np.arange(4.0).tobytes()))
HUGE = 0xFFFFFFF0


@pytest.mark.parametrize(
    "bad",
    [
        _mat_element(14, _variable(b"bad", (2, 2), np.arange(4.0).tobytes(), declared=HUGE)),
        _mat_element(14, _variable(b"bad", (2**31 - 1, 2**31 - 1), np.arange(4.0).tobytes())),
        _mat_element(14, _variable(b"bad", (-2, -2), np.arange(4.0).tobytes())),
        _mat_element(15, zlib.compress(struct.pack("<II", 14, HUGE) + bytes(64))),
        _mat_element(15, zlib.compress(struct.pack("<II", 14, 1000) + bytes(64))),
        _mat_element(15, b"not deflated"),
    ],
)
def test_absurd_sizes_are_reported_and_the_rest_is_kept(tmp_path: Path, bad: bytes) -> None:
    (tmp_path / "x.mat").write_bytes(_mat_file(bad, GOOD))
    recording = read_tabular(tmp_path / "x.mat")
    np.testing.assert_array_equal(recording.topics["good"].fields["2"], [2.0, 3.0])
    assert [entry.kind for entry in recording.damage] == ["framing"]


def test_absurd_size_of_the_last_variable_is_a_lost_tail(tmp_path: Path) -> None:
    (tmp_path / "x.mat").write_bytes(_mat_file(GOOD, struct.pack("<II", 14, HUGE)))
    recording = read_tabular(tmp_path / "x.mat")
    assert [entry.kind for entry in recording.damage] == ["lost_tail"]


def test_hdf5_that_declares_more_than_it_stores(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "x.h5", "w") as file:
        file["good"] = TABLE.T
        file.create_dataset("bad", shape=(10**6, 10**6), chunks=(1000, 1000), dtype="f8")
    recording = read_tabular(tmp_path / "x.h5")
    assert "good" in recording.topics
    assert "bad" in recording.damage[0].what


@pytest.mark.heavy
@pytest.mark.parametrize("name", list(WRITERS))
@pytest.mark.parametrize("harm", ["cut", "flip"])
def test_damaged_bytes_give_a_recording_or_a_refusal(
    tmp_path: Path, trials, name: str, harm: str
) -> None:
    whole = WRITERS[name](tmp_path / name).read_bytes()
    rng = np.random.default_rng(3)
    cut_silently, count = 0, trials(100, 2000)
    for _ in range(count):
        data = bytearray(whole)
        if harm == "cut":
            data = data[: rng.integers(1, len(data))]
        else:
            for place in rng.integers(0, len(data), rng.integers(1, 4)):
                data[place] ^= 1 << int(rng.integers(8))
        path = tmp_path / f"harmed-{name}"
        path.write_bytes(data)
        try:
            recording = read_tabular(path)
        except InputError:
            continue
        assert isinstance(recording, Recording)
        cut_silently += harm == "cut" and not recording.damage
    # A cut exactly at the end of a line or variable leaves a file that is whole in itself.
    assert cut_silently <= 0.05 * count
