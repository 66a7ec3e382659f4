"""A model linearised along a motion: the same small matrices for every sample, from runs of one
step each, all side by side."""

from dataclasses import dataclass
from typing import Protocol, TypeGuard

import numpy as np

from aerodb.estimation.dynamic_model import DynamicModel, Values
from aerodb.estimation.filters.one_step import around, stepped
from aerodb.estimation.output_error import acting
from aerodb.estimation.time_history import TimeHistory
from aerodb.support import Array, Integers

#: Runs computed in one call: their numbers stay small.
_LANES = 20_000
#: Step of a parameter, as a share of it.
_SHARE = 1e-2
#: Least parameter that the step is a share of: one near zero would have no step.
_LEAST = 1e-3


class Advancing(Protocol):
    """A model that computes many short runs in one call."""

    def advanced(
        self, values: Values, record: TimeHistory, samples: Integers, state: Array
    ) -> tuple[Array, Array]:
        """As `advanced`: states (s, m) one sample later and outputs (o, m)."""


def _advancing(model: object) -> TypeGuard[Advancing]:
    return hasattr(model, "advanced")


def advanced(
    model: DynamicModel, values: Values, record: TimeHistory, samples: Integers, state: Array
) -> tuple[Array, Array]:
    """Return states (s, m), in SI units, one sample later, and outputs (o, m) now, of m states (s,
    m), each with its own sample (m,), in ascending order, and its own parameters, numbers or (m,).

    The last sample has no later one: there the inputs are held. NaN where the model has no answer.
    """
    if _advancing(model):
        return model.advanced(values, record, samples, state)
    following, outputs = np.empty(state.shape), np.empty((len(model.outputs), len(samples)))
    firsts = np.flatnonzero(np.diff(samples, prepend=-1))
    for first, last in zip(firsts, [*firsts[1:], len(samples)], strict=True):
        part, sample = slice(first, last), int(samples[first])
        own = {name: v[part] if np.ndim(v) else v for name, v in values.items()}
        outputs[:, part] = model.observed(own, record, sample, state[:, part])
        following[:, part] = stepped(
            model, own, record, min(sample, len(record.time) - 2), state[:, part]
        )
    return following, outputs


