"""Telemetry logs: published checksums first, then what was written is read, whatever the version;
damage costs its messages and no others."""

from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from aerodb.errors import InputError
from aerodb.logs import choose_mapping, hover_times, map_recording, read_autopilot
from aerodb.recording import Recording
from aerodb.storage.mappings import builtin_mappings
from aerodb.storage.readers.any_format import read_log
from aerodb.storage.readers.mavlink import MESSAGES as KNOWN
from aerodb.storage.readers.mavlink import crc16
from aerodb.tasks.steps.log_findings import _ANY
from aerodb.vehicle import parse_vehicle
from tests.support.command import aerodb
from tests.support.tlog import MESSAGES, START, Telemetry, checksum

SECONDS = np.arange(0.0, 30.0, 0.1)


def test_checksums_are_the_published_ones() -> None:
    """The check value of CRC-16/MCRF4XX, and the bytes of MAVLink's generated headers."""
    assert crc16(b"123456789") == checksum(b"123456789") == 0x6F91
    published = {24: 24, 26: 170, 32: 185, 36: 222, 65: 118, 105: 93, 116: 76, 168: 1}
    published |= {identity: extra for identity, _, extra in MESSAGES.values()}
    assert {i: m.extra for i, m in KNOWN.items()} == {i: published[i] for i in KNOWN}


def flown(version: int = 2, signed: bool = False, autopilot: int = 3) -> Telemetry:
    """A plane whose vehicle's clock began 100 s before; a ground station between its messages."""
    log = Telemetry(version, signed)
    log.add(0.0, "HEARTBEAT", 10, 1, autopilot, 0, 4, 3)
    log.add(0.0, "PARAM_VALUE", 12.0, 900, 1, b"AIRSPEED_MIN", 9)
    log.add(0.0, "STATUSTEXT", 6, b"ArduPlane V4.5.7")
    for k, t in enumerate(SECONDS.tolist()):
        boot, late = round((100.0 + t) * 1000), t + 0.02 + 0.01 * (k % 3)
        log.add(late, "ATTITUDE", boot, 0.1 * np.sin(t), 0.05, 3.0, 0.1 * np.cos(t), 0.02, -0.03)
        log.add(late, "RAW_IMU", boot * 1000, 100, -50, -1000, 10, 20, 30, 0, 0, 0)
        log.add(late, "VFR_HUD", 20.0 + np.sin(t), 18.0, 250.0, 0.5, 90, 40)
        log.add(late, "SCALED_PRESSURE", boot, 984.5, 2.5, 2150)
        log.add(
            late,
            "GLOBAL_POSITION_INT",
            *(boot, 471_234_567, 85_000_000, 250_000, 100_000, 1500, -300, 50, 65535),
        )
        log.add(late, "MISSION_CURRENT", k)
        log.add(late, "HEARTBEAT", 0, 6, 8, 0, 4, 3, system=255)
    return log


def read(folder: Path, data: bytes) -> Recording:
    (folder / "a.tlog").write_bytes(data)
    return read_log(folder / "a.tlog")


@pytest.mark.parametrize(("version", "signed"), [(1, False), (2, False), (2, True)])
def test_what_was_written_is_read(tmp_path: Path, version: int, signed: bool) -> None:
    found = read(tmp_path, bytes(flown(version, signed).data))
    assert found.format == found.layout == "mavlink"
    assert found.damage == ()
    attitude = found.topics["ATTITUDE"]
    # On the vehicle's clock, without the scatter of the link.
    np.testing.assert_allclose(np.diff(attitude.time), 0.1, atol=1e-6)
    np.testing.assert_allclose(attitude.fields["roll"], 0.1 * np.sin(SECONDS), atol=1e-7)
    assert attitude.units["rollspeed"] == "rad/s"
    np.testing.assert_allclose(found.topics["RAW_IMU"].fields["zacc"], -1.0)
    np.testing.assert_allclose(found.topics["SCALED_PRESSURE"].fields["press_abs"], 98450.0)
    place = found.topics["GLOBAL_POSITION_INT"].fields
    assert place["lat"][0] == pytest.approx(47.1234567, abs=1e-9)
    assert place["vy"][0] == pytest.approx(-3.0)
    assert np.isnan(place["hdg"]).all()  # not known
    assert found.metadata["param:AIRSPEED_MIN"] == 12.0
    assert found.metadata["messages"] == "ArduPlane V4.5.7"
    assert read_autopilot(found).kind == "fixed wing"
    begun = datetime.fromtimestamp(START / 1e6, UTC)
    assert found.start_utc is not None
    assert abs(found.start_utc - begun) < timedelta(seconds=0.1)


