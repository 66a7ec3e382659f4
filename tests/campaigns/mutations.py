"""Logs of every format that is read, and mutations of any file."""

import json
import re
from pathlib import Path

import h5py
import numpy as np
from mcap_ros2.writer import Writer
from scipy.io import savemat

from tests.storage.readers.test_mcap import FLOAT, IMU, JOINTS, START, header
from tests.storage.readers.test_mcap_messages import DESCRIPTORS, Messages, made, write
from tests.support.glider_ulog import write_glider_ulog
from tests.support.small_glider import RHO, channels, write_csv, write_parquet

#: Name of a format and a mutated file of it.
Mutated = tuple[str, bytes]
#: What is put in place of numbers and words.
_STRANGE = (
    b"nan", b"inf", b"-inf", b"1e400", b"-1e308", b"1e-320", b"0", b"-1", b"9" * 400, b'""', b"[]",
    b"{}", b"true", b"\x00", b"\xff\xfe", b"'''", b'"\\u202e"', b"<a>", b"]]>", b"&x;", b"[" * 90,
    b"{a=" * 90, b"(" * 90, b"1970-01-01", b"0x7fffffffffffffffff", b"alpha", b"=cmd|x", b"../../x",
    b"deg", b"lb", b"\xf0\x9f\x98\x80", b"\n", b"\t", b",", b"-", b"1/0", b"2**999999999",
)  # fmt: skip
_NUMBER, _WORD = re.compile(rb"-?\d+\.?\d*(?:e[-+]?\d+)?"), re.compile(rb"[A-Za-z_]{2,}")


def logs(folder: Path, seconds: float = 6.0) -> dict[str, Path]:
    """A flight of the small glider in every format: name -> file. Stamps of MCAP are 10 ms apart.

    MAT, HDF5 and text without units in their header need a mapping that states them.
    """
    folder.mkdir()
    table = channels(11, seconds, rate=100.0)
    plain = {name: np.asarray(values, float) for name, values in table.items()}
    names = [
        "ulog.ulg",
        "ros2.mcap",
        "json.mcap",
        "protobuf.mcap",
        "v5.mat",
        "table.h5",
        "text.txt",
    ]
    places = {name: folder / name for name in [*names, "table.csv", "table.parquet"]}
    write_glider_ulog(places["ulog.ulg"], 12, seconds)
    _write_ros2(places["ros2.mcap"], plain)
    for encoding in ("json", "protobuf"):
        _write_messages(places[f"{encoding}.mcap"], encoding, plain)
    savemat(places["v5.mat"], plain)
    with h5py.File(places["table.h5"], "w") as file:
        for name, values in plain.items():
            file[name] = values
    np.savetxt(
        places["text.txt"],
        np.column_stack(list(plain.values())),
        header=" ".join(plain),
        fmt="%.9g",
    )
    write_csv(places["table.csv"], table)
    write_parquet(places["table.parquet"], table)
    return places


def _imu(table: dict[str, np.ndarray], k: int) -> dict[str, object]:
    """sensor_msgs/Imu by REP 103."""
    p, q, r = (float(table[name][k]) for name in "pqr")
    ax, ay, az = (float(table[name][k]) for name in ("ax", "ay", "az"))
    return {
        "header": header(START + k * _NANOSECONDS),
        "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
        "orientation_covariance": [0.0] * 9,
        "angular_velocity": {"x": p, "y": -q, "z": -r},
        "linear_acceleration": {"x": ax, "y": -ay, "z": -az},
    }


def _joint(table: dict[str, np.ndarray], k: int) -> dict[str, object]:
    """sensor_msgs/JointState without its header."""
    angle = float(table["delta_elevator"][k])
    return {"name": ["elevator"], "position": [angle], "velocity": [], "effort": []}


_NANOSECONDS = 10_000_000
#: Topic -> channel of a std_msgs/Float64.
_FLOATS = {"/airspeed/true": "V", "/alpha": "alpha", "/beta": "beta"}
#: Of sensor_msgs/FluidPressure and Temperature, of dry air with the glider's density: topic ->
#: field, value, definition.
_KELVIN = 288.15
_AIR = {
    "/static_pressure": ("fluid_pressure", RHO * 287.053 * _KELVIN, "float64 fluid_pressure\n"),
    "/temperature": ("temperature", _KELVIN - 273.15, "float64 temperature\n"),
}


