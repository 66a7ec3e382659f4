"""What no sensor error explains is said and not applied: vanes that are not where the vehicle file
says, and channels that lead the motion.

The published position of the vanes is that of ATTAS' nose boom, 13.08 m ahead of the CG (Jategaonkar
2015, the data that come with the book).
"""

import re

import numpy as np
import pytest

from aerodb.consistency.calibration import Calibration
from aerodb.consistency.output_error.estimation import decimated_records, estimate_sensors
from aerodb.consistency.output_error.posterior import applied_corrections, shared_estimates
from aerodb.consistency.plan import make_plan
from aerodb.consistency.whole_flight import make_consistent
from aerodb.flight import Flight
from aerodb.logs.mapping import choose_mapping, map_recording
from aerodb.storage.mappings import builtin_mappings
from aerodb.storage.readers.tabular import read_tabular
from aerodb.vehicle import parse_vehicle
from tests.support import consistent_flights
from tests.support.attas_stalls import VEHICLE as ATTAS
from tests.support.consistency_records import BOOM, TWIN_OTTER

STATED = ATTAS.replace("\nimu = ", f"\nair_data = {list(BOOM)}\nimu = ")
STALLS = ("fAttas_qst01.asc", "fAttas_qst02.asc")
MANOEUVRES = ("fAttasElv1.mat", "fAttasAil1.mat", "fAttasRud1.mat", "fAttasAilRud1.mat")
TWIN_OTTERS = ("totter_9752ed20_data.mat", "totter_demo_data.mat", "totter_f1_017_data.mat")
VEHICLE = parse_vehicle(consistent_flights.VEHICLE)
SAYS = re.compile(r"the vane seems to be ([\d.]+) \+- ([\d.]+) m (ahead of|behind)")


def recorded(path, vehicle):
    recording = read_tabular(path)
    mapping = choose_mapping(recording, builtin_mappings().values())
    return map_recording(recording, mapping, vehicle, path.stem)


def simulated(seed, planted=consistent_flights.PLANTED, ahead=0.0, gusts=0.0):
    """A flight of known truth whose vanes are `ahead` of the CG [m]."""
    columns = consistent_flights.table(seed, planted, gusts=gusts)
    exact = consistent_flights.exact(columns)
    columns["alpha"] = columns["alpha"] - exact["q"] * ahead / exact["V"]
    columns["beta"] = columns["beta"] + exact["r"] * ahead / exact["V"]
    time = columns.pop("time")
    return Flight(f"s{seed}", consistent_flights.NAME, time, columns)


def position(verdict):
    """(m ahead, standard error) by what the first reason states; None where none is stated."""
    said = [SAYS.search(reason) for reason in verdict.reasons]
    if not any(said):
        return None
    assert said[0] is not None, verdict.reasons  # first of all
    value, half, side = said[0].groups()
    return float(value) * (1 if side == "ahead of" else -1), float(half) / 1.96


@pytest.mark.parametrize("name", [*STALLS, *MANOEUVRES])
def test_published_boom_of_attas_is_found_where_the_vehicle_file_does_not_state_it(measured, name):
    vehicle = parse_vehicle(ATTAS)
    made = make_consistent(recorded(measured(f"attas/{name}"), vehicle), vehicle)
    value, error = position(made.verdict)
    assert made.verdict.word == "limited"
    assert error < 2.5
    assert abs(value - BOOM[0]) < 3.0 * error
    assert "[points] air_data" in made.verdict.reasons[0]
    applied = {e["parameter"] for e in made.document["estimates"] if e["applied"]}
    assert not {name for name in applied if name.endswith(("_delay", "alpha_scale", "beta_scale"))}


@pytest.mark.parametrize("name", [*STALLS, *MANOEUVRES])
def test_nothing_is_said_of_attas_with_its_boom_stated(measured, name):
    vehicle = parse_vehicle(STATED)
    assert (
        position(make_consistent(recorded(measured(f"attas/{name}"), vehicle), vehicle).verdict)
        is None
    )


