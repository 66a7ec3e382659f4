"""A hobbyist with ArduPilot: from the .bin of a glider without vanes to what its handbook has wrong,
by the commands and in Python."""

from pathlib import Path

import numpy as np
import pytest

import aerodb
from aerodb.exchange import read_native
from aerodb.simulation import Instrument, SensorSignal, measure
from aerodb.vehicle import parse_vehicle
from tests.support.command import aerodb as command
from tests.support.command import asked
from tests.support.dataflash_log import write_dataflash
from tests.support.guide_flights import Flown, blocks, fly_glider, steeper
from tests.support.paths import ROOT

DEGREES = 180.0 / np.pi
GUIDE = (ROOT / "docs" / "guides" / "px4-without-vanes.md").read_text(encoding="utf-8")
FILES = {title: text for _, title, text in blocks(GUIDE) if title}
HANDBOOK = FILES["handbook.toml"]
FLIGHTS = 2
MODEL = """
[[increment]]
axis = "CZ"
terms = ["1", "alpha", "q_hat", "delta_elevator"]
"""
#: The sensors of the guide's glider, as ArduPilot logs them.
INSTRUMENTS = (
    Instrument(
        "IMU",
        50.0,
        (
            *(
                SensorSignal(f"Gyr{x}", rate, 6e-4, 2e-4)
                for x, rate in zip("XYZ", "pqr", strict=True)
            ),
            *(SensorSignal(f"Acc{x}", f"a{x.lower()}_imu", 0.03, 0.01) for x in "XYZ"),
        ),
    ),
    Instrument(
        "ATT",
        50.0,
        tuple(
            SensorSignal(field, channel, 3e-4, scale=DEGREES)
            for field, channel in (("Roll", "phi"), ("Pitch", "theta"), ("Yaw", "psi"))
        ),
        phase=0.003,
    ),
    Instrument("ARSP", 10.0, (SensorSignal("Airspeed", "calibrated_airspeed", 0.1),), phase=0.004),
    Instrument("BARO", 10.0, (SensorSignal("Press", "static_pressure", 6.0),), phase=0.007),
    Instrument("GPS", 5.0, (SensorSignal("Alt", "altitude", 0.3),), phase=0.002),
    Instrument(
        "XKF1",
        20.0,
        (
            *(SensorSignal(f"P{x}", to, 0.2) for x, to in (("N", "north"), ("E", "east"))),
            *(
                SensorSignal(f"V{x}", f"velocity_{to}", 0.04)
                for x, to in (("N", "north"), ("E", "east"), ("D", "down"))
            ),
        ),
        delay=0.03,
        phase=0.001,
    ),
    Instrument(
        "RCOU",
        50.0,
        tuple(
            SensorSignal(f"C{k + 1}", f"servo_{k}", scale=500.0, offset=1500.0, held=True)
            for k in range(4)
        ),
    ),
)


def vehicle_file() -> str:
    """The guide's glider with servos that are logged as pulses [us]."""
    text = FILES["my-glider.toml"].replace(
        'scale = "25 deg"', 'scale = "0.05 deg"\noffset = "-75 deg"'
    )
    for k in range(4):
        pulse = f'topic = "RCOU", field = "C{k + 1}", unit = "1"'
        text = text.replace(f'topic = "actuator_servos", field = "control[{k}]"', pulse)
    return text


@pytest.fixture(scope="module")
def flown() -> Flown:
    vehicle = parse_vehicle(FILES["my-glider.toml"])
    return fly_glider(vehicle, read_native(HANDBOOK), read_native(steeper(HANDBOOK)), FLIGHTS, 7)


@pytest.fixture(scope="module")
def folder(flown: Flown, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("ardupilot")
    (folder / "glider.toml").write_text(vehicle_file(), encoding="utf-8")
    (folder / "handbook.toml").write_text(HANDBOOK, encoding="utf-8")
    for number in range(FLIGHTS):
        random = np.random.default_rng([7, number])
        topics = measure(flown.history, flown.channels, number, INSTRUMENTS, random, 20.0)
        for topic in topics:
            if topic.name == "ATT":
                topic.fields["Yaw"][:] %= 360.0  # type: ignore[index]
        write_dataflash(folder / f"{number + 1:08}.bin", topics)
    return folder


def test_the_commands_take_the_log_as_it_comes_from_the_card(folder: Path, tmp_path: Path) -> None:
    log, workspace = str(folder / "00000001.bin"), tmp_path / "w"
    seen = asked(workspace, "log", "inspect", log)
    assert (seen["format"], seen["mapping"]) == ("dataflash", "ardupilot")
    assert "calibrated_airspeed" in seen["channels"]  # of which V and qbar are computed
    assert not any("airspeed" in sentence for sentence in (*seen["prevents"], *seen["because"]))
    done = command(workspace, "vehicle", "init", "plane", "--from", log, folder=tmp_path)
    assert done.returncode == 0, done.stderr
    text = (tmp_path / "plane.toml").read_text(encoding="utf-8")
    assert "Airframe: fixed wing." in text
    assert {"aileron", "elevator", "rudder"} == set(parse_vehicle(text).surfaces)
    asked(workspace, "vehicle", "add", str(folder / "glider.toml"))
    asked(workspace, "database", "import", str(folder / "handbook.toml"), "--vehicle", "my-glider")
    outcome = asked(workspace, "flight", "ingest", log, "--vehicle", "my-glider", "--direct")
    flight = outcome[0] if isinstance(outcome, list) else outcome
    assert flight["status"] == "stored", flight
    assert flight["damage"] == []
    assert set(flight["comparison"]["axes"]) >= {"CX", "CZ", "Cm", "Cn"}


def test_alpha_is_reconstructed_and_the_planted_lift_slope_found(
    folder: Path, flown: Flown
) -> None:
    vehicle = aerodb.load_vehicle(folder / "glider.toml")
    database = aerodb.load_database(folder / "handbook.toml")
    compared = []
    for number in range(FLIGHTS):
        log = aerodb.load(folder / f"{number + 1:08}.bin", vehicle)
        flight = aerodb.reconstruct(log)
        compared.append(aerodb.compare(aerodb.total_coefficients(flight), database))
        time, alpha = flown.true("alpha", number)
        found = flight.flight["alpha"]
        error = found - np.interp(flight.flight.time - 20.0, time, alpha)
        assert np.sqrt(np.mean(error**2)) * DEGREES < 0.4
    slope = aerodb.fit(compared, MODEL)["CZ_alpha"]
    assert slope.value == pytest.approx(-1.0, abs=4 * slope.standard_error)
    assert slope.standard_error < 0.2
