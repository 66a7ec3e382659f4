"""Columns that contradict what others of the table say are asked: an axis, a sign, a unit or a name is
another. Nothing is asked where the flight agrees with itself."""

from pathlib import Path

import numpy as np
import pytest

from aerodb.logs import draft_mapping
from aerodb.logs.guesses import Guess
from aerodb.nomenclature import channel
from aerodb.storage.readers.tabular import read_tabular
from aerodb.units import conversion
from tests.aerodb.logs.test_tables_of_other_axes import turning


def flight() -> dict[str, np.ndarray]:
    """A flight of turns and climbs in SI, with the air of the standard atmosphere at sea level."""
    truth = turning(20.0)
    speed, time = truth["V"], truth["time"]
    north = speed * np.cos(truth["psi"]) * np.cos(truth["theta"] - truth["alpha"])
    east = speed * np.sin(truth["psi"]) * np.cos(truth["theta"] - truth["alpha"])
    lat = 0.8 + np.cumsum(north) / 20.0 / 6.371e6
    return truth | {
        **{"velocity_north": north, "velocity_east": east, "latitude": lat},
        "longitude": 0.15 + np.cumsum(east / np.cos(lat)) / 20.0 / 6.371e6,
        **{"calibrated_airspeed": 0.97 * speed, "rho": 1.16 + 0.0 * time, "mach": speed / 338.0},
        **{"qbar": 0.58 * speed**2, "pressure_altitude": truth["altitude"] + 40.0},
        "static_pressure": 101325.0 * (1.0 - (truth["altitude"] + 40.0) / 44330.8) ** 5.25588,
    }


#: Name of a column -> channel, and unit; what it holds is an expression of the flight `f`, in SI.
NAMES = {
    **{"roll [deg]": ("phi", "deg"), "pitch [deg]": ("theta", "deg"), "yaw [deg]": ("psi", "deg")},
    **{"gyro_x [deg/s]": ("p", "deg/s"), "gyro_y [deg/s]": ("q", "deg/s")},
    **{"gyro_z [deg/s]": ("r", "deg/s"), "alpha [deg]": ("alpha", "deg")},
    **{"AccX [g]": ("ax_imu", "g"), "AccY [g]": ("ay_imu", "g"), "AccZ [g]": ("az_imu", "g")},
    **{"TAS [m/s]": ("V", "m/s"), "CAS [m/s]": ("calibrated_airspeed", "m/s")},
    **{"vel_n [m/s]": ("velocity_north", "m/s"), "vel_e [m/s]": ("velocity_east", "m/s")},
    **{"vel_d [m/s]": ("velocity_down", "m/s"), "altitude_msl [m]": ("altitude", "m")},
    **{"lat [deg]": ("latitude", "deg"), "lon [deg]": ("longitude", "deg")},
    **{"qbar [Pa]": ("qbar", "Pa"), "rho [kg/m3]": ("rho", "kg/m^3"), "mach": ("mach", "1")},
    "pressure_altitude [m]": ("pressure_altitude", "m"),
    "static_pressure [Pa]": ("static_pressure", "Pa"),
}


def drafted(path: Path, **against: np.ndarray) -> dict[str, Guess]:
    """Channel -> guess, of a table in which some channels hold something else (SI)."""
    truth = flight()
    columns = {"time [s]": truth["time"]}
    for name, (known, unit) in NAMES.items():
        values = against.get(known, truth[known])
        if values is not None:
            scale, offset = conversion(unit, channel(known).unit)
            columns[name] = (values - offset) / scale
    rows = ["\t".join(f"{each:.9g}" for each in row) for row in zip(*columns.values(), strict=True)]
    path.write_text("\n".join(["\t".join(columns), *rows]) + "\n")
    return {guess.channel: guess for guess in draft_mapping(read_tabular(path), "own").guesses}


def test_a_flight_that_agrees_with_itself_is_not_asked_about(tmp_path: Path) -> None:
    found = drafted(tmp_path / "a.txt")
    assert len(found) == len(NAMES)
    assert [guess for guess in found.values() if guess.confidence == "asked"] == []


