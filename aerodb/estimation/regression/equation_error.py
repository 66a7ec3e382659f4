"""What the methods share that solve a `LinearEquation`: the problem in its unknown parameters, and
the answer as a `Fit`."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from aerodb.errors import InputError
from aerodb.estimation.coloured_noise import NoiseModel, autoregressive_noise
from aerodb.estimation.fit import Fit, ParameterEstimate, Standing
from aerodb.estimation.parameters import Parameter, Parameters
from aerodb.estimation.regression.linear_equation import LinearEquation
from aerodb.estimation.time_history import elapsed
from aerodb.signals import theil
from aerodb.support import Array, Mask

#: Independent samples per estimate below which intervals are known to be too narrow.
ENOUGH_PER_ESTIMATE = 10
#: Two estimates correlated beyond this are told to the user.
_CLOSE = 0.95
#: Variation about the mean, as a share of the largest value, below which a column stands still.
_STILL = 1e-9
#: Singular values of columns of unit length below this share of the largest are zero.
_DEPENDENT = 1e-8

#: name -> what an estimate is worth, and why.
Standings = Mapping[str, tuple[Standing, str]]


@dataclass(frozen=True, eq=False)
class Reduced:
    """``y = A u + v``: a linear equation in its f unknown parameters u (001, eqs. 29 and 30).

    Parameters
    ----------
    equation : ``z = X theta + v``, with ``theta = mix u + known``.
    unknown : the f parameters.
    mix, known : (k, f) and (k,).
    columns : A (n, f). response : y (n,), less what is known.
    lengths : samples of each record.
    """

    equation: LinearEquation
    unknown: tuple[Parameter, ...]
    mix: Array
    known: Array
    columns: Array
    response: Array
    lengths: tuple[int, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the f unknown parameters, in the order of the columns (n, f)."""
        return tuple(each.name for each in self.unknown)

    @property
    def constants(self) -> Mask:
        """Mask (f,) of the columns of the matrix (n, f) that are ones, the constants without
        unit."""
        return np.asarray(np.all(self.columns == 1.0, axis=0))

    @property
    def excited(self) -> Mask:
        """(f,) columns that move; the first column of ones counts as excited, and a column that
        stands still does where no constant takes its place, without unit; a column (n,) of zeros
        never counts."""
        spread, size = self.columns.std(axis=0), np.abs(self.columns).max(axis=0)
        moving = spread > _STILL * np.maximum(size, 1e-300)
        still = np.flatnonzero(~moving & (size > 0.0))
        first = [*np.flatnonzero(self.constants), *still][:1]
        moving[first] = True
        return np.asarray(moving)

    def blocks(self, values: Array) -> list[Array]:
        """`values` (n, ...) record by record, in the unit of `values`."""
        return np.split(values, np.cumsum(self.lengths)[:-1])

    def noise(self, estimates: Array) -> NoiseModel:
        """Noise model of the residuals (n,) at estimates (f,), in the unit of the response:
        autoregressive, by Burg's recursion (`autoregressive_noise`)."""
        return autoregressive_noise(self.blocks(self.response - self.columns @ estimates))


def reduced(equation: LinearEquation) -> Reduced:
    """The equation in its unknown parameters. Raises InputError where there is none, and for fewer
    samples than unknown parameters. A (n, f) and y (n,) are in the units of the equation."""
    parameters = equation.parameters
    unknown = parameters.unknown
    where = f"equation of {equation.response}"
    if not unknown:
        raise InputError("every parameter is fixed or tied", where, "leave one free")
    mix, known = parameters.jacobian, parameters.offset
    matrix, response = equation.stacked()
    if len(response) <= len(unknown):
        raise InputError(
            f"{len(response)} samples cannot give {len(unknown)} estimates", where, "fly longer"
        )
    return Reduced(
        equation,
        unknown,
        mix,
        known,
        matrix @ mix,
        response - matrix @ known,
        equation.lengths,
    )


