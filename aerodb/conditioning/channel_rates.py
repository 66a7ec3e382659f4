"""Kinematic rates of flow angles, airspeed and attitude over a flat earth in steady air.

They follow from accelerations, angular rates, attitude and gravity: Stevens, Lewis & Johnson,
*Aircraft Control and Simulation*, 3rd ed., sections 1.3 and 2.5. All functions take channels by
name, in SI, each (n,); gravity is that of the place (`local_gravity`).
"""

from collections.abc import Callable, Mapping
from typing import Final

import numpy as np

from aerodb.conditioning.local_gravity import local_gravity
from aerodb.flight import Flight
from aerodb.signals import bridge
from aerodb.support import Array


def alpha_rate(f: Mapping[str, Array]) -> Array:
    """Return alphadot [rad/s] (n,).

    From alpha, V, q, ax, az, theta and, if present, beta, p, r, phi:
    ``q - tan(beta)(p cos(alpha) + r sin(alpha)) + (az cos(alpha) - ax sin(alpha) + g(cos(alpha)
    cos(theta) cos(phi) + sin(alpha) sin(theta))) / (V cos(beta))``.
    """
    sin, cos = np.sin(f["alpha"]), np.cos(f["alpha"])
    zero = np.zeros_like(sin)
    beta, phi = f.get("beta", zero), f.get("phi", zero)
    turn = np.tan(beta) * (f.get("p", zero) * cos + f.get("r", zero) * sin)
    weight = local_gravity(f) * (cos * np.cos(f["theta"]) * np.cos(phi) + sin * np.sin(f["theta"]))
    result: Array = (
        f["q"] - turn + (f["az"] * cos - f["ax"] * sin + weight) / (f["V"] * np.cos(beta))
    )
    return result


def beta_rate(f: Mapping[str, Array]) -> Array:
    """Return betadot [rad/s] (n,).

    From beta, alpha, V, p, r, ax, ay, az, theta, phi:
    ``p sin(alpha) - r cos(alpha) + (force along the wind's y axis, gravity included) / V``.
    """
    (sa, ca), (sb, cb) = ((np.sin(f[name]), np.cos(f[name])) for name in ("alpha", "beta"))
    gravity = local_gravity(f)
    fx = f["ax"] - gravity * np.sin(f["theta"])
    fy = f["ay"] + gravity * np.cos(f["theta"]) * np.sin(f["phi"])
    fz = f["az"] + gravity * np.cos(f["theta"]) * np.cos(f["phi"])
    result: Array = f["p"] * sa - f["r"] * ca + (fy * cb - sb * (fx * ca + fz * sa)) / f["V"]
    return result


def airspeed_rate(f: Mapping[str, Array]) -> Array:
    """Return Vdot [m/s^2] (n,) in steady air.

    From alpha, ax, az, theta and, if present, beta, ay, phi: the force per mass along the
    air-relative velocity, gravity included.
    """
    zero = np.zeros_like(f["alpha"])
    beta, phi, ay = f.get("beta", zero), f.get("phi", zero), f.get("ay", zero)
    gravity = local_gravity(f)
    fx = f["ax"] - gravity * np.sin(f["theta"])
    fy = ay + gravity * np.cos(f["theta"]) * np.sin(phi)
    fz = f["az"] + gravity * np.cos(f["theta"]) * np.cos(phi)
    result: Array = np.cos(beta) * (
        fx * np.cos(f["alpha"]) + fz * np.sin(f["alpha"])
    ) + fy * np.sin(beta)
    return result


def bank_rate(f: Mapping[str, Array]) -> Array:
    """Return phidot = p + tan(theta) (q sin(phi) + r cos(phi)), rad/s (n,)."""
    result: Array = f["p"] + np.tan(f["theta"]) * (
        f["q"] * np.sin(f["phi"]) + f["r"] * np.cos(f["phi"])
    )
    return result


def pitch_attitude_rate(f: Mapping[str, Array]) -> Array:
    """Return thetadot = q cos(phi) - r sin(phi), rad/s (n,)."""
    zero = np.zeros_like(f["q"])
    phi = f.get("phi", zero)
    return np.asarray(f["q"] * np.cos(phi) - f.get("r", zero) * np.sin(phi))


def heading_rate(f: Mapping[str, Array]) -> Array:
    """Return psidot = (q sin(phi) + r cos(phi)) / cos(theta), rad/s (n,)."""
    return np.asarray((f["q"] * np.sin(f["phi"]) + f["r"] * np.cos(f["phi"])) / np.cos(f["theta"]))


#: Channel -> its kinematic rate and the channels that the rate needs (accelerations at the CG, else
#: at the IMU).
KINEMATICS: Final[dict[str, tuple[Callable[[Mapping[str, Array]], Array], tuple[str, ...]]]] = {
    "alpha": (alpha_rate, ("alpha", "V", "q", "ax", "az", "theta")),
    "beta": (beta_rate, ("beta", "alpha", "V", "p", "r", "ax", "ay", "az", "theta", "phi")),
    "V": (airspeed_rate, ("V", "alpha", "ax", "az", "theta")),
    "phi": (bank_rate, ("phi", "p", "q", "r", "theta")),
    "theta": (pitch_attitude_rate, ("theta", "q")),
    "psi": (heading_rate, ("psi", "q", "r", "phi", "theta")),
}

#: Channels that these rates also use, if present.
OPTIONAL: Final[dict[str, tuple[str, ...]]] = {
    "alpha": ("beta", "p", "r", "phi"),
    "V": ("beta", "ay", "phi"),
    "theta": ("r", "phi"),
}


def with_accelerations(flight: Flight) -> dict[str, Array]:
    """Return the flight's channels with unusable samples interpolated linearly.

    ax, ay, az are those at the IMU if those at the CG are missing.

    Channel -> (n,): accelerations [m/s²], rates [rad/s], angles [rad]. One with less than two
    usable samples is left out.
    """
    channels = {}
    for name in flight.channels:
        good = flight.usable([name])
        if good.sum() > 1:
            values = flight[name]
            channels[name] = bridge(values if good.all() else np.where(good, values, np.nan))
    for axis in "xyz":
        if f"a{axis}" not in channels and f"a{axis}_imu" in channels:
            channels[f"a{axis}"] = channels[f"a{axis}_imu"]
    return channels
