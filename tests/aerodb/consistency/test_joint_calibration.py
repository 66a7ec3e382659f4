"""Tests of what a calibration from several flights contains, and that it takes no good flight with
it."""

import numpy as np
import pytest

from aerodb.consistency.output_error.joint_calibration import joint_calibrations
from aerodb.consistency.output_error.posterior import SensorEstimates, agreeing_flights
from aerodb.consistency.whole_flight import make_consistent
from aerodb.flight import Flight
from aerodb.logs.mapping import map_recording
from aerodb.storage.mappings import load_mapping
from aerodb.storage.readers.any_format import read_log
from aerodb.vehicle import air_data_at_cg, parse_vehicle
from tests.support.consistency_records import TWIN_OTTER
from tests.support.consistent_flights import NAME, PLANTED, VEHICLE, table
from tests.support.installed_flights import BIASES, PRESSURES
from tests.support.installed_flights import table as installed
from tests.support.installed_flights import vehicle as probed_vehicle
from tests.support.instrumented_path import PROBE

RECORDS = ("f1_017", "9752ed20", "demo")


@pytest.fixture(scope="module")
def otter(measured):
    """The three records and their calibration."""
    flights = {
        name: map_recording(
            read_log(measured(f"twin_otter/totter_{name}_data.mat")),
            load_mapping("sidpac_fdata"),
            TWIN_OTTER,
            flight_id=name,
        )
        for name in RECORDS
    }
    (calibration,) = joint_calibrations(list(flights.values()), TWIN_OTTER)
    return flights, calibration


def test_the_twin_otter_records_do_not_share_what_nasa_removed_from_one(otter):
    """From f1_017 NASA removed -1.112 m/s2 and -1.108 deg/s, from demo nothing of both: estimated
    as one, they were -2.2 m/s2 and -1.7 deg/s, which no flight alone says."""
    _, calibration = otter
    assert not {"ay_bias", "r_bias"} & set(calibration.names)
    assert {"ax_bias", "az_bias", "q_bias", "alpha_bias"} <= set(calibration.names)


@pytest.mark.parametrize("name", RECORDS)
def test_no_record_is_rejected_by_its_calibration(otter, name):
    """Under the vane's bias that they share, what the air did in 9752ed20 stands in alpha (.9 deg at
    57 m/s) and limits it."""
    flights, calibration = otter
    found = make_consistent(flights[name], TWIN_OTTER, calibration)
    assert found.verdict.word in ("good", "limited")
    assert found.drifted == ()
    assert not [reason for reason in found.verdict.reasons if "_bias" in reason]
    biases = {
        entry["parameter"]: (entry["value"], entry["standard_error"])
        for entry in found.document["estimates"]
    }
    if name == "f1_017":
        for parameter, removed in (("ay_bias", -1.1123), ("r_bias", np.deg2rad(-1.1079))):
            value, error = biases[parameter]
            assert abs(value - removed) < 2 * error


def _flight(seed, planted):
    columns = table(seed, planted=planted, seconds=30.0)
    channels = {name: values for name, values in columns.items() if name != "time"}
    return Flight(f"{seed:064d}", NAME, columns["time"], channels)


@pytest.mark.parametrize("first", [1, 11])
def test_what_flights_share_is_all_kept(first):
    """The empty case: nothing is left out of flights with the same errors."""
    flights = [_flight(first + k, PLANTED) for k in range(3)]
    (calibration,) = joint_calibrations(flights, parse_vehicle(VEHICLE))
    found = calibration.by_name
    sensors = [name for name in PLANTED if not name.startswith("wind")]
    assert set(sensors) <= set(found)
    for name in sensors:
        value, error = found[name]
        assert abs(value - PLANTED[name]) < 3.5 * error, name


def test_what_one_flight_contradicts_is_left_to_the_flights():
    """A pitch gyro exchanged before the third flight: the first two share theirs, the rest is
    everybody's and stays within its interval."""
    vehicle = parse_vehicle(VEHICLE)
    flights = [_flight(1, PLANTED), _flight(2, PLANTED), _flight(3, {**PLANTED, "q_bias": 0.006})]
    before, calibration = joint_calibrations(flights, vehicle)
    assert before.flights == tuple(sorted(flight.id for flight in flights[:2]))
    value, error = before.by_name["q_bias"]
    assert abs(value - PLANTED.get("q_bias", 0.0)) < 3.5 * error < 0.002
    assert set(calibration.names) < set(before.names)
    assert "q_bias" not in calibration.names
    assert len(calibration.flights) == 3
    for name, (value, error) in calibration.by_name.items():
        assert abs(value - PLANTED.get(name, 0.0)) < 3.5 * error, name
    found = make_consistent(flights[2], vehicle, calibration)
    gyro = {entry["parameter"]: entry for entry in found.document["estimates"]}["q_bias"]
    assert abs(gyro["value"] - 0.006) < 3 * gyro["standard_error"]


def test_a_large_bias_that_all_flights_share_limits_and_does_not_reject():
    """1.8 m/s2 of the lateral accelerometer, thrice its natural size: alone it rejects a flight,
    known from a calibration it is removed."""
    vehicle = parse_vehicle(VEHICLE)
    planted = {**PLANTED, "ay_bias": 1.8}
    flights = [_flight(k, planted) for k in range(1, 4)]
    (calibration,) = joint_calibrations(flights[:2], vehicle)
    assert abs(calibration.by_name["ay_bias"][0] - 1.8) < 0.05
    assert make_consistent(flights[2], vehicle).verdict.word == "rejected"
    found = make_consistent(flights[2], vehicle, calibration)
    assert found.verdict.word == "limited"
    (reason,) = found.verdict.reasons
    assert reason.startswith("ay_bias of 1.8")
    assert reason.endswith("and known from its calibration")