F = flight()
AGAINST: dict[str, tuple[dict[str, np.ndarray], str]] = {
    "x right, y forward, z up": ({"p": F["q"], "q": F["p"], "r": -F["r"]}, "p q r"),
    "y up and z right": ({"q": -F["r"], "r": F["q"]}, "q r"),
    "rates in rad/s": ({"p": F["p"] / 57.3}, "p"),
    "north and east exchanged": (
        {"velocity_north": F["velocity_east"], "velocity_east": F["velocity_north"]},
        "velocity_north velocity_east",
    ),
    "yaw from east": ({"psi": F["psi"] + np.pi / 2.0}, "psi"),
    "up for down": ({"velocity_down": -F["velocity_down"]}, "velocity_down"),
    "flow angle in rad": ({"alpha": F["alpha"] / 57.3}, "alpha"),
    "a gauge of the stall": ({"alpha": 5.5 * F["alpha"]}, "alpha"),
    "knots said to be m/s": ({"V": F["V"] / 0.5144, "qbar": F["qbar"]}, "V mach"),
    "psf said to be Pa": ({"qbar": F["qbar"] / 47.88}, "qbar"),
    "flight levels": ({"pressure_altitude": F["altitude"] / 30.48}, "pressure_altitude"),
    "GOST: y up": ({"ay_imu": -F["az_imu"], "az_imu": F["ay_imu"]}, "ay_imu az_imu"),
    "gravity taken out": ({"az_imu": F["az_imu"] + 9.81}, "ax_imu ay_imu az_imu"),
    "y forward": ({"ax_imu": F["ay_imu"], "ay_imu": F["ax_imu"]}, "ax_imu ay_imu"),
    "positive aft": ({"ax_imu": -F["ax_imu"]}, "ax_imu"),
}


@pytest.mark.parametrize("kind", AGAINST)
def test_what_other_columns_contradict_is_asked(tmp_path: Path, kind: str) -> None:
    against, asked = AGAINST[kind]
    found = drafted(tmp_path / "a.txt", **against)
    for name in asked.split():
        assert found[name].confidence == "asked", found[name]


def columns(path: Path, **texts: np.ndarray) -> dict[str, Guess]:
    """Channel -> guess, of columns that are written as they are."""
    table = {"time": np.arange(60) / 20.0, **texts}
    rows = [",".join(f"{each:.10g}" for each in row) for row in zip(*table.values(), strict=True)]
    path.write_text("\n".join([",".join(table), *rows]) + "\n")
    return {guess.channel: guess for guess in draft_mapping(read_tabular(path), "own").guesses}


SWING = np.sin(np.arange(60) / 9.0)


def test_degrees_and_minutes_of_one_position_are_asked_of_both(tmp_path: Path) -> None:
    """NMEA writes 1 deg 30.5' as 130.5, which is a longitude; 47 deg 6' as 4706 is no latitude."""
    found = columns(tmp_path / "a.csv", lat=4706.1 + 0.01 * SWING, lon=130.5 + 0.01 * SWING)
    assert {guess.confidence for guess in found.values()} == {"asked"}
    right = columns(tmp_path / "b.csv", lat=47.1 + 0.01 * SWING, lon=130.5 + 0.01 * SWING)
    assert {guess.confidence for guess in right.values()} == {"likely"}


def test_tenths_of_a_degree_of_one_angle_are_asked_of_all(tmp_path: Path) -> None:
    tenths = {"roll": 250.0 * SWING, "pitch": 40.0 + 30.0 * SWING, "yaw_rate": 70.0 * SWING + 0.3}
    found = columns(tmp_path / "a.csv", **tenths)
    assert {guess.confidence for guess in found.values()} == {"asked"}
    tenths["roll"] = 25.0 * SWING
    right = columns(tmp_path / "b.csv", **tenths)
    assert {guess.confidence for guess in right.values()} == {"likely"}


def test_counts_of_a_gyro_are_asked(tmp_path: Path) -> None:
    counts = columns(tmp_path / "a.csv", roll_rate=np.round(130.0 * SWING))
    assert counts["p"].confidence == "asked"
    assert columns(tmp_path / "b.csv", roll_rate=130.0 * SWING)["p"].confidence == "likely"


def test_impact_pressure_is_asked(tmp_path: Path) -> None:
    found = columns(tmp_path / "a.csv", **{"impact_pressure [Pa]": 900.0 + 90.0 * SWING})
    assert "Mach" in found["qbar"].open
