"""A flight given by formulas: attitude and air velocity are sums of sines, so rates and specific
force follow exactly, without any integration. What the reconstruction must find again."""

from collections.abc import Mapping

import numpy as np

from aerodb.consistency.sensors.prediction import MAX_DELAY, FlightRecord

GRAVITY = 9.80665
DENSITY = 1.1
#: channel: mean, then (amplitude, rad/s, phase) of each sine
_MOTION = {
    "V": (60.0, (3.0, 0.25, 0.3), (1.0, 0.9, 1.0)),
    "alpha": (0.06, (0.03, 0.8, 0.2), (0.02, 2.3, 1.0), (0.01, 4.0, 2.0)),
    "beta": (0.0, (0.03, 1.1, 0.7), (0.015, 2.9, 0.1)),
    "phi": (0.05, (0.5, 0.35, 0.0), (0.1, 1.9, 0.4)),
    "theta": (0.08, (0.1, 0.5, 0.9), (0.03, 2.1, 0.2)),
    "psi": (0.4, (1.4, 0.16, 0.0), (0.05, 1.3, 0.5)),
}
NOISE = {
    "V": 0.3, "alpha": 0.003, "beta": 0.003, "phi": 0.002, "theta": 0.002, "psi": 0.003, "qbar": 15.0,
    "velocity_north": 0.1, "velocity_east": 0.1, "velocity_down": 0.1,
}  # fmt: skip
INERTIAL_NOISE = np.array([0.02, 0.02, 0.02, 5e-4, 5e-4, 5e-4])


def _wave(name: str, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    mean, *sines = _MOTION[name]
    value = mean + sum(a * np.sin(w * time + f) for a, w, f in sines)
    return value, sum(a * w * np.cos(w * time + f) for a, w, f in sines)


def truth(time: np.ndarray, wind=(0.0, 0.0, 0.0), arm=(0.0, 0.0, 0.0)) -> dict[str, np.ndarray]:
    """Channels at the times (n,): inputs at the CG, air data at the arm, velocity over the earth
    with the wind."""
    wave = {name: _wave(name, time) for name in _MOTION}
    (v, dv), (a, da), (b, db) = wave["V"], wave["alpha"], wave["beta"]
    (f, df), (t, dt), (p, dp) = wave["phi"], wave["theta"], wave["psi"]
    rates = np.stack(
        [
            df - dp * np.sin(t),
            dt * np.cos(f) + dp * np.cos(t) * np.sin(f),
            -dt * np.sin(f) + dp * np.cos(t) * np.cos(f),
        ]
    )
    unit = np.stack([np.cos(b) * np.cos(a), np.sin(b), np.cos(b) * np.sin(a)])
    by_alpha = np.stack([-np.cos(b) * np.sin(a), 0 * a, np.cos(b) * np.cos(a)])
    by_beta = np.stack([-np.sin(b) * np.cos(a), np.cos(b), -np.sin(b) * np.sin(a)])
    air = v * unit
    down = np.stack([-np.sin(t), np.cos(t) * np.sin(f), np.cos(t) * np.cos(f)])
    force = (
        dv * unit
        + v * (da * by_alpha + db * by_beta)
        + np.cross(rates, air, axis=0)
        - GRAVITY * down
    )
    probe = air + np.cross(rates, np.broadcast_to(np.array(arm)[:, None], air.shape), axis=0)
    ahead = air[0] * np.cos(t) + (air[1] * np.sin(f) + air[2] * np.cos(f)) * np.sin(t)
    across = air[1] * np.cos(f) - air[2] * np.sin(f)
    speed = np.sqrt(np.sum(probe**2, axis=0))
    return {
        **dict(zip(("ax", "ay", "az"), force, strict=True)), **dict(zip(("p", "q", "r"), rates, strict=True)),
        "V": speed, "alpha": np.arctan2(probe[2], probe[0]), "beta": np.arcsin(probe[1] / speed),
        "qbar": 0.5 * DENSITY * speed**2, "phi": f, "theta": t, "psi": p,
        "velocity_north": ahead * np.cos(p) - across * np.sin(p) + wind[0],
        "velocity_east": ahead * np.sin(p) + across * np.cos(p) + wind[1],
        "velocity_down": np.sum(air * down, axis=0) + wind[2],
    }  # fmt: skip


def simulated(
    rng: np.random.Generator,
    planted: Mapping[str, float],
    *,
    seconds: float = 40.0,
    step: float = 0.02,
    channels: tuple[str, ...] = tuple(NOISE),
    noise: float = 1.0,
    start: float = 0.0,
    arm: tuple[float, float, float] = (0.0, 0.0, 0.0),
    name: str = "simulated",
) -> FlightRecord:
    """A record with `planted` sensor errors, wind and boom position; `arm` is what the vehicle file
    says of the boom."""
    time = start + step * np.arange(round(seconds / step))
    wind = tuple(planted.get(f"wind_{axis}", 0.0) for axis in ("north", "east", "down"))
    boom = tuple(
        known + planted.get(f"air_data_{axis}", 0.0) for known, axis in zip(arm, "xyz", strict=True)
    )
    exact = truth(time, wind, boom)

    def shown(key: str, values: np.ndarray, sigma: float) -> np.ndarray:
        biased = (1 + planted.get(f"{key}_scale", 0.0)) * values + planted.get(f"{key}_bias", 0.0)
        return biased + noise * sigma * rng.standard_normal(len(values))

    inputs = np.column_stack(
        [
            shown(key, exact[key], s)
            for key, s in zip(("ax", "ay", "az", "p", "q", "r"), INERTIAL_NOISE, strict=True)
        ]
    )
    outputs = {}
    for key in channels:
        delay = planted.get(f"{key}_delay", 0.0)
        assert abs(delay) < MAX_DELAY
        outputs[key] = shown(
            key, truth(time - delay, wind, boom)[key] if delay else exact[key], NOISE[key]
        )
    return FlightRecord(
        name, step, inputs, outputs, name, arm, density=np.full(len(time), DENSITY), gravity=GRAVITY
    )
