"""A data log as a Garmin G1000 writes it: comments of aircraft and units above the names, rows
without a time or a fix at first. Names and units are Garmin's; the flight is our own."""

from pathlib import Path

import numpy as np
import pytest

from aerodb.logs import choose_mapping, map_recording
from aerodb.physics import standard_atmosphere
from aerodb.storage.mappings import builtin_mappings
from aerodb.storage.readers.any_format import read_log
from aerodb.tasks.steps.log_findings import _ANY
from aerodb.vehicle import parse_vehicle
from tests.support.command import aerodb

HEAD = (
    '#airframe_info, log_version="1.00", airframe_name="Own", mode=NORMAL,\n'
    "#yyy-mm-dd, hh:mm:ss,   hh:mm, ident, degrees, degrees, ft Baro, ft msl, deg C, kt, kt,"
    " fpm, deg, deg, G, G, deg, volts\n"
    "  Lcl Date, Lcl Time, UTCOfst, AtvWpt, Latitude, Longitude, AltB, AltMSL, OAT, IAS, GndSpd,"
    " VSpd, Pitch, Roll, LatAc, NormAc, HDG, volt1\n"
)
T = np.arange(200)
LOAD = 1.0 + 0.3 * np.sin(0.2 * T)


def write(path: Path, blank: int = 0) -> None:
    rows = [" , , , , , , , , , , , , , , , , , 27.9\n"] * blank
    for k, t in enumerate(T.tolist()):
        rows.append(
            f"2024-03-12, 14:{t // 60:02d}:{t % 60:02d}, -05:00, KABC, {47.1 + 1e-5 * t:.7f},"
            f" {8.5:.7f}, 2500.0, {3000.0 + t:.1f}, 11.5, 100.0, 105.0, 60.0, 4.0,"
            f" {10 * np.sin(0.05 * t):.2f}, 0.02, {LOAD[k] - 1.0:.4f}, 90.0, 27.9\n"
        )
    path.write_text(HEAD + "".join(rows), encoding="utf-8")


@pytest.mark.parametrize("blank", [0, 20])
def test_a_log_of_a_g1000_becomes_a_flight(tmp_path: Path, blank: int) -> None:
    write(tmp_path / "log.csv", blank)
    recording = read_log(tmp_path / "log.csv")
    mapping = choose_mapping(recording, builtin_mappings().values())
    assert mapping.name == "garmin_g1000"
    flight = map_recording(recording, mapping, parse_vehicle(_ANY))
    assert len(flight.time) == len(T)
    np.testing.assert_allclose(flight["az_imu"], -9.80665 * LOAD, atol=1e-3)
    np.testing.assert_allclose(flight["velocity_down"], -60.0 * 0.3048 / 60.0, atol=1e-9)
    height = 0.3048 * (3000.0 + T)
    np.testing.assert_allclose(flight["altitude"], height, atol=1e-6)
    # Equivalent airspeed is calibrated airspeed up to compressibility, of .1 % here.
    sigma = flight["rho"] / 1.225
    calibrated = 100.0 * 1852.0 / 3600.0
    np.testing.assert_allclose(flight["V"] * np.sqrt(sigma), calibrated, rtol=2e-3)
    pressure = standard_atmosphere(height).pressure
    np.testing.assert_allclose(flight["qbar"], 0.7 * pressure * flight["mach"] ** 2, rtol=1e-2)
    assert [each.kind for each in flight.damage] == (["time"] if blank else [])


def test_a_log_of_a_g1000_by_command(tmp_path: Path) -> None:
    write(tmp_path / "log.csv", 20)
    done = aerodb(tmp_path / "w", "log", "inspect", str(tmp_path / "log.csv"))
    lines = done.stdout.splitlines()
    assert lines[0].startswith("log.csv: USABLE (tabular")
    assert len(lines) <= 20
