"""What flight-path reconstruction can give a flight, before it is run."""

from collections.abc import Mapping
from typing import Final

import numpy as np

from aerodb.flight import Flight
from aerodb.support import Array

#: Channels without which no path is integrated (`records.inertial_inputs`); either specific force.
_FORCES = (("ax", "ay", "az"), ("ax_imu", "ay_imu", "az_imu"))
_MOTION = ("p", "q", "r", "phi", "theta")
#: With these the wind is told from the motion, so that flow angles follow without a vane.
_PATH = ("V", "velocity_north", "velocity_east", "velocity_down")

#: Change of track (rad) needed to separate the wind from an airspeed error.
TURN: Final = 1.0


def unmeasured_angles_outlook(flight: Flight) -> dict[str, dict[str, object]]:
    """Return what becomes of the flow angles that a flight lacks.

    Angle -> ``expected``, whether reconstruction can give it; ``lacking``, the channels without
    which it cannot; and for beta ``turn``, by how much the track turns, and ``turn_needed``
    [rad]. Whether its standard error is small enough shows only when it is run
    (docs/method/consistency.md, section "What a flight becomes").
    """
    forces = min(([name for name in names if name not in flight] for names in _FORCES), key=len)
    lacking = [*forces, *(name for name in (*_MOTION, *_PATH) if name not in flight)]
    turn = turn_of(flight.channels)
    found: dict[str, dict[str, object]] = {}
    if "alpha" not in flight and "probe_dp_alpha" not in flight:
        found["alpha"] = {"expected": not lacking, "lacking": lacking}
    if "beta" not in flight and "probe_dp_beta" not in flight:
        enough = not lacking and turn > TURN
        turned = {"turn": turn, "turn_needed": TURN}
        found["beta"] = {"expected": enough, "lacking": lacking, **turned}
    return found


def turn_of(channels: Mapping[str, Array]) -> float:
    """Return by how much the track turns [rad], the heading where there is no track; 0 where there
    is neither.

    channels : name -> (n,), SI.
    """
    if {"velocity_north", "velocity_east"} <= set(channels):
        track = np.arctan2(channels["velocity_east"], channels["velocity_north"])
    elif "psi" in channels:
        track = channels["psi"]
    else:
        return 0.0
    good = track[np.isfinite(track)]
    return float(np.ptp(np.unwrap(good))) if len(good) else 0.0