@dataclass(frozen=True, eq=False)
class Directions:
    """Columns that move, scaled to unit length, by singular values: ``A_e / scale = U S V'`` (001,
    eq. 31).

    Parameters
    ----------
    excited : (f,) columns that move.
    scale : (e,) lengths of these columns.
    left, singular, right : U (n, r), S (r,) and V (e, r) of the r directions that the records
        determine.
    """

    excited: Mask
    scale: Array
    left: Array
    singular: Array
    right: Array


def directions(problem: Reduced) -> Directions:
    """Of a problem with at least one column that moves; else InputError. Scale (e,), U (n, r), S
    (r,), V (e, r)."""
    excited = problem.excited
    if not excited.any():
        raise InputError(
            "nothing moves in these records",
            f"equation of {problem.equation.response}",
            "fly a manoeuvre that excites a term",
        )
    columns = problem.columns[:, excited]
    scale = np.linalg.norm(columns, axis=0)
    left, singular, right = np.linalg.svd(columns / scale, full_matrices=False)
    rank = int(np.sum(singular > _DEPENDENT * singular[0]))
    return Directions(excited, scale, left[:, :rank], singular[:rank], right[:rank].T)


def whitened(problem: Reduced, left: Array, noise: NoiseModel, rank: int) -> Array:
    """Covariance (r, r) of ``U' v`` for coloured residuals v, with the loss of degrees of freedom
    by `rank` estimates restored. left : U (n, r). In the square of the response's unit. Morelli &
    Klein, 1997."""
    middle = sum(
        (noise.summed(block) for block in problem.blocks(left)), np.zeros((left.shape[1],) * 2)
    )
    return middle * noise.independent / max(noise.independent - rank, 1.0)


def combination(names: Sequence[str], weights: Array) -> str:
    """Return a direction (f,) in words: ``0.71 Cm_q - 0.70 Cm_alphadot``, without its small parts.

    >>> combination(["a", "b", "c"], np.array([0.7071, -0.7071, 0.001]))
    '0.71 a - 0.71 b'
    """
    weights = weights * np.sign(weights[np.argmax(np.abs(weights))] or 1.0)
    order = sorted(range(len(names)), key=lambda k: -abs(weights[k]))
    shown = [k for k in order if abs(weights[k]) > 0.1 * np.abs(weights).max()]
    terms = [f"{'-' if weights[k] < 0 else '+'} {abs(weights[k]):.2f} {names[k]}" for k in shown]
    return " ".join(terms).removeprefix("+ ")


def answer(
    method: str,
    problem: Reduced,
    estimates: Array,
    covariance: Array,
    noise: NoiseModel,
    rank: int,
    *,
    standings: Standings | None = None,
    white: Array | None = None,
    assumes: Sequence[str] = (),
    notes: Sequence[str] = (),
) -> Fit:
    """Return the `Fit` of estimates (f,) [SI units] with covariance (f, f).

    noise : of the residuals. rank : number of directions that were estimated.
    standings : of the parameters that are not simply estimated. Values of those that are not
        excited or not identifiable are not shown; the model contains them at `estimates`.
    white : (f,) standard errors as if the residuals were white, None for none.
    """
    standings = standings or {}
    errors = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    lower = np.full(len(errors), np.nan) if white is None else white
    named = dict(zip(problem.names, zip(estimates, errors, lower, strict=True), strict=True))
    items = [
        _estimate(item, named, problem.equation.parameters, standings)
        for item in problem.equation.parameters.items
    ]
    theta = problem.mix @ estimates + problem.known
    output, records = problem.equation.response, problem.equation.records
    fitted = {record.name: {output: record.regressors @ theta} for record in records}
    residuals = {
        record.name: {output: record.response - fitted[record.name][output]} for record in records
    }
    left = problem.response - problem.columns @ estimates
    freedom = max(noise.independent - rank, 1.0)
    return Fit(
        method=method,
        estimates=tuple(items),
        names=problem.names,
        covariance=covariance,
        residuals=residuals,
        fitted=fitted,
        times=elapsed(records),
        noise={output: float(np.sqrt(left @ left / max(len(left) - rank, 1)))},
        theil={
            record.name: {output: theil(fitted[record.name][output], record.response)}
            for record in records
        },
        degrees_of_freedom=freedom,
        assumes=tuple(assumes),
        notes=(
            *notes,
            *_of_length(noise, rank),
            *_close(problem.names, covariance, standings),
            *_beyond(list(zip(problem.equation.parameters.items, items, strict=True))),
            *_overall(fitted, problem.equation),
        ),
    )


