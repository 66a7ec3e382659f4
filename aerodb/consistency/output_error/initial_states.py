"""First approximation of a record's initial state, from its first samples."""

from collections.abc import Mapping

import numpy as np

from aerodb.consistency.kinematics import STATES
from aerodb.consistency.sensors import FlightRecord, earth_to_body
from aerodb.errors import InputError
from aerodb.support import Array
from aerodb.vehicle import flow_angles

#: A heading that is not logged is taken from the track over this time, s.
_TRACK = 5.0


def first_states(record: FlightRecord, wind: Mapping[str, float] | None = None) -> Array:
    """Initial state of a record, from the first finite sample of each channel.

    Velocity comes from the air data (moved from the air-data point to the CG; airspeed also from
    dynamic pressure, flow angles also from raw pressures, zero where not measured), otherwise from
    the velocity of the antenna. Attitude comes from its channels, a missing heading from the track.
    Position comes from its channels, a missing altitude from the pressure altitude, otherwise zero.

    Parameters
    ----------
    record : the record.
    wind : ``wind_north``, ``wind_east``, ``wind_down`` -> [m/s], added to the air data; None: calm.

    Returns
    -------
    (9,), order of `kinematics.STATES`.

    Raises InputError when no channel gives the velocity, or bank or pitch attitude.
    """
    state = np.zeros(9)
    for name in STATES:
        known = _first(record, name)
        state[STATES.index(name)] = known if known is not None else 0.0
    if _first(record, "altitude") is None:
        state[8] = _first(record, "pressure_altitude") or 0.0
    if _first(record, "phi") is None or _first(record, "theta") is None:
        raise InputError(
            "no bank or pitch attitude",
            record.name,
            "log the attitude: reconstruction starts from it",
        )
    over_earth = [_first(record, f"velocity_{axis}") for axis in ("north", "east", "down")]
    north, east = over_earth[:2]
    if _first(record, "psi") is None:
        state[5] = _track(record) if north is None or east is None else np.arctan2(east, north)
    rotation = earth_to_body(state[:, None])[:, :, 0]
    turn = record.inputs[0, 3:]
    air = _air_velocity(record)
    if air is not None:
        blowing = np.array(
            [(wind or {}).get(f"wind_{axis}", 0.0) for axis in ("north", "east", "down")]
        )
        state[:3] = air - np.cross(turn, record.arm) + rotation @ blowing
    elif north is not None and east is not None:
        state[:3] = rotation @ np.array([north, east, over_earth[2] or 0.0]) - np.cross(
            turn, record.installation.gps
        )
    elif not {"u", "v", "w"} <= set(record.given):
        raise InputError(
            "no airspeed and no velocity over the earth", record.name, "log one of them"
        )
    for name, values in record.given.items():
        state[STATES.index(name)] = values[0]
    return state


def _air_velocity(record: FlightRecord) -> Array | None:
    """(3,) velocity of the air-data point through the air, body axes, m/s; None without airspeed
    and dynamic pressure."""
    speed, pressure = _first(record, "V"), _first(record, "qbar")
    if speed is None and pressure is not None and pressure > 0 and record.density is not None:
        speed = float(np.sqrt(2.0 * pressure / record.density[0]))
    if speed is None:
        return None
    how = record.installation
    alpha, beta = _first(record, "alpha") or 0.0, _first(record, "beta") or 0.0
    raw = [_first(record, name) for name in ("probe_dp_alpha", "probe_dp_beta")]
    if (
        _first(record, "alpha") is None
        and how.five_hole is not None
        and None not in raw
        and record.density is not None
    ):
        q = 0.5 * float(record.density[0]) * speed**2
        angles = flow_angles(np.array(raw[0]), np.array(raw[1]), np.array(q), how.five_hole)
        alpha, beta = (float(np.nan_to_num(angle)) for angle in angles)
    alpha, beta = alpha / (1.0 + how.upwash[0]), beta / (1.0 + how.upwash[1])
    beta = np.arctan(np.tan(beta) * np.cos(alpha)) if how.flank else beta
    air = speed * np.array(
        [np.cos(beta) * np.cos(alpha), np.sin(beta), np.cos(beta) * np.sin(alpha)]
    )
    boom = earth_to_body(np.r_[np.zeros(3), how.boom, np.zeros(3)][:, None])[:, :, 0]
    return np.asarray(boom.T @ air)


def _track(record: FlightRecord) -> float:
    """Direction of the track over the first few seconds of a logged position, rad; zero without
    one. A heading that starts half a turn off would not be found: the wind would absorb it."""
    count = max(2, round(_TRACK / record.step))
    moved = []
    for name in ("north", "east"):
        values = record.outputs.get(name)
        good = (
            np.zeros(0, dtype=np.int64)
            if values is None
            else np.flatnonzero(np.isfinite(values[:count]))
        )
        if values is None or len(good) < 2:
            return 0.0
        moved.append(np.polyfit(good, values[good], 1)[0])
    return float(np.arctan2(moved[1], moved[0]))


def _first(record: FlightRecord, name: str) -> float | None:
    """First finite sample of an output or given state; None where there is none."""
    for channels in (record.given, record.outputs):
        if name in channels:
            finite = np.flatnonzero(np.isfinite(channels[name]))
            if len(finite):
                return float(channels[name][finite[0]])
    return None
