"""Air data corrected from the probe to the CG: calibration, upwash, boom orientation, rotation.

The rotation of the aircraft moves a probe away from the CG, such as a nose boom, through the air.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aerodb.flight import Bits, Flight
from aerodb.support import Array, Dual, body_to_earth
from aerodb.vehicle.description import AirData, Vehicle
from aerodb.vehicle.five_hole import flow_angles
from aerodb.vehicle.on_flights import mass_channels

_PRESSURES = ("probe_dp_alpha", "probe_dp_beta", "qbar")


def velocity_at_cg(velocity: Array, rates: Array, arm: Array) -> Array:
    """Return the air-relative velocity at the CG from that at the probe, ``v - w x r``.

    Parameters
    ----------
    velocity : (n, 3), v at the probe in body axes, m/s
    rates : (n, 3), w = (p, q, r), rad/s
    arm : (n, 3), r from the CG to the probe in body axes, m

    Returns
    -------
    (n, 3), m/s

    References
    ----------
    Klein & Morelli (2006), chapter 10.

    >>> velocity, rates = np.array([[50.0, 0.0, 4.0]]), np.array([[0.0, 0.5, 0.0]])
    >>> velocity_at_cg(velocity, rates, np.array([[2.0, 0.0, 0.0]])).tolist()
    [[50.0, 0.0, 5.0]]
    """
    moved: Array = velocity - np.cross(rates, arm)
    return moved


def air_data_at_cg(flight: Flight, vehicle: Vehicle) -> Flight:
    """Return the flight with V, alpha and beta corrected for the probe and transferred to the CG.

    1. Without logged alpha and beta, the raw pressures of a five-hole probe give them.
    2. Alpha and beta are corrected for what [air_data] of the vehicle file declares.
    3. V, alpha and beta are transferred from the vehicle's air-data point to the CG. This is left
       out if the vehicle file names no point (the logged air data are then taken to be at the CG),
       and with a note if airspeed, angle of attack or a rate is not logged. Without beta, sideslip
       is taken as zero.

    Each correction adds a note. Raises InputError as `mass_channels` does.
    """
    flight = _at_probe(flight, vehicle.air_data)
    if vehicle.points.air_data is None:
        return flight
    absent = [name for name in ("V", "alpha", "p", "q", "r") if name not in flight]
    if absent:
        note = f"air data not transferred to the CG: {', '.join(absent)} not logged"
        return replace(flight, notes=(*flight.notes, note))
    properties = mass_channels(flight, vehicle)
    arm = np.asarray(vehicle.points.air_data) - np.column_stack(
        [properties[f"cg_{axis}"] for axis in "xyz"]
    )
    velocity = velocity_at_cg(
        _velocity(flight).T, np.column_stack([flight[name] for name in "pqr"]), arm
    ).T
    names = [name for name in ("V", "alpha", "beta") if name in flight]
    return _replaced(
        flight, velocity, names, (*names, "p", "q", "r"), "transferred from the probe to the CG"
    )


def angles_from_pressures(flight: Flight, probe: AirData) -> dict[str, Array]:
    """Return alpha and beta [rad], each (n,), from the raw pressures of a five-hole probe.

    They hold at the air-data point, in body axes. Empty if a pressure or the calibration is
    missing.
    """
    wanted = (*_PRESSURES, *(each.channel for each in probe.configurations))
    bare = {name: flight[name] for name in wanted if name in flight}
    angles = _at_probe(replace(flight, channels=bare, flags={}), probe)
    return {name: angles[name] for name in ("alpha", "beta") if name in angles}


def probe_configuration(flight: Flight, probe: AirData) -> NDArray[np.int64]:
    """Return which of `AirData.alternatives` the probe is in at each sample (n,): 0 where no
    configuration holds, or its channel is not logged."""
    found = np.zeros(len(flight.time), dtype=np.int64)
    for number, each in reversed(list(enumerate(probe.configurations, start=1))):
        if each.channel in flight:
            values = flight[each.channel]
            found[(values > each.above) & (values < each.below)] = number
    return found


def _at_probe(flight: Flight, probe: AirData) -> Flight:
    """Return the flight with alpha and beta at the probe in body axes, each sample by the
    configuration that holds."""
    if not probe.configurations:
        return _as_flow_angles(_from_pressures(flight, probe), probe)
    number = probe_configuration(flight, probe)
    made = {
        each: _as_flow_angles(_from_pressures(flight, alternative), alternative)
        for each, alternative in enumerate(probe.alternatives())
        if each in number
    }
    most = max(made, key=lambda each: len(made[each].channels))
    angles = [name for name in ("alpha", "beta") if name in made[most]]
    nothing = np.full(len(flight.time), np.nan)
    together = {
        name: np.select(
            [number == each for each in made],
            [each.channels.get(name, nothing) for each in made.values()],
        )
        for name in angles
    }
    absent = [each.channel for each in probe.configurations if each.channel not in flight]
    notes = [
        f"{name} not logged: the probe is taken as without that configuration"
        for name in dict.fromkeys(absent)
    ]
    return replace(made[most].with_channels(together), notes=(*made[most].notes, *notes))


def _velocity(flight: Flight) -> Array:
    """Return the velocity (3, n) of V, alpha and beta (zero if not logged)."""
    speed, alpha = flight["V"], flight["alpha"]
    beta = flight["beta"] if "beta" in flight else np.zeros_like(alpha)
    return np.asarray(
        speed * np.stack([np.cos(beta) * np.cos(alpha), np.sin(beta), np.cos(beta) * np.sin(alpha)])
    )


def _replaced(
    flight: Flight, velocity: Array, names: list[str], sources: tuple[str, ...], how: str
) -> Flight:
    """Return the flight with `names` (among V, alpha, beta) computed from a velocity (3, n).

    Flagged where one of `sources` is; `how` completes the note.
    """
    u, v, w = velocity
    total = np.sqrt(u * u + v * v + w * w)
    with np.errstate(invalid="ignore", divide="ignore"):
        computed = {"V": total, "alpha": np.arctan2(w, u), "beta": np.arcsin(v / total)}
    flags = dict(flight.flags)
    for name in names:
        own = (name, *(source for source in sources if source not in names))
        bits = [flight.flags[source] for source in own if source in flight.flags]
        if bits:
            flags[name] = np.bitwise_or.reduce(bits)
    note = f"{', '.join(names)} {how}"
    return replace(
        flight.with_channels({name: computed[name] for name in names}),
        flags=flags,
        notes=(*flight.notes, note),
    )


def _from_pressures(flight: Flight, probe: AirData) -> Flight:
    """Return the flight with alpha and beta at a five-hole probe, unless both are logged."""
    if (
        probe.five_hole is None
        or not all(name in flight for name in _PRESSURES)
        or {"alpha", "beta"} <= set(flight.channels)
    ):
        return flight
    alpha, beta = flow_angles(
        flight["probe_dp_alpha"], flight["probe_dp_beta"], flight["qbar"], probe.five_hole
    )
    bits = [flight.flags[name] for name in _PRESSURES if name in flight.flags]
    combined: Bits = np.bitwise_or.reduce(bits) if bits else np.zeros(len(alpha), dtype=np.uint8)
    note = "alpha and beta from the raw pressures of the five-hole probe"
    flags = {**flight.flags, "alpha": combined, "beta": combined} if bits else flight.flags
    return replace(
        flight.with_channels({"alpha": alpha, "beta": beta}),
        flags=flags,
        notes=(*flight.notes, note),
    )


def _as_flow_angles(flight: Flight, probe: AirData) -> Flight:
    """Return the flight with alpha and beta in body axes.

    Corrected for upwash, flank angle instead of sideslip, and the orientation of the boom.
    """
    if probe == AirData(five_hole=probe.five_hole) or "alpha" not in flight:
        return flight
    alpha = flight["alpha"] / (1.0 + probe.upwash[0])
    beta = flight["beta"] / (1.0 + probe.upwash[1]) if "beta" in flight else np.zeros_like(alpha)
    if probe.beta == "flank":
        beta = np.arctan(np.tan(beta) * np.cos(alpha))
    flow = np.stack([np.cos(beta) * np.cos(alpha), np.sin(beta), np.cos(beta) * np.sin(alpha)])
    rows = body_to_earth(*(Dual(angle, {}) for angle in probe.orientation))
    turned = np.stack(
        [sum((row[k].value * flow[k] for k in range(3)), np.zeros_like(alpha)) for row in rows]
    )
    names = [name for name in ("alpha", "beta") if name in flight]
    return _replaced(
        flight, turned, names, tuple(names), "corrected for the probe as declared in [air_data]"
    )