def _estimate(
    item: Parameter,
    named: Mapping[str, tuple[float, float, float]],
    parameters: Parameters,
    standings: Standings,
) -> ParameterEstimate:
    if item.tied is not None:
        other, factor = item.tied
        source = _estimate(parameters[other], named, parameters, standings)
        return ParameterEstimate(
            item.name,
            factor * source.value,
            abs(factor) * source.standard_error,
            item.unit,
            "tied",
            f"{factor:g} times {other}"
            + ("" if source.standing == "estimated" else f", which is {source.standing}"),
        )
    if not item.free:
        return ParameterEstimate(item.name, item.value, 0.0, item.unit, "fixed", "by the model")
    value, error, white = named[item.name]
    standing, reason = standings.get(item.name, ("estimated", ""))
    if standing in ("not excited", "not identifiable"):
        value = error = white = np.nan
    elif standing == "left out":
        error = white = np.nan
    return ParameterEstimate(
        item.name, float(value), float(error), item.unit, standing, reason, float(white)
    )


def _of_length(noise: NoiseModel, rank: int) -> list[str]:
    """A warning where intervals are known to be too narrow."""
    if noise.independent >= ENOUGH_PER_ESTIMATE * rank:
        return []
    return [
        f"Too short: the residuals count as {noise.independent:.0f} independent samples for"
        f" {rank} estimates; below {ENOUGH_PER_ESTIMATE} for each, 95 % intervals hold the truth"
        " less often than that."
    ]


def _close(names: Sequence[str], covariance: Array, standings: Standings) -> list[str]:
    """A sentence for each pair of estimates that the records hardly separate."""
    deviation = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    notes = []
    for i, one in enumerate(names):
        for j in range(i + 1, len(names)):
            size = deviation[i] * deviation[j]
            if size > 0.0 and not {one, names[j]} & set(standings):
                correlation = covariance[i, j] / size
                if abs(correlation) > _CLOSE:
                    notes.append(
                        f"The records hardly separate {one} and {names[j]}: their estimates are"
                        f" correlated by {correlation:.3f}."
                    )
    return notes


def _beyond(items: Sequence[tuple[Parameter, ParameterEstimate]]) -> list[str]:
    """A sentence where a method that has no bounds ends beyond one."""
    names = [
        item.name
        for item, estimate in items
        if estimate.standing == "estimated" and not item.lower <= estimate.value <= item.upper
    ]
    if not names:
        return []
    return [f"This method has no bounds: {', '.join(names)} lies beyond the bounds given."]


def _overall(fitted: Mapping[str, Mapping[str, Array]], equation: LinearEquation) -> list[str]:
    """Theil's statistics over all records together, where there are several."""
    if len(equation.records) < 2:
        return []
    output = equation.response
    all_fitted = np.concatenate([fitted[record.name][output] for record in equation.records])
    whole = theil(all_fitted, equation.stacked()[1])
    return [
        f"All {len(equation.records)} records of {output} together: fit"
        f" {whole.fit_percent:.1f} %, of the error {whole.bias:.3f} bias,"
        f" {whole.variance:.3f} variance, {whole.covariance:.3f} covariance."
    ]
