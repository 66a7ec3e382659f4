"""Linear models of the simulated motion, and their modes."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aerodb.support import Array


@dataclass(frozen=True)
class Mode:
    """One eigenvalue of a linear model [1/s].

    `time_to_double` [s] is infinite for a mode that does not grow.
    """

    eigenvalue: complex

    @property
    def time_to_double(self) -> float:
        """Time in which the amplitude doubles, ln 2 / Re(lambda) [s]."""
        return (
            float(np.log(2.0) / self.eigenvalue.real) if self.eigenvalue.real > 0 else float("inf")
        )


def linearise(rate: Callable[[Array], Array], state: Array, step: float = 1e-4) -> Array:
    """Return the Jacobian (m, m) of a state derivative by central differences.

    Parameters
    ----------
    rate : function of states (m, 2 m) in columns, all perturbations at once, to their derivatives
    state : (m,), point of linearisation
    step : float, perturbation of each state
    """
    m = state.shape[0]
    perturbed = state[:, None] + step * np.concatenate([np.eye(m), -np.eye(m)], axis=1)
    rates = rate(perturbed)
    result: Array = (rates[:, :m] - rates[:, m:]) / (2 * step)
    return result


def modes(matrix: Array, rows: NDArray[np.int64] | None = None) -> tuple[Mode, ...]:
    """Return the modes of a linear model, the least stable first.

    Parameters
    ----------
    matrix : (m, m) [1/s]
    rows : states of the subsystem to use, all by default
    """
    subsystem = matrix if rows is None else matrix[np.ix_(rows, rows)]
    values = np.linalg.eigvals(subsystem)
    return tuple(Mode(complex(v)) for v in values[np.argsort(-values.real)])
