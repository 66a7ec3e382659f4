"""The least feedback that keeps an unstable vehicle on its recorded flight."""

from typing import Final

import numpy as np
from scipy.linalg import LinAlgError, solve_continuous_are

from aerodb.simulation.engine import FlightModel, simulate
from aerodb.simulation.layout import FEEDBACK
from aerodb.simulation.replay import FlightStretch
from aerodb.support import Array
from aerodb.tables import STILL_AIR

#: Perturbation of each state: m/s for V, else rad or rad/s.
_STEPS: Final = np.array([0.1, *[1e-4] * 7])
#: Below this airspeed [m/s] its angles are no states of the motion: rates and attitude are fed
#: back alone.
_SLOWEST: Final = 1.0
#: Gains below this share of an input's greatest one, each in deflection per perturbation as large
#: as the growing motion makes it, are left out.
_SMALLEST: Final = 1e-3


def stabilising_feedback(
    model: FlightModel, stretch: FlightStretch
) -> dict[tuple[str, str], float]:
    """Return gains (input, channel) -> gain on (flown - simulated) that stabilise a stretch; none
    where no motion grows by more than e over it.

    The gains use the least deflection: growth rates are mirrored, all other modes stay as they are
    (the optimal regulator without weight on the states; Anderson & Moore, Optimal Control: Linear
    Quadratic Methods (1990), section 3.3 with a prescribed degree of stability). Rates are those of
    the model at the start of the stretch. The inputs are those that the flight moves.

    Raises nothing where the inputs cannot stabilise the motion: the result is empty.
    """
    moved = [name for name in model.inputs if np.ptp(stretch.series[name]) > 0]
    duration = float(stretch.time[-1] - stretch.time[0])
    if not moved or duration <= 0:
        return {}
    fed = _fed_back(stretch)
    states, controls = _linear(model, stretch, moved)
    grown = states - np.eye(len(fed)) / duration
    if np.linalg.eigvals(grown).real.max() <= 0:
        return {}
    try:
        cost = solve_continuous_are(grown, controls, np.zeros_like(states), np.eye(len(moved)))
    except (LinAlgError, ValueError):
        return {}
    gains = controls.T @ cost
    largest = np.abs(gains).max(axis=1, keepdims=True)
    return {
        (name, channel): float(gains[i, j])
        for i, name in enumerate(moved)
        for j, channel in enumerate(fed)
        if abs(gains[i, j]) > _SMALLEST * max(largest[i, 0], 1e-12)
    }


def fastest_growth(model: FlightModel, stretch: FlightStretch) -> float:
    """Return the rate [1/s] at which the model's fastest motion grows at the start of a stretch;
    not above zero where it is stable."""
    return float(np.linalg.eigvals(_linear(model, stretch, [])[0]).real.max())


def _fed_back(stretch: FlightStretch) -> tuple[str, ...]:
    """Those of `FEEDBACK` that are states at the start of a stretch."""
    slow = float(np.max(stretch.start["V"])) < _SLOWEST
    return tuple(n for n in FEEDBACK if not (slow and n in ("V", "alpha", "beta")))


def _linear(model: FlightModel, stretch: FlightStretch, moved: list[str]) -> tuple[Array, Array]:
    """Derivatives of the rates of what is fed back by these states (s, s) and by inputs (s, m)."""
    fed = _fed_back(stretch)
    kept = [FEEDBACK.index(name) for name in fed]
    m = len(fed)
    steps = np.concatenate([_STEPS[kept], np.full(len(moved), 1e-4)])
    lanes = np.concatenate([np.diag(steps), -np.diag(steps)], axis=1)
    k = lanes.shape[1]
    series: dict[str, Array] = {
        name: np.full((1, k), values[0])
        for name, values in stretch.series.items()
        if not name.startswith(("wind", "gust"))
    }
    for row, name in enumerate(moved, m):
        series[name] = series[name] + lanes[row]
    start = {name: stretch.start[name] + np.zeros(k) for name in stretch.start}
    for row, name in enumerate(fed):
        start[name] = start[name] + lanes[row]
    run = simulate(model, stretch.time[:1], start, series)
    channel = {name: values[0] for name, values in run.channels.items()}
    air = run.state[:3]
    speed = (air * run.rates[:3]).sum(axis=0) / np.maximum(channel["V"], STILL_AIR)
    sine, cosine = np.sin(channel["phi"]), np.cos(channel["phi"])
    climb = channel["q"] * sine + channel["r"] * cosine
    rates = np.stack(
        [
            speed,
            channel["alphadot"],
            channel["betadot"],
            *run.rates[3:6],
            channel["p"] + np.tan(channel["theta"]) * climb,
            channel["q"] * cosine - channel["r"] * sine,
        ]
    )[kept]
    half = len(steps)
    jacobian = (rates[:, :half] - rates[:, half:]) / (2.0 * steps)
    return jacobian[:, :m], jacobian[:, m:]
