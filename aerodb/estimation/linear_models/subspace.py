"""Subspace identification of linear models.

The state-space model is found without a start value and without a search: past inputs and outputs
are the instruments with which the space of the states is seen in future outputs (PO-MOESP). It
gives linear models as those of "Parameter Identification for Application within a Fault-Tolerant
Flight Control System", eqs. 1 and 2.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from aerodb.errors import InputError, nearest
from aerodb.estimation.time_history import TimeHistory
from aerodb.support import Array

#: Time that past and future span each [s].
_SPAN: Final = 0.8
#: Fewest samples of it: fewer leave no room for the order.
_FEWEST = 8
#: Most samples of it: the matrices grow with its square.
_MOST = 40
#: Highest order that is looked at where none is given.
_HIGHEST: Final = 10
#: Singular values below this share of the largest are zero.
_ZERO: Final = 1e-9


@dataclass(frozen=True, eq=False)
class LinearIdentified:
    """``x' = A x + B u``, ``y = C x + D u`` about a constant of each record.

    Parameters
    ----------
    A, B, C, D : (s, s), (s, m), (o, s) and (o, m), continuous, for inputs that are linear between
        samples. States are the outputs `states`, or of no meaning where that is empty.
    states, inputs, outputs : names.
    singular : of the space of the states, by size; the order is where they fall.
    initial : record -> state at its first sample (s,). offset : record -> outputs (o,) at rest.
    note : how the order came about, as a sentence.
    """

    A: Array
    B: Array
    C: Array
    D: Array
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    singular: Array
    initial: dict[str, Array]
    offset: dict[str, Array]
    note: str


def identified_linear_model(
    records: Sequence[TimeHistory],
    inputs: Sequence[str],
    outputs: Sequence[str],
    *,
    order: int | None = None,
    states: Sequence[str] = (),
    direct: Sequence[str] = (),
) -> LinearIdentified:
    """Identify a linear model from several records by subspaces.

    Parameters
    ----------
    records : of one sampling rate, with these inputs and outputs; outputs without gaps.
    order : number of states; None: where the singular values fall most.
    states : outputs that are to be the states, as many as the order.
    direct : outputs to which inputs pass without delay, such as accelerations.

    References
    ----------
    Verhaegen, Automatica 30(1), 1994. Van Overschee & De Moor, Subspace Identification for Linear
    Systems, 1996, chapters 2 and 4. Ljung, System Identification, 1999, section 10.6.

    Raises InputError for records of unequal rates or too short, inputs that do not excite, an order
    beyond what the records show, poles that no continuous model has, and states that the outputs
    are not.
    """
    step = _checked(records, inputs, outputs, (*states, *direct))
    u = [np.column_stack([r.inputs[name] for name in inputs]) for r in records]
    y = [r.stacked(tuple(outputs)) for r in records]
    size_u, size_y = _spread(u), _spread(y)
    if not size_u.all():
        still = [name for name, size in zip(inputs, size_u, strict=True) if size == 0.0]
        raise InputError(f"inputs do not move: {', '.join(still)}", "subspace", "leave them out")
    size_y[size_y == 0.0] = 1.0
    horizon = int(np.clip(round(_SPAN / step), max(_FEWEST, (order or 0) + 2), _MOST))
    scaled_u, scaled_y = [v / size_u for v in u], [v / size_y for v in y]
    space, singular = _state_space(scaled_u, scaled_y, horizon)
    chosen, note = _order(singular, order or (len(states) or None))
    observed = space[:, :chosen] * np.sqrt(singular[:chosen])
    o = len(outputs)
    discrete: Array = np.asarray(np.linalg.lstsq(observed[:-o], observed[o:], rcond=None)[0])
    a, c = _continuous(discrete, step), observed[:o] * size_y[:, None]
    free = [name in direct for name in outputs]
    b, d, initial, offset = _inputs_and_states(a, c, u, y, step, np.array(free))
    if states:
        rows = [list(outputs).index(name) for name in states]
        turn = c[rows]
        if len(states) != chosen or np.linalg.cond(turn / size_y[rows][:, None]) > 1e8:
            raise InputError(
                f"the outputs {', '.join(states)} are not the {chosen} states",
                "subspace",
                "name as many independent outputs as the order",
            )
        a, b, c = turn @ a @ np.linalg.inv(turn), turn @ b, c @ np.linalg.inv(turn)
        initial = [turn @ x for x in initial]
    named = [record.name for record in records]
    return LinearIdentified(
        a, b, c, d, tuple(states), tuple(inputs), tuple(outputs), singular,
        dict(zip(named, initial, strict=True)), dict(zip(named, offset, strict=True)), note,
    )  # fmt: skip


def _checked(
    records: Sequence[TimeHistory],
    inputs: Sequence[str],
    outputs: Sequence[str],
    named: Sequence[str],
) -> float:
    if not records or not outputs:
        raise InputError("it needs records and outputs", "subspace")
    for name in named:
        if name not in outputs:
            raise InputError(f"no output '{name}'", "subspace", nearest(name, outputs))
    for record in records:
        where = f"record {record.name}"
        for name, known in (
            *((n, record.inputs) for n in inputs),
            *((n, record.outputs) for n in outputs),
        ):
            if name not in known:
                raise InputError(f"it has no '{name}'", where, nearest(name, known))
            if not np.isfinite(known[name]).all():
                raise InputError(f"{name} has gaps", where, "bridge them, or cut the record there")
        if abs(record.step / records[0].step - 1.0) > 1e-3:
            raise InputError("its sampling rate is another", where, "resample it")
    return records[0].step


def _spread(parts: Sequence[Array]) -> Array:
    """Root mean square about the mean of each record, (columns,)."""
    about = np.concatenate([part - part.mean(axis=0) for part in parts])
    return np.asarray(np.sqrt(np.mean(about**2, axis=0)))


def _hankel(values: Array, first: int, rows: int, columns: int) -> Array:
    """``values[first + i + j]`` at block row i and column j."""
    return np.vstack([values[first + i : first + i + columns].T for i in range(rows)])


def _state_space(u: Sequence[Array], y: Sequence[Array], horizon: int) -> tuple[Array, Array]:
    """The space of the states in `horizon` future outputs, and its singular values."""
    future_u, past, future_y, own = [], [], [], []
    for k, (inputs, outputs) in enumerate(zip(u, y, strict=True)):
        columns = len(inputs) - 2 * horizon + 1
        if columns < 1:
            continue
        future_u.append(_hankel(inputs, horizon, horizon, columns))
        past.append(
            np.vstack([_hankel(inputs, 0, horizon, columns), _hankel(outputs, 0, horizon, columns)])
        )
        future_y.append(_hankel(outputs, horizon, horizon, columns))
        constant = np.zeros((len(u), columns))  # the rest of each record
        constant[k] = 1.0
        own.append(constant)
    rows = 2 * horizon * (u[0].shape[1] + y[0].shape[1])
    total = sum(part.shape[1] for part in future_y)
    if total < rows:
        raise InputError(
            f"{sum(map(len, u))} samples are too short for a horizon of {horizon}",
            "subspace",
            "give longer records",
        )
    known = [np.hstack(future_u), np.hstack(own), np.hstack(past)]
    known[1] = known[1][known[1].any(axis=1)]
    stacked = np.vstack([*known, np.hstack(future_y)])
    triangle = np.linalg.qr(stacked.T / np.sqrt(total))[1].T
    first = known[0].shape[0] + known[1].shape[0]
    excited = np.abs(np.diag(triangle)[: known[0].shape[0]])
    if excited.min() < 1e-10 * excited.max():
        raise InputError(
            "inputs do not excite the model enough to separate their effects",
            "subspace",
            "fly inputs that move independently, or leave one out",
        )
    end = first + known[2].shape[0]
    left, singular, _ = np.linalg.svd(triangle[end:, first:end], full_matrices=False)
    return left, singular


def _order(singular: Array, wanted: int | None) -> tuple[int, str]:
    shown = int(np.sum(singular > _ZERO * singular[0]))
    if wanted is not None:
        if wanted > shown:
            raise InputError(
                f"the records show {shown} states, not {wanted}",
                "subspace",
                "lower the order, or fly manoeuvres that excite all states",
            )
        share = singular[wanted] / singular[wanted - 1] if wanted < len(singular) else 0.0
        said = f"Order {wanted} as given; the next singular value is {share:.2g} of its last."
        return wanted, said
    most = min(_HIGHEST, len(singular) - 1)
    floor = np.maximum(singular, _ZERO * singular[0])
    chosen = int(np.argmax(floor[:most] / floor[1 : most + 1])) + 1
    listed = ", ".join(f"{value / singular[0]:.2g}" for value in singular[: chosen + 2])
    return chosen, (
        f"Order {chosen}, after which the singular values fall most: {listed} of the largest."
    )


def _continuous(discrete: Array, step: float) -> Array:
    from scipy.linalg import logm  # slow to import

    poles = np.linalg.eigvals(discrete)
    if np.any((np.abs(poles.imag) < 1e-12) & (poles.real <= 0.0)):
        raise InputError(
            "a pole has no continuous counterpart: it is noise",
            "subspace",
            "lower the order, or sample faster",
        )
    return np.asarray(np.real(logm(discrete)) / step)


def input_responses(a: Array, u: Array, step: float) -> Array:
    """States (n, s, s m) that each input through each row of B gives, from rest; inputs linear
    between samples, in SI units."""
    from scipy.linalg import expm  # slow to import

    s = len(a)
    blocks = np.zeros((3 * s, 3 * s))
    blocks[:s, :s], blocks[:s, s : 2 * s], blocks[s : 2 * s, 2 * s :] = (
        a * step, np.eye(s) * step, np.eye(s),
    )  # fmt: skip
    power = expm(blocks)
    phi, held, ramp = power[:s, :s], power[:s, s : 2 * s], power[:s, 2 * s :]
    change = np.diff(u, axis=0)
    drive = np.einsum("ij,nk->nijk", held, u[:-1]) + np.einsum("ij,nk->nijk", ramp, change)
    states = np.zeros((len(u), s, s * u.shape[1]))
    flat = drive.reshape(len(u) - 1, s, -1)
    for i in range(len(u) - 1):
        states[i + 1] = phi @ states[i] + flat[i]
    return states


def free_response(a: Array, count: int, step: float) -> Array:
    """States (n, s, s) from each unit state on."""
    from scipy.linalg import expm  # slow to import

    phi = expm(a * step)
    states = np.empty((count, *a.shape))
    states[0] = np.eye(len(a))
    for i in range(count - 1):
        states[i + 1] = phi @ states[i]
    return states


def _inputs_and_states(
    a: Array, c: Array, u: Sequence[Array], y: Sequence[Array], step: float, direct: Array
) -> tuple[Array, Array, list[Array], list[Array]]:
    """B, D, and of each record the initial state and the constant outputs, by least squares:
    outputs are linear in all of them."""
    s, m, o, g = len(a), u[0].shape[1], len(c), len(u)
    places = np.flatnonzero(direct)
    shared = s * m + len(places) * m
    blocks, responses = [], []
    scale = np.maximum(_spread(y), 1e-300)
    for k, (inputs, outputs) in enumerate(zip(u, y, strict=True)):
        n = len(inputs)
        wide = np.zeros((n, o, shared + g * (s + o)))
        wide[:, :, : s * m] = np.einsum("os,nsk->nok", c, input_responses(a, inputs, step))
        for j, place in enumerate(places):
            wide[:, place, s * m + j * m : s * m + (j + 1) * m] = inputs
        own = shared + k * (s + o)
        wide[:, :, own : own + s] = np.einsum("os,nsk->nok", c, free_response(a, n, step))
        wide[:, :, own + s : own + s + o] = np.eye(o)
        blocks.append((wide / scale[:, None]).reshape(n * o, -1))
        responses.append((outputs / scale).ravel())
    matrix, response = np.concatenate(blocks), np.concatenate(responses)
    size = np.maximum(np.linalg.norm(matrix, axis=0), 1e-300)
    found = np.linalg.lstsq(matrix / size, response, rcond=1e-9)[0] / size
    b = found[: s * m].reshape(s, m)
    d = np.zeros((o, m))
    d[places] = found[s * m : shared].reshape(-1, m)
    own = found[shared:].reshape(g, s + o)
    return b, d, [row[:s] for row in own], [row[s:] for row in own]


def path(found: LinearIdentified, record: TimeHistory) -> tuple[Array, Array]:
    """Deviation of the states from their constant along a record, and their rates, (n, s) each, in
    SI units, rates per second."""
    inputs = np.column_stack([record.inputs[name] for name in found.inputs])
    forced = np.einsum("nsk,k->ns", input_responses(found.A, inputs, record.step), found.B.ravel())
    free = free_response(found.A, len(inputs), record.step) @ found.initial[record.name]
    return forced + free, (forced + free) @ found.A.T + inputs @ found.B.T