def test_the_modes_of_a_quadplane_are_in_its_heartbeats(tmp_path: Path) -> None:
    log = flown()
    log.add(0.0, "PARAM_VALUE", 1.0, 900, 2, b"Q_ENABLE", 9)
    for t, mode in ((2.0, 18), (3.0, 18), (5.0, 10)):
        log.add(t, "HEARTBEAT", mode, 1, 3, 0, 4, 3)
    found = read(tmp_path, bytes(log.data))
    assert read_autopilot(found).kind == "quadplane VTOL"
    assert hover_times(found) == (pytest.approx((2.0, 5.0), abs=0.05),)


def test_it_becomes_a_flight(tmp_path: Path) -> None:
    found = read(tmp_path, bytes(flown().data))
    mapping = choose_mapping(found, builtin_mappings().values())
    assert mapping.name == "mavlink"
    flight = map_recording(found, mapping, parse_vehicle(_ANY))
    middle = len(flight.time) // 2
    assert flight["az_imu"][middle] == pytest.approx(-9.80665)
    assert flight["q"][middle] == pytest.approx(0.02, abs=1e-6)
    assert flight["static_pressure"][middle] == pytest.approx(98450.0)
    assert flight["velocity_east"][middle] == pytest.approx(-3.0)
    assert "qbar" in flight
    assert "calibrated_airspeed" in flight.estimated


def test_raw_counts_of_another_autopilot_are_no_accelerations(tmp_path: Path) -> None:
    found = read(tmp_path, bytes(flown(autopilot=12).data))
    assert "RAW_IMU" not in found.topics
    assert found.metadata["sys_name"] == "PX4"


def test_damaged_messages_are_the_only_ones_missing(tmp_path: Path) -> None:
    log = flown()
    data, rng = bytes(log.data), np.random.default_rng(1)
    whole = {name: len(topic.time) for name, topic in read(tmp_path, data).topics.items()}
    for _ in range(30):
        k = int(rng.integers(3, len(log.ends) - 2))
        begin, (end, name) = log.ends[k - 1][0], log.ends[k]
        changed = bytearray(data)
        changed[begin + 18 : end] = rng.bytes(end - begin - 18)  # behind the head
        found = read(tmp_path, bytes(changed))
        counts = {topic: len(values.time) for topic, values in found.topics.items()}
        lost = {n: whole[n] - counts[n] for n in whole if whole[n] != counts[n]}
        is_vehicles = name in whole and name != "HEARTBEAT"  # those are the ground station's
        assert lost == ({name: 1} if is_vehicles else {})
        if name in MESSAGES and MESSAGES[name][0] in KNOWN:
            assert found.damage[0].bytes_lost == end - begin


def test_a_cut_log_is_read_to_its_last_message(tmp_path: Path) -> None:
    data = bytes(flown().data)
    found = read(tmp_path, data[: len(data) // 2])
    assert len(found.topics["ATTITUDE"].time) == pytest.approx(len(SECONDS) / 2, abs=3)


def test_telemetry_without_a_vehicle_is_refused(tmp_path: Path) -> None:
    log = Telemetry()
    for t in range(5):
        log.add(float(t), "HEARTBEAT", 0, 6, 8, 0, 4, 3, system=255)
    with pytest.raises(InputError, match="no message of a vehicle"):
        read(tmp_path, bytes(log.data))


def test_telemetry_by_command(tmp_path: Path) -> None:
    (tmp_path / "a.tlog").write_bytes(bytes(flown().data))
    done = aerodb(tmp_path / "w", "log", "inspect", str(tmp_path / "a.tlog"))
    assert done.returncode == 0, done.stderr
    first = done.stdout.split("\n")[0]
    assert first.startswith("a.tlog: USABLE (mavlink, fixed wing")