@pytest.mark.parametrize("name", TWIN_OTTERS)
def test_nothing_is_said_of_the_twin_otter_whose_angles_are_at_the_cg(measured, name):
    flight = recorded(measured(f"twin_otter/{name}"), TWIN_OTTER)
    assert position(make_consistent(flight, TWIN_OTTER).verdict) is None


@pytest.mark.parametrize("seed", range(1, 5))
@pytest.mark.parametrize("ahead", [2.0, -1.2])
def test_planted_position_is_found(seed, ahead):
    found = position(make_consistent(simulated(seed, {}, ahead), VEHICLE).verdict)
    assert found is not None
    assert abs(found[0] - ahead) < 3.0 * found[1] + 0.01  # as printed


@pytest.mark.parametrize("seed", range(1, 5))
@pytest.mark.parametrize("delays", [(0.0, 0.0), (0.03, 0.0), (0.05, 0.08)])
def test_true_delays_are_no_position(seed, delays):
    planted = consistent_flights.PLANTED | {"alpha_delay": delays[0], "beta_delay": delays[1]}
    made = make_consistent(simulated(seed, planted), VEHICLE)
    assert position(made.verdict) is None
    applied = {e["parameter"]: e["value"] for e in made.document["estimates"] if e["applied"]}
    for name, seconds in zip(("alpha_delay", "beta_delay"), delays, strict=True):
        assert applied.get(name, 0.0) == pytest.approx(seconds, abs=0.004)


@pytest.mark.parametrize("seed", range(1, 4))
def test_gusts_are_no_position(seed):
    assert position(make_consistent(simulated(seed, gusts=0.5), VEHICLE).verdict) is None


@pytest.mark.parametrize("seed", range(1, 4))
def test_channel_that_leads_is_said_and_not_applied(seed):
    planted = consistent_flights.PLANTED | {"alpha_delay": -0.06}
    made = make_consistent(simulated(seed, planted), VEHICLE)
    assert position(made.verdict) is None
    (said,) = made.document["remarks"]
    lead, half = map(
        float, re.search(r"alpha seems to lead .* by (\d+) \+- (\d+) ms", said).groups()
    )
    assert abs(lead - 60.0) < 1.53 * half + 1.0  # three standard errors
    assert "alpha_delay" not in {e["parameter"] for e in made.document["estimates"]}


def test_inertial_channels_that_are_late_make_all_others_lead():
    planted = {f"{name}_delay": -0.05 for name in ("alpha", "beta", "V", "phi", "theta", "psi")}
    made = make_consistent(simulated(1, planted), VEHICLE)
    (said,) = made.document["remarks"]
    assert said.startswith("several channels seem to lead the motion (alpha by")
    assert "accelerations and rates" in said


@pytest.mark.parametrize("seed", range(1, 6))
def test_no_flight_without_delays_is_given_a_negative_one(seed):
    made = make_consistent(simulated(seed, {"alpha_bias": 0.01}), VEHICLE)
    late = {e["parameter"]: e["value"] for e in made.document["estimates"]}
    assert all(value >= 0.0 for name, value in late.items() if name.endswith("_delay"))
    assert made.document["remarks"] == []


def test_negative_delay_of_an_earlier_calibration_is_not_applied():
    flight = simulated(1, {})
    old = Calibration(
        consistent_flights.NAME,
        ("alpha_bias", "alpha_delay"),
        np.array([0.001, -0.04]),
        np.diag([1e-4, 1e-3]) ** 2,
        ("another",),
        None,
        None,
    )
    made = make_consistent(flight, VEHICLE, old)
    assert "alpha_delay" not in {e["parameter"] for e in made.document["estimates"] if e["applied"]}
    records = decimated_records(flight, VEHICLE)
    result, plan = estimate_sensors(records, make_plan(records, VEHICLE), VEHICLE.accuracy)
    assert "alpha_delay" not in applied_corrections(shared_estimates(result), plan, old)
