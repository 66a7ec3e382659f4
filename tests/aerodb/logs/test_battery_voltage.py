"""The voltage of the battery: read where an autopilot logs it, and never told missing."""

from typing import Any

import numpy as np
import pytest

from aerodb.logs import channels_found, map_recording
from aerodb.recording import Recording, Topic
from aerodb.storage.mappings import builtin_mappings
from aerodb.tasks.steps.log_findings import _ANY
from aerodb.vehicle import parse_vehicle

TIME = np.arange(0.0, 60.0, 0.1)
FALLS = np.linspace(16.0, 14.0, len(TIME))


def log(mapping: str, **more: dict[str, Any]) -> Recording:
    """Rates of an autopilot, and more topics."""
    rates = {
        "px4": {"vehicle_angular_velocity": {f"xyz[{k}]": np.sin(TIME) for k in range(3)}},
        "ardupilot": {"IMU": {f"Gyr{axis}": np.sin(TIME) for axis in "XYZ"}},
    }[mapping]
    topics = {n.replace("__", "."): each for n, each in {**rates, **more}.items()}
    found = {name: Topic(name, TIME, fields) for name, fields in topics.items()}
    return Recording("a.log", "any", "0" * 64, 1, found)


@pytest.mark.parametrize(
    ("mapping", "more"),
    [
        ("px4", {"battery_status": {"voltage_v": FALLS, "voltage_filtered_v": FALLS + 0.1}}),
        ("px4", {"battery_status": {"voltage_filtered_v": FALLS}}),
        ("ardupilot", {"BAT": {"Volt": FALLS, "VoltR": FALLS + 0.1}}),
        ("ardupilot", {"BAT__1": {"Volt": FALLS}}),
    ],
)
def test_it_is_read(mapping: str, more: dict[str, Any]) -> None:
    flight = map_recording(log(mapping, **more), builtin_mappings()[mapping], parse_vehicle(_ANY))
    assert np.allclose(flight["battery_voltage"], np.interp(flight.time, TIME, FALLS))


@pytest.mark.parametrize("mapping", ["px4", "ardupilot"])
def test_a_flight_without_it_lacks_nothing(mapping: str) -> None:
    recording = log(mapping)
    flight = map_recording(recording, builtin_mappings()[mapping], parse_vehicle(_ANY))
    assert "battery_voltage" not in {*flight.channels, *flight.missing}
    assert "battery_voltage" not in channels_found(recording, builtin_mappings()[mapping])[1]
    assert {"V", "altitude"} <= set(flight.missing)
