"""The flight of `simulated_path` through further sensors, by plain formulas of their own: antenna
and air-data boom off the CG and mounted askew, ports with errors, a five-hole probe, heights over
terrain."""

from collections.abc import Mapping

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from aerodb.consistency.sensors.models import Installation
from aerodb.consistency.sensors.prediction import FlightRecord
from aerodb.vehicle.five_hole import Curve, FiveHole
from tests.support.simulated_path import DENSITY, GRAVITY, INERTIAL_NOISE, truth

NOISE = {
    "V": 0.3, "alpha": 0.003, "beta": 0.003, "phi": 0.002, "theta": 0.002, "psi": 0.003, "qbar": 15.0,
    "velocity_north": 0.1, "velocity_east": 0.1, "velocity_down": 0.1, "north": 0.5, "east": 0.5, "altitude": 0.7,
    "pressure_altitude": 0.5, "height_above_ground": 1.0, "slant_range": 0.5, "probe_dp_alpha": 20.0, "probe_dp_beta": 20.0,
}  # fmt: skip
PROBE = FiveHole(alpha=Curve(slope=4.5, break_angle=0.1), beta=Curve(slope=4.2))
GPS = (-1.0, 0.3, -0.8)
BOOM = (3.0, 0.0, 0.2)
START_ALTITUDE = 900.0
PRESSURE = 90000.0


def motion(time: np.ndarray, planted: Mapping[str, float]) -> dict[str, np.ndarray]:
    """True channels (n,) that the sensors look at, at the times (n,), with planted wind, arms,
    mounts, terrain and ports."""
    get = lambda name, start=0.0: start + planted.get(name, 0.0)  # noqa: E731
    wind = np.array([get(f"wind_{axis}") for axis in ("north", "east", "down")])
    fine = np.arange(-1.0, time[-1] + 1.5, 0.01)
    along = truth(fine, wind)
    exact = truth(time, wind)
    to_earth = Rotation.from_euler(
        "ZYX", np.column_stack([exact["psi"], exact["theta"], exact["phi"]])
    )
    rates = np.column_stack([exact[name] for name in "pqr"])
    velocity = np.column_stack([exact[f"velocity_{axis}"] for axis in ("north", "east", "down")])
    place = np.column_stack(
        [
            CubicSpline(fine, along[f"velocity_{a}"]).antiderivative()(time)
            for a in ("north", "east", "down")
        ]
    )
    antenna = np.array([get(f"gps_{axis}", known) for axis, known in zip("xyz", GPS, strict=True)])
    seen = velocity + to_earth.apply(np.cross(rates, antenna))
    where = place + to_earth.apply(antenna)
    boom = np.array(
        [get(f"air_data_{axis}", known) for axis, known in zip("xyz", BOOM, strict=True)]
    )
    mount = Rotation.from_euler(
        "ZYX", [get("air_data_yaw"), get("air_data_pitch"), get("air_data_roll")]
    )
    flow = mount.inv().apply(to_earth.inv().apply(velocity - wind) + np.cross(rates, boom))
    speed = np.linalg.norm(flow, axis=1)
    alpha, beta = np.arctan2(flow[:, 2], flow[:, 0]), np.arcsin(flow[:, 1] / speed)
    altitude = START_ALTITUDE - place[:, 2]
    static, offset, total = (
        get("static_port_error"),
        get("static_port_offset"),
        get("total_port_error"),
    )
    q = 0.5 * DENSITY * speed**2
    # density was computed with the pressure that the static port shows; that pressure is PRESSURE
    # throughout
    for _ in range(30):
        q = 0.5 * DENSITY * (PRESSURE - static * q - offset) / PRESSURE * speed**2
    shown = q * (1.0 + total - static) - offset
    down = to_earth.apply([0.0, 0.0, 1.0])[:, 2]
    port = altitude - to_earth.apply(boom)[:, 2]
    height = altitude - get("terrain_elevation")
    return {
        **{name: exact[name] for name in ("phi", "theta", "psi", "ax", "ay", "az", "p", "q", "r")},
        "V": np.sqrt(2.0 * shown / DENSITY), "alpha": alpha, "beta": beta, "qbar": shown,
        "velocity_north": seen[:, 0], "velocity_east": seen[:, 1], "velocity_down": seen[:, 2],
        "north": where[:, 0], "east": where[:, 1], "altitude": START_ALTITUDE - where[:, 2],
        "pressure_altitude": port - (static * q + offset) / (DENSITY * GRAVITY),
        "height_above_ground": height, "slant_range": height / down,
        "probe_dp_alpha": q * _holes("alpha", alpha, beta, planted), "probe_dp_beta": q * _holes("beta", beta, alpha, planted),
    }  # fmt: skip


def _holes(which: str, x: np.ndarray, y: np.ndarray, planted: Mapping[str, float]) -> np.ndarray:
    curve = getattr(PROBE, which)
    part = {
        name: planted.get(f"probe_{which}_{name}", 0.0)
        for name in ("offset", "slope", "square", "cross", "bend")
    }
    over = np.maximum(x - curve.break_angle, 0.0) + np.minimum(x + curve.break_angle, 0.0)
    shape = (
        part["offset"]
        + (1 + part["slope"]) * x
        + part["square"] * x**2
        + part["cross"] * y**2
        + part["bend"] * over
    )
    return curve.slope * shape


def instrumented(
    rng: np.random.Generator,
    planted: Mapping[str, float],
    channels: tuple[str, ...],
    *,
    seconds: float = 40.0,
    noise: float = 1.0,
    step: float = 0.02,
    start: float = 0.0,
    name: str = "flight",
) -> FlightRecord:
    """A record with these channels and `planted` errors; the installation that it declares knows
    nothing of them."""
    time = start + step * np.arange(round(seconds / step))
    exact = motion(time, planted)

    def shown(key: str, sigma: float) -> np.ndarray:
        delay = planted.get(f"{key}_delay", 0.0)
        delay += (
            planted.get("gps_delay", 0.0)
            if key.startswith("velocity_") or key in ("north", "east", "altitude")
            else 0.0
        )
        values = motion(time - delay, planted)[key] if delay else exact[key]
        biased = (1 + planted.get(f"{key}_scale", 0.0)) * values + planted.get(f"{key}_bias", 0.0)
        return biased + noise * sigma * rng.standard_normal(len(time))

    inputs = [
        shown(key, sigma)
        for key, sigma in zip(("ax", "ay", "az", "p", "q", "r"), INERTIAL_NOISE, strict=True)
    ]
    full = np.ones(len(time))
    return FlightRecord(
        name, step, np.column_stack(inputs), {key: shown(key, NOISE[key]) for key in channels}, name, BOOM,
        density=DENSITY * full, gravity=GRAVITY, installation=Installation(gps=GPS, five_hole=PROBE), pressure=PRESSURE * full,
    )  # fmt: skip
