"""Output error over short segments, for motions that diverge from a start that is slightly
wrong."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import Protocol

import numpy as np

from aerodb.errors import InputError
from aerodb.estimation.dynamic_model import DynamicModel, ModelAround, Values
from aerodb.estimation.fit import Fit
from aerodb.estimation.output_error.gauss_newton import search
from aerodb.estimation.output_error.likelihood import Covariance
from aerodb.estimation.output_error.output_error import ASSUMES, checked_records, fit_of
from aerodb.estimation.output_error.sensitivities import ModelResponse, acting, differences
from aerodb.estimation.parameters import Parameter, Parameters
from aerodb.estimation.time_history import TimeHistory
from aerodb.support import Array


class Propagated(DynamicModel, Protocol):
    """A model that can start anywhere."""

    def propagated(self, values: Values, record: TimeHistory, start: Array) -> tuple[Array, Array]:
        """Outputs (n, o, k) from a state (s, k) on, and the state (s, k) at the last sample, in SI
        units; NaN after a divergence."""


@dataclass(frozen=True, eq=False)
class _Segmented(ModelAround):
    """A model whose records are cut at samples; the states there are parameters.

    model : whose parameters come first. cuts : record -> first samples of its segments, and the
    number of its samples. continuous : whether the segments must join.
    """

    model: Propagated
    parameters: Parameters
    cuts: dict[str, tuple[int, ...]]
    continuous: bool

    def responded(
        self, parameters: Parameters, vector: Array, record: TimeHistory, steps: Array
    ) -> ModelResponse:
        """Segment by segment: a parameter moves all of them, a state at a cut only its own."""
        cuts = self.cuts[record.name]
        names = [item.name for item in parameters.unknown]
        whole = acting(parameters, record.name)
        at = {int(column): j for j, column in enumerate(whole)}
        own = [
            [names.index(_cut(state, record.name, j)) for state in self.states] if j else []
            for j in range(len(cuts) - 1)
        ]
        nodes = {column for row in own for column in row}
        common = [int(column) for column in whole if int(column) not in nodes]
        n, o, s = len(record.time), len(self.outputs), len(self.states)
        outputs, slopes = np.empty((n, o)), np.zeros((n, o, len(whole)))
        gaps, gap_slopes = list[Array](), list[Array]()
        for j, (first, last) in enumerate(pairwise(cuts)):
            columns = np.array(common + own[j], dtype=np.int64)
            part = _part(record, first, min(last + 1, n))
            rows = (last - first) * o
            result, change = differences(
                partial(self._run, record=record, part=part, number=j),
                parameters,
                vector,
                columns,
                steps,
            )
            place = [at[int(column)] for column in columns]
            outputs[first:last] = result[:rows].reshape(-1, o)
            slopes[first:last][:, :, place] = change[:rows].reshape(last - first, o, -1)
            if self.continuous and j + 2 < len(cuts):
                following = own[j + 1]
                gap = np.zeros((s, len(whole)))
                gap[:, place] = change[-s:]
                gap[np.arange(s), [at[column] for column in following]] -= 1.0
                gaps.append(result[-s:] - vector[following])
                gap_slopes.append(gap)
        return ModelResponse(
            outputs,
            slopes,
            whole,
            np.concatenate([*gaps, np.zeros(0)]),
            np.concatenate([*gap_slopes, np.zeros((0, len(whole)))]),
        )

    def _run(self, values: Values, record: TimeHistory, part: TimeHistory, number: int) -> Array:
        """Outputs and the last state of a segment, one after the other, (n o + s, k)."""
        if number:
            rows = [np.atleast_1d(values[_cut(s, record.name, number)]) for s in self.states]
            start = np.stack(np.broadcast_arrays(*rows))
        else:
            start = self.model.initial_state(values, record)
        outputs, last = self.model.propagated(values, part, start)
        k = outputs.shape[2]
        return np.concatenate([outputs.reshape(-1, k), np.broadcast_to(last, (len(last), k))])


def multiple_shooting(
    model: Propagated,
    records: Sequence[TimeHistory],
    *,
    segment: float = 1.0,
    continuous: bool = True,
    covariance: Covariance = "diagonal",
    most_iterations: int = 50,
) -> Fit:
    """Output error whose records are cut into segments, each with an initial state of its own.

    Errors of the start grow within one segment only, so that the search of an unstable aircraft
    ends. Where the segments must join, the optimum is that of output error over whole records;
    where they need not, turbulence within a record disturbs the estimates less, and they are less
    precise.

    Parameters
    ----------
    segment : length of a segment [s]; about the time in which the motion doubles or longer.
    continuous : whether the segments must join.
    covariance, most_iterations : see `output_error`.

    States at the cuts start as measured, or at 0 where no output has the state's name.

    References
    ----------
    Bock, in: Modelling of Chemical Reaction Systems, 1981; Jategaonkar, Flight Vehicle System
    Identification, 2015, section 9.12.
    """
    checked_records(model, records, "multiple shooting")
    cuts, items = dict[str, tuple[int, ...]](), list[Parameter]()
    for record in records:
        n = len(record.time)
        length = round(segment / record.step)
        if length < 1:
            raise InputError(
                f"segments of {segment:g} s are shorter than a sample",
                f"record {record.name}",
                "make them longer",
            )
        firsts = [*range(0, max(n - length // 2, 1), length)]
        cuts[record.name] = (*firsts, n)
        items += [
            Parameter(_cut(state, record.name, j), _measured(record, state, first))
            for j, first in enumerate(firsts)
            if j
            for state in model.states
        ]
    segmented = _Segmented(model, model.parameters.with_more(items), cuts, continuous)
    solution = search(segmented, records, covariance, most_iterations)
    fit = fit_of("multiple-shooting", segmented, records, solution, ASSUMES)
    own = {item.name for item in model.parameters.items}
    kept = [j for j, name in enumerate(fit.names) if name in own]
    return replace(
        fit,
        estimates=tuple(estimate for estimate in fit.estimates if estimate.name in own),
        names=tuple(fit.names[j] for j in kept),
        covariance=fit.covariance[np.ix_(kept, kept)],
    )


def _cut(state: str, record: str, number: int) -> str:
    return f"initial_{state}[{record},{number}]"


def _part(record: TimeHistory, first: int, last: int) -> TimeHistory:
    some = slice(first, last)
    return replace(
        record,
        time=record.time[some],
        inputs={name: values[some] for name, values in record.inputs.items()},
        outputs={name: values[some] for name, values in record.outputs.items()},
    )


def _measured(record: TimeHistory, name: str, sample: int) -> float:
    """Measured value nearest in time; 0 where there is none."""
    values = record.outputs.get(name, np.zeros(1))
    good = np.flatnonzero(np.isfinite(values))
    if not len(good):
        return 0.0
    return float(values[good[np.argmin(np.abs(good - sample))]])
