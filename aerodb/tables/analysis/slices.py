"""Slices through two databases where they differ: coefficients over one variable, all other inputs
neutral."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from aerodb.nomenclature import AXES, SHARES, in_order
from aerodb.support import Array
from aerodb.tables.analysis.arguments import scattered_over
from aerodb.tables.analysis.nodes import table_grids
from aerodb.tables.analysis.sensitivity import slopes_by_parameter
from aerodb.tables.analysis.slopes import new_increments
from aerodb.tables.analysis.unstated_inputs import neutral_point
from aerodb.tables.database import AeroDatabase
from aerodb.tables.increment import Increment
from aerodb.tables.parameter import covariance_of, sigma_of
from aerodb.tables.reference import WIND_AXES

#: Most slices of two databases; `diff` lists every node.
MOST_SLICES: Final = 12
_POINTS: Final = 241
_CELLS_BEYOND: Final = 3.0
#: A smaller change of a coefficient is rounding.
_SAME: Final = 1e-12

#: Channels and states from 0 to 1.
_FROM_0_TO_1: Final = (*SHARES, "flow_attachment")
_NEVER_NEGATIVE: Final = (
    *_FROM_0_TO_1,
    "V",
    "mach",
    "qbar",
    "rho",
    "temperature",
    "static_pressure",
    "mass",
    "height_above_ground",
)


@dataclass(frozen=True, eq=False)
class Slice:
    """Coefficients of two databases on `axis` over `variable`.

    Parameters
    ----------
    at : (n,) values of the variable, SI.
    before, after : (n,), dimensionless.
    error : (n,) standard error of the increments that only one of the databases has, and of the
        parameters that differ. inside : (n,) whether their flights have been there.
    held : other inputs -> value, SI.
    """

    axis: str
    variable: str
    at: Array
    before: Array
    after: Array
    error: Array
    inside: NDArray[np.bool_]
    held: Mapping[str, float]

    @property
    def change(self) -> Array:
        """(n,) after - before, dimensionless."""
        return self.after - self.before

    @property
    def largest(self) -> float:
        """Largest change where flights have been; anywhere, where they have been nowhere."""
        where = self.inside if np.any(self.inside) else np.ones_like(self.inside)
        return float(np.max(np.abs(self.change[where]), initial=0.0))


@lru_cache(maxsize=1)  # a page asks for its tables, and again for its figures
def slices(before: AeroDatabase, after: AeroDatabase) -> tuple[Slice, ...]:
    """Return the slices that show how two databases differ, at most `MOST_SLICES`: per axis that
    changes, the variables over which it changes most. Each axis has an equal share of them."""
    increments = _new(before, after)
    by_axis: dict[str, list[Slice]] = {}
    for axis in in_order({*before.axes, *after.axes}):
        for variable, reach in _ranges(before, after, increments).items():
            for _ in range(2):  # over all that is known, then closer where something changes
                cut = _cut(before, after, axis, variable, np.linspace(*reach, _POINTS))
                reach = _closer(cut.at, cut.change)
            change = cut.change
            # A variable that only carries a constant change along says nothing that alpha does not.
            varies = variable == "alpha" or np.ptp(change) > 0.02 * np.max(
                np.abs(change), initial=0.0
            )
            if np.any(np.abs(change) > _SAME) and varies:
                by_axis.setdefault(axis, []).append(cut)
    share = max(1, MOST_SLICES // max(1, len(by_axis)))
    kept = []
    for cuts in by_axis.values():
        largest = sorted(cuts, key=lambda cut: -float(np.ptp(cut.change)))[:share]
        kept += [cut for cut in cuts if any(cut is each for each in largest)]
    return tuple(_with_errors_of_parameters(before, after, cut) for cut in kept)


def slice_over(
    before: AeroDatabase, after: AeroDatabase, axis: str, variable: str, at: Array
) -> Slice:
    """Return the slice on a body axis at given values (n,) of a variable [SI]."""
    return _with_errors_of_parameters(before, after, _cut(before, after, axis, variable, at))


def _cut(before: AeroDatabase, after: AeroDatabase, axis: str, variable: str, at: Array) -> Slice:
    """`slice_over` without the errors of parameters, which take two databases for each of them."""
    increments, flown = _new(before, after), _flown(before, after)
    point = {**neutral_point(before, increments), **neutral_point(after, increments)}
    if not increments:  # speeds at which there are coefficients
        point |= {n: 0.5 * sum(ends) for n, ends in flown.items() if n in _NEVER_NEGATIVE}
    held = {name: value for name, value in point.items() if name != variable}
    channels = {**{name: np.full(len(at), value) for name, value in held.items()}, variable: at}
    nothing = np.zeros(len(at))
    old, new = (
        database.predict(channels).coefficients.get(axis, nothing) for database in (before, after)
    )
    variance = np.zeros(len(at))
    inside = np.full(len(at), bool(increments or flown))
    if variable in flown:
        inside &= (flown[variable][0] <= at) & (at <= flown[variable][1])
    for increment in (each for each in increments if acts_on(each, axis)):
        own = increment.evaluate(after.resolved(sorted(increment.names), channels))
        variance = variance + own.standard_error**2
        inside = inside & own.inside
    return Slice(axis, variable, at, old, new, np.sqrt(variance), inside, held)


def changed_parameters(before: AeroDatabase, after: AeroDatabase) -> list[str]:
    """Return the parameters of both databases whose values differ, first those that moved by the
    most standard errors; those without an error come before them."""
    moved = {
        name: abs(value - before.parameters[name])
        / (sigma_of(after.variables[name].uncertainty) or np.finfo(np.float64).tiny)
        for name, value in after.parameters.items()
        if before.parameters.get(name, value) != value
    }
    return sorted(moved, key=lambda name: -moved[name])


def _flown(before: AeroDatabase, after: AeroDatabase) -> dict[str, tuple[float, float]]:
    """Variable -> what all flights that changed parameters have flown of it, lowest and highest."""
    found: dict[str, tuple[float, float]] = {}
    for name in changed_parameters(before, after):
        known = after.variables[name].parameter
        for variable, (low, high) in ({} if known is None else known.flown).items():
            first, last = found.get(variable, (-np.inf, np.inf))
            found[variable] = max(first, low), min(last, high)
    return found


def _with_errors_of_parameters(before: AeroDatabase, after: AeroDatabase, cut: Slice) -> Slice:
    """The slice with the errors of the parameters that differ, correlated as stated."""
    names = changed_parameters(before, after)
    if not names:
        return cut
    n = len(cut.at)
    held = {name: np.full(n, value) for name, value in cut.held.items()}
    channels = {**held, cut.variable: cut.at}
    slopes = np.stack(
        [
            np.broadcast_to(slopes_by_parameter(after, name, channels).get(cut.axis, 0.0), (n,))
            for name in names
        ]
    )
    covariance = covariance_of({name: after.variables[name].uncertainty for name in names})
    variance = np.einsum("in,ij,jn->n", slopes, covariance, slopes)
    return replace(cut, error=np.sqrt(cut.error**2 + variance))


def acts_on(increment: Increment, axis: str) -> bool:
    """Return whether an increment changes the coefficient on a body axis."""
    return increment.axis == axis or (increment.axis in WIND_AXES and axis in AXES[:3])


def _new(before: AeroDatabase, after: AeroDatabase) -> tuple[Increment, ...]:
    return (*new_increments(after, before), *new_increments(before, after))


def _ranges(
    before: AeroDatabase, after: AeroDatabase, increments: Sequence[Increment]
) -> dict[str, tuple[float, float]]:
    """Variables to slice over, alpha first, with ranges that hold envelopes and all breakpoints."""
    marks: dict[str, list[float]] = {"alpha": []}
    for increment in increments:
        for name, interval in increment.envelope.items():
            # where tables have no cells, a cell is as wide as the envelope: nobody reads alpha at
            # 50 deg
            beyond = min(
                _CELLS_BEYOND * interval.cell,
                max(interval.high - interval.low, interval.cell / _CELLS_BEYOND),
            )
            lowest = 0.0 if name in _NEVER_NEGATIVE else -np.inf
            highest = 1.0 if name in _FROM_0_TO_1 else np.inf
            marks.setdefault(name, []).extend(
                (max(lowest, interval.low - beyond), min(highest, interval.high + beyond))
            )
    flown = _flown(before, after)
    known = {*before.inputs, *after.inputs, *marks}
    for database in (before, after):
        for grid in table_grids(database).values():
            for name, values in zip(grid.channels, grid.values, strict=True):
                marks.setdefault(name, []).extend((float(values[0]), float(values[-1])))
        for name in database.inputs:
            for values in scattered_over(name, database):
                marks.setdefault(name, []).extend((float(values[0]), float(values[-1])))
    if not increments:  # as far again as flights that changed parameters have been
        for name, (low, high) in flown.items():
            least = 0.0 if name in _NEVER_NEGATIVE else -np.inf
            marks[name] = [max(least, 2.0 * low - high), 2.0 * high - low]
    return {
        name: (min(v), max(v))
        for name, v in marks.items()
        if name in known and v and max(v) > min(v)
    }


def _closer(at: Array, change: Array) -> tuple[float, float]:
    """Range of `at` (n,) in which there is a change, plus a quarter of it on both sides.

    The whole range where there is no change.
    """
    there = at[np.abs(change) > 1e-9 * np.max(np.abs(change), initial=1e-3)]
    if not len(there):
        return float(at[0]), float(at[-1])
    room = 0.25 * float(there[-1] - there[0]) + float(at[1] - at[0])
    return max(float(at[0]), float(there[0]) - room), min(float(at[-1]), float(there[-1]) + room)
