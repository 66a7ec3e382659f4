"""ULog: same numbers as PX4's own reader; round trip; every lost byte is accounted for."""

import struct
import subprocess
import sys
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from pyulog import ULog

from aerodb.errors import InputError
from aerodb.logs.inspection import describe
from aerodb.logs.mapping import choose_mapping, map_recording
from aerodb.recording import Damage, Recording, Topic
from aerodb.storage.mappings import builtin_mappings
from aerodb.storage.readers.any_format import read_log
from aerodb.storage.readers.ulog import read_ulog
from aerodb.storage.writers.ulog import write_ulog
from aerodb.vehicle import parse_vehicle
from tests.support.command import aerodb

SAMPLES = ("sample.ulg", "sample_log_small.ulg", "sample_appended_multiple.ulg")


def example_topics(seconds: float = 4.0) -> list[Topic]:
    """Three topics of different rates, types and instances."""
    fast, slow = (
        np.arange(1, int(200 * seconds) + 1) / 200.0,
        np.arange(1, int(10 * seconds) + 1) / 10.0,
    )
    gyro = {f"xyz[{k}]": np.sin(fast + k).astype(np.float32) for k in range(3)}
    mixed = {
        "count": np.arange(len(slow), dtype=np.uint16),
        "level": np.arange(len(slow), dtype=np.int8),
        "on": np.arange(len(slow)) % 2 == 0,
        "lat": np.linspace(47.0, 48.0, len(slow)),
    }
    return [
        Topic("vehicle_angular_velocity", fast, gyro),
        Topic("battery", slow, mixed),
        Topic("battery.1", slow + 0.001, {k: v[::-1] for k, v in mixed.items()}),
    ]


@pytest.fixture
def log(tmp_path: Path) -> Path:
    path = tmp_path / "flight.ulg"
    write_ulog(
        path,
        example_topics(),
        metadata={"sys_name": "PX4", "ver_hw": "V5"},
        parameters={"A_B": 1.5, "N": 7},
    )
    return path


def file_damage(recording: Recording) -> list[Damage]:
    return [damage for damage in recording.damage if not damage.topic]


def messages(data: bytes) -> list[tuple[int, int, int]]:
    """Offset, end and type of every message of an intact log: an independent, plain walk."""
    at, found = 16, []
    while at < len(data):
        end = at + 3 + int.from_bytes(data[at : at + 2], "little")
        found.append((at, end, data[at + 2]))
        at = end
    assert at == len(data)
    return found


@pytest.mark.parametrize("name", SAMPLES)
def test_same_arrays_as_pyulog_on_measured_logs(name: str, measured: Callable[[str], Path]) -> None:
    path = measured(f"px4_ulog/{name}")
    ours, theirs = read_log(path), ULog(str(path))
    assert ours.layout == "px4"
    assert ours.metadata["ver_sw"] == theirs.msg_info_dict["ver_sw"]
    expected = {
        f"{d.name}.{d.multi_id}" if d.multi_id else d.name: d.data for d in theirs.data_list
    }
    assert set(ours.topics) == set(expected)
    for topic, data in expected.items():
        read = ours.topics[topic]
        np.testing.assert_array_equal(read.time, data["timestamp"] * 1e-6)
        assert list(read.fields) == [field for field in data if field != "timestamp"]
        for field, values in read.fields.items():
            assert values.dtype == data[field].dtype
            np.testing.assert_array_equal(values, data[field])
    assert sum(d.kind == "dropout" for d in file_damage(ours)) == len(theirs.dropouts)
    assert not [d for d in ours.damage if d.kind in ("framing", "lost_tail")]


def test_dropout_is_located_in_the_topics_that_lost_samples(
    measured: Callable[[str], Path],
) -> None:
    recording = read_ulog(measured("px4_ulog/sample_log_small.ulg"))
    lost = {d.topic: d for d in recording.damage if d.kind == "dropout" and d.topic}
    rates = lost["vehicle_angular_velocity"]
    time = recording.topics["vehicle_angular_velocity"].time
    assert rates.start is not None
    assert rates.end is not None
    assert not np.any((time > rates.start) & (time < rates.end))
    assert rates.end - rates.start == pytest.approx(0.163747, abs=1e-6)
    assert recording.start_utc == datetime(2021, 4, 21, 6, 30, 58, 437779, tzinfo=UTC)


