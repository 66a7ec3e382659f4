"""Start values for linear models without any, from a subspace model of the same records."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from aerodb.estimation.linear_models.delays import DelayedStateSpace
from aerodb.estimation.linear_models.state_space import StateSpace
from aerodb.estimation.linear_models.structure_matching import matched_start_values
from aerodb.estimation.linear_models.subspace import identified_linear_model, path
from aerodb.estimation.time_history import TimeHistory
from aerodb.support import Array

#: Difference of two sampling intervals that are one, as a share.
_SAME_RATE = 1e-3
#: What a fit says of such a start.
FROM_SUBSPACE = "The search began at values from subspace identification."
#: A model that gets start values.
LinearModel = StateSpace | DelayedStateSpace


def has_start_values(model: LinearModel) -> bool:
    """Return whether an unknown entry (a scalar, SI units) of the matrices starts away from
    zero."""
    entries = model.model.entries if isinstance(model, DelayedStateSpace) else model.entries
    return any(
        item.value and item.name.split("[", 1)[0] in entries for item in model.parameters.unknown
    )


def with_start_values(model: LinearModel, records: Sequence[TimeHistory]) -> LinearModel:
    """The model with start values for its unknown parameters, from a subspace model of its states.

    Where every state is an output of its name, the model's own equations are linear in the
    parameters along the smooth paths of the subspace model, and are solved by least squares; else
    its structure is matched to the subspace model (`structure_matching`). Parameters that are in
    none of them, delays among them, or that bounds hold, keep their start values.

    Raises InputError as `identified_linear_model`.
    """
    if isinstance(model, DelayedStateSpace):
        timely = [model.timely(record) for record in records]
        return replace(model, model=_started(model.model, timely))
    return _started(model, records)


def _started(model: StateSpace, records: Sequence[TimeHistory]) -> StateSpace:
    records = _at_one_rate(records)
    if any(name not in model.outputs for name in model.states):
        return _inside(model, matched_start_values(model, records))
    found = identified_linear_model(
        records, model.inputs, model.states, order=len(model.states), states=model.states
    )
    paths = [path(found, record) for record in records]
    offset = [found.offset[record.name] for record in records]
    return _along(
        model, records, [(x + at, rate) for (x, rate), at in zip(paths, offset, strict=True)]
    )


def with_regressed_start_values(
    model: LinearModel, records: Sequence[TimeHistory]
) -> LinearModel | None:
    """The model with start values from its equations along the measured states and their numerical
    derivatives, which noise bends a little; None where a state is not measured throughout. States
    (n, s) and their rates in SI units, per second."""
    if isinstance(model, DelayedStateSpace):
        inner = with_regressed_start_values(model.model, [model.timely(each) for each in records])
        return replace(model, model=inner) if isinstance(inner, StateSpace) else None
    if any(name not in model.outputs for name in model.states):
        return None
    paths = [record.stacked(model.states) for record in records]
    if not all(np.isfinite(states).all() and len(states) > 1 for states in paths):
        return None
    rates = [np.gradient(x, record.step, axis=0) for x, record in zip(paths, records, strict=True)]
    return _along(model, records, list(zip(paths, rates, strict=True)))


def _along(
    model: StateSpace, records: Sequence[TimeHistory], paths: Sequence[tuple[Array, Array]]
) -> StateSpace:
    """The model with what least squares give of its state equations along paths: states and rates
    (n, s) of each record."""
    unknown = [item.name for item in model.parameters.unknown]
    blocks, responses = _equations(model, records, paths, unknown)
    # Constants of each record first: trim and biases are no part of the derivatives.
    about = [(x - x.mean(axis=0)).reshape(-1, len(unknown)) for x in blocks]
    varying = [(z - z.mean(axis=0)).ravel() for z in responses]
    solved = _solved(np.concatenate(about), np.concatenate(varying))
    used = np.isfinite(solved)
    known = np.where(used, solved, 0.0)
    steady = [x.mean(axis=0)[:, ~used] for x in blocks]
    left = [(z - x @ known).mean(axis=0) for x, z in zip(blocks, responses, strict=True)]
    solved[~used] = _solved(np.concatenate(steady), np.concatenate(left))
    used = np.isfinite(solved)
    starts = dict(zip(np.array(unknown)[used].tolist(), solved[used].tolist(), strict=True))
    return _inside(model, starts)


def _inside(model: StateSpace, starts: Mapping[str, float]) -> StateSpace:
    """The model with these start values, moved into their bounds."""
    inside = {
        item.name: float(np.clip(starts[item.name], item.lower, item.upper))
        for item in model.parameters.unknown
        if item.name in starts
    }
    return replace(model, parameters=model.parameters.changed(inside))


def _at_one_rate(records: Sequence[TimeHistory]) -> list[TimeHistory]:
    """The records of the sampling rate at which most was recorded: a subspace model has one."""
    alike = [
        [other for other in records if abs(other.step / record.step - 1.0) < _SAME_RATE]
        for record in records
    ]
    return max(alike, key=lambda each: sum(record.time[-1] - record.time[0] for record in each))


def _solved(matrix: Array, response: Array) -> Array:
    """Least squares (g,); NaN for columns of zeros."""
    solved, scale = np.full(matrix.shape[1], np.nan), np.linalg.norm(matrix, axis=0)
    used = scale > 1e-9 * scale.max(initial=1e-300)
    if used.any():
        size = scale[used]
        columns = matrix[:, used] / size
        normal, right = columns.T @ columns, columns.T @ response  # a start need not be exact
        solved[used] = np.linalg.lstsq(normal, right, rcond=1e-14)[0] / size
    return solved


def _equations(
    model: StateSpace,
    records: Sequence[TimeHistory],
    paths: Sequence[tuple[Array, Array]],
    unknown: Sequence[str],
) -> tuple[list[Array], list[Array]]:
    """The model's state equations along paths of the states and their rates: for each record the
    columns (n, s, g) of the unknown parameters, and what the known entries leave (n, s). Each row
    is scaled by the spread of its rate."""
    column = {name: j for j, name in enumerate(unknown)}
    matrices: list[Array] = []
    responses: list[Array] = []
    known = model.parameters.values(np.zeros(len(unknown)))
    tied = {item.name: item.tied for item in model.parameters.items if item.tied is not None}
    for record, (states, rate) in zip(records, paths, strict=True):
        inputs = model.driving(record)[:, :-1]
        weight = 1.0 / np.maximum(rate.std(axis=0), 1e-300)
        wide = np.zeros((*rate.shape, len(unknown)))
        left = rate.copy()
        ones = np.ones((len(inputs), 1))
        for part, series in ((model.a, states), (model.b, inputs), (model.state_bias, ones)):
            left -= series @ part.constant.T
            for name, slope in part.slopes.items():
                special = f"{name}[{record.name}]"
                own = special if special in model.parameters.names else name
                target, factor = tied.get(own, (own, 1.0))
                if target in column:
                    wide[:, :, column[target]] += factor * (series @ slope.T)
                else:
                    left -= float(known[own]) * (series @ slope.T)
        matrices.append(wide * weight[:, None])
        responses.append(left * weight)
    return matrices, responses
