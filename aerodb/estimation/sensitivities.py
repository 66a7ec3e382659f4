"""Outputs of a model and their derivatives with respect to its unknown parameters."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from aerodb.estimation.dynamic_model import DynamicModel, Values
from aerodb.estimation.parameters import Parameters
from aerodb.estimation.time_history import TimeHistory
from aerodb.support import Array, Integers

#: First difference of a parameter, as a share of its size, and the size of one that starts near 0.
_SHARE, _LEAST = 1e-4, 0.1


@dataclass(frozen=True, eq=False)
class Response:
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


@runtime_checkable
class Differentiable(Protocol):
    """A model that knows the derivatives of its outputs."""

    def derivatives(
        self, values: Values, record: TimeHistory, names: Sequence[str]
    ) -> tuple[Array, Array]:
        """Outputs (n, o) and their derivatives (n, o, g) with respect to the parameters `names`."""


@runtime_checkable
class Constrained(Protocol):
    """A model whose parameters are bound by equations (see `multiple_shooting`)."""

    def responded(
        self, parameters: Parameters, vector: Array, record: TimeHistory, steps: Array
    ) -> Response:
        """As `respond`."""


def acts_on(name: str, record: str) -> bool:
    """Whether a parameter acts on a record: those of single records end with its name.

    >>> acts_on("bias_p[one]", "one"), acts_on("bias_p[one]", "two"), acts_on("Lp", "two")
    (True, False, True)
    """
    return not name.endswith("]") or name.split("[", 1)[-1][:-1].split(",")[0] == record


def first_steps(vector: Array) -> Array:
    """Differences (f,) for parameters of which nothing is known but their values (f,)."""
    return _SHARE * np.maximum(np.abs(vector), _LEAST)


def respond(
    model: DynamicModel, parameters: Parameters, vector: Array, record: TimeHistory, steps: Array
) -> Response:
    """Outputs of a record and their derivatives at the unknowns `vector` (f,).

    Derivatives are the model's own, or central differences of `steps` (f,), all runs side by side.
    """
    if isinstance(model, Constrained):
        return model.responded(parameters, vector, record, steps)
    columns = acting(parameters, record.name)
    none = np.zeros(0), np.zeros((0, len(columns)))
    if isinstance(model, Differentiable):
        with np.errstate(all="ignore"):
            outputs, slopes = model.derivatives(parameters.values(vector), record, parameters.names)
            slopes = slopes @ parameters.jacobian()[:, columns]
        return Response(outputs, slopes, columns, *none)
    run: Callable[[Values], Array] = lambda values: model.simulated(values, record)  # noqa: E731
    outputs, slopes = differences(run, parameters, vector, columns, steps)
    return Response(outputs, slopes, columns, *none)


def acting(parameters: Parameters, record: str) -> Integers:
    """Numbers (g,) of the unknowns that act on a record, themselves or by a parameter tied."""
    matrix = parameters.jacobian()
    on = np.array([acts_on(name, record) for name in parameters.names], dtype=bool)
    return np.flatnonzero((matrix[on] != 0.0).any(axis=0))


def differences(
    run: Callable[[Values], Array],
    parameters: Parameters,
    vector: Array,
    columns: Integers,
    steps: Array,
) -> tuple[Array, Array]:
    """Result (..., ) of `run`, whose arrays end with the runs, and its derivatives (..., g).

    Twice as many runs as unknowns, and one. Where one side has no result, the other is used.
    """
    g = len(columns)
    lanes = np.repeat(vector[:, None], 2 * g + 1, axis=1)
    lanes[columns, np.arange(1, g + 1)] += steps[columns]
    lanes[columns, np.arange(g + 1, 2 * g + 1)] -= steps[columns]
    results = run(parameters.values(lanes))
    if results.shape[-1] == 1:  # nothing that is varied acts
        results = np.repeat(results, 2 * g + 1, axis=-1)
    middle, up, down = results[..., :1], results[..., 1 : g + 1], results[..., g + 1 :]
    slopes = (up - down) / (2.0 * steps[columns])
    bad = ~np.isfinite(slopes)
    if bad.any():
        one = np.where(np.isfinite(up), up - middle, middle - down) / steps[columns]
        slopes = np.where(bad, one, slopes)
    return results[..., 0], slopes