def test_what_is_written_is_read_by_pyulog_and_by_us(log: Path) -> None:
    ours, theirs = read_ulog(log), ULog(str(log))
    assert not theirs.file_corruption
    assert ours.damage == ()
    for topic in example_topics():
        name, _, instance = topic.name.partition(".")
        data = theirs.get_dataset(name, int(instance or 0)).data
        np.testing.assert_array_equal(
            data["timestamp"], np.round(topic.time * 1e6).astype(np.uint64)
        )
        np.testing.assert_allclose(ours.topics[topic.name].time, topic.time, rtol=0, atol=1e-9)
        for field, values in topic.fields.items():
            read = ours.topics[topic.name].fields[field]
            np.testing.assert_array_equal(read, values)
            np.testing.assert_array_equal(data[field], values)
    assert (ours.metadata["sys_name"], ours.metadata["param:A_B"], ours.metadata["param:N"]) == (
        "PX4",
        1.5,
        7,
    )
    assert theirs.message_formats["vehicle_angular_velocity"].fields[1] == ("float", 3, "xyz")


def test_messages_stand_in_the_order_of_time(log: Path) -> None:
    data = log.read_bytes()
    stamps = [
        int.from_bytes(data[at + 5 : at + 13], "little")
        for at, _, kind in messages(data)
        if kind == ord("D")
    ]
    assert len(stamps) == 880
    assert stamps == sorted(stamps)


def test_start_utc_survives(tmp_path: Path) -> None:
    start = datetime(2024, 5, 6, 7, 8, 9, 123456, tzinfo=UTC)
    write_ulog(tmp_path / "a.ulg", example_topics(), start_utc=start)
    assert read_ulog(tmp_path / "a.ulg").start_utc == start


def test_only_the_topics_asked_for(log: Path) -> None:
    some = read_ulog(log, topics=["battery"])
    assert sorted(some.topics) == ["battery", "battery.1"]
    np.testing.assert_array_equal(
        some.topics["battery"].fields["count"], read_ulog(log).topics["battery"].fields["count"]
    )


def test_cut_anywhere_keeps_all_whole_messages_and_reports_the_rest(log: Path) -> None:
    data = log.read_bytes()
    found = messages(data)
    for cut in np.random.default_rng(1).integers(found[20][0], len(data), 40):
        log.write_bytes(data[:cut])
        recording = read_ulog(log)
        whole = [(at, end) for at, end, kind in found if kind == ord("D") and end <= cut]
        boundary = max(end for _, end, _ in found if end <= cut)
        assert sum(len(t.time) for t in recording.topics.values()) == len(whole)
        lost = [d for d in recording.damage if d.kind == "lost_tail"]
        assert [d.bytes_lost for d in lost] == ([cut - boundary] if cut > boundary else [])


@pytest.mark.parametrize("fill", [b"\x00", b"\xff", b"D"])
def test_overwritten_block_is_excised_and_located(log: Path, fill: bytes) -> None:
    """A bad block of a memory card: everything outside it is read, what was in it is reported with
    its times."""
    data = bytearray(log.read_bytes())
    found = [(at, end) for at, end, kind in messages(bytes(data)) if kind == ord("D")]
    first, last = found[300], found[420]
    data[first[0] + 2 : last[0] + 7] = fill * (last[0] + 5 - first[0])
    log.write_bytes(data)
    recording = read_ulog(log)
    assert sum(len(t.time) for t in recording.topics.values()) == len(found) - 121
    (place,) = file_damage(recording)
    assert (place.kind, place.bytes_lost) == ("framing", last[1] - first[0])
    (rates,) = [d for d in recording.damage if d.topic == "vehicle_angular_velocity"]
    before, after = recording.topics["vehicle_angular_velocity"].time, example_topics()[0].time
    absent = np.setdiff1d(np.round(after * 1e6), np.round(before * 1e6)) * 1e-6
    assert f"about {len(absent)} samples" in rates.what
    assert rates.start is not None
    assert rates.end is not None
    assert rates.start < absent.min() < absent.max() < rates.end