def _write_ros2(path: Path, table: dict[str, np.ndarray]) -> None:
    with path.open("wb") as out:
        writer = Writer(out, chunk_size=2048)
        imu = writer.register_msgdef("sensor_msgs/msg/Imu", IMU)
        joints = writer.register_msgdef("sensor_msgs/msg/JointState", JOINTS)
        number = writer.register_msgdef("std_msgs/msg/Float64", FLOAT)
        air = {
            topic: writer.register_msgdef(f"sensor_msgs/msg/{name}", definition)
            for (topic, (_, _, definition)), name in zip(
                _AIR.items(), ("FluidPressure", "Temperature"), strict=True
            )
        }
        for k in range(len(table["time"])):
            at = START + k * _NANOSECONDS
            writer.write_message("/imu/data", imu, _imu(table, k), log_time=at)
            for topic, name in _FLOATS.items():
                message = {"data": float(table[name][k])}
                writer.write_message(topic, number, message, log_time=at)
            for topic, (name, value, _) in _AIR.items():
                writer.write_message(topic, air[topic], {name: value}, log_time=at)
            joint = {**_joint(table, k), "header": header(at)}
            writer.write_message("/joint_states", joints, joint, log_time=at)
        writer.finish()


def _write_messages(path: Path, encoding: str, table: dict[str, np.ndarray]) -> None:
    """The IMU in an encoding, single values as JSON; 100 messages a second."""
    rows = range(len(table["time"]))
    messages: Messages = [json.dumps(_imu(table, k)).encode() for k in rows]
    schema = ("Imu", "jsonschema", b'{"type": "object"}')
    if encoding == "protobuf":
        kind = made("t.Imu")
        messages = [kind(**_imu(table, k)).SerializeToString() for k in rows]
        schema = ("t.Imu", "protobuf", DESCRIPTORS)
    single: dict[str, list[dict[str, object]]] = {
        topic: [{"data": float(table[name][k])} for k in rows] for topic, name in _FLOATS.items()
    }
    single |= {topic: [{name: value}] * len(rows) for topic, (name, value, _) in _AIR.items()}
    single |= {"/joint_states": [_joint(table, k) for k in rows]}
    others = [
        (topic, "json", None, [json.dumps(one).encode() for one in many])
        for topic, many in single.items()
    ]
    write(path, ("/imu/data", encoding, schema, messages), *others, plain=True)


def mutated(data: bytes, rng: np.random.Generator) -> bytes:
    """`data` with one to four mutations, each of a kind drawn at random."""
    for _ in range(int(rng.choice([1, 1, 1, 2, 4]))):
        data = _KINDS[int(rng.integers(len(_KINDS)))](data, rng)
    return data


def _at(data: bytes, rng: np.random.Generator) -> int:
    return int(rng.integers(max(1, len(data))))


def _cut(data: bytes, rng: np.random.Generator) -> bytes:
    return data[: _at(data, rng)]


def _flipped(data: bytes, rng: np.random.Generator) -> bytes:
    changed, bits = bytearray(data), int(rng.integers(1, 6))
    for at in rng.integers(0, len(data), bits) if data else ():
        changed[at] ^= 1 << int(rng.integers(8))
    return bytes(changed)


def _without(data: bytes, rng: np.random.Generator) -> bytes:
    at = _at(data, rng)
    return data[:at] + data[at + int(rng.integers(1, 300)) :]


def _repeated(data: bytes, rng: np.random.Generator) -> bytes:
    at = _at(data, rng)
    part = data[at : at + int(rng.integers(1, 300))]
    return data[:at] + part * int(rng.choice([2, 2, 6, 50])) + data[at + len(part) :]


def _noise(data: bytes, rng: np.random.Generator) -> bytes:
    at, size = _at(data, rng), int(rng.integers(1, 300))
    return data[:at] + rng.bytes(size) + data[at + size :]


def _strange(data: bytes, rng: np.random.Generator) -> bytes:
    at = _at(data, rng)
    return data[:at] + _STRANGE[int(rng.integers(len(_STRANGE)))] + data[at:]


def _strange_number(data: bytes, rng: np.random.Generator) -> bytes:
    found = list(_NUMBER.finditer(data))
    if not found:
        return _strange(data, rng)
    hit = found[int(rng.integers(len(found)))]
    return data[: hit.start()] + _STRANGE[int(rng.integers(len(_STRANGE)))] + data[hit.end() :]


def _lines_exchanged(data: bytes, rng: np.random.Generator) -> bytes:
    lines = data.split(b"\n")
    one, other = (int(k) for k in rng.integers(0, len(lines), 2))
    lines[one], lines[other] = lines[other], lines[one]
    return b"\n".join(lines)


def _word_of_the_file(data: bytes, rng: np.random.Generator) -> bytes:
    """One word replaced by another that the file has."""
    found = list(_WORD.finditer(data))
    if not found:
        return _flipped(data, rng)
    hit, other = (found[int(k)] for k in rng.integers(0, len(found), 2))
    return data[: hit.start()] + other.group() + data[hit.end() :]


_KINDS = (
    _cut, _flipped, _without, _repeated, _noise, _strange, _strange_number, _strange_number,
    _lines_exchanged, _word_of_the_file,
)  # fmt: skip
