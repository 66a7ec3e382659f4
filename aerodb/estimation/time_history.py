"""Measured time histories that a model is fitted to."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from aerodb.errors import InputError
from aerodb.support import Array

#: Largest departure of an interval from the mean interval, as a share of it.
_UNEVEN = 1e-3


@dataclass(frozen=True, eq=False)
class TimeHistory:
    """One record of one manoeuvre, uniformly sampled.

    Parameters
    ----------
    name : unique among the records of a fit.
    time : (n,) [s].
    inputs : name -> (n,), SI: what drives the model. Finite.
    outputs : name -> (n,), SI: what the model is compared with; NaN where it was not measured.

    Raises InputError for unequal lengths, uneven sampling, and inputs that are not finite.
    """

    name: str
    time: Array
    inputs: Mapping[str, Array]
    outputs: Mapping[str, Array]

    def __post_init__(self) -> None:
        where = f"record {self.name}"
        n = len(self.time)
        for name, values in {**self.inputs, **self.outputs}.items():
            if np.shape(values) != (n,):
                raise InputError(
                    f"{name} has {len(values)} samples, time has {n}", where, "resample it"
                )
        if n < 2 or not np.all(np.abs(np.diff(self.time) / self.step - 1.0) < _UNEVEN):
            raise InputError("its time steps are uneven", where, "resample it to one rate")
        bad = [name for name, values in self.inputs.items() if not np.isfinite(values).all()]
        if bad:
            raise InputError(f"inputs are not finite: {', '.join(bad)}", where, "bridge their gaps")

    @property
    def step(self) -> float:
        """Sampling interval [s]. The mean interval of the n samples (n,)."""
        return float(self.time[-1] - self.time[0]) / (len(self.time) - 1)

    def stacked(self, names: tuple[str, ...]) -> Array:
        """Measured outputs of these names, (n, o), in SI units; NaN where one was not measured."""
        return np.column_stack([self.outputs[name] for name in names])


class Recorded(Protocol):
    """A record with a name and a clock."""

    @property
    def name(self) -> str:
        """Unique among the records of a fit."""

    @property
    def time(self) -> Array:
        """(n,) [s]."""


def elapsed(records: Sequence[Recorded]) -> dict[str, Array]:
    """Record -> time (n,) [s] from its first sample."""
    return {record.name: record.time - record.time[0] for record in records}
