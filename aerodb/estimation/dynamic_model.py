"""What the methods that integrate a model ask of it."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

from aerodb.estimation.parameters import Parameters
from aerodb.estimation.time_history import TimeHistory
from aerodb.support import Array

#: Value of each parameter: a number, or (k,) for k runs side by side.
Values = Mapping[str, Array]


class DynamicModel(Protocol):
    """``x' = f(x, u, theta)``, ``y = h(x, u, theta)`` with s states, o outputs and named parameters
    theta. Arrays end with the runs: every method takes k sets of parameters at once."""

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the s states. A tuple (s,); each state is in SI units."""

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the o outputs, as in `TimeHistory.outputs`. A tuple (o,); each output is in SI
        units."""

    @property
    def parameters(self) -> Parameters:
        """All p parameters, those of single records (initial states, biases) too, as scalars in SI
        units."""

    def initial_state(self, values: Values, record: TimeHistory) -> Array:
        """State at the first sample of a record, (s, k), in SI units; k is 1 where all parameters
        are numbers."""

    def rates(self, values: Values, record: TimeHistory, sample: float, state: Array) -> Array:
        """Time derivatives (s, k) of a state (s, k); inputs at `sample`, a place between samples is
        interpolated linearly, in SI units, per second."""

    def observed(self, values: Values, record: TimeHistory, sample: int, state: Array) -> Array:
        """Outputs (o, k) at a state (s, k), in SI units."""

    def simulated(self, values: Values, record: TimeHistory) -> Array:
        """Outputs (n, o, k), in SI units, from the initial state on; NaN after a divergence."""


@dataclass(frozen=True, eq=False)
class ModelAround:
    """A model with the motion of another (`model`) and parameters of its own; its methods have the
    shapes and units of `DynamicModel`."""

    model: DynamicModel
    parameters: Parameters

    @property
    def states(self) -> tuple[str, ...]:
        """See `DynamicModel.states`."""
        return self.model.states

    @property
    def outputs(self) -> tuple[str, ...]:
        """See `DynamicModel.outputs`."""
        return self.model.outputs

    def initial_state(self, values: Values, record: TimeHistory) -> Array:
        """See `DynamicModel.initial_state`."""
        return self.model.initial_state(values, record)

    def rates(self, values: Values, record: TimeHistory, sample: float, state: Array) -> Array:
        """See `DynamicModel.rates`."""
        return self.model.rates(values, record, sample, state)

    def observed(self, values: Values, record: TimeHistory, sample: int, state: Array) -> Array:
        """See `DynamicModel.observed`."""
        return self.model.observed(values, record, sample, state)

    def simulated(self, values: Values, record: TimeHistory) -> Array:
        """See `DynamicModel.simulated`."""
        return self.model.simulated(values, record)
