"""Commands of rotors that a log lacks, that stand still or leave their range are said."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aerodb.flight import Flight
from aerodb.logs import draft_rotorcraft, map_recording, read_autopilot
from aerodb.storage.mappings import load_mapping
from aerodb.storage.readers.ulog import read_ulog
from aerodb.suspicions.commands import command_suspicions
from aerodb.vehicle import Vehicle, parse_vehicle
from tests.support.multicopter_flight import fly, write_px4


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> tuple[Vehicle, Flight]:
    log = tmp_path_factory.mktemp("commands") / "sound.ulg"
    write_px4(log, fly([31], 12.0))
    recording = read_ulog(log)
    text, _ = draft_rotorcraft("quad", recording, read_autopilot(recording))
    vehicle = parse_vehicle(text)
    return vehicle, map_recording(recording, load_mapping("px4"), vehicle)


def changed(flight: Flight, **commands: Any) -> Flight:
    return flight.with_channels(commands)


def test_nothing_is_said_of_a_sound_flight(flown: tuple[Vehicle, Flight]) -> None:
    vehicle, flight = flown
    assert command_suspicions(flight, vehicle) == ()


def test_a_motor_that_never_turns_is_named(flown: tuple[Vehicle, Flight]) -> None:
    vehicle, flight = flown
    (found,) = command_suspicions(changed(flight, command_3=0.0 * flight["command_3"]), vehicle)
    assert (found.channel, found.kind) == ("command_3", "stuck")
    assert "rotor 3 never turns" in found.sentence
    assert "actuator_motors control[2]" in found.sentence


def test_all_that_stand_are_named(flown: tuple[Vehicle, Flight]) -> None:
    """Such as pulses all below their range."""
    vehicle, flight = flown
    still = {f"command_{k}": np.zeros(len(flight.time)) for k in range(1, 5)}
    found = command_suspicions(changed(flight, **still), vehicle)
    assert [each.channel for each in found] == list(still)


def test_pulses_beyond_their_range_are_named(tmp_path: Path) -> None:
    """The vehicle file holds another range than that of the log: 1,100 to 1,900 us."""
    write_px4(tmp_path / "pulses.ulg", fly([32], 12.0), pulses=(1100.0, 1900.0))
    text = (
        'log = {{ topic = "actuator_outputs", field = "output[{k}]" }}\nrange = [1000.0, 1500.0]\n'
    )
    rotors = "".join(f"[rotors.{k + 1}]\n{text.format(k=k)}" for k in range(4))
    own = parse_vehicle(SIZE + rotors)
    flight = map_recording(read_ulog(tmp_path / "pulses.ulg"), load_mapping("px4"), own)
    found = command_suspicions(flight, own)
    assert [each.kind for each in found] == ["unit"] * 4
    assert "range = [1000, 1500] of [rotors.1]" in found[0].sentence


def test_rotors_without_a_command_are_named(flown: tuple[Vehicle, Flight]) -> None:
    vehicle, flight = flown
    channels = {k: v for k, v in flight.channels.items() if k != "command_2"}
    (found,) = command_suspicions(replace(flight, channels=channels), vehicle)
    assert (found.channel, found.kind) == ("command_2", "missing")
    assert "no command of rotor 2" in found.sentence


SIZE = """\
name = "quad"
[reference]
area = 0.2
chord = 0.5
span = 0.5
[points]
moment_reference = [0.0, 0.0, 0.0]
[mass]
source = "constant"
mass = 1.5
cg = [0.0, 0.0, 0.0]
Ixx = 0.029
Iyy = 0.029
Izz = 0.055
Ixz = 0.0
"""
