"""One step of a dynamic model, from one sample to the next, and central differences of it."""

import numpy as np

from aerodb.estimation.dynamic_model import DynamicModel, Values
from aerodb.estimation.time_history import TimeHistory
from aerodb.support import Array

#: Step of the central differences, as a share of a state.
_SHARE = 1e-4
#: Least state that the step is a share of: one near zero would have no step.
_LEAST = 1e-2


def stepped(
    model: DynamicModel, values: Values, record: TimeHistory, sample: int, state: Array
) -> Array:
    """Return the state one sample later, (s, k) in SI units, by Runge-Kutta's fourth-order
    formula."""
    step = record.step
    a = model.rates(values, record, float(sample), state)
    b = model.rates(values, record, sample + 0.5, state + 0.5 * step * a)
    c = model.rates(values, record, sample + 0.5, state + 0.5 * step * b)
    d = model.rates(values, record, sample + 1.0, state + step * c)
    return state + (step / 6.0) * (a + 2.0 * b + 2.0 * c + d)


def around(state: Array) -> tuple[Array, Array]:
    """States (s, (2 s + 1) k): k states (s, k), then each displaced up and down by every element;
    and the displacements (s, k), in the unit of each state."""
    s = len(state)
    displaced = np.repeat(state[:, None, :], 2 * s + 1, axis=1)
    size = _SHARE * np.maximum(np.abs(state), _LEAST)
    for a in range(s):
        displaced[a, 1 + a] += size[a]
        displaced[a, 1 + s + a] -= size[a]
    return displaced.reshape(s, -1), size


def slopes(displaced: Array, size: Array) -> tuple[Array, Array]:
    """Value (m, k) and Jacobian (m, s, k) from values (m, (2 s + 1) k) at the states `around`. The
    Jacobian is in the unit of a value per unit of a state."""
    s = len(size)
    split = displaced.reshape(len(displaced), 2 * s + 1, size.shape[1])
    jacobian = (split[:, 1 : 1 + s] - split[:, 1 + s :]) / (2.0 * size)
    return split[:, 0], np.ascontiguousarray(jacobian)


def repeated(values: Values, times: int) -> Values:
    """Values of k sets of parameters, for `times` states each. Values (k,) become (times k,), in SI
    units; numbers stay."""
    return {
        name: np.tile(value, times) if np.ndim(value) else value for name, value in values.items()
    }
