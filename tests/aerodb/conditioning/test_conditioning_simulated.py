"""Simulated flights of the example, logged by its instruments: conditioning finds nothing wrong and
nothing alike."""

from itertools import combinations

import pytest

from aerodb.conditioning.delay import delays
from aerodb.conditioning.duplicates import fingerprint, shared_samples
from aerodb.conditioning.segmentation import segments
from aerodb.conditioning.suspicion import clock_suspicions
from aerodb.conditioning.wild_points import flag_wild_points
from aerodb.examples.phoenix import mission, read_example
from aerodb.flight import Flight
from aerodb.logs.mapping import map_recording
from aerodb.recording import Recording
from aerodb.storage.mappings import builtin_mappings
from aerodb.suspicions.plausibility import suspicions
from aerodb.vehicle import parse_vehicle


@pytest.fixture(scope="module")
def recordings() -> list[Recording]:
    logs = mission.fly(seed=4, flights=3)
    return [
        Recording(log.name, "ulog", "0" * 64, 0, {t.name: t for t in log.topics}, layout="px4")
        for log in logs
    ]


@pytest.fixture(scope="module")
def flights(recordings: list[Recording]) -> list[Flight]:
    vehicle = parse_vehicle(read_example("vehicle.toml"))
    return [
        map_recording(recording, builtin_mappings()["px4"], vehicle, recording.source)
        for recording in recordings
    ]


def test_no_wild_points_and_no_suspicions(
    recordings: list[Recording], flights: list[Flight]
) -> None:
    for recording, flight in zip(recordings, flights, strict=True):
        assert clock_suspicions(recording) == ()
        assert suspicions(flight) == ()
        assert flag_wild_points(flight).notes == flight.notes


def test_flights_of_one_campaign_are_different_flights(flights: list[Flight]) -> None:
    prints = [fingerprint(flight) for flight in flights]
    assert min(map(len, prints)) > 200
    assert max(len(a & b) for a, b in combinations(prints, 2)) < 3
    assert not any(shared_samples(a, b) for a, b in combinations(flights, 2))


def test_gear_speed_brake_and_attitude(flights: list[Flight]) -> None:
    """The mission lowers its gear near the ground and moves its speed brakes; its attitude comes
    without a delay."""
    for flight in flights:
        found = segments(flight)
        gear = [segment.reason for segment in found if segment.channel == "delta_landing_gear"]
        assert gear == ["landing gear 0.00", "landing gear moves", "landing gear 1.00"]
        assert any(segment.reason == "speed brake moves" for segment in found)
        attitude = {
            delay.channel: delay
            for delay in delays(flight)
            if delay.channel in ("phi", "theta", "psi")
        }
        assert all(delay.observable and abs(delay.seconds) < 1e-3 for delay in attitude.values())
