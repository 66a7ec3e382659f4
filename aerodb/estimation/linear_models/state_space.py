"""Linear models ``x' = A x + B u + b_x``, ``y = C x + D u + b_y`` with named entries."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from aerodb.errors import InputError, nearest
from aerodb.estimation.dynamic_model import Values
from aerodb.estimation.linear_models.affine import AffineMatrix, Entry, affine_matrix
from aerodb.estimation.parameters import Parameters
from aerodb.estimation.time_history import TimeHistory
from aerodb.support import Array

#: Inputs of this name and the output's in brackets are measured outputs (see `stabilised`).
_MEASURED = "measured"
#: Terms of the exponential's series for a norm of 1/2: the first left out is below 1e-16.
_TERMS = 15


@dataclass(frozen=True, eq=False)
class StateSpace:
    """A linear model of s states, m inputs and o outputs, simulated exactly for inputs that are
    linear between samples.

    Parameters
    ----------
    states, inputs, outputs : names.
    parameters : every parameter in the matrices. Where ``name[record]`` is there, it stands for
        ``name`` in that record: a bias of its own. ``initial_<state>[record]`` or
        ``initial_<state>`` is the state at the first sample; else that is the first measured
        value of the output of this name, or 0.
    a, b : (s, s), (s, m). c, d : (o, s), (o, m).
    state_bias, output_bias : (s, 1), (o, 1).
    """

    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    parameters: Parameters
    a: AffineMatrix
    b: AffineMatrix
    c: AffineMatrix
    d: AffineMatrix
    state_bias: AffineMatrix
    output_bias: AffineMatrix

    def initial_state(self, values: Values, record: TimeHistory) -> Array:
        """State at the first sample, (s, k), in SI units; 0 or the first measured value where no
        parameter states it."""
        rows = []
        for state in self.states:
            name = self._own(f"initial_{state}", record)
            rows.append(
                np.atleast_1d(values[name]) if name in values else np.array([_first(record, state)])
            )
        if all(row.size == 1 for row in rows):
            return np.array(rows).reshape(-1, 1)
        return np.stack(np.broadcast_arrays(*rows))

    def rates(self, values: Values, record: TimeHistory, sample: float, state: Array) -> Array:
        """Time derivatives (s, k), in SI units per second, at a state (s, k); inputs are
        interpolated linearly. Raises InputError for an input that the record lacks."""
        own = self._local(values, record)
        low = min(int(sample), len(record.time) - 2)
        pair = self.driving(record)[low : low + 2]
        driving = pair[0] + (sample - low) * (pair[1] - pair[0])
        inner = _beside(self.b.at(own), self.state_bias.at(own)) @ driving
        return np.asarray(np.einsum("kab,bk->ak", self.a.at(own), state) + inner.T)

    def observed(self, values: Values, record: TimeHistory, sample: int, state: Array) -> Array:
        """Outputs (o, k), in SI units, at a state (s, k). Raises InputError for an input that the
        record lacks."""
        own = self._local(values, record)
        direct = _beside(self.d.at(own), self.output_bias.at(own))
        inner = direct @ self.driving(record)[sample]
        return np.asarray(np.einsum("kab,bk->ak", self.c.at(own), state) + inner.T)

    def simulated(self, values: Values, record: TimeHistory) -> Array:
        """Outputs (n, o, k), in SI units, from the initial state on; NaN after a divergence."""
        return self.propagated(values, record, self.initial_state(values, record))[0]

    def propagated(self, values: Values, record: TimeHistory, start: Array) -> tuple[Array, Array]:
        """Outputs (n, o, k) from a state (s, k) on, and the state (s, k) at the last sample, in SI
        units; outputs are NaN after a divergence."""
        own, driving = self._local(values, record), self.driving(record)
        a = self.a.at(own)
        b = _beside(self.b.at(own), self.state_bias.at(own))
        d = _beside(self.d.at(own), self.output_bias.at(own))
        c = self.c.at(own)
        k = max(len(a), len(b), len(c), len(d), start.shape[1])
        with np.errstate(all="ignore"):
            phi, gamma = _discrete(a, b, record.step)
            states = _recursion(phi, gamma, None, driving, np.broadcast_to(start, (len(start), k)))
            outputs = np.einsum("kab,nkb->nak", np.broadcast_to(c, (k, *c.shape[1:])), states)
            outputs = outputs + np.moveaxis(driving @ np.swapaxes(d, 1, 2), 0, 2)
            return np.where(np.isfinite(outputs), outputs, np.nan), states[-1].T

    def discrete(
        self, values: Values, record: TimeHistory, runs: int
    ) -> tuple[Array, Array, Array, Array]:
        """The model between samples, for k runs: ``x[i+1] = F x[i] + f[i]``, ``y = C x + g``.

        Returns F (s, s, k), f (n - 1, s, k), C (o, s, k) and g (n, o, k).

        In SI units; inputs are linear between samples (first-order hold).
        """
        own, driving = self._local(values, record), self.driving(record)
        b = _beside(self.b.at(own), self.state_bias.at(own))
        d = _beside(self.d.at(own), self.output_bias.at(own))
        phi, gamma = _discrete(self.a.at(own), b, record.step)
        wide = np.hstack([driving[:-1], np.diff(driving, axis=0)])
        parts = (
            phi,
            wide @ np.swapaxes(gamma, 1, 2),
            self.c.at(own),
            driving @ np.swapaxes(d, 1, 2),
        )
        first, drive, observation, direct = (
            np.array(np.moveaxis(np.broadcast_to(part, (runs, *part.shape[1:])), 0, -1), order="C")
            for part in parts
        )
        return first, drive, observation, direct

    def derivatives(
        self, values: Values, record: TimeHistory, names: Sequence[str]
    ) -> tuple[Array, Array]:
        """Outputs (n, o) and their derivatives (n, o, g) with respect to the parameters `names`:
        those of the discrete model, exact, in SI units. Raises InputError for an input that the
        record lacks."""
        own, driving = self._local(values, record), self.driving(record)
        b = _beside(self.b.at(own), self.state_bias.at(own))
        d = _beside(self.d.at(own), self.output_bias.at(own))[0]
        a, c = self.a.at(own), self.c.at(own)[0]
        da, db, direct = self._changes(names, record)
        phi, gamma, dphi, dgamma = self._discrete_slopes(a[0], b[0], da, db, record.step)
        start = np.zeros((len(self.states), len(names) + 1))
        start[:, :1] = self.initial_state(values, record)
        firsts = [self._own(f"initial_{state}", record) for state in self.states]
        for row, first in enumerate(firsts):
            if first in names:
                start[row, 1 + list(names).index(first)] = 1.0
        states = _recursion(
            np.repeat(phi[None], len(names) + 1, axis=0),
            np.concatenate([gamma[None], dgamma]),
            np.concatenate([np.zeros_like(phi)[None], dphi]),
            driving,
            start,
        )
        path = np.ascontiguousarray(states[:, 0])
        outputs = path @ c.T + driving @ d.T
        slopes = states[:, 1:] @ c.T
        if direct.any():
            slopes += (np.hstack([path, driving]) @ direct).reshape(slopes.shape)
        return outputs, np.swapaxes(slopes, 1, 2)

    def _discrete_slopes(
        self, a: Array, b: Array, da: Array, db: Array, step: float
    ) -> tuple[Array, Array, Array, Array]:
        """As the function; records with the same parameters share the last result."""
        key = (a.tobytes(), b.tobytes(), da.tobytes(), db.tobytes(), round(step, 9))
        if self._last.get("key") != key:
            self._last.update(key=key, found=_discrete_slopes(a, b, da, db, step))
        found: tuple[Array, Array, Array, Array] = self._last["found"]
        return found

    @cached_property
    def _last(self) -> dict[str, Any]:
        return {}

    @cached_property
    def entries(self) -> tuple[str, ...]:
        """Names of the parameters that are scalar entries of the matrices, in order of `a` (s, s)
        to `output_bias`."""
        matrices = (self.a, self.b, self.c, self.d, self.state_bias, self.output_bias)
        return tuple(dict.fromkeys(name for matrix in matrices for name in matrix.slopes))

    @cached_property
    def _known(self) -> frozenset[str]:
        return frozenset(self.parameters.names)

    def _own(self, name: str, record: TimeHistory) -> str:
        special = f"{name}[{record.name}]"
        return special if special in self._known else name

    def _local(self, values: Values, record: TimeHistory) -> dict[str, Array]:
        return {name: values[self._own(name, record)] for name in self.entries}

    def _changes(self, names: Sequence[str], record: TimeHistory) -> tuple[Array, Array, Array]:
        """Derivatives of A (g, s, s), of B beside the bias (g, s, m + 1), and of all that gives the
        outputs, transposed, (s + m + 1, g o), with respect to parameters in this record."""
        key = (tuple(names), record.name)
        if key not in self._remembered:
            local = {self._own(name, record): name for name in self.entries}
            inside = [local.get(name, "") for name in names]
            rows = [
                np.hstack([m.slope(n) for m in (self.c, self.d, self.output_bias)]) for n in inside
            ]
            self._remembered[key] = (
                np.stack([self.a.slope(n) for n in inside]),
                np.stack([np.hstack([self.b.slope(n), self.state_bias.slope(n)]) for n in inside]),
                np.concatenate(rows).T,
            )
        return self._remembered[key]

    @cached_property
    def _remembered(self) -> dict[tuple[tuple[str, ...], str], tuple[Array, Array, Array]]:
        return {}

    def driving(self, record: TimeHistory) -> Array:
        """Inputs and a column of ones, (n, m + 1), in SI units. Raises InputError for an input that
        the record lacks or that is not finite."""
        columns = []
        for name in self.inputs:
            source, _, output = name.partition("[")
            series = (
                record.outputs.get(output[:-1])
                if source == _MEASURED and output
                else record.inputs.get(name)
            )
            where = f"record {record.name}"
            if series is None:
                raise InputError(f"it has no input '{name}'", where, nearest(name, record.inputs))
            if not np.isfinite(series).all():
                raise InputError(f"input {name} is not finite", where, "bridge its gaps")
            columns.append(series)
        return np.column_stack([*columns, np.ones(len(record.time))])


def state_space(
    states: Sequence[str],
    inputs: Sequence[str],
    outputs: Sequence[str],
    parameters: Parameters,
    *,
    a: Sequence[Sequence[Entry]],
    b: Sequence[Sequence[Entry]],
    c: Sequence[Sequence[Entry]],
    d: Sequence[Sequence[Entry]] | None = None,
    state_bias: Sequence[Entry] | None = None,
    output_bias: Sequence[Entry] | None = None,
) -> StateSpace:
    """Return the model with these entries, each a number or a sum such as ``2*Lp - 0.1*Lr``.

    Without `d` or biases they are 0. Raises InputError for matrices of another size than the names
    ask for, and for an entry that is no parameter.

    Shapes: A (s, s), B (s, m), C (o, s), D (o, m), biases (s,) and (o,); units are SI.
    """
    s, m, o = len(states), len(inputs), len(outputs)
    given = {
        "A": (a, (s, s)),
        "B": (b, (s, m)),
        "C": (c, (o, s)),
        "D": (d or [[0.0] * m] * o, (o, m)),
        "state bias": ([[entry] for entry in state_bias or [0.0] * s], (s, 1)),
        "output bias": ([[entry] for entry in output_bias or [0.0] * o], (o, 1)),
    }
    matrices = []
    for name, (rows, shape) in given.items():
        matrix = affine_matrix(rows, name)
        if matrix.constant.shape != shape and 0 not in shape:
            raise InputError(
                f"it is {matrix.constant.shape}, not {shape}",
                name,
                "give a row for each state or output and a column for each state or input",
            )
        common = {each.split("[", 1)[0] for each in parameters.names}
        for entry in matrix.slopes:
            if entry not in common:
                raise InputError(f"no parameter '{entry}'", name, nearest(entry, sorted(common)))
        matrices.append(replace(matrix, constant=matrix.constant.reshape(shape)))
    return StateSpace(tuple(states), tuple(inputs), tuple(outputs), parameters, *matrices)


def stabilised(model: StateSpace, gains: Mapping[tuple[str, str], float]) -> StateSpace:
    """The model with feedback of what is measured: ``x' = A x + B u + b_x + K (z - y)``.

    An artificial stabilisation: the output error of an unstable aircraft stays bounded, and so does
    the search. The measured outputs become inputs and must have no gaps.

    Parameters
    ----------
    gains : (state, output) -> gain of its rate [SI per SI].

    References
    ----------
    Jategaonkar, Flight Vehicle System Identification, 2015, section 9.6.
    """
    gain = np.zeros((len(model.states), len(model.outputs)))
    for (state, output), value in gains.items():
        for name, known in ((state, model.states), (output, model.outputs)):
            if name not in known:
                raise InputError(f"the model has no '{name}'", "feedback", nearest(name, known))
        gain[model.states.index(state), model.outputs.index(output)] = value
    used = np.flatnonzero(gain.any(axis=0))
    b = _minus(model.b, gain, model.d)
    more = tuple(f"{_MEASURED}[{model.outputs[j]}]" for j in used)
    empty = np.zeros((len(gain), len(used)))
    return replace(
        model,
        inputs=(*model.inputs, *more),
        a=_minus(model.a, gain, model.c),
        b=AffineMatrix(
            np.hstack([b.constant, gain[:, used]]),
            {name: np.hstack([slope, empty]) for name, slope in b.slopes.items()},
        ),
        d=AffineMatrix(
            np.hstack([model.d.constant, np.zeros((len(model.outputs), len(used)))]),
            {
                name: np.hstack([slope, np.zeros((len(model.outputs), len(used)))])
                for name, slope in model.d.slopes.items()
            },
        ),
        state_bias=_minus(model.state_bias, gain, model.output_bias),
    )


def _minus(matrix: AffineMatrix, gain: Array, other: AffineMatrix) -> AffineMatrix:
    """``matrix - gain @ other``."""
    names = dict.fromkeys([*matrix.slopes, *other.slopes])
    return AffineMatrix(
        matrix.constant - gain @ other.constant,
        {name: matrix.slope(name) - gain @ other.slope(name) for name in names},
    )


def _beside(left: Array, right: Array) -> Array:
    """Matrices (k, r, c) beside each other, where one may be the same (1, r, c) in all k runs."""
    k = max(len(left), len(right))
    return np.concatenate(
        [np.broadcast_to(each, (k, *each.shape[1:])) for each in (left, right)], axis=2
    )


def _first(record: TimeHistory, name: str) -> float:
    """First measured value of an output; 0 where it is not measured."""
    values = record.outputs.get(name, np.zeros(1))
    good = np.flatnonzero(np.isfinite(values))
    return float(values[good[0]]) if len(good) else 0.0


def _blocks(a: Array, b: Array, step: float) -> Array:
    """``[[A, B, 0], [0, 0, 1], [0, 0, 0]]`` times the step, its last column per step."""
    s, m = b.shape[1], b.shape[2]
    k = max(len(a), len(b))
    matrix = np.zeros((k, s + 2 * m, s + 2 * m))
    matrix[:, :s, :s], matrix[:, :s, s : s + m] = a * step, b * step
    matrix[:, s : s + m, s + m :] = np.eye(m)
    return matrix


def _discrete(a: Array, b: Array, step: float) -> tuple[Array, Array]:
    """Transition (k, s, s), and (k, s, 2 m) for the inputs at a sample and their change to the
    next: first-order hold."""
    s, blocks = a.shape[-1], _blocks(a, b, step)
    power, _ = _exponential(blocks, np.zeros((0, 1, *blocks.shape[1:])))
    return power[:, :s, :s], power[:, :s, s:]


def _discrete_slopes(
    a: Array, b: Array, da: Array, db: Array, step: float
) -> tuple[Array, Array, Array, Array]:
    """`_discrete` of one model and its derivatives along (g, ...) changes of A and B."""
    s, m = b.shape
    moved = np.flatnonzero(da.any(axis=(1, 2)) | db.any(axis=(1, 2)))
    changes = np.zeros((len(moved), 1, s + 2 * m, s + 2 * m))
    changes[:, 0, :s, :s], changes[:, 0, :s, s : s + m] = da[moved] * step, db[moved] * step
    power, slopes = _exponential(_blocks(a[None], b[None], step), changes)
    dphi, dgamma = np.zeros((len(da), s, s)), np.zeros((len(da), s, 2 * m))
    dphi[moved], dgamma[moved] = slopes[:, 0, :s, :s], slopes[:, 0, :s, s:]
    return power[0, :s, :s], power[0, :s, s:], dphi, dgamma


def _exponential(matrix: Array, changes: Array) -> tuple[Array, Array]:
    """Exponential of k matrices (k, q, q), and its derivatives along g changes (g, k, q, q).

    Scaling and squaring of the Taylor series, whose derivative is summed beside it: scipy's `expm`
    would need matrices of twice the size for that.
    """
    size = float(np.abs(matrix).sum(axis=-1).max(initial=0.0))
    halvings = max(0, int(np.ceil(np.log2(max(size, 1e-300)))) + 1) if np.isfinite(size) else 0
    matrix, changes = matrix / 2.0**halvings, changes / 2.0**halvings
    term = np.broadcast_to(np.eye(matrix.shape[-1]), matrix.shape)
    total, slope, slopes = term.copy(), np.zeros_like(changes), np.zeros_like(changes)
    for order in range(1, _TERMS):
        slope = (slope @ matrix + term @ changes) / order
        term = (term @ matrix) / order
        total, slopes = total + term, slopes + slope
    for _ in range(halvings):
        slopes = slopes @ total + total @ slopes
        total = total @ total
    return total, slopes


def _recursion(phi: Array, gamma: Array, psi: Array | None, driving: Array, start: Array) -> Array:
    """States (n, k, s): ``x_k[i+1] = phi_k x_k[i] + psi_k x_0[i] + gamma_k w[i]``."""
    from aerodb.estimation.linear_models.recursion import recursion  # loads the compiler

    k, s = start.shape[1], start.shape[0]
    change = np.diff(driving, axis=0)
    wide = np.hstack([driving[:-1], change])
    states = np.empty((len(driving), k, s))
    flat = np.broadcast_to(gamma, (k, *gamma.shape[1:])).reshape(k * s, -1)
    np.matmul(wide, flat.T, out=states[1:].reshape(len(wide), k * s))
    states[0] = start.T
    own = np.ascontiguousarray(np.broadcast_to(phi, (k, s, s)))
    recursion(own, np.zeros((0, s, s)) if psi is None else np.ascontiguousarray(psi), states)
    return states
