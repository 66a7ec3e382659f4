"""Flights cut into records, and the consistent flight that comes back."""

from dataclasses import replace

import numpy as np
import pytest

from aerodb.consistency.reconstruction import reconstruct
from aerodb.consistency.records import consistent_flight, records_from_flight
from aerodb.consistency.sensors import Record
from aerodb.errors import InputError
from aerodb.flight import Flight
from aerodb.vehicle import parse_vehicle
from tests.simulated_path import DENSITY, simulated, truth

VEHICLE = """
name = "simulated"
[reference]
area = 10.0
chord = 1.0
span = 10.0
[points]
moment_reference = "cg"
imu = [1.5, 0.2, -0.1]
air_data = [4.0, 0.0, 0.2]
[mass]
mass = 1000.0
cg = [1.0, 0.0, 0.0]
Ixx = 1000.0
Iyy = 2000.0
Izz = 2500.0
Ixz = 50.0
"""
FREE = ("ax_bias", "az_bias", "q_bias", "alpha_bias", "wind_north", "wind_east")
STATES = ("u", "v", "w", "phi", "theta", "psi")


@pytest.fixture(scope="module")
def vehicle():
    return parse_vehicle(VEHICLE)


def _flight(planted, seconds=60.0):
    """The simulated record as a Flight whose accelerometer sits off the CG."""
    record: Record = simulated(np.random.default_rng(3), planted, seconds=seconds, arm=(3.0, 0.0, 0.2))
    time = 0.02 * np.arange(len(record.inputs))
    exact = truth(time)
    rates = np.column_stack([exact[name] for name in "pqr"])
    turning = np.gradient(rates, 0.02, axis=0)
    arm = np.array([0.5, 0.2, -0.1])
    moved = record.inputs[:, :3] + np.cross(turning, arm) + np.cross(rates, np.cross(rates, arm))
    channels = {f"a{axis}_imu": moved[:, k] for k, axis in enumerate("xyz")}
    channels |= {name: record.inputs[:, 3 + k] for k, name in enumerate("pqr")}
    return Flight("f", "simulated", time, {**channels, **record.outputs, "rho": np.full(len(time), DENSITY)})


def test_a_flight_becomes_consistent(vehicle):
    """Accelerometer and boom off the CG, a wind and biases: alpha, V and pitch rate at the CG come back."""
    planted = {"az_bias": 0.1, "q_bias": 0.002, "alpha_bias": 0.02, "wind_north": 7.0}
    flight = _flight(planted)
    records = records_from_flight(flight, vehicle, seconds=30.0)
    assert [record.name for record in records] == ["f/0", "f/1"]
    assert records[0].arm == (3.0, 0.0, 0.2)
    result = reconstruct(records, FREE, initial=STATES)
    mended = consistent_flight(flight, result)
    exact = truth(flight.time)
    for name, limit in (("alpha", 1e-3), ("V", 0.15), ("q", 7e-4), ("theta", 1e-3)):
        before = np.sqrt(np.mean((flight[name] - exact[name]) ** 2))
        after = np.sqrt(np.mean((mended[name] - exact[name]) ** 2))
        assert after < limit < before, name
    assert mended.usable().all()
    assert result["wind_north[f]"].value == pytest.approx(7.0, abs=4 * result["wind_north[f]"].standard_error)


def test_gaps_end_a_record_and_are_flagged(vehicle):
    flight = _flight({})
    lost = (flight.time > 25.0) & (flight.time < 28.0)
    short = (flight.time > 40.0) & (flight.time < 40.1)
    flight = flight.with_channels({"ax_imu": np.where(lost | short, np.nan, flight["ax_imu"])})
    records = records_from_flight(flight, vehicle)
    assert [round(len(record.inputs) * 0.02) for record in records] == [25, 32]
    mended = consistent_flight(flight, reconstruct(records, FREE, initial=STATES))
    assert not mended.usable()[lost].any()
    assert mended.usable()[~lost].all()


def test_what_a_flight_lacks_is_said(vehicle):
    flight = _flight({}, seconds=10.0)
    without = replace(flight, channels={name: values for name, values in flight.channels.items() if name != "theta"})
    with pytest.raises(InputError, match="theta not logged"):
        records_from_flight(without, vehicle)
    with pytest.raises(InputError, match="without a gap"):
        records_from_flight(flight.with_channels({"p": np.full(len(flight.time), np.nan)}), vehicle)
