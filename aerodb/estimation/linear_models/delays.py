"""Time delays: series that arrive late, and linear models whose inputs or outputs do."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from aerodb.errors import InputError
from aerodb.estimation.dynamic_model import Values
from aerodb.estimation.linear_models.state_space import StateSpace
from aerodb.estimation.parameters import Parameters
from aerodb.estimation.time_history import TimeHistory
from aerodb.support import Array

#: Longest delay that is searched for [s].
MOST_DELAY = 0.5


def delayed(series: Array, late: Array, *, held: bool = True) -> tuple[Array, Array]:
    """Series later by some samples, and its derivative with respect to that number.

    Parameters
    ----------
    series : (n, k) or (n, 1). late : (k,) or (1,) samples, any number. Returns (n, k) twice.
    held : beyond its ends the series keeps its last value, as controls do; False: its last slope.

    Between samples by cubic convolution, which is smooth in `late`.

    References
    ----------
    Keys, IEEE Transactions on Acoustics, Speech, and Signal Processing 29(6), 1981.
    """
    n, k = len(series), max(series.shape[1], len(late))
    wanted = np.arange(n)[:, None] - np.broadcast_to(late, (k,))
    place = np.clip(wanted, 0.0, n - 1.0)
    low = np.minimum(place.astype(np.int64), max(n - 2, 0))
    t = place - low
    lanes = np.arange(k) % series.shape[1]
    here, after = series[low, lanes], series[np.minimum(low + 1, n - 1), lanes]
    before = np.where(low > 0, series[np.maximum(low - 1, 0), lanes], 2.0 * here - after)
    last = low + 2 > n - 1
    beyond = np.where(last, 2.0 * after - here, series[np.minimum(low + 2, n - 1), lanes])
    slope, next_slope = 0.5 * (after - before), 0.5 * (beyond - here)
    cubic = 2.0 * (here - after) + slope + next_slope
    square = after - here - slope - cubic
    outside = (wanted < 0.0) | (wanted > n - 1.0)
    ends = np.zeros_like(t) if held else after - here
    return (
        here + t * (slope + t * (square + t * cubic)) + (wanted - place) * ends,
        -np.where(outside, ends, slope + t * (2.0 * square + 3.0 * t * cubic)),
    )


@dataclass(frozen=True, eq=False)
class DelayedStateSpace:
    """A linear model whose inputs act late, and whose outputs are measured late.

    Parameters
    ----------
    model : its parameters include ``delay_<name>`` [s] of every name in `late_inputs` and
        `late_outputs`, or ``delay_<name>[record]`` for a record of its own.
    late_inputs, late_outputs : names. A name among both has one delay.
    """

    model: StateSpace
    late_inputs: tuple[str, ...]
    late_outputs: tuple[str, ...]

    @property
    def states(self) -> tuple[str, ...]:
        """As of `StateSpace`. A tuple (s,), in SI units."""
        return self.model.states

    @property
    def inputs(self) -> tuple[str, ...]:
        """As of `StateSpace`. A tuple (m,), in SI units."""
        return self.model.inputs

    @property
    def outputs(self) -> tuple[str, ...]:
        """As of `StateSpace`. A tuple (o,), in SI units."""
        return self.model.outputs

    @property
    def parameters(self) -> Parameters:
        """All p parameters as of `StateSpace`, with the delays [s]."""
        return self.model.parameters

    def initial_state(self, values: Values, record: TimeHistory) -> Array:
        """State at the first sample, (s, k), in SI units."""
        return self.model.initial_state(values, record)

    def rates(self, values: Values, record: TimeHistory, sample: float, state: Array) -> Array:
        """Time derivatives (s, k), in SI units per second."""
        lanes = self._lanes(values, record, state.shape[1])
        return np.concatenate(
            [self.model.rates(v, r, sample, state[:, at]) for at, v, r in lanes], axis=1
        )

    def observed(self, values: Values, record: TimeHistory, sample: int, state: Array) -> Array:
        """Outputs (o, k) at a state (s, k). Raises InputError for outputs that are late."""
        self._refuse_late_outputs()
        lanes = self._lanes(values, record, state.shape[1])
        return np.concatenate(
            [self.model.observed(v, r, sample, state[:, at]) for at, v, r in lanes], axis=1
        )

    def simulated(self, values: Values, record: TimeHistory) -> Array:
        """Outputs (n, o, k), in SI units, from the initial state on; NaN after a divergence."""
        runs = max(np.size(value) for value in values.values())
        made = [self.model.simulated(v, r) for _, v, r in self._lanes(values, record, runs)]
        timely = np.concatenate(made, axis=2)
        outputs = np.array(np.broadcast_to(timely, (*timely.shape[:2], runs)))
        for j, late in self._late_outputs(values, record):
            outputs[:, j] = delayed(outputs[:, j], late, held=False)[0]
        return outputs

    def discrete(
        self, values: Values, record: TimeHistory, runs: int
    ) -> tuple[Array, Array, Array, Array]:
        """As of `StateSpace`. Raises InputError for outputs that are late. Shapes (s, s, k), (n -
        1, s, k), (o, s, k) and (n, o, k)."""
        self._refuse_late_outputs()
        lanes = self._lanes(values, record, runs)
        each = (self.model.discrete(v, r, runs if at == slice(None) else 1) for at, v, r in lanes)
        parts = zip(*each, strict=True)
        first, drive, observation, direct = (
            np.array(np.concatenate(part, axis=-1), order="C") for part in parts
        )
        return first, drive, observation, direct

    def propagated(self, values: Values, record: TimeHistory, start: Array) -> tuple[Array, Array]:
        """Raises InputError: a run that begins within a record lacks what came before it."""
        raise InputError(
            "delays need whole records", "multiple shooting", "use output-error, or fix them at 0"
        )

    def derivatives(
        self, values: Values, record: TimeHistory, names: Sequence[str]
    ) -> tuple[Array, Array]:
        """Outputs (n, o) and their derivatives (n, o, g) with respect to the parameters `names`, in
        SI units."""
        ((_, own, moved),) = self._lanes(values, record, 1)
        outputs, slopes = self.model.derivatives(own, moved, names)
        for name in self.late_inputs:
            delay = self._delay(name, record)
            if delay in names:
                late = np.atleast_1d(own[delay]) / record.step
                change = delayed(record.inputs[name][:, None], late)[1][:, 0] / record.step
                nudged = _with_input(moved, name, moved.inputs[name] + change)
                slopes[:, :, list(names).index(delay)] += (
                    self.model.simulated(own, nudged)[:, :, 0] - outputs
                )
        for j, late in self._late_outputs(own, record):
            found, change = delayed(outputs[:, j, None], late, held=False)
            outputs[:, j] = found[:, 0]
            slopes[:, j] = delayed(slopes[:, j], late, held=False)[0]
            delay = self._delay(self.outputs[j], record)
            if delay in names:
                slopes[:, j, list(names).index(delay)] += change[:, 0] / record.step
        return outputs, slopes

    def timely(self, record: TimeHistory) -> TimeHistory:
        """Return the record, channels (n,) in SI units, with its inputs as late, and its outputs as
        early, as the delays' start values make them: what the model without delays is compared
        with."""
        own = self.parameters.values(self.parameters.start())
        ((_, _, moved),) = self._lanes(own, record, 1)
        early = {
            self.outputs[j]: delayed(record.outputs[self.outputs[j]][:, None], -late)[0][:, 0]
            for j, late in self._late_outputs(own, record)
        }
        return replace(moved, outputs={**record.outputs, **early})

    def _lanes(
        self, values: Values, record: TimeHistory, runs: int
    ) -> Iterator[tuple[slice, Values, TimeHistory]]:
        """Each run: its place, its values, and the record with its inputs as late as they are;
        all runs at once where none of these delays differs."""
        late = {name: values[self._delay(name, record)] for name in self.late_inputs}
        together = all(np.size(value) == 1 or np.ptp(value) == 0.0 for value in late.values())
        for first in range(1 if together else runs):
            at = slice(None) if together else slice(first, first + 1)
            moved = record
            for name, value in late.items():
                samples = np.atleast_1d(value)[[first if np.size(value) > 1 else 0]] / record.step
                series = delayed(record.inputs[name][:, None], samples)[0][:, 0]
                moved = _with_input(moved, name, series)
            own = {n: v[at] if np.size(v) > 1 else v for n, v in values.items()}
            yield at, own, moved

    def _late_outputs(self, values: Values, record: TimeHistory) -> list[tuple[int, Array]]:
        """Number of each output that is late, and by how many samples, (k,) or (1,)."""
        return [
            (
                self.outputs.index(name),
                np.atleast_1d(values[self._delay(name, record)]) / record.step,
            )
            for name in self.late_outputs
        ]

    def _delay(self, name: str, record: TimeHistory) -> str:
        own = f"delay_{name}[{record.name}]"
        return own if own in self.parameters.names else f"delay_{name}"

    def _refuse_late_outputs(self) -> None:
        if self.late_outputs:
            raise InputError(
                f"a filter cannot use an output that is late: {', '.join(self.late_outputs)}",
                "delays",
                "use output-error, or delay all inputs instead",
            )


def with_delays(
    model: StateSpace, inputs: Sequence[str], outputs: Sequence[str]
) -> DelayedStateSpace:
    """The linear model with delays of these inputs and outputs, whose parameters it has already.

    Raises InputError for a name that is neither, and for a delay without a parameter.

    A delay's parameter ``delay_NAME`` is in seconds [s].
    """
    common = {name.split("[", 1)[0] for name in model.parameters.names}
    for names, known, what in ((inputs, model.inputs, "input"), (outputs, model.outputs, "output")):
        for name in names:
            if name not in known:
                raise InputError(f"no {what} '{name}'", "delays", ", ".join(known))
            if f"delay_{name}" not in common:
                raise InputError(f"no parameter 'delay_{name}'", "delays", "add it")
    return DelayedStateSpace(model, tuple(inputs), tuple(outputs))


def _with_input(record: TimeHistory, name: str, series: Array) -> TimeHistory:
    return replace(record, inputs={**record.inputs, name: series})
