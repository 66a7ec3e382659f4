"""Tests of cutting flights into records."""

from dataclasses import replace

import numpy as np
import pytest

from aerodb.consistency.output_error.reconstruction import reconstruct
from aerodb.consistency.records import (
    air_data_at_probe,
    air_data_from_probe,
    flight_of,
    inertial_inputs,
    qbar_follows_airspeed,
    records_from_flight,
)
from aerodb.consistency.sensors.prediction import FlightRecord
from aerodb.errors import InputError
from aerodb.flight import Flight
from aerodb.vehicle import VerticalAir, parse_vehicle
from tests.support.simulated_path import DENSITY, simulated, truth

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
    """The simulated record as a mapped Flight: its accelerometer sits off the CG, its air data were
    moved to the CG."""
    record: FlightRecord = simulated(
        np.random.default_rng(3), planted, seconds=seconds, arm=(3.0, 0.0, 0.2)
    )
    time = 0.02 * np.arange(len(record.inputs))
    exact = truth(time)
    rates = np.column_stack([exact[name] for name in "pqr"])
    turning = np.gradient(rates, 0.02, axis=0)
    arm = np.array([0.5, 0.2, -0.1])
    moved = record.inputs[:, :3] + np.cross(turning, arm) + np.cross(rates, np.cross(rates, arm))
    channels = {f"a{axis}_imu": moved[:, k] for k, axis in enumerate("xyz")}
    channels |= {name: record.inputs[:, 3 + k] for k, name in enumerate("pqr")}
    at_cg = air_data_from_probe(
        {name: record.outputs[name] for name in ("V", "alpha", "beta")},
        record.inputs[:, 3:],
        record.arm,
    )
    outputs = {**record.outputs, **at_cg}
    return Flight(
        "f", "simulated", time, {**channels, **outputs, "rho": np.full(len(time), DENSITY)}
    )


def test_a_flight_is_cut_into_records(vehicle):
    """At most half a minute each, at the probe, with the arm from the CG; specific force is moved
    to the CG."""
    planted = {"az_bias": 0.1, "q_bias": 0.002, "alpha_bias": 0.02, "wind_north": 7.0}
    flight = _flight(planted)
    records = records_from_flight(flight, vehicle, seconds=30.0)
    assert [record.name for record in records] == ["f/0", "f/1"]
    assert records[0].arm == (3.0, 0.0, 0.2)
    result = reconstruct(records, FREE, initial=STATES)
    for name, value in planted.items():
        found = result[f"{name}[f]" if name.startswith("wind") else name]
        assert abs(found.value - value) < 4 * found.standard_error, name


def test_a_look_is_the_reconstruction_without_its_covariances(vehicle):
    """Residuals, states and estimates are the same to the last bit, and so is the rest once it is
    asked for."""
    records = records_from_flight(_flight({"alpha_bias": 0.02}), vehicle, seconds=30.0)
    how = {"initial": STATES, "vertical_air": VerticalAir(sigma=0.3), "details": False}
    whole, look = (reconstruct(records, FREE, errors=errors, **how) for errors in (True, False))
    for one, other in zip(look.paths, whole.paths, strict=True):
        assert np.array_equal(one.states, other.states)
        assert np.array_equal(one.air, other.air)
        for name, residual in other.residuals.items():
            assert np.array_equal(one.residuals[name], residual, equal_nan=True)
    assert [each.value for each in look.estimates] == [each.value for each in whole.estimates]
    assert np.array_equal(look.white, whole.white)
    assert look["alpha_bias"].standard_error < whole["alpha_bias"].standard_error
    for name in ("covariance", "still", "white"):
        assert np.array_equal(getattr(look.whole, name), getattr(whole, name))
    assert look.whole.air_sigma == whole.air_sigma > 0.0


