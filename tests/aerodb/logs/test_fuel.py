"""Tests of fuel on board from what the engines used: the Citation's two counters and flows first,
then planted flows."""

import numpy as np
import pytest

from aerodb.errors import InputError
from aerodb.flight import Flight
from aerodb.logs.fuel import with_fuel_mass
from aerodb.logs.mapping import choose_mapping, map_recording
from aerodb.nomenclature import channel
from aerodb.storage.mappings import builtin_mappings
from aerodb.storage.readers.tabular import read_tabular
from aerodb.vehicle import mass_channels, parse_vehicle
from tests.support.measured_flights import CITATION, VEHICLE

TABLE = """
[mass]
source = "fuel_table"
fuel_mass = [0, 2000]
mass = [5000, 7000]
cg = [[-7.0, 0, 0], [-7.4, 0, 0]]
Ixx = [10000, 14000]
Iyy = [30000, 32000]
Izz = [40000, 46000]
Ixz = [1000, 1400]
"""
COUNTERS = """
[fuel.used]
left = { topic = "table", field = "lh_engine_FU", unit = "lb" }
right = { topic = "table", field = "rh_engine_FU", unit = "lb" }
"""
FLOWS = """
[fuel.flow]
left = { topic = "table", field = "lh_engine_FMF", unit = "lb/h" }
right = { topic = "table", field = "rh_engine_FMF", unit = "lb/h" }
"""
INITIAL = '[fuel]\ninitial = "4050 lb"\n'


def _vehicle(fuel: str, mass: str = TABLE):
    return parse_vehicle(VEHICLE.replace('[mass]\nsource = "channels"\n', mass) + INITIAL + fuel)


def _citation(path, vehicle) -> Flight:
    recording = read_tabular(path)
    mapping = choose_mapping(recording, builtin_mappings().values())
    return map_recording(recording, mapping, vehicle, path.stem)


def test_the_citations_flows_integrate_to_its_counters(measured):
    """Over 78 minutes the integral of the logged flows is what the counters of fuel used show, 650
    kg (its recorder evidently makes one from the other)."""
    path = measured(CITATION)
    counted, integrated = (_citation(path, _vehicle(each)) for each in (COUNTERS, FLOWS))
    burnt = [flight["fuel_mass"][0] - flight["fuel_mass"][-1] for flight in (counted, integrated)]
    assert burnt[0] > 500.0
    assert burnt[1] == pytest.approx(burnt[0], rel=1e-4)
    assert counted["fuel_mass"][0] < 4050 * 0.45359237
    mass = mass_channels(counted, _vehicle(COUNTERS))
    np.testing.assert_allclose(mass["mass"], 5000.0 + counted["fuel_mass"])
    assert mass["cg_x"][0] < mass["cg_x"][-1]
    assert "fuel_mass is 1837.05 kg less fuel_used_left and fuel_used_right" in counted.notes


def test_counters_are_preferred_to_flows(measured):
    both = _citation(measured(CITATION), _vehicle(COUNTERS + FLOWS))
    assert "fuel_used_left" in both.notes[next(k for k, n in enumerate(both.notes) if "fuel" in n)]


def test_planted_flows_integrate_over_a_gap_and_a_logged_mass_is_kept():
    vehicle = _vehicle(FLOWS)
    time = np.arange(0.0, 100.0, 0.1)
    flow = np.full(len(time), 0.5)
    flow[200:300] = np.nan
    channels = {"fuel_flow_left": flow, "fuel_flow_right": 0.01 * time}
    flight = Flight("f" * 64, "any", time, channels)
    mass = with_fuel_mass(flight, vehicle)["fuel_mass"]
    np.testing.assert_allclose(mass, 4050 * 0.45359237 - 0.5 * time - 0.005 * time**2, atol=1e-6)
    logged = flight.with_channels({"fuel_mass": np.full(len(time), 77.0)})
    assert with_fuel_mass(logged, vehicle)["fuel_mass"][-1] == 77.0
    one = Flight("f" * 64, "any", time, {"fuel_flow_left": flow})
    assert "fuel_mass" not in with_fuel_mass(one, vehicle)


def test_names_and_units_of_fuel_channels():
    assert channel("fuel_flow_left").unit == "kg/s"
    assert channel("fuel_used_right").unit == "kg"
    assert channel("flags_fuel_used_right").unit == ""


def test_fuel_without_a_place_in_the_log_is_refused():
    with pytest.raises(InputError, match="used"):
        _vehicle("")
