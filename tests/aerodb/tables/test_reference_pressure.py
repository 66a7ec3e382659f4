"""A constant reference pressure: the same loads at rest and in flight, measured and predicted."""

from dataclasses import replace

import numpy as np
import pytest

from aerodb.coefficients import compare, total_coefficients
from aerodb.errors import InputError
from aerodb.exchange import over_dynamic_pressure
from aerodb.exchange.native import from_document, read_native, to_document
from aerodb.flight import Flight
from aerodb.simulation import Condition, flight_model, simulate, trim
from aerodb.tables import AeroDatabase, Increment, Term, parse
from aerodb.vehicle import parse_vehicle
from tests.support.quadrotor import MASSES, QUADROTOR

PRESSURE = 120.0
COEFFICIENTS = """
[[terms]]
name = "frame"
axis = "CX"
expression = "-0.02*V*cos(alpha)"
[[terms]]
name = "spin"
axis = "Cm"
expression = "-0.3*q_hat - 0.02*q"
"""
VEHICLE = """
name = "quad"
[reference]
area = 0.2
chord = 0.5
span = 0.5
{pressure}
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


def hovering() -> AeroDatabase:
    text = QUADROTOR.replace("span = 0.5", 'span = 0.5\npressure = "120 Pa"')
    return read_native(text + COEFFICIENTS)


def test_it_is_stored_and_its_absence_leaves_documents_as_they_were() -> None:
    own = hovering()
    assert own.reference.pressure == PRESSURE
    assert from_document(to_document(own)).reference == own.reference
    assert "pressure" not in to_document(read_native(QUADROTOR))["reference"]


def test_coefficients_exist_at_rest() -> None:
    own = hovering()
    x = {"V": 0.0, "alpha": 0.0, "beta": 0.0, "p": 0.0, "q": 0.5, "r": 0.0, "rho": 1.2}
    commands = {f"command_{k}": 0.6 for k in range(1, 5)}
    found = own.predict({**x, **commands}).coefficients
    thrust = 4 * 1.2 * 72.0**2 * 0.254**4 * 0.11
    # Rotors that move down with the pitch rate have more thrust, up ones less: their sum is that.
    assert found["CZ"][0] == pytest.approx(-thrust / (PRESSURE * 0.2), rel=1e-9)
    assert all(np.isfinite(values).all() for values in found.values())
    assert "qbar" not in own.inputs


def flown(own: AeroDatabase) -> tuple[Flight, dict[str, np.ndarray]]:
    """From a hover over 4 s with small moves of the commands, and what the rotors do."""
    model = flight_model(own)
    found = trim(model, Condition(0.0, 100.0, hover=True), MASSES)
    time = np.arange(0.0, 4.001, 0.01)
    series = dict(found.series)
    for k in range(1, 5):
        wave = 0.02 * np.sin((1.0 + 0.7 * k) * time) * np.exp(-0.3 * time)
        series[f"command_{k}"] = found.series[f"command_{k}"] + wave
    run = simulate(model, time, found.start, series)
    channels = {name: values[:, 0] for name, values in run.channels.items()}
    names = (
        "V",
        "alpha",
        "beta",
        "p",
        "q",
        "r",
        "rho",
        "qbar",
        "ax",
        "ay",
        "az",
        "command_1",
        "command_2",
        "command_3",
        "command_4",
    )
    return Flight("hover", "quad", time, {name: channels[name] for name in names}), channels


def test_a_flight_from_rest_is_measured_as_it_is_predicted() -> None:
    own = hovering()
    flight, channels = flown(own)
    vehicle = parse_vehicle(VEHICLE.format(pressure="pressure = 120.0"), "quad")
    measured = total_coefficients(flight, vehicle)
    comparison = compare(flight, measured, own, vehicle.reference)
    assert channels["V"][0] == 0.0
    for axis in ("CX", "CY", "CZ"):
        assert comparison.usable[axis].all()
        np.testing.assert_allclose(comparison.residual(axis), 0.0, atol=1e-9)
        np.testing.assert_allclose(channels[axis], comparison.measured[axis], atol=1e-9)
    inner = slice(50, -50)  # moments by differentiated rates, away from the ends
    size = np.abs(comparison.measured["Cm"][inner]).max()
    assert np.abs(comparison.residual("Cm")[inner]).max() < 0.05 * size


def test_one_pressure_in_vehicle_and_database() -> None:
    own = hovering()
    flight, _ = flown(own)
    vehicle = parse_vehicle(VEHICLE.format(pressure=""), "quad")
    with pytest.raises(InputError, match="constant reference pressure"):
        compare(flight, total_coefficients(flight, vehicle), own, vehicle.reference)
    other = parse_vehicle(VEHICLE.format(pressure="pressure = 240.0"), "quad")
    comparison = compare(flight, total_coefficients(flight, other), own, other.reference)
    np.testing.assert_allclose(comparison.residual("CZ"), 0.0, atol=1e-9)


def test_an_increment_acts_at_rest_and_an_export_has_it_as_a_load() -> None:
    increment = Increment("CZ", (parse("1"),), np.array([-0.05]), np.diag([0.01]))
    own = replace(hovering(), increments=(increment,))
    loads = over_dynamic_pressure(own)
    assert loads.reference.pressure is None
    time = np.arange(0.0, 1.001, 0.01)
    start = {"altitude": 100.0, "V": 0.0}
    series = {**MASSES, **dict.fromkeys(("command_1", "command_2", "command_3", "command_4"), 0.6)}
    one, other = (simulate(flight_model(each), time, start, series) for each in (own, loads))
    for name in ("V", "altitude", "az", "q"):
        np.testing.assert_allclose(one.channels[name], other.channels[name], rtol=1e-9, atol=1e-12)
    plain = simulate(flight_model(hovering()), time[:1], start, series)
    extra = one.channels["az"][0, 0] - plain.channels["az"][0, 0]
    assert extra == pytest.approx(-0.05 * PRESSURE * 0.2 / 1.5)


def test_wind_axes_have_no_constant_pressure() -> None:
    own = hovering()
    with pytest.raises(InputError, match="wind axes"):
        replace(own, terms=(*own.terms, Term("lift", "C_lift", parse("0.1"))))
    with pytest.raises(InputError, match="pressure"):
        read_native(QUADROTOR.replace("span = 0.5", 'span = 0.5\npressure = "-1 Pa"'))
