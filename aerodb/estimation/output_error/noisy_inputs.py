"""What noise of logged deflections does to a model that is simulated, and its correction.

A deflection with noise moves the model by that noise too. A model with less effectiveness then fits
better, and what the noise of one flight happened to be goes into the estimates. What it does on
average is taken off (`moved_by_noise`), and its scatter is added to the covariance.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np

from aerodb.estimation.dynamic_model import DynamicModel
from aerodb.estimation.input_noise import (
    Equations,
    moved_by_noise,
    told_of_move,
    with_noise_once_more,
)
from aerodb.estimation.output_error.gauss_newton import (
    OutputErrorSolution,
    equations_with,
    projected,
    search,
)
from aerodb.estimation.output_error.likelihood import Covariance, Normal, whitened
from aerodb.estimation.parameters import bounds_of
from aerodb.estimation.time_history import TimeHistory
from aerodb.support import Array

#: Draws of the noise, each with both signs, of which what noise does on average is taken.
_DRAWS: Final = 8
#: Draws of which its scatter is taken: it has an error of an eighth, so that two standard errors
#: hold what they say within half a per cent.
_SCATTER_DRAWS: Final = 32


def without_input_noise(
    model: DynamicModel, records: Sequence[TimeHistory], solution: OutputErrorSolution
) -> tuple[OutputErrorSolution, Array, tuple[str, ...]]:
    """Return the solution without the draw of noisy deflections, the covariance (f, f) of what
    their noise adds to the estimates, and what is to be told, in sentences.

    A search without an end stays as it is, as does one in which noise is most of what moves the
    deflections, and then this is told.
    """
    unknown, f = model.parameters.unknown, len(solution.vector)
    as_it_is = solution, np.zeros((f, f)), ()
    if not solution.converged:
        return as_it_is
    lower, upper = bounds_of(unknown)
    free = (solution.vector > lower) & (solution.vector < upper)
    prior = solution.information - solution.normal.information

    def noisier(draw: int) -> tuple[Equations, Equations] | None:
        sides = _noisier(model, records, solution, draw)
        if sides is None:
            return None
        first, second = ((side.information + prior, side.gradient) for side in sides)
        return first, second

    def directions_of(information: Array) -> Array:
        return projected(information, solution.normal, free)

    normal = solution.normal
    try:
        mean = moved_by_noise(noisier, solution.information, normal.gradient, directions_of, _DRAWS)
    except ValueError as error:
        return *as_it_is[:2], (f"Effects of controls may be too small: {error}.",)
    if mean is None:
        return as_it_is
    directions = directions_of(solution.information)
    vector = np.clip(solution.vector - mean, lower, upper)
    values = {item.name: float(value) for item, value in zip(unknown, vector, strict=True)}
    placed: Any = replace(model, parameters=model.parameters.changed(values))  # type: ignore[type-var]
    corrected = search(placed, records, _kind(solution), 0, solution.beside)
    if not np.isfinite(corrected.noise.log_likelihood):
        return as_it_is
    return (
        replace(corrected, converged=True, iterations=solution.iterations),
        _scatter(model, records, solution, directions),
        told_of_move(mean, directions),
    )


def _scatter(
    model: DynamicModel,
    records: Sequence[TimeHistory],
    solution: OutputErrorSolution,
    directions: Array,
) -> Array:
    """Covariance (f, f) of what a draw of the noise does to the estimates, to first order: by the
    outputs alone, with the slopes of the solution."""
    values = model.parameters.values(solution.vector[:, None])
    moves = np.zeros((_SCATTER_DRAWS, len(directions)))
    for record, own, response in zip(records, solution.records, solution.responses, strict=True):
        none = np.zeros(response.outputs.shape)
        _, slopes = whitened(own, none, response.slopes, solution.noise)
        weighted = solution.beside.counted(slopes)
        for draw, move in enumerate(moves):
            if (both := with_noise_once_more(record.inputs, record.name, draw)) is None:
                break
            above, below = (
                model.simulated(values, replace(record, inputs=side))[:, :, 0] for side in both
            )
            apart = np.where(own.mask, 0.5 * (above - below), 0.0)
            white, _ = whitened(own, apart, np.zeros((*apart.shape, 0)), solution.noise)
            move[response.columns] += np.einsum("no,nof->f", white, weighted)
    moved = moves @ directions @ directions.T
    return np.asarray(moved.T @ moved / _SCATTER_DRAWS)


def _noisier(
    model: DynamicModel, records: Sequence[TimeHistory], solution: OutputErrorSolution, draw: int
) -> tuple[Normal, Normal] | None:
    """The normal equations at the solution with a draw of the noise once more, with both signs;
    None without noise."""
    noisy = [with_noise_once_more(record.inputs, record.name, draw) for record in records]
    if all(each is None for each in noisy):
        return None
    first, second = (
        equations_with(
            model,
            [
                record if both is None else replace(record, inputs=both[side])
                for record, both in zip(records, noisy, strict=True)
            ],
            solution,
            _kind(solution),
        )
        for side in (0, 1)
    )
    return first, second


def _kind(solution: OutputErrorSolution) -> Covariance:
    found = solution.noise.covariance
    return "full" if np.any(found != np.diag(np.diag(found))) else "diagonal"