def advanced_everywhere(
    model: DynamicModel, record: TimeHistory, vectors: Array, states: Array
) -> tuple[Array, Array]:
    """States (n, s, l) one sample later and outputs (n, o, l), from l states (n, s, l) at each of n
    samples, with unknowns (f, l) or (n, f, l), in SI units; NaN where the model has no answer."""
    n, s, lanes = states.shape
    following, outputs = np.empty(states.shape), np.empty((n, len(model.outputs), lanes))
    vectors = np.broadcast_to(vectors, (n, vectors.shape[-2], lanes))
    some = max(1, _LANES // max(lanes, 1))
    for first in range(0, n if lanes else 0, some):
        part = slice(first, min(first + some, n))
        count = part.stop - first

        def flat(array: Array, part: slice = part) -> Array:
            chosen = np.moveaxis(array[part], 1, 0)
            return np.ascontiguousarray(chosen).reshape(len(chosen), -1)

        later, now = advanced(
            model,
            model.parameters.values(flat(vectors)),
            record,
            np.repeat(np.arange(first, part.stop), lanes),
            flat(states),
        )
        following[part] = np.moveaxis(later.reshape(s, count, lanes), 0, 1)
        outputs[part] = np.moveaxis(now.reshape(-1, count, lanes), 0, 1)
    return following, outputs


@dataclass(frozen=True, eq=False)
class Linearised:
    """A model along a motion, bilinear in state and unknowns.

    The last axis of each matrix holds the value at `vector`, then the derivatives by the g unknowns
    `columns` that act on rates or outputs.

    Parameters
    ----------
    record, model : of which. vector : (f,), the unknowns. columns : (g,).
    motion : (n, s), where the model is linearised.
    following : (n, s, 1 + g), state one sample later. transition : (n, s, s, 1 + g), its Jacobian.
    outputs : (n, o, 1 + g). observation : (n, o, s, 1 + g), their Jacobian.
    """

    model: DynamicModel
    record: TimeHistory
    vector: Array
    columns: Integers
    motion: Array
    following: Array
    transition: Array
    outputs: Array
    observation: Array

    @property
    def finite(self) -> bool:
        """Whether the model has an answer all along the motion. False where following (n, s, 1 + g)
        or outputs (n, o, 1 + g) has a NaN or inf."""
        return bool(np.isfinite(self.following).all() and np.isfinite(self.outputs).all())


def linearised(
    model: DynamicModel,
    record: TimeHistory,
    vector: Array,
    motion: Array,
    derivatives: bool = True,
) -> Linearised:
    """The model at the unknowns `vector` (f,) along a motion (n, s), with or without derivatives by
    the unknowns, in SI units; NaN where the model has no answer."""
    n, s = motion.shape
    displaced, size = around(motion.T)  # (s, (2 s + 1) n) in blocks of n, and (s, n)
    states = np.moveaxis(displaced.reshape(s, 2 * s + 1, n), 2, 0)
    both = advanced_everywhere(model, record, vector[:, None], states)
    steps = _SHARE * np.maximum(np.abs(vector), _LEAST)
    columns = acting(model.parameters, record.name)[: None if derivatives else 0]
    columns = columns[_act(model, record, vector, steps, columns, motion + size.T)]
    g = len(columns)
    nudged = np.repeat(vector[:, None], g * (s + 1), axis=1)
    nudged[np.repeat(columns, s + 1), np.arange(g * (s + 1))] += np.repeat(steps[columns], s + 1)
    changed = advanced_everywhere(model, record, nudged, np.tile(states[:, :, : s + 1], (1, 1, g)))
    values, jacobians = [], []
    for base, other in zip(both, changed, strict=True):
        m = base.shape[1]
        central = (base[:, :, 1 : s + 1] - base[:, :, s + 1 :]) / (2.0 * size.T[:, None])
        change = other.reshape(n, m, g, s + 1) - base[:, :, None, : s + 1]
        change = change / steps[columns][:, None]
        mixed = (change[..., 1:] - change[..., :1]) / size.T[:, None, None]
        values.append(np.concatenate([base[:, :, :1], change[..., 0]], axis=2))
        jacobians.append(np.concatenate([central[..., None], np.moveaxis(mixed, 2, 3)], axis=3))
    return Linearised(
        model, record, vector, columns, motion, values[0], jacobians[0], values[1], jacobians[1]
    )


def _act(
    model: DynamicModel,
    record: TimeHistory,
    vector: Array,
    steps: Array,
    columns: Integers,
    states: Array,
) -> Array:
    """Return which of the unknowns `columns` change rates or outputs anywhere; others are first
    states."""
    lanes = len(columns) + 1 if len(columns) else 0
    vectors = np.repeat(vector[:, None], lanes, axis=1)
    vectors[columns, np.arange(1, lanes)] += steps[columns]
    tried = advanced_everywhere(
        model, record, vectors, np.repeat(states[:, :, None], lanes, axis=2)
    )
    changes = [np.any(each[:, :, 1:] != each[:, :, :1], axis=(0, 1)) for each in tried]
    return np.asarray(changes[0] | changes[1])


def measured_motion(model: DynamicModel, record: TimeHistory, vector: Array) -> Array:
    """States (n, s) as measured, gaps bridged; those that are no outputs as at the start, in SI
    units."""
    n = len(record.time)
    first = model.initial_state(model.parameters.values(vector[:, None]), record)
    motion = np.repeat(first[:, :1].T, n, axis=0)
    for j, name in enumerate(model.states):
        values = record.outputs.get(name, np.zeros(0))
        good = np.flatnonzero(np.isfinite(values))
        if len(good):
            motion[:, j] = np.interp(np.arange(n), good, values[good])
    return motion