def test_what_looks_like_a_record_amid_damage_is_not_believed(log: Path) -> None:
    """Five stray bytes have the form of a dropout report; only what further records follow
    counts."""
    data = bytearray(log.read_bytes())
    found = [(at, end) for at, end, kind in messages(bytes(data)) if kind == ord("D")]
    first, last = found[300][0], found[320][0]
    data[first:last] = bytes(40) + b"\x02\x00O\x05\x00" + bytes(last - first - 45)
    log.write_bytes(data)
    recording = read_ulog(log)
    assert [(d.kind, d.bytes_lost) for d in file_damage(recording)] == [("framing", last - first)]


def test_lost_announcement_and_lost_format_are_reported_by_topic(log: Path) -> None:
    data = log.read_bytes()
    for kind, expected in (("A", ""), ("F", "vehicle_angular_velocity")):
        at = next(a for a, _, k in messages(data) if k == ord(kind))
        log.write_bytes(data[:at] + bytes([255, 255, 0]) + data[at + 3 :])
        recording = read_ulog(log)
        assert "vehicle_angular_velocity" not in recording.topics
        assert len(recording.topics["battery"].time) == 40
        (entry,) = [d for d in recording.damage if d.kind == "values"]
        assert entry.topic == expected
        assert entry.what.startswith("800 messages not decoded")


def test_data_appended_after_a_crash_are_read_behind_a_cut_record(log: Path) -> None:
    """PX4 appends what it finds in memory after a hard fault, and notes the offset in the flag bits
    message."""
    data = log.read_bytes()
    found = [(at, end) for at, end, kind in messages(data) if kind == ord("D")]
    cut = found[400][0] + 6
    flags = bytearray(data[19:59])
    flags[8] = 1
    flags[16:24] = cut.to_bytes(8, "little")
    log.write_bytes(data[:19] + bytes(flags) + data[59:cut] + data[found[401][0] :])
    recording = read_ulog(log)
    assert sum(len(t.time) for t in recording.topics.values()) == len(found) - 1
    assert [(d.kind, d.bytes_lost) for d in file_damage(recording)] == [("framing", 6)]
    log.write_bytes(log.read_bytes()[: found[399][1]])
    assert [(d.kind, d.bytes_lost) for d in file_damage(read_ulog(log))] == [("lost_tail", 0)]


def test_clock_that_runs_backwards_is_reported(tmp_path: Path) -> None:
    time = np.array([1.0, 2.0, 3.0, 2.5, 4.0])
    write_ulog(tmp_path / "a.ulg", [Topic("a", time, {"x": np.arange(5.0)})])
    recording = read_ulog(tmp_path / "a.ulg")
    np.testing.assert_allclose(recording.topics["a"].time, time)
    (entry,) = recording.damage
    assert (entry.kind, entry.topic, entry.start) == ("time", "a", 3.0)


def test_format_of_absurd_size_costs_its_topic_only(log: Path) -> None:
    """An array of 60,000 arrays of 60,000: the sizes are multiplied, nothing is allocated."""
    data = log.read_bytes()
    at = next(a for a, _, k in messages(data) if k == ord("F"))
    nested = b"".join(
        len(text).to_bytes(2, "little") + b"F" + text
        for text in (b"deep:uint64_t timestamp;wide[60000] x;", b"wide:deep[60000] y;")
    )
    announced = (7).to_bytes(2, "little") + b"A" + bytes([0, 99, 0]) + b"deep"
    log.write_bytes(
        data[:at]
        + nested
        + data[at:]
        + announced
        + (20).to_bytes(2, "little")
        + b"D"
        + bytes([99, 0])
        + bytes(18)
    )
    recording = read_ulog(log)
    assert len(recording.topics) == 3
    assert [d.topic for d in recording.damage if d.kind == "values"] == ["deep"]


