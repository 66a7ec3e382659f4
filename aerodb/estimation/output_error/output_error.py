"""Output error: the parameters whose simulated outputs are most likely, given what was measured."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from aerodb.errors import InputError
from aerodb.estimation.dynamic_model import DynamicModel
from aerodb.estimation.fit import Fit, ParameterEstimate, Standing
from aerodb.estimation.linear_models import (
    FROM_SUBSPACE,
    DelayedStateSpace,
    LinearModel,
    StateSpace,
    has_start_values,
    with_regressed_start_values,
    with_start_values,
)
from aerodb.estimation.output_error.gauss_newton import (
    SINGULAR,
    OutputErrorSolution,
    likelihood_of_start,
    projected,
    search,
)
from aerodb.estimation.output_error.instability import instability
from aerodb.estimation.output_error.likelihood import (
    Beside,
    Covariance,
    MeasuredOutputs,
    Noise,
    coloured_information,
)
from aerodb.estimation.output_error.noisy_inputs import without_input_noise
from aerodb.estimation.output_error.sensitivities import ModelResponse
from aerodb.estimation.parameters import Parameters
from aerodb.estimation.regression import ENOUGH_PER_ESTIMATE
from aerodb.estimation.standing import standings
from aerodb.estimation.time_history import TimeHistory, elapsed
from aerodb.signals import theil
from aerodb.support import Array

ASSUMES = (
    "The motion is deterministic: turbulence and errors of the inputs bias the estimates."
    " What white noise of deflections does is taken off.",
    "The noise of the outputs has no mean and is the same in every record.",
)
_FROM_REGRESSION = (
    "The search began at values from regression, which are likelier than those given."
)
_UNCORRELATED = "The noise of different outputs is uncorrelated."

#: The model explains nothing of an output whose residual is this many times what a constant leaves.
_WORSE = 2.0
#: And nothing at all where this share of what a constant leaves remains of every output.
_NOTHING = 0.9

#: What `coloured_information` takes and returns.
Coloured = Callable[
    [Sequence[MeasuredOutputs], Sequence[ModelResponse], Noise, int, Beside], tuple[Array, float]
]


def output_error(
    model: DynamicModel,
    records: Sequence[TimeHistory],
    *,
    covariance: Covariance = "diagonal",
    most_iterations: int = 50,
    at_least: float = -np.inf,
) -> Fit:
    """Estimate a model's parameters from what it predicts for several records at once.

    Maximises ``-1/2 sum_i v_i' R^-1 v_i - N/2 ln det R`` with ``v = z - y`` and the measurement
    covariance R estimated in turn, by Gauss-Newton steps with Levenberg-Marquardt damping within
    bounds. Priors are added to the likelihood.

    Parameters
    ----------
    model : a linear one starts from what regression on measured states gives where that is likelier
        than its start values; where these are all zero, or the search does not end from them, from
        those of subspace identification.
    records : with the model's outputs; a sample that is NaN is left out.
    covariance : of the measurement noise: diagonal, or full with correlation between outputs.
    at_least : log-likelihood below which an answer is of no use: a search that is too slow to come
        there is ended.

    Standard errors count the correlation of the residuals in time and between outputs; the
    Cramer-Rao bound is for white ones. Where the search does not end, or the model explains an
    output worse than a constant, all estimates are ``diverged``.

    Raises InputError for records of one name, and for a model without records or outputs.

    References
    ----------
    Jategaonkar, Flight Vehicle System Identification, 2015, chapter 4.
    Klein & Morelli, Aircraft System Identification, 2016, chapter 6.
    Morelli & Klein, Journal of Guidance, Control, and Dynamics 20(1), 1997.
    """
    checked_records(model, records, "output error")
    assumes = (*ASSUMES, *((_UNCORRELATED,) if covariance == "diagonal" else ()))

    def fitted(started: DynamicModel, note: str) -> Fit:
        solution = search(started, records, covariance, most_iterations, at_least=at_least)
        unstable = instability(started, records, solution.vector, SINGULAR**-0.5)
        fit = fit_of("output-error", started, records, solution, assumes, unstable)
        return replace(fit, notes=(*fit.notes, *([note] if note else [])))

    if not isinstance(model, StateSpace | DelayedStateSpace):
        return fitted(model, "")
    regressed = with_regressed_start_values(model, records)
    if has_start_values(model):
        given = likelihood_of_start(model, records, covariance)
        if regressed and likelihood_of_start(regressed, records, covariance) > given:
            fit = fitted(regressed, _FROM_REGRESSION)
        else:
            fit = fitted(model, "")
        if fit.converged:
            return fit
        again = _from_subspace(model, records)
        if isinstance(again, str):
            return fit
        other = fitted(again, FROM_SUBSPACE)
        return other if other.converged else fit
    started = _from_subspace(model, records)
    if isinstance(started, str):
        note = f"The search began at {'values from regression' if regressed else 'zero'}"
        return fitted(regressed or model, f"{note}: {started}.")
    return fitted(started, FROM_SUBSPACE)


def _from_subspace(model: LinearModel, records: Sequence[TimeHistory]) -> LinearModel | str:
    """The model with start values from the records; or why there are none."""
    try:
        return with_start_values(model, records)
    except InputError as error:
        return error.what


def checked_records(model: DynamicModel, records: Sequence[TimeHistory], where: str) -> None:
    """Raise InputError for no record, records of one name, and a record without an output. Outputs
    are arrays (n,)."""
    names = [record.name for record in records]
    if not records or len(set(names)) < len(names):
        raise InputError(
            "records must be at least one, with unique names", where, "name them apart"
        )
    for record in records:
        if lacking := [name for name in model.outputs if name not in record.outputs]:
            raise InputError(
                f"it has no {', '.join(lacking)}",
                f"record {record.name}",
                "leave these outputs out of the model, or give NaN where they were not measured",
            )


def fit_of(
    method: str,
    model: DynamicModel,
    records: Sequence[TimeHistory],
    solution: OutputErrorSolution,
    assumes: tuple[str, ...],
    unstable: str = "",
    coloured: Coloured = coloured_information,
) -> Fit:
    """The answer that belongs to where a search ended.

    unstable : why the motion has no answer at all; empty where it has one. coloured : what the
    residuals' colour makes of the information. What noise of the deflections does is taken off
    (`without_input_noise`).

    Values are in SI units; NaN where the records determine none, ``diverged`` where the search has
    no end.
    """
    unknown, vector = model.parameters.unknown, solution.vector
    why = unstable or _divergence(model, records, solution)
    added, taken_off = np.zeros((len(vector), len(vector))), tuple[str, ...]()
    if not why:
        solution, added, taken_off = without_input_noise(model, records, solution)
        vector = solution.vector
    found = _covariances(solution, coloured)
    found = found._replace(coloured=found.coloured + added)
    white, own_information = found.white, np.diag(solution.information)
    judged: Mapping[str, tuple[Standing, str]] = {}
    if why:
        judged = {item.name: ("diverged", why) for item in unknown}
    else:
        judged = standings(unknown, vector, solution.information, white, SINGULAR)
    residuals, fitted, agreement = {}, {}, {}
    for record, measured, response in zip(
        records, solution.records, solution.responses, strict=True
    ):
        left = np.where(measured.mask, measured.values - response.outputs, np.nan)
        residuals[record.name] = dict(zip(model.outputs, left.T, strict=True))
        fitted[record.name] = dict(zip(model.outputs, response.outputs.T, strict=True))
        agreement[record.name] = {
            name: theil(response.outputs[mask, j], measured.values[mask, j])
            for j, (name, mask) in enumerate(zip(model.outputs, measured.mask.T, strict=True))
            if mask.any() and np.isfinite(response.outputs[mask, j]).all()
        }
    deviation = np.sqrt(np.diag(solution.noise.covariance))
    return Fit(
        method=method,
        estimates=_estimates(
            model.parameters, vector, white, found.coloured, own_information, judged
        ),
        names=tuple(item.name for item in unknown),
        covariance=found.coloured,
        degrees_of_freedom=found.freedom,
        residuals=residuals,
        fitted=fitted,
        times=elapsed(records),
        noise=dict(zip(model.outputs, deviation.tolist(), strict=True)),
        theil=agreement,
        converged=solution.converged and not why,
        iterations=solution.iterations,
        log_likelihood=solution.noise.log_likelihood,
        assumes=assumes,
        notes=(*_notes(why, found), *taken_off),
    )


def _divergence(
    model: DynamicModel, records: Sequence[TimeHistory], solution: OutputErrorSolution
) -> str:
    """Return why there is no estimate; empty where there is one."""
    remedy = "start closer; an unstable motion needs stabilised output error or multiple shooting"
    for record, response in zip(records, solution.responses, strict=True):
        lost = ~np.isfinite(response.outputs).all(axis=1)
        if lost.any():
            at = float(record.time[int(np.argmax(lost))] - record.time[0])
            return f"the model's motion in {record.name} diverges after {at:.2f} s: {remedy}"
    shares = list[float]()
    for record, measured, response in zip(
        records, solution.records, solution.responses, strict=True
    ):
        for j, name in enumerate(model.outputs):
            values = measured.values[measured.mask[:, j], j]
            left = values - response.outputs[measured.mask[:, j], j]
            if not len(values) or not values.std() > 0:
                continue
            shares.append(float(np.sqrt(np.mean(left**2)) / values.std()))
            if shares[-1] > _WORSE:
                return f"the model explains {name} in {record.name} worse than a constant: {remedy}"
    if shares and min(shares) > _NOTHING:
        return f"the model explains no output better than a constant: {remedy}"
    if not solution.converged:
        return f"the search did not end within {solution.iterations} steps: {remedy}"
    return ""


class _Covariances(NamedTuple):
    """Covariance (f, f) as if the residuals were white, and corrected for coloured ones; how many
    independent samples these count as; and how many directions the unknowns have."""

    white: Array
    coloured: Array
    independent: float
    rank: int

    @property
    def freedom(self) -> float:
        return max(self.independent - self.rank, 1.0)


def _covariances(solution: OutputErrorSolution, coloured: Coloured) -> _Covariances:
    f = len(solution.vector)
    if not solution.information.any():
        none = np.full((f, f), np.nan)
        return _Covariances(none, none, np.inf, 0)
    # What a bound holds might be off it: errors of the others count that, as those of regression.
    directions = projected(solution.information, solution.normal, np.ones(f, dtype=bool))
    white, rank = directions @ directions.T, directions.shape[1]
    data, independent = coloured(
        solution.records, solution.responses, solution.noise, f, solution.beside
    )
    prior = solution.information - solution.normal.information
    # residuals are smaller than the noise by what the parameters take up
    samples = float(solution.noise.count.sum())
    whole = white @ (data * independent / max(independent - rank, 1.0) + prior) @ white
    if solution.beside.cycles:
        white = white @ (solution.normal.scatter + prior) @ white
    return _Covariances(white * samples / max(samples - rank, 1.0), whole, independent, rank)


def _estimates(
    parameters: Parameters,
    vector: Array,
    white: Array,
    coloured: Array,
    own_information: Array,
    judged: Mapping[str, tuple[Standing, str]],
) -> tuple[ParameterEstimate, ...]:
    """own_information : (f,) information of each unknown alone."""
    number = {item.name: j for j, item in enumerate(parameters.unknown)}
    values = parameters.values(vector)
    made = []
    for item in parameters.items:
        source, factor = item.tied or (item.name, 1.0)
        standing, reason = judged.get(source, ("estimated", ""))
        value, error, bound, alone = float(values[item.name]), np.nan, np.nan, np.nan
        if source in number and standing not in ("diverged", "at bound"):
            j = number[source]
            error = abs(factor) * float(np.sqrt(coloured[j, j]))
            bound = abs(factor) * float(np.sqrt(white[j, j]))
            alone = (
                abs(factor) / float(np.sqrt(own_information[j]))
                if own_information[j] > 0
                else np.nan
            )
        if standing in ("not excited", "not identifiable"):
            value = error = bound = alone = np.nan
        if source not in number:
            standing, reason = "fixed", "not estimated"
        elif item.tied is not None and standing == "estimated":
            standing, reason = "tied", f"{factor:g} times {source}"
        made.append(
            ParameterEstimate(item.name, value, error, item.unit, standing, reason, bound, alone)
        )
    return tuple(made)


def _notes(why: str, found: _Covariances) -> tuple[str, ...]:
    if why:
        return (f"The search diverged: {why}.",)
    notes = []
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.sqrt(np.diag(found.coloured) / np.diag(found.white))
    ratio = ratio[np.isfinite(ratio)]
    if len(ratio) and float(np.median(ratio)) > 1.5:
        notes.append(
            "The residuals are coloured: standard errors are"
            f" {float(np.median(ratio)):.1f} times the Cramer-Rao bounds (median); the model lacks"
            " something, or the noise is not white."
        )
    if found.independent < ENOUGH_PER_ESTIMATE * found.rank:
        notes.append(
            f"Too short: the residuals count as {found.independent:.0f} independent samples for"
            f" {found.rank} estimates; below {ENOUGH_PER_ESTIMATE} for each, 95 % intervals hold"
            " the truth less often than that."
        )
    return tuple(notes)
