"""An increment: a correction identified from flights, with its covariance and the envelope in which it may act."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from aerodb.errors import InputError
from aerodb.tables.expression import Expression
from aerodb.tables.functions import Array, Value
from aerodb.tables.program import Program, compile_program

#: Variables whose envelope bounds every regressor, whether or not it depends on them.
BASE_VARIABLES: Final[tuple[str, ...]] = ("alpha", "beta", "mach")


@dataclass(frozen=True)
class Interval:
    """Where flights have been along one variable: `low` to `high`, and the width of a table cell, all in its SI unit."""

    low: float
    high: float
    cell: float

    def __post_init__(self) -> None:
        if not (np.all(np.isfinite((self.low, self.high, self.cell))) and self.low <= self.high and self.cell >= 0):
            raise InputError(f"envelope from {self.low:g} to {self.high:g} with a cell of {self.cell:g}")
        for name in ("low", "high", "cell"):
            object.__setattr__(self, name, float(getattr(self, name)) + 0.0)

    def contains(self, x: Value) -> NDArray[np.bool_]:
        """Whether flights have been at x."""
        return np.asarray((np.asarray(x) >= self.low) & (np.asarray(x) <= self.high))

    def weight(self, x: Value) -> Array:
        """1 inside and one cell beyond, then linearly to 0 over one further cell (CONVENTIONS, Envelope)."""
        if self.cell == 0.0:
            return self.contains(x).astype(np.float64)
        beyond = np.maximum(self.low - np.asarray(x), np.asarray(x) - self.high)
        return np.clip(2.0 - beyond / self.cell, 0.0, 1.0)


class IncrementValue(NamedTuple):
    """Value and standard error (n,), and where all variables lie inside the envelope (n,)."""

    value: Array
    standard_error: Array
    inside: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Increment:
    """``sum of estimates x regressors`` on one coefficient axis.

    estimates : (k,), covariance : (k, k) of them. envelope : per variable, where the flights behind it have been.
    flights : their ids. Raises InputError when shapes do not fit or a regressor calls a table.
    """

    axis: str
    regressors: tuple[Expression, ...]
    estimates: Array
    covariance: Array
    envelope: Mapping[str, Interval] = field(default_factory=dict)
    flights: tuple[str, ...] = ()
    note: str = ""

    def __post_init__(self) -> None:
        k, where = len(self.regressors), f"increment on {self.axis}"
        estimates = np.array(self.estimates, dtype=np.float64) + 0.0
        covariance = np.array(self.covariance, dtype=np.float64) + 0.0
        if k == 0 or estimates.shape != (k,) or covariance.shape != (k, k):
            raise InputError(f"{k} regressors, estimates {estimates.shape}, covariance {covariance.shape}", where)
        if not (np.all(np.isfinite(estimates)) and np.all(np.isfinite(covariance))):
            raise InputError("estimates or covariance are not finite", where)
        estimates.flags.writeable = covariance.flags.writeable = False
        object.__setattr__(self, "estimates", estimates)
        object.__setattr__(self, "covariance", covariance)
        object.__setattr__(self, "regressors", tuple(self.regressors))
        object.__setattr__(self, "flights", tuple(self.flights))
        object.__setattr__(self, "_program", compile_program(self.regressors, {}))

    _program: Program = field(init=False, repr=False)

    @cached_property
    def names(self) -> frozenset[str]:
        """Channels that it needs: those of its regressors and of its envelope."""
        return frozenset(self._program.inputs) | frozenset(self.envelope)

    def evaluate(self, channels: Mapping[str, Value]) -> IncrementValue:
        """The increment at `channels` (each (n,) or a number), by the envelope rule.

        Beyond the envelope a regressor's variables are held at its edge; its weight is the product over its own
        variables and over `BASE_VARIABLES`. What the weight takes away was a correction of the baseline, so its size
        is added (in squares) to the standard error: fully faded, the error is the baseline's as far as it is known.
        """
        absent = sorted(self.names - set(channels))
        if absent:
            raise InputError(f"no value for {', '.join(absent)}", f"increment on {self.axis}")
        n = max((np.size(channels[name]) for name in self.names), default=1)
        columns, weights = self._columns(channels, n)
        acting = columns * weights
        faded = (columns - acting) @ self.estimates
        variance = np.einsum("nk,kl,nl->n", acting, self.covariance, acting) + faded**2
        inside = np.ones(n, dtype=np.bool_)
        for name, interval in self.envelope.items():
            inside &= interval.contains(channels[name])
        return IncrementValue(acting @ self.estimates, np.sqrt(np.maximum(variance, 0.0)), inside)

    def value(self, channels: Mapping[str, Value]) -> Array:
        """(n,) only the value of `evaluate`, for the simulation's inner loop."""
        n = max((np.size(channels[name]) for name in self.names), default=1)
        columns, weights = self._columns(channels, n)
        return np.asarray((columns * weights) @ self.estimates, dtype=np.float64)

    def _columns(self, channels: Mapping[str, Value], n: int) -> tuple[Array, Array]:
        """(n, k) regressors with variables held at the envelope's edge, and (n, k) their weights."""
        held: dict[str, Any] = {name: channels[name] for name in self._program.inputs}
        weight: dict[str, Array] = {}
        for name, interval in self.envelope.items():
            weight[name] = interval.weight(channels[name])
            if name in held:
                held[name] = np.clip(held[name], interval.low, interval.high)
        columns, weights = np.empty((n, len(self.regressors))), np.ones((n, len(self.regressors)))
        for k, (regressor, values) in enumerate(zip(self.regressors, self._program.run(held).values, strict=True)):
            columns[:, k] = values
            for name in regressor.names.union(BASE_VARIABLES) & weight.keys():
                weights[:, k] *= weight[name]
        return columns, weights
