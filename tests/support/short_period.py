"""The short period of an aircraft in vertical turbulence, simulated exactly, and as a model."""

import numpy as np
from scipy.linalg import expm

from aerodb.estimation import Parameter, Parameters, StateSpace, TimeHistory, state_space
from aerodb.support import Array

#: Speed [m/s], and the gusts' scale [m] over it.
SPEED, LAG = 80.0, 150.0 / 80.0
STABLE = {"Z_alpha": -1.2, "Z_de": -0.1, "M_alpha": -4.0, "M_q": -1.6, "M_de": -7.0}
#: Time to double .5 s.
UNSTABLE = {**STABLE, "M_alpha": 6.17, "M_q": -1.0}
NOISE = {"alpha": 0.002, "q": 0.003, "az": 0.3}


def model(start: dict[str, float], **changes: dict) -> StateSpace:
    """Unknown: five derivatives, the first states and a bias; `changes` of single parameters. The
    gust angle has Dryden's spectrum: white noise through two lags."""
    first = {"initial_alpha": 0.0, "initial_q": 0.0, "bias_az": 0.0}
    items = [
        Parameter(name, **{"value": value, **changes.get(name, {})})
        for name, value in {**start, **first}.items()
    ]
    gusts = [Parameter(f"initial_{name}", 0.0, free=False) for name in ("g1", "g2")]

    def seen(name: str, factor: float = 1.0) -> list[str]:
        parts = (1.0, np.sqrt(3.0), 1.0 - np.sqrt(3.0))
        return [f"{factor * part:.15f}*{name}" for part in parts]

    lift, pitch, az = seen("Z_alpha"), seen("M_alpha"), seen("Z_alpha", SPEED)
    return state_space(
        ("alpha", "q", "g1", "g2"),
        ("de",),
        ("alpha", "q", "az"),
        Parameters((*items, *gusts)),
        a=[
            [lift[0], 1.0, *lift[1:]],
            [pitch[0], "M_q", *pitch[1:]],
            [0.0, 0.0, -1.0 / LAG, 0.0],
            [0.0, 0.0, 1.0 / LAG, -1.0 / LAG],
        ],
        b=[["Z_de"], ["M_de"], [0.0], [0.0]],
        c=[
            [1.0, 0.0, np.sqrt(3.0), 1.0 - np.sqrt(3.0)],
            [0.0, 1.0, 0.0, 0.0],
            [az[0], 0.0, *az[1:]],
        ],
        d=[[0.0], [0.0], [f"{SPEED}*Z_de"]],
        output_bias=[0.0, 0.0, "bias_az"],
    )


def doublets(time: Array) -> Array:
    """A 3-2-1-1 after 1 s, and a doublet half way, of 2 degrees."""
    edges = np.array([1.0, 2.5, 3.5, 4.0, 4.5])
    wave = np.select([time < edge for edge in edges], [0.0, 1.0, -1.0, 1.0, -1.0], 0.0)
    middle = time[-1] / 2.0
    wave += (np.abs(time - middle) < 0.6) * np.sign(time - middle)
    return np.radians(2.0) * wave


def flown(
    truth: dict[str, float],
    intensity: float,
    seed: int,
    *,
    name: str = "flight",
    seconds: float = 20.0,
    step: float = 0.05,
    feedback: float = 0.0,
    coloured: float = 0.0,
) -> TimeHistory:
    """A flight through turbulence whose gust angle has white noise of `intensity` behind it.

    The motion is integrated exactly over steps a twentieth of the sampling; elevator as commanded
    plus `feedback` times the measured alpha. `coloured`: correlation of the measurement noise from
    one sample to the next.
    """
    rng = np.random.default_rng(seed)
    n, parts = round(seconds / step) + 1, 20
    time, h = step * np.arange(n), step / parts
    t = truth
    gust = np.array([0.0, 0.0, np.sqrt(3.0), 1.0 - np.sqrt(3.0)])
    a = np.zeros((4, 4))
    a[0], a[1] = t["Z_alpha"] * gust, t["M_alpha"] * gust
    a[0, :2], a[1, :2] = [t["Z_alpha"], 1.0], [t["M_alpha"], t["M_q"]]
    a[2, 2], a[3, 2], a[3, 3] = -1.0 / LAG, 1.0 / LAG, -1.0 / LAG
    b = np.array([t["Z_de"], t["M_de"], 0.0, 0.0])
    whole = np.zeros((6, 6))
    whole[:4, :4], whole[:4, 4], whole[4, 5] = a * h, b * h, 1.0
    moved = expm(whole)
    command, x = doublets(time), np.zeros(4)
    noise = rng.standard_normal((n, 3))
    for i in range(1, n):
        noise[i] = coloured * noise[i - 1] + np.sqrt(1.0 - coloured**2) * noise[i]
    noise *= list(NOISE.values())
    de, outputs = np.zeros(n), np.zeros((n, 3))
    seen = np.array([1.0, 0.0, gust[2], gust[3]])
    previous = 0.0
    for i in range(n):
        alpha = seen @ x
        de[i] = command[i] - feedback * previous
        outputs[i] = [
            alpha, x[1], SPEED * (t["Z_alpha"] * alpha + t["Z_de"] * de[i])
        ]  # fmt: skip
        outputs[i] += noise[i]
        previous = outputs[i, 0]
        if i + 1 < n:
            later = command[i + 1] - feedback * previous
            for part in range(parts):
                u0 = de[i] + (later - de[i]) * part / parts
                x = (moved @ np.concatenate([x, [u0, (later - de[i]) / parts]]))[:4]
                x[2] += intensity * np.sqrt(h) * rng.standard_normal()
    return TimeHistory(name, time, {"de": de}, dict(zip(NOISE, outputs.T, strict=True)))
