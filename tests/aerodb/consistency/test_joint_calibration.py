"""Tests of what a calibration from several flights contains, and that it takes no good flight with
it."""

import numpy as np
import pytest

from aerodb.consistency.output_error.estimation import joint_calibration
from aerodb.consistency.whole_flight import make_consistent
from aerodb.flight import Flight
from aerodb.logs.mapping import map_recording
from aerodb.storage.mappings import load_mapping
from aerodb.storage.readers.any_format import read_log
from aerodb.vehicle import parse_vehicle
from tests.support.consistency_records import TWIN_OTTER
from tests.support.consistent_flights import NAME, PLANTED, VEHICLE, table

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
    return flights, joint_calibration(list(flights.values()), TWIN_OTTER)


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
    found = joint_calibration(flights, parse_vehicle(VEHICLE)).by_name
    sensors = [name for name in PLANTED if not name.startswith("wind")]
    assert set(sensors) <= set(found)
    for name in sensors:
        value, error = found[name]
        assert abs(value - PLANTED[name]) < 3.5 * error, name


def test_what_one_flight_contradicts_is_left_to_the_flights():
    """A pitch gyro exchanged before the third flight; the rest stays within its interval."""
    vehicle = parse_vehicle(VEHICLE)
    flights = [_flight(1, PLANTED), _flight(2, PLANTED), _flight(3, {**PLANTED, "q_bias": 0.006})]
    calibration = joint_calibration(flights, vehicle)
    assert "q_bias" not in calibration.names
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
    calibration = joint_calibration(flights[:2], vehicle)
    assert abs(calibration.by_name["ay_bias"][0] - 1.8) < 0.05
    assert make_consistent(flights[2], vehicle).verdict.word == "rejected"
    found = make_consistent(flights[2], vehicle, calibration)
    assert found.verdict.word == "limited"
    (reason,) = found.verdict.reasons
    assert reason.startswith("ay_bias of 1.8")
    assert reason.endswith("and known from its calibration")
