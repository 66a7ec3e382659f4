"""A sensor's error that is as large as it may be limits the flight and is named; right flights, and
those whose errors are corrected, say nothing of it."""

import numpy as np
import pytest

from aerodb.consistency import make_consistent
from aerodb.remarks import SENSOR_ERROR
from tests.campaigns.corrupted import fleet
from tests.campaigns.corruptions import Pair

pytest.importorskip("jsbsim")


@pytest.fixture(scope="module")
def right(tmp_path_factory) -> Pair:
    return next(fleet(tmp_path_factory.mktemp("fleet"), 1, ["T37"]))


def said(pair: Pair, **channels) -> tuple[str, list[str]]:
    """The verdict, and the errors that are beyond a serviceable sensor."""
    flight = pair.flight.with_channels(channels)
    document = make_consistent(flight, pair.vehicle, None).document
    remarks = [each for each in document["verdict_remarks"] if each["kind"] == SENSOR_ERROR]
    return document["verdict"], [each["subjects"][0] for each in remarks]


def late(pair: Pair, name: str, seconds: float) -> np.ndarray:
    shift = round(seconds / pair.flight.step)
    values = pair.flight[name]
    return np.concatenate([np.full(shift, values[0]), values[:-shift]])


def test_a_right_flight_and_a_usual_delay_are_good(right):
    assert said(right) == ("good", [])
    assert said(right, alpha=late(right, "alpha", 0.1)) == ("good", [])


@pytest.mark.parametrize("name", ["alpha", "beta"])
def test_a_vane_that_is_very_late_is_named(right, name):
    word, named = said(right, **{name: late(right, name, 0.4)})
    assert word in ("limited", "rejected")
    assert named == [f"{name}_delay"]


@pytest.mark.parametrize("factor", [1.3, 0.7])
def test_a_vane_of_another_scale_is_named(right, factor):
    word, named = said(right, alpha=factor * right.flight["alpha"])
    assert (word, named) == ("limited", ["alpha_scale"])


def test_noise_that_hides_a_scale_names_none(right):
    rng = np.random.default_rng(3)
    noisy = right.flight["alpha"] + 0.01 * rng.standard_normal(len(right.flight.time))
    assert said(right, alpha=noisy)[1] == []