@pytest.mark.parametrize(
    ("content", "what"),
    [
        (b"", "empty"),
        (b"ULog\x01\x12\x35\x01", "header is incomplete"),
        (b"ULog\x01\x12\x35\x01" + bytes(8), "no data"),
        (b"ULog\x01\x12\x35\x01" + bytes(8) + b"\xff\xffD" + bytes(300), "no data"),
        (b"PX\x03\x04 not a log", "not a ULog file"),
        (b"PK\x03\x04 not a log", "a damaged archive"),
        (
            b"ULog\x01\x12\x35\x01" + bytes(8) + b"\x28\x00B" + bytes(8) + b"\x02" + bytes(31),
            "ncompatible flag",
        ),
    ],
)
def test_refused(tmp_path: Path, content: bytes, what: str) -> None:
    path = tmp_path / "bad.ulg"
    path.write_bytes(content)
    with pytest.raises(InputError, match=what) as refusal:
        read_log(path)
    assert str(path) in str(refusal.value)
    assert refusal.value.remedy


def test_absent_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"nowhere\.ulg"):
        read_log(tmp_path / "nowhere.ulg")


@pytest.mark.parametrize(
    ("topic", "what"),
    [
        (Topic("a b", np.ones(1), {}), "is not allowed as a topic"),
        (Topic("a", np.ones(1), {"x.y": np.ones(1)}), "is not allowed as a field"),
        (Topic("a", np.ones(1), {"x": np.ones(1, dtype=complex)}), "has type"),
        (Topic("a", np.ones(1), {"x[1]": np.ones(1)}), "has gaps"),
        (Topic("a", np.array([np.nan]), {"x": np.ones(1)}), "times must be finite"),
        (Topic("a", np.ones(2), {"x": np.ones(1)}), "values for"),
    ],
)
def test_what_ulog_cannot_hold_is_refused_and_nothing_is_left_behind(
    tmp_path: Path, topic: Topic, what: str
) -> None:
    with pytest.raises(InputError, match=what):
        write_ulog(tmp_path / "a.ulg", [topic])
    assert list(tmp_path.iterdir()) == []


def test_inspection_shows_rates_and_gaps(log: Path) -> None:
    summary = describe(read_ulog(log))
    rates = {topic.name: topic.rate for topic in summary.topics}
    assert rates == pytest.approx(
        {"battery": 10.0, "battery.1": 10.0, "vehicle_angular_velocity": 200.0}
    )
    assert (summary.start, summary.end) == pytest.approx((0.005, 4.001))
    time = np.array([0.0, 0.1, 0.2, 0.3, 1.0, 1.1])
    (topic,) = describe(Recording("", "ulog", "", 0, {"a": Topic("a", time, {})})).topics
    assert (topic.longest_gap, topic.gaps[0].samples) == pytest.approx((0.7, 6))


VEHICLE = """
name = "wing"
[reference]
area = 1.0
chord = 0.3
span = 3.0
[points]
moment_reference = "cg"
[mass]
mass = 5.0
cg = [0, 0, 0]
Ixx = 1
Iyy = 1
Izz = 1
Ixz = 0
[surfaces.elevator]
limits = ["-25 deg", "20 deg"]
scale = "20 deg"
"""


#: What PX4 logs of a fixed wing in level flight: topic -> field -> level.
LEVEL_FLIGHT = {
    "vehicle_angular_velocity": {"xyz[0]": 0.0, "xyz[1]": 0.0, "xyz[2]": 0.0},
    "vehicle_acceleration": {"xyz[0]": 0.0, "xyz[1]": 0.0, "xyz[2]": -9.8},
    "vehicle_attitude": {"q[0]": 1.0, "q[1]": 0.0, "q[2]": 0.0, "q[3]": 0.0},
    "airspeed_validated": {"calibrated_airspeed_m_s": 28.0, "true_airspeed_m_s": 30.0},
    "airflow_aoa": {"aoa_rad": 0.05},
    "airflow_slip": {"slip_rad": 0.0},
    "vehicle_air_data": {
        "rho": 1.1,
        "baro_pressure_pa": 9e4,
        "baro_alt_meter": 1000.0,
        "ambient_temperature": 12.0,
    },
    "vehicle_local_position": {"x": 0.0, "y": 0.0, "z": 0.0, "vx": 30.0, "vy": 0.0, "vz": 0.0},
    "vehicle_torque_setpoint": {"xyz[0]": 0.0, "xyz[1]": 0.0, "xyz[2]": 0.0},
}


