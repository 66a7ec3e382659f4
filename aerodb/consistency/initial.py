"""First states of a record from what its sensors show there: where the integration starts before it is improved."""

from collections.abc import Mapping

import numpy as np

from aerodb.consistency.kinematics import STATES
from aerodb.consistency.sensors import Array, Record, to_body
from aerodb.errors import InputError


def first_states(record: Record, wind: Mapping[str, float] | None = None) -> Array:
    """(9,) first state of a record, from the first finite sample of each channel.

    Velocity from the air data (moved from the air-data point to the CG; alpha and beta zero where not measured), else from
    the velocity over the earth; attitude from the attitude channels, a missing heading from the track; position from its
    channels, else zero. wind : ``wind_north ...`` -> m/s, added to the air data. Raises InputError when no channel gives a
    velocity or the attitude.
    """
    state = np.zeros(9)
    for name in STATES:
        known = _first(record, name)
        state[STATES.index(name)] = known if known is not None else 0.0
    if _first(record, "phi") is None or _first(record, "theta") is None:
        raise InputError("no bank or pitch attitude", record.name, "log the attitude: reconstruction starts from it")
    over_earth = [_first(record, f"velocity_{axis}") for axis in ("north", "east", "down")]
    north, east = over_earth[:2]
    if _first(record, "psi") is None and north is not None and east is not None:
        state[5] = np.arctan2(east, north)
    rotation = to_body(state[:, None])[:, :, 0]
    speed = _first(record, "V")
    if speed is not None:
        alpha, beta = _first(record, "alpha") or 0.0, _first(record, "beta") or 0.0
        air = speed * np.array([np.cos(beta) * np.cos(alpha), np.sin(beta), np.cos(beta) * np.sin(alpha)])
        blowing = np.array([(wind or {}).get(f"wind_{axis}", 0.0) for axis in ("north", "east", "down")])
        state[:3] = air - np.cross(record.inputs[0, 3:], record.arm) + rotation @ blowing
    elif north is not None and east is not None:
        state[:3] = rotation @ np.array([north, east, over_earth[2] or 0.0])
    elif not {"u", "v", "w"} <= set(record.given):
        raise InputError("no airspeed and no velocity over the earth", record.name, "log one of them")
    for name, values in record.given.items():
        state[STATES.index(name)] = values[0]
    return state


def _first(record: Record, name: str) -> float | None:
    """First finite sample of an output or given state; None where there is none."""
    for channels in (record.given, record.outputs):
        if name in channels:
            finite = np.flatnonzero(np.isfinite(channels[name]))
            if len(finite):
                return float(channels[name][finite[0]])
    return None
