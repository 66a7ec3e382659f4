"""Each kind of bad input gets a plain sentence that names its cause; good records, measured and
simulated, get none."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aerodb.conditioning.segmentation import segments
from aerodb.conditioning.suspicion import clock_suspicions
from aerodb.flight import Flight
from aerodb.logs.mapping import map_recording
from aerodb.nomenclature import FLAGS
from aerodb.recording import Recording, Topic
from aerodb.storage.mappings import builtin_mappings
from aerodb.storage.readers.ulog import read_ulog
from aerodb.suspicions.hypotheses import agreement, explain
from aerodb.suspicions.plausibility import suspicions
from aerodb.vehicle import parse_vehicle
from tests.support.kinematic_flights import GRAVITY, kinematic_flight
from tests.support.measured_flights import (
    ATTAS,
    CITATION,
    HFB320,
    RECORDS,
    STALLS,
    TWIN_OTTER,
    VEHICLE,
    as_flight,
)

DEGREE = np.pi / 180
ANGLES = ("p", "q", "r", "phi", "theta", "psi", "alpha", "beta")


@pytest.mark.parametrize("record", RECORDS)
def test_good_measured_records_raise_no_suspicion(
    measured: Callable[[str], Path], record: str
) -> None:
    assert suspicions(as_flight(measured(record))) == ()


def test_consistent_flights_raise_no_suspicion() -> None:
    for seed in range(12):
        flight = kinematic_flight(seed)
        assert suspicions(flight) == ()
        channels = {name: np.asarray(values) for name, values in flight.channels.items()}
        assert min(agreement(channels, flight.step).values()) > 0.9


@pytest.mark.parametrize("name", [*ANGLES, "az"])
def test_a_flipped_sign_is_named(name: str) -> None:
    flight = kinematic_flight(3)
    (found,) = suspicions(flight.with_channels({name: -flight[name]}))
    assert (found.kind, found.channel) == ("sign", name)
    assert f"{name}" in found.sentence
    assert "flipped" in found.sentence


@pytest.mark.parametrize("name", ANGLES)
def test_degrees_declared_as_radians_are_named(name: str) -> None:
    flight = kinematic_flight(4)
    found = suspicions(flight.with_channels({name: flight[name] / DEGREE}))
    assert [(s.kind, s.channel) for s in found] == [("degrees", name)]
    assert "is in degrees" in found[0].sentence


@pytest.mark.parametrize("name", ["brake", "brake_left", "delta_landing_gear"])
@pytest.mark.parametrize(("full", "unit"), [(100.0, "per cent"), (2000.0, "microseconds")])
def test_a_share_in_another_unit_is_named(name: str, full: float, unit: str) -> None:
    flight = kinematic_flight(4)
    position = np.clip(flight.time - 5.0, 0.0, 1.0)
    assert suspicions(flight.with_channels({name: position})) == ()
    (found,) = suspicions(flight.with_channels({name: full * position}))
    assert (found.kind, found.channel) == ("unit", name)
    assert unit in found.sentence


def test_radians_declared_as_degrees_are_named() -> None:
    flight = kinematic_flight(5)
    (found,) = suspicions(flight.with_channels({"q": flight["q"] * DEGREE}))
    assert (found.kind, found.channel) == ("radians", "q")


@pytest.mark.parametrize(
    ("record", "name"),
    [
        (ATTAS[0], "q"),
        (ATTAS[2], "beta"),
        (STALLS[0], "alpha"),
        (TWIN_OTTER[0], "p"),
        (TWIN_OTTER[1], "theta"),
        (HFB320, "alpha"),
    ],
)
@pytest.mark.parametrize(("kind", "factor"), [("sign", -1.0), ("degrees", 1.0 / DEGREE)])
def test_faults_planted_in_measured_records(
    measured: Callable[[str], Path], record: str, name: str, kind: str, factor: float
) -> None:
    flight = as_flight(measured(record))
    found = suspicions(flight.with_channels({name: factor * flight[name]}))
    assert [(s.kind, s.channel) for s in found] == [(kind, name)]


def test_what_a_record_cannot_tell_is_said(measured: Callable[[str], Path]) -> None:
    """A longitudinal record: phi and p hardly move, and nothing else tells which of them is
    flipped."""
    flight = as_flight(measured(TWIN_OTTER[1]))
    (found,) = suspicions(flight.with_channels({"p": -flight["p"]}))
    assert "cannot distinguish it from" in found.sentence
    assert "sign of p is flipped" in found.sentence
    assert "sign of phi is flipped" in found.sentence
    assert found.evidence["alternatives"] == 1


def test_gravity_missing_as_in_the_citations_normal_acceleration(
    measured: Callable[[str], Path],
) -> None:
    """That log holds nz - 1; read without its mapping's correction it is -az - g."""
    flight = as_flight(measured(CITATION))
    (found,) = suspicions(flight.with_channels({"az_imu": flight["az_imu"] + GRAVITY}))
    assert (found.kind, found.channel) == ("gravity", "az")
    assert "gravity is missing" in found.sentence
    assert "nz - 1" in found.sentence


