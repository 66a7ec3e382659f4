"""Outputs of a model and their derivatives with respect to its unknown parameters."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol, TypeGuard

import numpy as np

from aerodb.estimation.dynamic_model import DynamicModel, Values
from aerodb.estimation.parameters import Parameters
from aerodb.estimation.time_history import TimeHistory
from aerodb.support import Array, Integers

#: First difference of a parameter, as a share of its size.
_SHARE = 1e-4
#: Size of a parameter that starts near 0.
_LEAST = 0.1
#: Share of an output's deviation by which a cheaper rule may be wrong: its derivatives then turn a
#: step a little, while the optimum is that of the accurate rule.
_CLOSE = 0.03


@dataclass(frozen=True, eq=False)
class ModelResponse:
    """What a model makes of one record.

    Parameters
    ----------
    outputs : (n, o); NaN after a divergence.
    slopes : (n, o, g), derivatives with respect to the unknowns that act on this record.
    columns : (g,) their numbers among all f unknowns.
    gaps : (c,) what constraints on the unknowns lack (continuity between segments); gap_slopes (c,
        g) their derivatives.
    """

    outputs: Array
    slopes: Array
    columns: Integers
    gaps: Array
    gap_slopes: Array


class Differentiable(Protocol):
    """A model that knows the derivatives of its outputs."""

    def derivatives(
        self, values: Values, record: TimeHistory, names: Sequence[str]
    ) -> tuple[Array, Array]:
        """Outputs (n, o) and their derivatives (n, o, g) with respect to the parameters `names`."""


class Approximated(DynamicModel, Protocol):
    """A model with a cheaper rule of integration, from which derivatives are taken."""

    def approximated(self, values: Values, record: TimeHistory) -> Array:
        """Outputs (n, o, k) as of `simulated`, less accurate."""


class Constrained(Protocol):
    """A model whose parameters are bound by equations (see `multiple_shooting`)."""

    def responded(
        self, parameters: Parameters, vector: Array, record: TimeHistory, steps: Array
    ) -> ModelResponse:
        """Outputs (n, o) and their slopes (n, o, g), as of `respond`."""


def differentiable(model: object) -> TypeGuard[Differentiable]:
    """Return whether a model is `Differentiable`: gives slopes (n, o, g) itself."""
    return hasattr(model, "derivatives")


def _approximated(model: object) -> TypeGuard[Approximated]:
    return hasattr(model, "approximated")


def _constrained(model: object) -> TypeGuard[Constrained]:
    return hasattr(model, "responded")


def acts_on(name: str, record: str) -> bool:
    """Return whether a parameter acts on a record: those of single records end with its name.

    >>> acts_on("bias_p[one]", "one"), acts_on("bias_p[one]", "two"), acts_on("Lp", "two")
    (True, False, True)
    """
    return not name.endswith("]") or name.split("[", 1)[-1][:-1].split(",")[0] == record


def first_steps(vector: Array) -> Array:
    """Return steps (f,) of differences for parameters of which nothing is known but their values
    (f,), in the unit of each."""
    return _SHARE * np.maximum(np.abs(vector), _LEAST)


def respond(
    model: DynamicModel, parameters: Parameters, vector: Array, record: TimeHistory, steps: Array
) -> ModelResponse:
    """Outputs of a record and their derivatives at the unknowns `vector` (f,).

    Derivatives are the model's own, or differences over `steps` (f,), all runs side by side.

    In SI units; NaN after a divergence.
    """
    if _constrained(model):
        return model.responded(parameters, vector, record, steps)
    columns = acting(parameters, record.name)
    none = np.zeros(0), np.zeros((0, len(columns)))
    if differentiable(model):
        with np.errstate(all="ignore"):
            outputs, slopes = model.derivatives(parameters.values(vector), record, parameters.names)
            chain = parameters.jacobian[:, columns]
            if not np.array_equal(chain, np.eye(len(chain))):
                slopes = slopes @ chain
        return ModelResponse(outputs, slopes, columns, *none)
    if _approximated(model):
        accurate = model.simulated(parameters.values(vector[:, None]), record)[:, :, 0]
        outputs, slopes = differences(
            lambda values: model.approximated(values, record), parameters, vector, columns, steps
        )
        if _agree(outputs, accurate):
            return ModelResponse(accurate, slopes, columns, *none)
    outputs, slopes = differences(
        lambda values: model.simulated(values, record), parameters, vector, columns, steps
    )
    return ModelResponse(outputs, slopes, columns, *none)


def acting(parameters: Parameters, record: str) -> Integers:
    """Return the numbers (g,) of the unknowns that act on a record, themselves or by a parameter
    tied (`acts_on`, and the matrix `Parameters.jacobian`)."""
    matrix = parameters.jacobian
    on = np.array([acts_on(name, record) for name in parameters.names], dtype=bool)
    return np.flatnonzero((matrix[on] != 0.0).any(axis=0))


def _agree(outputs: Array, accurate: Array) -> bool:
    """Return whether outputs (n, o) are close enough for derivatives."""
    apart = np.sqrt(np.mean((outputs - accurate) ** 2, axis=0))
    return bool(np.all(apart <= _CLOSE * accurate.std(axis=0)))


def differences(
    run: Callable[[Values], Array],
    parameters: Parameters,
    vector: Array,
    columns: Integers,
    steps: Array,
) -> tuple[Array, Array]:
    """Result (..., ) of `run`, whose arrays end with the runs, and its derivatives (..., g).

    One run more than there are unknowns, side by side: differences that noise hides are so small
    that a second-order rule would only cost as many runs again. Where a run has no result, the
    derivative is 0.

    The derivatives are in the unit of the result per unit of each unknown.
    """
    g = len(columns)
    lanes = np.repeat(vector[:, None], g + 1, axis=1)
    lanes[columns, np.arange(1, g + 1)] += steps[columns]
    results = run(parameters.values(lanes))
    if results.shape[-1] == 1:  # nothing that is varied acts
        results = np.repeat(results, g + 1, axis=-1)
    slopes = (results[..., 1:] - results[..., :1]) / steps[columns]
    return results[..., 0], np.where(np.isfinite(slopes), slopes, 0.0)
