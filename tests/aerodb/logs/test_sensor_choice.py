"""One airspeed of several sensors of ArduPilot: that in use (Pri), or a healthy one (H)."""

import numpy as np
import pytest

from aerodb.logs import map_recording, sensor_choices
from aerodb.recording import Recording, Topic
from aerodb.storage.mappings import builtin_mappings
from aerodb.tasks.steps.log_findings import _ANY
from aerodb.vehicle import parse_vehicle

TIME = np.arange(0.0, 60.0, 0.1)


def recording(**sensors: dict[str, np.ndarray]) -> Recording:
    """A log with these topics of airspeed beside rates."""
    rates = {name: np.sin(TIME) for name in ("GyrX", "GyrY", "GyrZ", "AccX", "AccY", "AccZ")}
    topics = {"IMU": Topic("IMU", TIME, rates), "ATT": Topic("ATT", TIME, {"Roll": np.sin(TIME)})}
    for name, fields in sensors.items():
        topic = name.replace("_", ".")
        topics[topic] = Topic(topic, TIME, fields)
    return Recording("a.bin", "dataflash", "0" * 64, 1, topics)


def shown(log: Recording) -> np.ndarray:
    flight = map_recording(log, builtin_mappings()["ardupilot"], parse_vehicle(_ANY))
    return flight["calibrated_airspeed"]


def sensor(value: float, fails: float = 100.0, primary: np.ndarray | float = 0.0, **more: float):
    good = fails > TIME
    return {
        "Airspeed": np.where(good, value, 0.0),
        "H": good.astype(np.uint8),
        "Pri": np.broadcast_to(primary, TIME.shape),
    }


TURNED = np.where(TIME < 20.0, 0, 1)


@pytest.mark.parametrize("second", ["ARSP_1", "ASP2"])
def test_the_sensor_that_the_autopilot_used_counts(second: str) -> None:
    log = recording(ARSP=sensor(15.0, 20.0, TURNED), **{second: sensor(16.0, primary=TURNED)})
    found = shown(log)
    assert np.allclose(found[TIME < 19.8], 15.0)
    assert np.allclose(found[TIME > 20.2], 16.0)
    (said,) = sensor_choices(log, builtin_mappings()["ardupilot"])
    assert second.replace("_", ".") + " from 20.0 s on" in said


def test_a_healthy_sensor_counts_where_that_in_use_is_not() -> None:
    """Also in logs of former firmware, which do not say which is in use."""
    log = recording(ARSP=sensor(15.0, 20.0), ARSP_1=sensor(16.0))
    assert np.allclose(shown(log)[TIME > 20.2], 16.0)
    for topic in ("ARSP", "ARSP.1"):
        del log.topics[topic].fields["Pri"]
    assert np.allclose(shown(log)[TIME > 20.2], 16.0)


def test_one_sensor_alone_is_read_as_it_is() -> None:
    log = recording(ARSP=sensor(15.0))
    assert np.allclose(shown(log), 15.0)
    assert sensor_choices(log, builtin_mappings()["ardupilot"]) == ()
    fields = log.topics["ARSP"].fields
    fields["H"] = np.zeros(len(TIME))  # never set: it does not say
    assert np.allclose(shown(log), 15.0)
    del fields["Pri"], fields["H"]
    assert np.allclose(shown(log), 15.0)


def test_the_first_sensor_stays_while_it_is_in_use() -> None:
    log = recording(ARSP=sensor(15.0), ARSP_1=sensor(40.0))
    assert np.allclose(shown(log), 15.0)
    assert sensor_choices(log, builtin_mappings()["ardupilot"]) == ()
