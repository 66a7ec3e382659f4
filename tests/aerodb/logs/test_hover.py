"""Aircraft that also hover, by ArduPilot's documented parameters (Q_ENABLE, Q_FRAME_CLASS,
Q_TAILSIT_ENABLE) and mode numbers (ModeNum 17 to 23)."""

from dataclasses import replace

import numpy as np
import pytest

from aerodb.logs import hover_sentence, hover_times, read_autopilot
from aerodb.recording import Recording, Topic


def log(modes: list[int], times: list[float], system: str = "ArduPlane", **known: float):
    topics = {
        "ATT": Topic("ATT", np.arange(0.0, 100.1, 0.1), {"Roll": np.zeros(1001)}),
        "MODE": Topic("MODE", np.array(times), {"ModeNum": np.array(modes, "u1")}),
    }
    stated = {"sys_name": system} | {f"param:{name}": value for name, value in known.items()}
    return Recording("a.bin", "dataflash", "0" * 64, 1, topics, stated)


@pytest.mark.parametrize(
    ("known", "kind"),
    [
        ({}, "fixed wing"),
        ({"Q_ENABLE": 0.0}, "fixed wing"),
        ({"Q_ENABLE": 1.0, "Q_FRAME_CLASS": 1.0}, "quadplane VTOL"),
        ({"Q_ENABLE": 2.0}, "quadplane VTOL"),
        ({"Q_ENABLE": 1.0, "Q_FRAME_CLASS": 10.0}, "tailsitter VTOL"),
        ({"Q_ENABLE": 1.0, "Q_TAILSIT_ENABLE": 2.0}, "tailsitter VTOL"),
    ],
)
def test_the_kind_of_a_plane_by_its_parameters(known: dict[str, float], kind: str) -> None:
    autopilot = read_autopilot(log([0], [0.0], **known))
    assert autopilot.kind == kind
    assert autopilot.has_wing
    assert bool(hover_sentence(kind)) == ("VTOL" in kind)


def test_a_copter_stays_one() -> None:
    assert read_autopilot(log([0], [0.0], "ArduCopter", Q_ENABLE=1.0)).kind == "multicopter"


def test_times_of_hover_by_the_modes() -> None:
    recording = log([18, 19, 10, 12, 20], [1.0, 9.0, 20.0, 50.0, 80.0], Q_ENABLE=1.0)
    assert hover_times(recording) == ((1.0, 20.0), (80.0, 100.0))
    said = hover_sentence("tailsitter VTOL", hover_times(recording))
    assert "axes turned" in said
    assert "from 1.0 to 20.0 s and from 80.0 to 100.0 s" in said


def test_lift_motors_in_other_modes_are_hover() -> None:
    """A take-off and a landing in AUTO (10), and QHOVER (18) in between, which they overlap."""
    recording = log([10, 18, 10], [0.0, 10.0, 20.0], Q_ENABLE=1.0)
    acts = np.concatenate([np.arange(2.0, 22.0, 0.04), np.arange(90.0, 99.0, 0.04)])
    lifted = Topic("QTUN", acts, {"ThO": np.full(acts.size, 0.4)})
    recording = replace(recording, topics={**recording.topics, "QTUN": lifted})
    (first, last), (begin, end) = hover_times(recording)
    assert (first, begin) == pytest.approx((2.0, 90.0))
    assert (last, end) == pytest.approx((22.0, 99.0), abs=0.05)
    assert hover_times(replace(recording, metadata={"sys_name": "ArduPlane"})) == ()


def test_a_flight_without_hover_has_none() -> None:
    assert hover_times(log([0, 10, 11], [0.0, 9.0, 20.0], Q_ENABLE=1.0)) == ()
    assert hover_sentence("fixed wing", ()) == ""
