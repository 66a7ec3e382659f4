"""Linear models whose states are measured, as equations that are linear in their parameters.

``x' = A x + B u + b_x`` with the measured states is one equation per state, and each output that is
no state is one more. All of them are one `LinearEquation`, because their rows can share parameters:
each is divided by its noise, so that all count as much as they are worth.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from aerodb.coefficients import DEFAULT_BANDWIDTH
from aerodb.errors import InputError
from aerodb.estimation import (
    AffineMatrix,
    EquationRecord,
    Fit,
    LinearEquation,
    Parameters,
    StateSpace,
    TimeHistory,
)
from aerodb.identification.methods import Method
from aerodb.signals import FEWEST_SAMPLES, low_passed_rate, smooth, theil
from aerodb.support import Array

#: Rounds of weighting; the noise of the rows changes by less than a tenth after the second.
_ROUNDS: Final = 3
#: Longest gap that is bridged [s].
_BRIDGED: Final = 0.25
_WHERE: Final = "equations of the model"


@dataclass(frozen=True, eq=False)
class _Row:
    """One equation of one record: ``response (n,) = regressors (n, k) theta + v``."""

    record: TimeHistory
    name: str
    regressors: Array
    response: Array

    @property
    def label(self) -> str:
        return f"{self.record.name}: {self.name}"


def equation_error_fit(method: Method, model: StateSpace, records: Sequence[TimeHistory]) -> Fit:
    """The fit of a method of equation error to a linear model with measured states.

    The rate of a state is the output whose row equals that of the rate, or else the derivative of
    the measured state; both sides of that equation are low-passed alike, at 5 Hz or a quarter of
    the sampling rate. Known numbers are taken off the response.

    References
    ----------
    Klein & Morelli, Aircraft System Identification, 2006, section 5.1 (equation error).
    Generalised least squares over equations: Zellner, JASA 57, 1962, without the correlation
    between them.

    Missing samples are bridged for a quarter of a second.

    Raises InputError for states that no output shows, longer gaps in the records, and equations
    without parameters.
    """
    sizes: dict[str, float] = {}
    rows = _rows(model, records)
    for _ in range(_ROUNDS):
        equation = _equation(model, rows, sizes)
        regressors, response = equation.stacked()
        jacobian, offset = equation.parameters.jacobian, equation.parameters.offset
        matrix, left = regressors @ jacobian, response - regressors @ offset
        solution = np.linalg.lstsq(matrix, left, rcond=None)[0]
        sizes = _noise(rows, jacobian @ solution + offset)
    fit: Fit = method.load()(_equation(model, rows, sizes))
    missing = [
        f"{record.name}: {count} missing samples of {name} bridged."
        for record in records
        for name in model.outputs
        if (count := int(np.isnan(record.outputs[name]).sum()))
    ]
    return _by_record(replace(fit, notes=(*fit.notes, *missing)), rows, sizes)


def _rows(model: StateSpace, records: Sequence[TimeHistory]) -> list[_Row]:
    """Every equation with a parameter, of every record."""
    seen = {state: _output_of(model, k) for k, state in enumerate(model.states)}
    measured_rates = {
        j
        for j in range(len(model.outputs))
        for i in range(len(model.states))
        if _same_row(model, i, j)
    }
    rates = [
        i
        for i in range(len(model.states))
        if not any(_same_row(model, i, j) for j in measured_rates)
        and _has_parameters((model.a, model.b, model.state_bias), i)
    ]
    shown = [
        j
        for j, output in enumerate(model.outputs)
        if output not in seen.values() and _has_parameters((model.c, model.d, model.output_bias), j)
    ]
    if not rates and not shown:
        raise InputError("no equation has a parameter", _WHERE, "leave one free")
    rows = []
    for record in records:
        states = _complete(record, [seen[state] for state in model.states])
        driving = np.hstack([states, model.driving(record)])
        band = min(DEFAULT_BANDWIDTH, 0.25 / record.step)
        smoothed = _low_passed(driving, record, band) if rates else driving
        for i in rates:
            response = smooth(states[:, i], record.step, band).rate
            matrices = (model.a, model.b, model.state_bias)
            name = f"rate of {model.states[i]}"
            rows.append(_row(model, record, name, matrices, i, smoothed, response))
        for j in shown:
            response = _complete(record, [model.outputs[j]])[:, 0]
            matrices = (model.c, model.d, model.output_bias)
            rows.append(_row(model, record, model.outputs[j], matrices, j, driving, response))
    return rows


def _row(
    model: StateSpace,
    record: TimeHistory,
    name: str,
    matrices: tuple[AffineMatrix, ...],
    number: int,
    driving: Array,
    response: Array,
) -> _Row:
    """One equation: columns of the parameters that act in this record."""
    columns = []
    for parameter in _acting(model):
        entry = parameter.split("[", 1)[0]
        own = f"{entry}[{record.name}]"
        acts = parameter == (own if own in model.parameters.names else entry)
        slope = np.hstack([m.slope(entry)[number] for m in matrices])
        columns.append(driving @ slope if acts else np.zeros(len(driving)))
    known = driving @ np.hstack([m.constant[number] for m in matrices])
    return _Row(record, name, np.column_stack(columns), response - known)


def _acting(model: StateSpace) -> list[str]:
    """Parameters in the matrices, and those that they are tied to."""
    inside = [name for name in model.parameters.names if name.split("[", 1)[0] in model.entries]
    tied = [model.parameters[name].tied for name in inside]
    return list(dict.fromkeys([*inside, *(each[0] for each in tied if each is not None)]))


def _equation(model: StateSpace, rows: Sequence[_Row], sizes: dict[str, float]) -> LinearEquation:
    parameters = Parameters(tuple(model.parameters[name] for name in _acting(model)))
    records = []
    for row in rows:
        size = sizes.get(row.name) or float(np.std(row.response)) or 1.0
        time = row.record.time - row.record.time[0]
        records.append(EquationRecord(row.label, time, row.regressors / size, row.response / size))
    return LinearEquation("all equations", parameters, tuple(records))


def _noise(rows: Sequence[_Row], theta: Array) -> dict[str, float]:
    """Root mean square of what the estimates leave, per equation over all records."""
    left: dict[str, list[Array]] = {}
    for row in rows:
        left.setdefault(row.name, []).append(row.response - row.regressors @ theta)
    return {
        name: float(np.sqrt(np.mean(np.square(np.concatenate(each)))))
        for name, each in left.items()
    }


def _by_record(fit: Fit, rows: Sequence[_Row], sizes: dict[str, float]) -> Fit:
    """The fit with each equation as a response of its record, in the unit of its left side."""
    fitted: dict[str, dict[str, Array]] = {}
    residuals: dict[str, dict[str, Array]] = {}
    for row in rows:
        size = sizes.get(row.name) or 1.0
        (own,) = fit.fitted[row.label].values()
        (left,) = fit.residuals[row.label].values()
        fitted.setdefault(row.record.name, {})[row.name] = size * own
        residuals.setdefault(row.record.name, {})[row.name] = size * left
    return replace(
        fit,
        fitted=fitted,
        residuals=residuals,
        times={row.record.name: row.record.time - row.record.time[0] for row in rows},
        noise=sizes,
        theil={
            record: {
                name: theil(values, values + residuals[record][name])
                for name, values in outputs.items()
            }
            for record, outputs in fitted.items()
        },
    )


def _output_of(model: StateSpace, state: int) -> str:
    """The output that is this state and nothing else."""
    unit = np.eye(len(model.states))[state]
    for j, output in enumerate(model.outputs):
        if (
            np.array_equal(model.c.constant[j], unit)
            and not model.d.constant[j].any()
            and not model.output_bias.constant[j].any()
            and not _has_parameters((model.c, model.d, model.output_bias), j)
        ):
            return output
    raise InputError(
        f"no output is the state '{model.states[state]}' alone",
        _WHERE,
        "a method of equation error needs every state measured: use output-error",
    )


def _same_row(model: StateSpace, state: int, output: int) -> bool:
    """Return whether an output is the rate of a state."""
    pairs = (
        (model.a, model.c),
        (model.b, model.d),
        (model.state_bias, model.output_bias),
    )
    return all(
        np.array_equal(of_rate.constant[state], of_output.constant[output])
        and all(
            np.array_equal(of_rate.slope(name)[state], of_output.slope(name)[output])
            for name in model.entries
        )
        for of_rate, of_output in pairs
    )


def _has_parameters(matrices: Sequence[AffineMatrix], row: int) -> bool:
    return any(slope[row].any() for matrix in matrices for slope in matrix.slopes.values())


def _complete(record: TimeHistory, outputs: Sequence[str]) -> Array:
    """Measured outputs (n, o), with short gaps bridged."""
    values = record.stacked(tuple(outputs)).copy()
    where, every = f"record {record.name}", np.arange(len(values))
    for name, column in zip(outputs, values.T, strict=True):
        good = np.flatnonzero(np.isfinite(column))
        gaps = np.diff(np.concatenate([[-1], good, [len(column)]])) - 1
        if gaps.max() * record.step > _BRIDGED:
            raise InputError(f"it has gaps in {name}", where, "use output-error")
        column[:] = np.interp(every, good, column[good])
    if len(values) < FEWEST_SAMPLES:
        raise InputError(f"{len(values)} samples are too few", where, "fly longer")
    return values


def _low_passed(driving: Array, record: TimeHistory, band: float) -> Array:
    """Columns (n, c) at the bandwidth; the last is the constant."""
    columns = [low_passed_rate(column, record.step, band) for column in driving[:, :-1].T]
    return np.column_stack([*columns, driving[:, -1]])
