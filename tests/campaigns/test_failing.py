"""Sensors that fail in flight are told with the right channel and time; right flights raise
nothing (`python -m tests.campaigns.failing` prints the table)."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from aerodb.conditioning import failures
from tests.campaigns.corrupted import measured as measured_pairs
from tests.campaigns.corrupted import simulated
from tests.campaigns.corruptions import Pair
from tests.campaigns.failing import KINDS, failing, false_alarms, told

#: Told of every flight of the example but these. A vane held for 3 s or less with exactly one value
#: is left out, and so are spikes. In the first flight beta moves too little, and air that moves
#: explains vanes that drift.
SILENT = ("beta held, noisy", "alpha drifts 6 deg", "beta drifts 6 deg")
LEFT_OUT = ("alpha held 3 s", "alpha drops to zero", *(kind for kind in KINDS if "spikes" in kind))
TOLD = tuple(kind for kind in KINDS if kind not in (*LEFT_OUT, *SILENT))
#: How late it is told [s]: an attitude that stands still is seen once it should have moved.
LATE = {"theta held": 30.0}


@pytest.fixture(scope="module")
def flight() -> Pair:
    return next(simulated(flights=1))


@pytest.mark.parametrize("kind", TOLD)
def test_a_failure_is_told_with_its_sensor_and_time(flight: Pair, kind: str) -> None:
    made = failing(flight, KINDS[kind])
    assert made is not None
    failed, where = made
    found = failures(failed)
    assert found
    assert {each.channel for each in found} <= {*KINDS[kind].channels}
    begin = failed.time[np.argmax(where)]
    assert min(each.start for each in found) == pytest.approx(begin, abs=LATE.get(kind, 10.0))


@pytest.mark.parametrize("kind", KINDS)
def test_no_failure_is_silent(flight: Pair, kind: str) -> None:
    found = told([flight], KINDS[kind])
    assert found.wrong == []
    assert found.silent == [] or kind in SILENT


def test_right_flights_raise_nothing(flight: Pair) -> None:
    assert list(false_alarms([flight])) == []


def test_right_measured_flights_raise_nothing(measured: Callable[[str], Path]) -> None:
    assert list(false_alarms([*measured_pairs(measured("README.md").parent)])) == []
