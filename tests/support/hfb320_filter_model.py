"""The HFB-320's longitudinal motion as published, for its record in turbulence."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numba import njit

from aerodb.estimation import Parameter, Parameters, TimeHistory, Values
from aerodb.support import Array

S_M, SC_IY, THRUST, V0, MASS, TILT, RHO, HALF_CHORD, G = (
    4.0280e-3, 8.0027e-4, -7.0153e-6, 104.67, 7472.0, 0.0524, 0.792, 1.215, 9.80665,
)  # fmt: skip
PUBLISHED = {
    "CD_0": 0.122688, "CD_V": -0.0644969, "CD_alpha": 0.320055,
    "CL_0": -0.0929113, "CL_V": 0.148726, "CL_alpha": 4.32785,
    "Cm_0": 0.111905, "Cm_V": 0.00395154, "Cm_alpha": -0.967854, "Cm_q": -34.7098, "Cm_de": -1.52913,
}  # fmt: skip
START = {
    "CD_0": 0.1, "CD_V": 0.0, "CD_alpha": 0.3, "CL_0": 0.0, "CL_V": 0.0, "CL_alpha": 4.0,
    "Cm_0": 0.1, "Cm_V": 0.0, "Cm_alpha": -1.0, "Cm_q": -30.0, "Cm_de": -1.5,
}  # fmt: skip


@njit(cache=True, error_model="numpy")
def _motion(t: Array, x: Array, de: float, thrust: float, rates: Array, outputs: Array) -> None:
    """Rates (4, k) and outputs (7, k) at states (4, k) with coefficients (11, k)."""
    for j in range(x.shape[1]):
        v, alpha, theta, q = x[0, j], x[1, j], x[2, j], x[3, j]
        drag = t[0, j] + t[1, j] * v / V0 + t[2, j] * alpha
        lift = t[3, j] + t[4, j] * v / V0 + t[5, j] * alpha
        pitch = t[6, j] + t[7, j] * v / V0 + t[8, j] * alpha
        pitch += t[9, j] * q * HALF_CHORD / V0 + t[10, j] * de
        force, push = 0.5 * RHO * v * v * S_M, thrust / MASS
        turn = 0.5 * RHO * v * v * SC_IY * pitch + THRUST * thrust
        sine, cosine = np.sin(alpha), np.cos(alpha)
        rates[0, j] = -force * drag + push * np.cos(alpha + TILT) + G * np.sin(alpha - theta)
        rates[1, j] = (
            q + (G * np.cos(alpha - theta) - push * np.sin(alpha + TILT) - force * lift) / v
        )
        rates[2, j] = q
        rates[3, j] = turn
        for a in range(4):
            outputs[a, j] = x[a, j]
        outputs[4, j] = turn
        outputs[5, j] = force * (lift * sine - drag * cosine) + push * np.cos(TILT)
        outputs[6, j] = -force * (lift * cosine + drag * sine) - push * np.sin(TILT)


@dataclass(frozen=True)
class Hfb320:
    """States and outputs as in the publication; the first states are parameters."""

    parameters: Parameters
    states: tuple[str, ...] = ("V", "alpha", "theta", "q")
    outputs: tuple[str, ...] = ("V", "alpha", "theta", "q", "q_dot", "ax", "az")

    def initial_state(self, values: Values, record: TimeHistory) -> Array:
        first = (np.atleast_1d(values[f"initial_{name}"]) for name in self.states)
        return np.stack(np.broadcast_arrays(*first))

    def rates(self, values: Values, record: TimeHistory, sample: float, state: Array) -> Array:
        low = min(int(sample), len(record.time) - 2)
        share = sample - low
        inputs = [(1.0 - share) * u[low] + share * u[low + 1] for u in record.inputs.values()]
        return self._both(values, state, *inputs)[0]

    def observed(self, values: Values, record: TimeHistory, sample: int, state: Array) -> Array:
        return self._both(values, state, *(u[sample] for u in record.inputs.values()))[1]

    def simulated(self, values: Values, record: TimeHistory) -> Array:
        """Runge-Kutta of fourth order from sample to sample."""
        state, h = self.initial_state(values, record), record.step
        out = np.empty((len(record.time), len(self.outputs), state.shape[1]))
        with np.errstate(all="ignore"):
            for i in range(len(record.time)):
                out[i] = self.observed(values, record, i, state)
                if i + 1 < len(record.time):
                    a = self.rates(values, record, i, state)
                    b = self.rates(values, record, i + 0.5, state + 0.5 * h * a)
                    c = self.rates(values, record, i + 0.5, state + 0.5 * h * b)
                    d = self.rates(values, record, i + 1, state + h * c)
                    state = state + h / 6.0 * (a + 2.0 * b + 2.0 * c + d)
        return np.where(np.isfinite(out), out, np.nan)

    def _both(self, values: Values, state: Array, de: float, thrust: float) -> tuple[Array, Array]:
        k = state.shape[1]
        coefficients = np.empty((len(PUBLISHED), k))
        for row, name in enumerate(PUBLISHED):
            coefficients[row] = values[name]
        rates, outputs = np.empty((4, k)), np.empty((7, k))
        _motion(coefficients, state, de, thrust, rates, outputs)
        return rates, outputs


def record(path: Path) -> TimeHistory:
    d = np.loadtxt(path)
    names = ("V", "alpha", "theta", "q", "q_dot", "ax", "az")
    return TimeHistory(
        "hfb320", d[:, 0], {"de": d[:, 1], "thrust": d[:, 3]},
        dict(zip(names, d[:, 4:11].T, strict=True)),
    )  # fmt: skip


def model(history: TimeHistory) -> Hfb320:
    first = [
        Parameter(f"initial_{name}", float(history.outputs[name][0]))
        for name in ("V", "alpha", "theta", "q")
    ]
    return Hfb320(Parameters((*(Parameter(name, value) for name, value in START.items()), *first)))
