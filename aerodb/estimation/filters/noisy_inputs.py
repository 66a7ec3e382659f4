"""What noise of logged deflections does to a filter's estimates, and its correction.

A filter takes the noise of deflections for process noise, so that its scatter is in the standard
errors already. On average the noise still draws the effectiveness of controls towards zero.
"""

from dataclasses import replace
from typing import Final

import numpy as np

from aerodb.estimation.filters.filter_problem import FilterProblem, Point
from aerodb.estimation.filters.scoring import Optimum, scored
from aerodb.estimation.input_noise import (
    Equations,
    moved_by_noise,
    told_of_move,
    with_noise_once_more,
)
from aerodb.estimation.output_error import no_equations, projected
from aerodb.estimation.parameters import bounds_of
from aerodb.support import Array

#: Draws of the noise, each with both signs; fewer than of output error, as a filter takes seconds
#: for each.
_DRAWS: Final = 4


def without_input_noise(optimum: Optimum) -> tuple[Optimum, tuple[str, ...]]:
    """Return the optimum without what noise of deflections does to its parameters on average, and
    what is to be told, in sentences.

    An optimum stays as it is where noise is most of what moves the deflections, and this is told.
    """
    problem, point = optimum.problem, optimum.point
    f = len(point.vector)
    lower, upper = bounds_of(problem.model.parameters.unknown)
    free = (point.vector > lower) & (point.vector < upper)

    def noisier(draw: int) -> tuple[Equations, Equations] | None:
        noisy = [with_noise_once_more(each.inputs, each.name, draw) for each in problem.records]
        if all(each is None for each in noisy):
            return None
        sides = list[Equations]()
        for side in (0, 1):
            records = tuple(
                record if both is None else replace(record, inputs=both[side])
                for record, both in zip(problem.records, noisy, strict=True)
            )
            sides.append(_equations(replace(problem, records=records), point))
        return sides[0], sides[1]

    def directions_of(information: Array) -> Array:
        return projected(information, no_equations(f), free)

    information, gradient = _equations(problem, point)
    try:
        move = moved_by_noise(noisier, information, gradient, directions_of, _DRAWS)
    except ValueError as error:
        return optimum, (f"Effects of controls may be too small: {error}.",)
    if move is None:
        return optimum, ()
    placed = replace(point, vector=np.clip(point.vector - move, lower, upper))
    corrected, _ = scored(problem, placed)
    if not np.isfinite(corrected.log_likelihood):
        return optimum, ()
    corrected = replace(corrected, converged=optimum.converged, iterations=optimum.iterations)
    return corrected, told_of_move(move, directions_of(optimum.information[:f, :f]))


def _equations(problem: FilterProblem, point: Point) -> Equations:
    found, gradient = scored(problem, point)
    f = len(gradient)
    return found.information[:f, :f], gradient