def test_records_of_one_day_share_what_another_day_contradicts(measured, otter):
    """Two halves of f1_017 are flights of one installation. The second finds -.4 +- .3 m/s2 for the
    side accelerometer, from which NASA removed -1.11; beside the record of another day, the two
    still share what they know, and neither takes the other day's."""
    whole = otter[0]["f1_017"]
    halves = [_part(whole, 0.0, 10.0, "first"), _part(whole, 10.0, 20.0, "second")]
    made = joint_calibrations([*halves, otter[0]["demo"]], TWIN_OTTER)
    values = {id: each.by_name for each in made[:-1] for id in each.flights}
    assert not {"ay_bias", "r_bias"} & (set(made[-1].names) | set(values.get("demo", {})))
    for name, removed in (("ay_bias", -1.1123), ("r_bias", np.deg2rad(-1.1079))):
        for half in ("first", "second"):
            value, error = values[half][name]
            assert abs(value - removed) < 2 * error
    assert values["second"]["ay_bias"][1] < 0.25


def _part(flight, start, end, name):
    chosen = (flight.time >= flight.time[0] + start) & (flight.time < flight.time[0] + end)
    channels = {channel: values[chosen] for channel, values in flight.channels.items()}
    return Flight(name, flight.vehicle, flight.time[chosen] - flight.time[chosen][0], channels)


def _estimates(rng, truth, spread):
    names = ("ay_bias", "r_bias")
    return SensorEstimates(names, rng.multivariate_normal(truth, spread), spread)


def test_a_sum_known_well_tells_flights_apart_that_know_neither_part():
    """ay - V r is known to .02 m/s2, ay alone to .7: flights of equal sensors agree in all of 40
    draws but few, those with .3 m/s2 between them in none."""
    rng = np.random.default_rng(34)
    along, across = np.array([72.0, 1.0]) / 72.0, np.array([1.0, -72.0]) / np.hypot(1.0, 72.0)
    spread = 0.5 * np.outer(along, along) + (0.02 / 72.0) ** 2 * np.outer(across, across)
    truths = (np.array([-1.1, -0.015]), np.array([-0.8, -0.015]))
    alike = apart = 0
    for _ in range(40):
        flights = [_estimates(rng, truths[k], spread) for k in (0, 0, 1)]
        groups = agreeing_flights(flights, ("ay_bias", "r_bias"))
        alike += (0, 1) in groups
        apart += (2,) in groups
    assert alike >= 38
    assert apart == 40


#: The flow with the gear down: what the probe's calibration is off by there.
GEAR_DOWN = {"probe_alpha_offset": 0.02, "probe_alpha_slope": 0.1, "probe_beta_slope": -0.06}
WITH_GEAR = f"""
[[air_data.configurations]]
channel = "delta_landing_gear"
above = 0.5
[air_data.configurations.five_hole.alpha]
slope = {1.1 * PROBE.alpha.slope}
offset = {0.02 / 1.1}
break_angle = {PROBE.alpha.break_angle}
[air_data.configurations.five_hole.beta]
slope = {0.94 * PROBE.beta.slope}
"""


def _probed(seed, down, declared):
    """A flight whose angles come from raw pressures, with the gear up or down throughout, as a
    vehicle file makes it."""
    planted = {**BIASES, **(GEAR_DOWN if down else {})}
    columns = installed(planted, PRESSURES, seed=seed, seconds=40.0)
    channels = {name: values for name, values in columns.items() if name != "time"}
    channels["delta_landing_gear"] = np.full(len(columns["time"]), float(down))
    vehicle = parse_vehicle(probed_vehicle(holes=True) + (WITH_GEAR if declared else ""))
    return air_data_at_cg(Flight(f"{seed:064d}", NAME, columns["time"], channels), vehicle), vehicle


def test_a_probe_that_the_gear_disturbs_is_identified_from_flights_in_both_configurations():
    """Flights with the gear down give what was planted, those with it up nothing. Stated in the
    vehicle file, that leaves no error of the probe in any; unstated, it does."""
    made = [_probed(seed, seed > 2, declared=False) for seed in range(1, 5)]
    flights, vehicle = [flight for flight, _ in made], made[0][1]
    up, down = (
        joint_calibrations(part, vehicle)[-1].by_name for part in (flights[:2], flights[2:])
    )
    for name, value in GEAR_DOWN.items():
        found, error = down[name]
        assert abs(found - value) < 3.5 * error, name
        assert abs(up.get(name, (0.0,))[0]) < 0.002
    mixed = joint_calibrations(flights, vehicle)[-1].by_name
    assert abs(mixed["probe_alpha_offset"][0]) > 0.005

    made = [_probed(seed, seed > 2, declared=True) for seed in range(1, 5)]
    (calibration,) = joint_calibrations([flight for flight, _ in made], made[0][1])
    for name, (value, error) in calibration.by_name.items():
        if name.startswith("probe_"):
            assert abs(value) < 3.5 * error < 0.002, name