def test_px4_mapping_gives_the_channels(tmp_path: Path) -> None:
    time = np.arange(1, 501) / 100.0
    wave = (0.05 * np.sin(0.3 * time)).astype(np.float32)
    topics = [
        Topic(name, time, {field: np.float32(level) + wave for field, level in levels.items()})
        for name, levels in LEVEL_FLIGHT.items()
    ]
    write_ulog(tmp_path / "a.ulg", topics, metadata={"sys_name": "PX4"})
    recording = read_log(tmp_path / "a.ulg")
    mapping = choose_mapping(recording, builtin_mappings().values())
    assert mapping.name == "px4"
    flight = map_recording(recording, mapping, parse_vehicle(VEHICLE))
    for name in (
        "p",
        "az_imu",
        "theta",
        "V",
        "alpha",
        "beta",
        "rho",
        "static_pressure",
        "altitude",
        "velocity_north",
    ):
        assert name in flight, name
    assert np.mean(flight["az_imu"]) == pytest.approx(-9.8, abs=0.1)
    assert np.mean(flight["temperature"]) == pytest.approx(285.15, abs=0.1)
    raw = recording.topics["vehicle_torque_setpoint"].fields["xyz[1]"]
    assert np.max(flight["delta_elevator"]) == pytest.approx(
        np.deg2rad(20.0) * np.max(raw), rel=1e-3
    )


def test_px4_mapping_knows_former_names(measured: Callable[[str], Path]) -> None:
    """sample.ulg is of 2016: rates and accelerations stand in sensor_combined, commands in
    actuator_controls_0."""
    recording = read_log(measured("px4_ulog/sample.ulg"))
    flight = map_recording(recording, builtin_mappings()["px4"], parse_vehicle(VEHICLE))
    for name in ("p", "q", "r", "ax_imu", "az_imu", "phi", "velocity_north", "delta_elevator"):
        assert name in flight, name
    assert np.median(flight["az_imu"]) == pytest.approx(-9.8, abs=0.5)


def test_one_topic_without_a_timestamp_costs_no_other(tmp_path: Path) -> None:
    """A flipped byte in one format once made pyulog stop, without a word, before all the topics
    that follow."""
    path = tmp_path / "a.ulg"
    topics = [
        Topic(name, np.arange(1.0, 11.0), {"x": np.arange(10.0)}) for name in ("aaa", "bbb", "ccc")
    ]
    write_ulog(path, topics, metadata={"sys_name": "PX4"})
    whole = path.read_bytes()
    path.write_bytes(whole.replace(b"bbb:uint64_t timestamp", b"bbb:uint64_t timestanp"))
    recording = read_ulog(path)
    assert sorted(recording.topics) == ["aaa", "ccc"]
    (damage,) = recording.damage
    assert (damage.topic, damage.kind) == ("bbb", "values")
    assert damage.what.startswith("10 messages not decoded")


def test_the_time_of_booting_dates_a_log(tmp_path: Path) -> None:
    """PX4 from version 1.17 states when it booted; the header's time counts from there."""
    write_ulog(tmp_path / "a.ulg", example_topics())
    data, booted, key = (tmp_path / "a.ulg").read_bytes(), 1710253330000000, b"boot_time_utc_us"
    text = b"uint64_t " + key
    body = bytes([len(text)]) + text + struct.pack("<Q", booted)
    at = 16 + (3 + struct.unpack_from("<H", data, 16)[0] if data[18:19] == b"B" else 0)
    dated = data[:at] + struct.pack("<HB", len(body), ord("I")) + body + data[at:]
    (tmp_path / "a.ulg").write_bytes(dated)
    header = struct.unpack_from("<Q", data, 8)[0]
    expected = datetime.fromtimestamp((booted + header) * 1e-6, UTC)
    assert read_ulog(tmp_path / "a.ulg").start_utc == expected
    said = aerodb(tmp_path, "log", "inspect", str(tmp_path / "a.ulg"), "-v").stdout
    assert f"begins {expected:%Y-%m-%d %H:%M:%S} UTC" in said


def test_a_prepared_reader_has_every_compiled_loop() -> None:
    """A process that may write nowhere cannot compile one (`aerodb.tasks.workers`)."""
    code = (
        "from aerodb.storage.readers import prepare_reader, ulog_kernels as k\n"
        "prepare_reader('.ulg')\n"
        "print([len(each.signatures) for each in (k.walk, k.candidate, k.copy)])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "0" not in done.stdout, done.stdout
