"""A clock that jumps in one topic asks for no memory, is named with its size, and takes nothing from the
other topics."""

import re
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from aerodb.errors import InputError
from aerodb.flight import Flight
from aerodb.logs.mapping import map_recording
from aerodb.nomenclature import FLAGS
from aerodb.recording import Recording, Topic
from aerodb.signals.resampling import resampler
from aerodb.storage.mappings import builtin_mappings
from aerodb.vehicle import parse_vehicle

RATE, SECONDS = 200.0, 60.0
VEHICLE = """
name = "glider"
[reference]
area = 10.0
chord = 1.0
span = 10.0
[points]
moment_reference = "cg"
[mass]
source = "channels"
[processing]
rate = 25.0
[surfaces.elevator]
limits = ["-25 deg", "25 deg"]
scale = "25 deg"
lag = 0.1
"""
JUMPS = {"an hour": 3600.0, "a day": 86400.0, "to UTC": 1.7e9}
#: Topic -> a channel of it.
TOPICS = {
    "vehicle_attitude": "theta",
    "airspeed_validated": "V",
    "actuator_controls_0": "delta_elevator",
}


def recording() -> Recording:
    t = np.arange(round(SECONDS * RATE)) / RATE
    wave = 0.1 * np.sin(t)
    one, zero = np.ones_like(t), np.zeros_like(t)
    fields = {
        "vehicle_angular_velocity": {"xyz[0]": wave, "xyz[1]": wave, "xyz[2]": wave},
        "vehicle_acceleration": {"xyz[0]": wave, "xyz[1]": wave, "xyz[2]": wave - 9.8},
        "vehicle_attitude": {"q[0]": one, "q[1]": zero, "q[2]": wave, "q[3]": zero},
        "airspeed_validated": {
            "true_airspeed_m_s": 20.0 + wave,
            "calibrated_airspeed_m_s": 20.0 + wave,
        },
        "vehicle_air_data": {"rho": 1.2 * one},
        "actuator_controls_0": {"control[0]": zero, "control[1]": wave},
    }
    topics = {name: Topic(name, t, values) for name, values in fields.items()}
    return Recording("jump.ulg", "ulog", topics=topics, layout="px4", sha256="a" * 64, size=0)


def jumping(names: set[str], by: float, part: float = 0.5) -> Recording:
    """The recording, with the clocks of these topics set forward after a `part` of their samples."""
    log = recording()
    topics = dict(log.topics)
    for name in names:
        stamps = topics[name].time.copy()
        stamps[int(part * len(stamps)) :] += by
        topics[name] = replace(topics[name], time=stamps)
    return replace(log, topics=topics)


def mapped(log: Recording) -> tuple[Flight, float]:
    """The flight, and the memory that its making took [bytes]."""
    tracemalloc.start()
    try:
        flight = map_recording(log, builtin_mappings()["px4"], parse_vehicle(VEHICLE))
        return flight, tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("topic", TOPICS)
@pytest.mark.parametrize("jump", JUMPS)
@pytest.mark.parametrize("part", [0.1, 0.5, 0.97])
def test_jump_in_one_topic(topic: str, jump: str, part: float) -> None:
    whole, usual = mapped(recording())
    flight, memory = mapped(jumping({topic}, JUMPS[jump], part))
    assert memory < 2.0 * usual
    assert np.array_equal(flight.time, whole.time)
    (damage,) = [entry for entry in flight.damage if entry.topic == topic]
    size = re.match(r"the clock jumps by (\S+) s, from", damage.what)
    assert size is not None
    assert float(size[1]) == pytest.approx(JUMPS[jump] + 1.0 / RATE, rel=1e-5)
    left = round((1.0 - part) * SECONDS * RATE)
    assert f"{left} of 12000 samples are far from the flight and not used" in damage.what
    jumped, name = part * SECONDS, TOPICS[topic]
    before, after = flight.time < jumped - 0.5, flight.time > jumped + 0.1
    gap = (flight.flags[name] & FLAGS["gap"]) > 0
    assert gap[after].all()
    assert np.allclose(flight[name][before], whole[name][before], atol=1e-9)
    settled = flight.time > 0.5
    assert not gap[before & settled].any()
    for other in set(TOPICS.values()) - {name}:  # no other topic is touched, to the last bit
        assert np.array_equal(flight[other], whole[other])


def test_pause_of_all_topics_is_a_gap() -> None:
    """An hour without samples is a few samples more per logged one: the flight has them as gaps."""
    flight, memory = mapped(jumping(set(recording().topics), 3600.0))
    assert memory < 100e6
    pause = (flight.time > 31.0) & (flight.time < 3629.0)
    assert all((flight.flags[name] & FLAGS["gap"])[pause].all() for name in ("p", "az_imu", "V"))


@pytest.mark.parametrize("jump", [86400.0, 1.7e9])
def test_jump_in_all_topics_is_refused_with_its_size(jump: float) -> None:
    log = jumping(set(recording().topics), jump)
    with pytest.raises(InputError, match=r"topic .*: the clock jumps by .* s, from 29\.99") as said:
        mapped(log)
    assert "split the log there" in said.value.remedy
    (until,) = re.findall(r"from 29\.99\d* to (\S+) s", said.value.what)
    assert float(until) == pytest.approx(30.0 + jump, abs=0.02)  # also of times since 1970


def test_topic_that_is_nowhere_near_the_flight_is_left_out() -> None:
    """Its first sample aside, a topic is stamped in UTC: the one sample remains, the rest is a gap."""
    flight, _ = mapped(jumping({"airspeed_validated"}, 1.7e9, 1e-4))
    assert (flight.flags["V"] & FLAGS["gap"])[2:].all()


def test_samples_far_apart_for_the_grid_are_refused() -> None:
    """Time stamps in another unit: 12,000 samples would be 1.2 million seconds, 30 million steps."""
    log = recording()
    slow = {name: replace(topic, time=2e4 * topic.time) for name, topic in log.topics.items()}
    with pytest.raises(
        InputError, match=r"samples are 99\.99\d* s apart, more than 100 steps"
    ) as said:
        mapped(replace(log, topics=slow))
    assert "unit" in said.value.remedy


def test_stamps_in_bursts_take_no_even_time_base_of_their_shortest_step() -> None:
    """Three samples 1 ns apart, twenty times a second: an even base would have 60 billion samples."""
    starts = np.arange(1200) / 20.0
    time = (starts[:, None] + 1e-9 * np.arange(3)).ravel()
    grid = np.arange(600) / 10.0
    tracemalloc.start()
    to_grid = resampler(time, grid)
    values = to_grid(np.full(len(time), 3.0))
    memory = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert memory < 50e6
    assert np.allclose(values, 3.0)
    assert not to_grid.gap.any()


def test_source_shorter_than_a_step_takes_no_endless_filter() -> None:
    """Ten samples 1e-12 s apart under a grid of .04 s: its low-pass would have 1e12 taps."""
    grid = np.arange(100) / 25.0
    values = resampler(1.0 + 1e-12 * np.arange(10), grid)(np.full(10, 2.0))
    assert np.array_equal(values, np.full(100, 2.0))
