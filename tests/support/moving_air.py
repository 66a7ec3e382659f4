"""The flight of formulas (`simulated_path`) in turbulence after Dryden: over the ground it flies
the formulas, the air moves."""

from dataclasses import replace

import numpy as np

from aerodb.consistency.sensors.prediction import FlightRecord, earth_to_body
from aerodb.physics.turbulence import DrydenGusts
from tests.support.simulated_path import DENSITY, GRAVITY, INERTIAL_NOISE, NOISE, truth

WIND = np.array([6.0, -4.0, 0.0])
FREE = ("ax_bias", "ay_bias", "az_bias", "p_bias", "q_bias", "r_bias", "wind_north", "wind_east")
FIRST = ("u", "v", "w", "phi", "theta", "psi")
#: One probe shows V and qbar alike; the second brings nothing new.
CHANNELS = tuple(name for name in NOISE if name != "qbar")


def gusts(seed: int, n: int, step: float, strength: float) -> np.ndarray:
    """(3, n) m/s at 60 m/s and 200 m above ground; `strength` m/s is the steady wind at 6 m."""
    model = DrydenGusts(np.array([strength]), np.random.default_rng(seed))
    return np.column_stack(
        [model.advance(step, np.array([60.0]), np.array([200.0]))[:, 0] for _ in range(n)]
    )


def moving_air(
    seed: int,
    strength: float,
    *,
    seconds: float = 40.0,
    step: float = 0.02,
    channels: tuple[str, ...] = CHANNELS,
    name: str = "gusty",
    delay: float = 0.0,
) -> tuple[FlightRecord, dict[str, np.ndarray]]:
    """A record, and the truth of its channels and wind; alpha is `delay` late."""
    rng = np.random.default_rng([seed, 1])
    n = round(seconds / step)
    exact = truth(step * np.arange(n), tuple(WIND))
    states = np.zeros((9, n))
    states[3:6] = exact["phi"], exact["theta"], exact["psi"]
    over_ground = np.stack([exact[f"velocity_{axis}"] for axis in ("north", "east", "down")])
    wind = WIND[:, None] + (gusts(seed, n, step, strength) if strength > 0 else 0.0)
    air = np.einsum("ijn,jn->in", earth_to_body(states), over_ground - wind)
    speed = np.sqrt(np.sum(air**2, axis=0))
    true = {
        **exact, "V": speed, "alpha": np.arctan2(air[2], air[0]), "beta": np.arcsin(air[1] / speed),
        "qbar": 0.5 * DENSITY * speed**2,
        **dict(zip(("wind_north", "wind_east", "wind_down"), np.broadcast_to(wind, (3, n)), strict=True)),
    }  # fmt: skip
    inputs = np.column_stack(
        [
            true[key] + sigma * rng.standard_normal(n)
            for key, sigma in zip(("ax", "ay", "az", *"pqr"), INERTIAL_NOISE, strict=True)
        ]
    )
    late = {**true, "alpha": np.interp(np.arange(n) - delay / step, np.arange(n), true["alpha"])}
    outputs = {key: late[key] + NOISE[key] * rng.standard_normal(n) for key in channels}
    return (
        FlightRecord(
            name, step, inputs, outputs, name, density=np.full(n, DENSITY), gravity=GRAVITY
        ),
        true,
    )


def parts(record: FlightRecord, number: int) -> list[FlightRecord]:
    """A record in equal parts of one flight."""
    size = len(record.inputs) // number
    return [
        replace(
            record,
            name=f"{record.name}/{k}",
            inputs=record.inputs[k * size : (k + 1) * size],
            outputs={
                key: values[k * size : (k + 1) * size] for key, values in record.outputs.items()
            },
            density=record.density[k * size : (k + 1) * size],
            first=k * size,
        )
        for k in range(number)
    ]
