"""DataFlash (ArduPilot): every record that is there is read with its units, and every byte that is
not is reported."""

import importlib.util
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from aerodb.errors import InputError
from aerodb.logs import choose_mapping, map_recording
from aerodb.recording import Recording
from aerodb.storage.mappings import builtin_mappings
from aerodb.storage.readers.any_format import read_log
from aerodb.vehicle import parse_vehicle
from tests.support.dataflash_log import DataFlashWriter

RATE, SAMPLES = 50, 400
VEHICLE = """
name = "plane"
[reference]
area = 0.5
chord = 0.25
span = 2.0
[points]
moment_reference = "cg"
imu = "cg"
[mass]
source = "constant"
mass = 2.0
cg = [0.0, 0.0, 0.0]
Ixx = 0.1
Iyy = 0.1
Izz = 0.2
Ixz = 0.0
[surfaces.elevator]
limits = ["-30 deg", "30 deg"]
scale = "-25 deg"
[surfaces.aileron]
limits = ["-30 deg", "30 deg"]
scale = "0.05 deg"
offset = "-75 deg"
[surfaces.aileron.log]
topic = "RCOU"
field = "C1"
unit = "1"
"""


def written(samples: int = SAMPLES, units: bool = True) -> DataFlashWriter:
    """A plane's log: two IMUs, attitude, GPS, barometer, airspeed, filter, commands."""
    log = DataFlashWriter.begun(units=units)
    log.add("MSG", 1000, "ArduPlane V4.3.0 (abcdef01)")
    log.add("PARM", 1001, "ARSPD_RATIO", 1.9936, 2.0)
    log.add("PARM", 1002, "SERVO1_FUNCTION", 4.0, 0.0)
    for k in range(samples):
        us = 5_000_000 + k * 1_000_000 // RATE
        t = k / RATE
        for unit in (0, 1):
            gyro = (0.1 * np.sin(t), 0.2 * np.cos(t), 0.01 * unit)
            log.add("IMU", us, unit, *gyro, 0.3, -0.2, -9.8, 0, 0, 31.5, 1, 1, 1000, 1000)
        roll, pitch, yaw = 10 * np.sin(t), 5.25, 359.5 if k % 2 else 0.5
        log.add("ATT", us + 100, 0.0, roll, 0.0, pitch, 0.0, yaw, 0.1, 0.1, 3)
        if k % 5 == 0:
            gps = (3, 388_800_000 + k * 1000 // RATE, 2240, 12, 0.8)
            log.add(
                "GPS", us + 200, 0, *gps, 47.1234567, 8.7654321, 512.25, 15.0, 90.0, -0.5, 0.0, 1
            )
            log.add("BARO", us + 300, 0, 12.5, 95000.0, 24.5, 0.1, us // 1000, 0.0, 20.0, 1)
            log.add("ARSP", us + 400, 0, 15.0, 140.0, 22.25, 141.0, 1.0, 1, 1, 1.0, 0.0, 0)
        filtered = (10 * np.sin(t), 5.0, 90.0, 1.5, 15.0, -0.5, 0.0, 3.0 * t, 15.0 * t, -100.0)
        log.add("XKF1", us + 500, 0, *filtered, 0.1, 0.1, 0.1, 500.0)
        log.add("XKF2", us + 600, 0, 0, 0, 0, 2.25, -1.5, *[0] * 6, 0.0, 0.0, 0.0)
        log.add("AETR", us + 700, 450, -900, 50, 90, 0)
        log.add("RCOU", us + 800, 1600, 1400, 1500, 1500)
    return log


def read(tmp_path: Path, data: bytes, name: str = "a.bin") -> Recording:
    (tmp_path / name).write_bytes(data)
    return read_log(tmp_path / name)


def test_a_log_is_read_as_it_was_written(tmp_path: Path) -> None:
    log = read(tmp_path, bytes(written().data))
    assert (log.format, log.layout, log.damage) == ("dataflash", "ardupilot", ())
    t = np.arange(SAMPLES) / RATE
    imu = log.topics["IMU"]
    np.testing.assert_allclose(imu.time, 5.0 + t, atol=1e-9)
    np.testing.assert_array_equal(imu.fields["GyrY"], (0.2 * np.cos(t)).astype(np.float32))
    assert log.topics["IMU.1"].fields["GyrZ"][0] == np.float32(0.01)
    assert {imu.units[name] for name in ("GyrX", "AccX", "T")} == {"rad/s", "m/s^2", "degC"}
    attitude = log.topics["ATT"]
    np.testing.assert_allclose(attitude.fields["Roll"], 10 * np.sin(t), atol=0.005)
    assert attitude.units["Yaw"] == "deg"
    gps = log.topics["GPS"].fields
    assert (gps["Lat"][0], gps["Alt"][0]) == (47.1234567, 512.25)
    assert gps["GMS"][0] == pytest.approx(388_800.0)  # s: the log says by which factor
    assert log.topics["XKF2"].fields["VWN"][0] == 2.25
    assert log.metadata["param:ARSPD_RATIO"] == pytest.approx(1.9936)
    assert log.metadata["ver_sw"] == "ArduPlane V4.3.0 (abcdef01)"
    # GPS week 2240 begins on 2022-12-11; Thursday 12:00 GPS time is 18 s ahead of UTC.
    assert log.start_utc == datetime(2022, 12, 15, 11, 59, 41, 999800, tzinfo=UTC)


def test_a_log_of_former_firmware_has_no_units_and_the_same_values(tmp_path: Path) -> None:
    new, old = (read(tmp_path, bytes(written(40, units).data)) for units in (True, False))
    assert old.topics["ATT"].units == {}
    for name in ("Roll", "Pitch", "Yaw"):
        np.testing.assert_array_equal(
            old.topics["ATT"].fields[name], new.topics["ATT"].fields[name]
        )
    assert "I" in old.topics["IMU"].fields, "nothing says that it counts instances"


def test_it_becomes_a_flight_by_the_built_in_mapping(tmp_path: Path) -> None:
    log = read(tmp_path, bytes(written().data))
    mapping = choose_mapping(log, builtin_mappings().values())
    assert mapping.name == "ardupilot"
    flight = map_recording(log, mapping, parse_vehicle(VEHICLE))
    k = SAMPLES // 2
    expected = {
        "q": 0.2 * np.cos(k / RATE),
        "az_imu": -9.8,
        "theta": np.deg2rad(5.25),
        "calibrated_airspeed": 15.0,
        "static_pressure": 95000.0,
        "velocity_east": 15.0,
        "altitude": 512.25,
        "latitude": np.deg2rad(47.1234567),
        "delta_elevator": np.deg2rad(-25) * -0.2,
        "delta_aileron": np.deg2rad(0.05 * (1600 - 1500)),
    }
    for name, value in expected.items():
        assert flight[name][k] == pytest.approx(value, rel=2e-3), name
    assert np.ptp(flight["psi"]) < 0.1, "north is passed without a jump"
    # 15 m/s at sea level have this dynamic pressure; the density is the standard one at 512 m.
    assert flight["qbar"][k] == pytest.approx(0.5 * 1.225 * 15.0**2, rel=1e-3)
    assert flight["V"][k] == pytest.approx(15.0 * np.sqrt(1.225 / 1.1659), rel=1e-3)
    assert not {"alpha", "beta"} & flight.channels.keys(), "no vane is logged"


def test_a_cut_log_accounts_for_every_byte(tmp_path: Path) -> None:
    log = written(30)
    data, rng = bytes(log.data), np.random.default_rng(1)
    ends = np.array([end for end, _ in log.ends])
    first = next(end for end, name in log.ends if name == "IMU")
    for cut in rng.integers(first, len(data), 60):
        found = read(tmp_path, data[:cut])
        boundary = int(ends[ends <= cut].max())
        lost = [each.bytes_lost for each in found.damage if each.kind == "lost_tail"]
        assert lost == ([cut - boundary] if cut > boundary else [])
        whole = sum(name in ("IMU", "ATT") for end, name in log.ends if end <= cut)
        kept = [n for n in ("IMU", "IMU.1", "ATT") if n in found.topics]
        assert sum(len(found.topics[n].time) for n in kept) == whole


def test_noise_over_records_costs_those_and_no_others(tmp_path: Path) -> None:
    log = written(30)
    data, rng = bytes(log.data), np.random.default_rng(2)
    names = [name for _, name in log.ends]
    ends = [0, *(end for end, _ in log.ends)]
    total = {name: names.count(name) for name in ("ATT", "XKF1", "RCOU")}
    for _ in range(60):
        k = int(rng.integers(len(names) // 2, len(names) - 12))
        count = int(rng.integers(1, 9))
        noise = rng.bytes(ends[k + count] - ends[k])
        found = read(tmp_path, data[: ends[k]] + noise + data[ends[k + count] :])
        lost = sum(each.bytes_lost for each in found.damage if each.kind == "framing")
        assert lost == len(noise)
        for name, there in total.items():
            assert len(found.topics[name].time) == there - names[k : k + count].count(name)


def test_a_record_with_a_damaged_id_swallows_no_other(tmp_path: Path) -> None:
    log = written(30)
    at = [0, *(end for end, _ in log.ends)][[name for _, name in log.ends].index("RCOU")]
    data = bytearray(log.data)
    data[at + 2] = 66  # IMU, which is longer
    found = read(tmp_path, bytes(data))
    assert [each.bytes_lost for each in found.damage] == [19]
    assert len(found.topics["RCOU"].time) == 29
    assert len(found.topics["IMU"].time) == 30


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"", "does not begin"),
        (b"\xa3\x95", "no data"),
        (b"ULog" * 9, "ULog"),
        (bytes(DataFlashWriter.begun().data), "no data"),
        (b"\xa3\x95\x80" + bytes(200), "no data"),
    ],
)
def test_what_is_no_log_is_refused_with_the_reason(data: bytes, said: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"a\.bin") as refusal:
        read(tmp_path, data)
    assert said in str(refusal.value)


@pytest.mark.skipif(
    importlib.util.find_spec("pymavlink") is None, reason="pymavlink is not installed"
)
def test_another_reader_reads_the_same(tmp_path: Path) -> None:
    from pymavlink.DFReader import DFReader_binary

    log = read(tmp_path, bytes(written(60).data))
    other = DFReader_binary(str(tmp_path / "a.bin"))
    seen: dict[str, list[dict[str, float]]] = {}
    while (message := other.recv_msg()) is not None:
        seen.setdefault(message.get_type(), []).append(message.to_dict())
    for name in ("ATT", "GPS", "BARO", "ARSP", "XKF1", "XKF2", "AETR", "RCOU"):
        topic = log.topics[name]
        assert len(seen[name]) == len(topic.time)
        for label, values in topic.fields.items():
            if label in ("GMS", "SMS"):
                continue  # their factor is in the unit there
            np.testing.assert_allclose(
                values, [each[label] for each in seen[name]], rtol=1e-12, err_msg=f"{name}.{label}"
            )
