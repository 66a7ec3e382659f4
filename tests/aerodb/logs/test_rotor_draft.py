"""Inertia and lag of motors from a log: planted ones that lie between the lags that are tried."""

from pathlib import Path

import numpy as np
import pytest

from aerodb.logs import read_autopilot
from aerodb.logs.rotor_draft import learnt_inertia
from aerodb.storage.readers.ulog import read_ulog
from tests.support import multicopter_flight
from tests.support.multicopter_flight import INERTIA, MASS, fly, write_px4


@pytest.mark.parametrize("lag", [0.0325, 0.047])
@pytest.mark.parametrize("busy", [1.0, 0.1])
def test_lag_and_inertia_are_found_between_the_lags_that_are_tried(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, lag: float, busy: float
) -> None:
    """A flight that begins in the air: what its motors did before is in no log."""
    monkeypatch.setattr(multicopter_flight, "MOTOR", lag)
    flights = fly([11, 12], 30.0, gusts=0.1, busy=busy)
    for column in range(2):
        write_px4(tmp_path / "log.ulg", flights, column)
        recording = read_ulog(tmp_path / "log.ulg")
        found = learnt_inertia(recording, read_autopilot(recording).rotors)
        assert found.lag == pytest.approx(lag, abs=1.5e-3)
        inertia = np.array([found.Ixx, found.Iyy]) / (INERTIA[:2] / MASS)
        assert np.all(np.abs(inertia - 1.0) < 0.025)
        assert min(found.correlation) > 0.95


def test_commands_that_turn_nothing_tell_neither(tmp_path: Path) -> None:
    flight = fly([13], 20.0)
    flight.commands[:] = flight.commands[::-1]
    write_px4(tmp_path / "log.ulg", flight)
    recording = read_ulog(tmp_path / "log.ulg")
    found = learnt_inertia(recording, read_autopilot(recording).rotors)
    assert not found.known
    assert np.isnan(found.lag)