def test_exchanged_axes_and_units_of_g() -> None:
    flight = kinematic_flight(6)
    (found,) = suspicions(flight.with_channels({"ay": flight["az"], "az": flight["ay"]}))
    assert found.kind == "swapped"
    assert found.sentence.endswith("y and z of the accelerations are swapped")
    (found,) = suspicions(flight.with_channels({"q": flight["r"], "r": flight["q"]}))
    assert (found.kind, found.channel) == ("swapped", "q")
    (found,) = suspicions(
        flight.with_channels({name: flight[name] / GRAVITY for name in ("ax", "ay", "az")})
    )
    assert found.kind == "unit"
    assert "in g, declared as m/s^2" in found.sentence


def test_a_stuck_sensor() -> None:
    flight = kinematic_flight(7)
    held = flight["q"].copy()
    held[1200:] = held[1200]
    found = suspicions(flight.with_channels({"q": held}))
    assert [(s.kind, s.channel) for s in found] == [("stuck", "q")]
    assert "does not change from 24 s on" in found[0].sentence
    constant = suspicions(flight.with_channels({"alpha": np.full_like(held, 0.1)}))
    assert [(s.kind, s.channel) for s in constant] == [("stuck", "alpha")]
    assert "never changes" in constant[0].sentence


def test_force_signs_that_only_the_aircraft_tells(measured: Callable[[str], Path]) -> None:
    flight = as_flight(measured(ATTAS[2]))
    (found,) = suspicions(flight.with_channels({"ay_imu": -flight["ay_imu"]}))
    assert (found.kind, found.channel) == ("sign", "ay")
    flight = as_flight(measured(STALLS[0]))
    (found,) = suspicions(flight.with_channels({"ax_imu": -flight["ax_imu"]}))
    assert (found.kind, found.channel) == ("sign", "ax")


def test_topics_without_overlap() -> None:
    def topic(name: str, start: float, end: float) -> Topic:
        time = np.linspace(start, end, 100)
        return Topic(name, time, {"x": time})

    def recording(*topics: Topic) -> Recording:
        return Recording("log", "ulog", "", 0, {t.name: t for t in topics})

    imu, air, baro = topic("imu", 5.0, 65.0), topic("air_data", 6.0, 64.0), topic("baro", 4.0, 66.0)
    assert clock_suspicions(recording(imu, air, baro)) == ()
    (found,) = clock_suspicions(recording(imu, air, topic("gps", 1.7e9, 1.7e9 + 60.0)))
    assert (found.kind, found.channel) == ("no_overlap", "gps")
    assert "UTC" in found.sentence
    (found,) = clock_suspicions(recording(imu, air, topic("vane", 5e6, 65e6)))
    assert "microseconds" in found.sentence
    (found,) = clock_suspicions(recording(imu, air, topic("late", 100.0, 160.0)))
    assert (
        found.sentence
        == "topic late runs from 100 to 160 s, the others from 5 to 65 s: it has a different clock"
    )


@pytest.mark.parametrize(
    "log", ["sample.ulg", "sample_log_small.ulg", "sample_appended_multiple.ulg"]
)
def test_clocks_of_real_logs_raise_no_suspicion(measured: Callable[[str], Path], log: str) -> None:
    """They hold topics of a moment (sensor_preflight, commander_state) that meet nothing: events,
    not records."""
    recording = read_ulog(measured(f"px4_ulog/{log}"))
    assert clock_suspicions(recording) == ()
    flight = map_recording(recording, builtin_mappings()["px4"], parse_vehicle(VEHICLE))
    assert suspicions(flight) == ()
    kinds = {segment.kind for segment in segments(flight)}
    # The VTOL's autopilot takes it to be off the ground for a second (vehicle_land_detected).
    assert kinds <= {"on_ground", *(["hover"] if "small" in log else [])}


def test_a_channel_that_is_all_gap_has_no_overlap() -> None:
    flight = kinematic_flight(8)
    gap = np.full(len(flight.time), FLAGS["gap"], dtype=np.uint8)
    (found,) = suspicions(replace(flight, flags={"alpha": gap}))
    assert (found.kind, found.channel) == ("no_overlap", "alpha")


def test_records_in_which_nothing_moves_or_nothing_is_there() -> None:
    time = 0.02 * np.arange(1000)
    assert suspicions(Flight("e", "synthetic", time, {"V": np.full(1000, 50.0)})) == ()
    parked = Flight(
        "p",
        "synthetic",
        time,
        {"q": np.zeros(1000), "az": np.full(1000, -9.81), "theta": np.zeros(1000)},
    )
    assert suspicions(parked) == ()
    assert explain({"theta": np.zeros(1000), "q": np.zeros(1000)}, 0.02) is None
    assert suspicions(Flight("s", "synthetic", time[:2], {"q": np.array([0.0, 0.1])})) == ()


@pytest.mark.parametrize("name", ["az", "q"])
def test_frequent_spikes_are_said(name: str) -> None:
    """Too many for wild points, which are left out."""
    flight = kinematic_flight(3)
    values = flight[name].copy()
    values[10::20] += 3.0 * np.std(values)
    (found,) = (
        each for each in suspicions(flight.with_channels({name: values})) if each.kind == "spikes"
    )
    assert found.channel == name
    assert found.evidence["share"] == pytest.approx(0.05, abs=0.01)