def test_decimation_loses_nothing(vehicle):
    """Estimates and standard errors at 12.5 Hz are those at 50 Hz: the motion is slower than
    both."""
    flight = _flight({"az_bias": 0.1, "q_bias": 0.002, "alpha_bias": 0.02})
    full, slow = (
        reconstruct(records_from_flight(flight, vehicle, decimation=m), FREE, initial=STATES)
        for m in (1, 4)
    )
    for name in ("az_bias", "q_bias", "alpha_bias"):
        assert slow[name].standard_error == pytest.approx(full[name].standard_error, rel=0.25), name
        assert abs(slow[name].value - full[name].value) < 0.7 * full[name].standard_error, name


def test_air_data_go_back_to_the_probe_and_come_again(vehicle):
    """What the mapping moved to the CG by the measured rates is undone exactly, with and without a
    beta vane."""
    flight = _flight({})
    moved = inertial_inputs(flight, vehicle)
    for names in (("V", "alpha", "beta"), ("V", "alpha")):
        shown = {name: flight[name] for name in names}
        at_cg = air_data_from_probe(shown, moved.values[:, 3:], moved.arm)
        assert np.abs(at_cg["alpha"] - shown["alpha"]).max() > 1e-3
        there = air_data_at_probe(
            flight.with_channels(at_cg) if len(names) == 3 else _only(flight, at_cg), moved
        )
        for name in names:
            np.testing.assert_allclose(there[name], shown[name], atol=1e-9)


def _only(flight, air):
    channels = {
        name: values
        for name, values in flight.channels.items()
        if name not in ("V", "alpha", "beta")
    }
    return replace(flight, channels={**channels, **air})


def test_a_wind_holds_for_a_while_and_a_layer(vehicle):
    """Stretches of one wind share its name; another layer has another."""
    flight = _flight({}).with_channels({"altitude": np.linspace(1000.0, 2000.0, 3000)})
    records = records_from_flight(flight, vehicle, seconds=6.0)
    assert len({record.flight for record in records}) > 3
    assert {flight_of(record) for record in records} == {"f"}
    level = records_from_flight(_flight({}), vehicle, seconds=6.0)
    assert {record.flight for record in level} == {"f"}


def test_one_pressure_is_one_sensor(vehicle):
    """A dynamic pressure made from the airspeed is no second measurement; an own one is."""
    flight = _flight({})
    made = flight.with_channels({"qbar": 0.5 * DENSITY * flight["V"] ** 2})
    assert qbar_follows_airspeed(made, made)
    assert "qbar" not in records_from_flight(made, vehicle)[0].outputs
    assert not qbar_follows_airspeed(flight, flight)
    assert "qbar" in records_from_flight(flight, vehicle)[0].outputs


def test_gaps_end_a_record(vehicle):
    flight = _flight({})
    lost = (flight.time > 25.0) & (flight.time < 28.0)
    short = (flight.time > 40.0) & (flight.time < 40.1)
    flight = flight.with_channels({"ax_imu": np.where(lost | short, np.nan, flight["ax_imu"])})
    records = records_from_flight(flight, vehicle)
    assert [round(len(record.inputs) * 0.02) for record in records] == [25, 32]


def test_an_aircraft_that_rolls_is_not_compared(vehicle):
    """At rest there are no flow angles."""
    flight = _flight({})
    still = flight.time < 20.0
    flight = flight.with_channels({"V": np.where(still, 0.5, flight["V"])})
    assert records_from_flight(flight, vehicle)[0].first == pytest.approx(1000, abs=2)


def test_what_a_flight_lacks_is_said(vehicle):
    flight = _flight({}, seconds=10.0)
    without = replace(
        flight,
        channels={name: values for name, values in flight.channels.items() if name != "theta"},
    )
    with pytest.raises(InputError, match="theta not logged"):
        records_from_flight(without, vehicle)
    with pytest.raises(InputError, match="without a gap"):
        records_from_flight(flight.with_channels({"p": np.full(len(flight.time), np.nan)}), vehicle)
