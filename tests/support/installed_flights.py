"""Flights of known truth as log tables, seen by sensors that are installed as a vehicle file says:
antenna and air-data boom off the CG, a five-hole probe, ports; over a flat or a rotating earth."""

from collections.abc import Mapping

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.spatial.transform import Rotation

from aerodb.physics.geodesy import EARTH_RATE, normal_gravity, radii_of_curvature
from tests.support.consistent_flights import NAME, VEHICLE
from tests.support.instrumented_path import BOOM, GPS, NOISE, PRESSURE, PROBE, motion
from tests.support.simulated_path import DENSITY, GRAVITY, INERTIAL_NOISE, truth

POINTS = f'moment_reference = "cg"\nair_data = {list(BOOM)}\n'
ANTENNA = f"gps = {list(GPS)}\n"
HOLES = f"""
[air_data.five_hole.alpha]
slope = {PROBE.alpha.slope}
break_angle = {PROBE.alpha.break_angle}
[air_data.five_hole.beta]
slope = {PROBE.beta.slope}
"""
BASE = (
    "V",
    "phi",
    "theta",
    "psi",
    "velocity_north",
    "velocity_east",
    "velocity_down",
    "north",
    "east",
    "altitude",
)
VANES = (*BASE, "alpha", "beta")
PRESSURES = (*BASE, "probe_dp_alpha", "probe_dp_beta")
RECEIVER = ("velocity_north", "velocity_east", "velocity_down", "north", "east", "altitude")
BIASES = {
    "ax_bias": 0.05, "ay_bias": -0.08, "az_bias": 0.12, "p_bias": 0.003, "q_bias": -0.002, "r_bias": 0.0025,
    "wind_north": 6.0, "wind_east": -4.0,
}  # fmt: skip
#: Where the qbar of 003, eq. 5 comes from when the static port alone errs.
PORT = 1.0 - 1.0 / 1.101907


def vehicle(antenna: bool = True, holes: bool = False) -> str:
    """The vehicle file of such a flight, with or without the antenna's place and the calibration of
    the probe."""
    text = VEHICLE.replace('moment_reference = "cg"\n', POINTS + (ANTENNA if antenna else ""))
    assert text != VEHICLE, NAME
    return text + HOLES if holes else text


def table(
    planted: Mapping[str, float],
    channels: tuple[str, ...] = VANES,
    *,
    seed: int = 1,
    seconds: float = 60.0,
    gusts: float = 0.0,
    weather: float = 0.0,
    step: float = 0.02,
) -> dict[str, np.ndarray]:
    """Columns of one flight with `planted` errors; `gusts` rms (m/s) of the airspeed, 1 s of
    correlation; `weather`: what the standard atmosphere is off by, m. Density is the one that goes
    with the logged static pressure and temperature."""
    rng = np.random.default_rng(seed)
    time = step * np.arange(round(seconds / step))
    exact = motion(time, planted)
    late = motion(time - planted["gps_delay"], planted) if "gps_delay" in planted else exact
    columns = {"time": time, "rho": np.full(len(time), DENSITY)}
    inertial = dict(zip(("ax", "ay", "az", "p", "q", "r"), INERTIAL_NOISE, strict=True))
    noise = {**{name: NOISE[name] for name in channels}, **inertial}
    for name, sigma in noise.items():
        shown = (late if name in RECEIVER else exact)[name]
        columns[name] = (
            shown + planted.get(f"{name}_bias", 0.0) + sigma * rng.standard_normal(len(time))
        )
    if "pressure_altitude" in channels:
        columns["pressure_altitude"] += weather
        pressure = PRESSURE + 0.5 * rng.standard_normal(len(time))
        columns |= {
            "static_pressure": pressure,
            "temperature": pressure / (287.05287 * columns["rho"]),
        }
    if gusts:
        keep, drive = np.exp(-step), gusts * rng.standard_normal(len(time))
        moved = np.zeros(len(time))
        for k in range(1, len(time)):
            moved[k] = keep * moved[k - 1] + np.sqrt(1.0 - keep**2) * drive[k]
        columns["V"] += moved
    columns["qbar"] = 0.5 * columns["rho"] * columns["V"] ** 2
    return columns


def exact_at_cg(columns: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The true channels of a table's times."""
    return truth(columns["time"])


def around_the_earth(
    seed: int, latitude: float, seconds: float, planted: Mapping[str, float]
) -> dict[str, np.ndarray]:
    """The same motion over a rotating earth, in axes that stay north, east, down: what gyros and
    accelerometers show beside it is the earth's own rate and that of its curvature (Groves 2013,
    section 5.4), at the altitude where it starts."""
    rng = np.random.default_rng(seed)
    time = 0.1 * np.arange(round(seconds / 0.1))
    exact = truth(time)
    velocity = np.stack([exact[f"velocity_{axis}"] for axis in ("north", "east", "down")])
    meridian, normal = radii_of_curvature(latitude)[:2]
    lat = latitude + cumulative_trapezoid(velocity[0], time, initial=0.0) / meridian
    lon = cumulative_trapezoid(velocity[1] / np.cos(lat), time, initial=0.0) / normal
    altitude = -cumulative_trapezoid(velocity[2], time, initial=0.0)
    spin = EARTH_RATE * np.stack([np.cos(lat), np.zeros_like(lat), -np.sin(lat)])
    turn = np.stack(
        [velocity[1] / normal, -velocity[0] / meridian, -velocity[1] * np.tan(lat) / normal]
    )
    to_body = Rotation.from_euler(
        "ZYX", np.column_stack([exact["psi"], exact["theta"], exact["phi"]])
    ).inv()
    more_rate = to_body.apply((spin + turn).T)
    heavy = np.zeros_like(velocity)
    heavy[2] = normal_gravity(latitude, 0.0).gravity - GRAVITY
    more_force = to_body.apply((np.cross(2.0 * spin + turn, velocity, axis=0) - heavy).T)
    columns = {
        "time": time,
        "rho": np.full(len(time), DENSITY),
        "latitude": lat,
        "longitude": lon,
        "altitude": altitude,
    }
    quiet = (*INERTIAL_NOISE[:3], 5e-5, 5e-5, 5e-5)
    for k, (name, sigma) in enumerate(zip(("ax", "ay", "az", "p", "q", "r"), quiet, strict=True)):
        more = (more_force if k < 3 else more_rate)[:, k % 3]
        columns[name] = (
            exact[name]
            + more
            + planted.get(f"{name}_bias", 0.0)
            + sigma * rng.standard_normal(len(time))
        )
    for name in (
        "V",
        "alpha",
        "beta",
        "phi",
        "theta",
        "psi",
        "velocity_north",
        "velocity_east",
        "velocity_down",
    ):
        columns[name] = exact[name] + 0.3 * NOISE[name] * rng.standard_normal(len(time))
    columns["qbar"] = 0.5 * DENSITY * columns["V"] ** 2
    return columns
