"""A ULog read while it is written holds what the file's reader finds afterwards; memory is let go of;
damage is passed over."""

import numpy as np
import pytest

from aerodb.errors import InputError
from aerodb.storage.readers.ulog import read_ulog
from aerodb.storage.readers.ulog_stream import UlogStream
from aerodb.storage.writers.ulog import write_ulog
from tests.storage.readers.test_ulog import SAMPLES, example_topics


def fed(data: bytes, rng: np.random.Generator, largest: int = 5000) -> UlogStream:
    stream, at = UlogStream("pipe"), 0
    while at < len(data):
        size = int(rng.integers(1, largest))
        stream.feed(data[at : at + size])
        at += size
    return stream


def assert_same(stream: UlogStream, path) -> None:
    found, expected = stream.recording(), read_ulog(path)
    assert set(found.topics) == set(expected.topics)
    for name, topic in expected.topics.items():
        np.testing.assert_array_equal(found.topics[name].time, topic.time)
        for field, values in topic.fields.items():
            np.testing.assert_array_equal(found.topics[name].fields[field], values)
    assert found.layout == expected.layout
    assert found.metadata == expected.metadata


@pytest.mark.parametrize("name", SAMPLES[:2])
def test_logs_of_px4_in_pieces(measured, name):
    path = measured(f"px4_ulog/{name}")
    stream = fed(path.read_bytes(), np.random.default_rng(1), 200_000)
    assert_same(stream, path)
    assert stream.lost == 0


def test_pieces_of_any_size(tmp_path):
    path = tmp_path / "flight.ulg"
    write_ulog(path, example_topics(), metadata={"sys_name": "PX4"})
    for largest in (2, 17, 900):
        assert_same(fed(path.read_bytes(), np.random.default_rng(largest), largest), path)


def test_what_was_taken_is_let_go_of(tmp_path):
    path = tmp_path / "flight.ulg"
    write_ulog(path, example_topics())
    stream = fed(path.read_bytes(), np.random.default_rng(2))
    stream.forget(3.0)
    gyro = stream.recording().topics["vehicle_angular_velocity"]
    assert gyro.time[0] == 3.0
    assert len(gyro.time) == 201
    stream.forget(99.0)
    assert not stream.recording().topics


def test_damage_is_passed_over(tmp_path):
    path = tmp_path / "flight.ulg"
    write_ulog(path, example_topics())
    data = path.read_bytes()
    half = len(data) // 2
    stream = fed(data[:half] + b"\xff\xfe\x07" * 40 + data[half + 60 :], np.random.default_rng(3))
    assert 0 < stream.lost < 400
    gyro = stream.recording().topics["vehicle_angular_velocity"]
    assert 780 <= len(gyro.time) < 800
    assert gyro.time[-1] == pytest.approx(4.0)


def test_what_is_no_log():
    with pytest.raises(InputError, match="not a ULog file"):
        UlogStream("pipe").feed(b"time,alpha,q\n1,2,3\n")
    stream = UlogStream("pipe")
    stream.feed(b"ULog")
    assert stream.size == 4
