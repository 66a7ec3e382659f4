"""An aircraft whose short period is unstable, flown by a pilot."""

import numpy as np
from scipy.linalg import expm

from aerodb.estimation import Parameter, Parameters, StateSpace, TimeHistory, state_space

TRUTH = {"Z_alpha": -0.6, "M_alpha": 3.6, "M_q": -0.5, "Z_de": -0.1, "M_de": -6.0}
SPEED = 60.0
NOISE = {"alpha": 1e-3, "q": 2e-3, "az": 0.05}


def matrices(values):
    t = values
    return (
        np.array([[t["Z_alpha"], 1.0], [t["M_alpha"], t["M_q"]]]),
        np.array([t["Z_de"], t["M_de"]]),
    )


def unstable_model(values) -> StateSpace:
    """Short period with free initial states; outputs alpha, q and az."""
    items = [Parameter(name, value) for name, value in values.items()]
    items += [Parameter("initial_alpha", 0.0), Parameter("initial_q", 0.0)]
    return state_space(
        ["alpha", "q"], ["de"], ["alpha", "q", "az"], Parameters(tuple(items)),
        a=[["Z_alpha", 1], ["M_alpha", "M_q"]],
        b=[["Z_de"], ["M_de"]],
        c=[[1, 0], [0, 1], [f"{SPEED}*Z_alpha", 0]],
        d=[[0], [0], [f"{SPEED}*Z_de"]],
    )  # fmt: skip


def piloted_flight(rng: np.random.Generator, seconds: float = 20.0) -> TimeHistory:
    """The elevator is that of a pilot who holds the aircraft, with steps added; linear between
    samples, as the model takes it, so that the record is exact but for the noise."""
    step, (a, b) = 0.02, matrices(TRUTH)
    time = np.arange(0.0, seconds, step)
    block = np.zeros((4, 4))
    block[:2, :2], block[:2, 2], block[2, 3] = a * step, b * step, 1.0
    power = expm(block)
    phi, first, change = power[:2, :2], power[:2, 2], power[:2, 3]
    gain = np.array([1.2, 0.5])
    added = 0.03 * np.sign(np.sin(2.1 * time) + 0.5 * np.sin(3.7 * time))
    state, elevator, rows = np.zeros(2), np.empty(len(time)), []
    elevator[0] = added[0]
    for i in range(len(time)):
        rows.append([*state, SPEED * (TRUTH["Z_alpha"] * state[0] + TRUTH["Z_de"] * elevator[i])])
        if i + 1 < len(time):
            right = phi @ state + (first - change) * elevator[i] + change * added[i + 1]
            state = np.linalg.solve(np.eye(2) - np.outer(change, gain), right)
            elevator[i + 1] = gain @ state + added[i + 1]
    noisy = np.array(rows) + np.array(list(NOISE.values())) * rng.standard_normal((len(time), 3))
    return TimeHistory("piloted", time, {"de": elevator}, dict(zip(NOISE, noisy.T, strict=True)))
