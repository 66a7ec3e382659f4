"""Equations that are linear in their parameters: what equation-error methods solve."""

from dataclasses import dataclass

import numpy as np

from aerodb.errors import InputError
from aerodb.estimation.parameters import Parameters
from aerodb.support import Array


@dataclass(frozen=True, eq=False)
class EquationRecord:
    """One record of an equation, uniformly sampled.

    Parameters
    ----------
    name : of the record.
    time : (n,) [s].
    regressors : (n, k), a column of ones for a constant.
    response : (n,).

    Raises InputError for unequal lengths and values that are not finite.
    """

    name: str
    time: Array
    regressors: Array
    response: Array

    def __post_init__(self) -> None:
        n = len(self.time)
        if self.regressors.ndim != 2 or len(self.regressors) != n or len(self.response) != n:
            raise InputError(
                "time, regressors and response differ in length", f"record {self.name}"
            )
        if not (np.isfinite(self.regressors).all() and np.isfinite(self.response).all()):
            raise InputError("values are not finite", f"record {self.name}", "leave them out")


@dataclass(frozen=True, eq=False)
class LinearEquation:
    """``z = X theta + v`` over several records, such as a coefficient against its derivatives.

    Parameters
    ----------
    response : name of z, such as ``Cm``; with its unit in `unit`.
    parameters : the k parameters, in the order of the columns of X.
    records : at least one.
    """

    response: str
    parameters: Parameters
    records: tuple[EquationRecord, ...]
    unit: str = "1"

    def __post_init__(self) -> None:
        k = len(self.parameters.items)
        if not self.records or any(record.regressors.shape[1] != k for record in self.records):
            raise InputError(
                f"needs records with one column for each of its {k} parameters",
                f"equation of {self.response}",
            )

    @property
    def lengths(self) -> tuple[int, ...]:
        """Number n of samples of each record, whose regressors are (n, k); for blocks of stacked
        columns."""
        return tuple(len(record.time) for record in self.records)

    def stacked(self) -> tuple[Array, Array]:
        """Regressors (n, k) and response (n,) of all records, one after the other, in the units of
        the records."""
        return (
            np.concatenate([record.regressors for record in self.records]),
            np.concatenate([record.response for record in self.records]),
        )
