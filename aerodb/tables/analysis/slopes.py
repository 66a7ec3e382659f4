"""New sign changes of dC_lift/dalpha and dCm/dalpha, over the whole range of the tables.

Inside the data a sign may change: the flights measured it. Outside the data a new sign change comes
only from the way an increment fades. A control law designed on it would be designed for an aircraft
that does not exist (docs/method/updates.md, "Envelope").
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from aerodb.support import Array
from aerodb.tables.analysis.nodes import air_beside, table_grids
from aerodb.tables.analysis.unstated_inputs import neutral_point
from aerodb.tables.database import AeroDatabase
from aerodb.tables.increment import Increment
from aerodb.tables.reference import body_to_wind

#: Quantity -> the axes whose increments change it.
QUANTITIES: dict[str, frozenset[str]] = {
    "C_lift": frozenset(("CX", "CZ", "C_lift", "C_drag")),
    "Cm": frozenset(("Cm",)),
}

#: Points along alpha, in addition to all breakpoints and envelope edges.
_POINTS = 241
#: A slope below this fraction of the baseline's largest counts as zero: rounding, or a table held
#: at its edge.
_FLAT = 1e-6
#: Number of cells beyond the envelope that are examined; an increment has faded after two.
_CELLS_BEYOND = 3.0


@dataclass(frozen=True)
class SignChange:
    """A sign change of the slope of a quantity.

    Parameters
    ----------
    quantity : key of `QUANTITIES`.
    alpha : where the sign changes [rad].
    rising : whether it changes from negative to positive.
    at : inputs that are not neutral there, SI.
    """

    quantity: str
    alpha: float
    rising: bool
    at: Mapping[str, float]


def new_increments(baseline: AeroDatabase, candidate: AeroDatabase) -> tuple[Increment, ...]:
    """Return the increments of `candidate` that `baseline` lacks; an increment that was only folded
    into a table is not new."""
    known = [_identity(increment) for increment in baseline.increments]
    return tuple(
        increment for increment in candidate.increments if _identity(increment) not in known
    )


def new_sign_changes(baseline: AeroDatabase, candidate: AeroDatabase) -> tuple[SignChange, ...]:
    """Sign changes of dC_lift/dalpha and dCm/dalpha along alpha that `candidate` has outside the
    data and `baseline` lacks.

    Alpha covers the breakpoints of all tables and three cells beyond the envelope. Every other
    input is varied alone: over the ends and the middle of its tables, the edges of its envelope and
    the middle of its fade. Outside the data is where any variable lies beyond the envelope of an
    increment that the candidate adds, or beyond what the flights of a changed parameter have flown.
    A change within one cell of a baseline change in the same direction is not new, only shifted.
    Neither is a change that the flights have measured, where the increment is held or fades in
    another variable. Empty where nothing depends on alpha.

    Alpha is in rad.
    """
    added = new_increments(baseline, candidate)
    if "alpha" not in {*baseline.inputs, *candidate.inputs}:
        return ()
    alpha, tolerance = _alphas((baseline, candidate), added)
    sign_changes, flown = [], dict[str, list[tuple[float, bool]]]()
    for at in _conditions((baseline, candidate), added):  # the neutral condition comes first
        point = {**neutral_point(baseline, added), **neutral_point(candidate, added), **at}
        if "V" in at and candidate.has_loads:
            point |= air_beside({"V": at["V"]})
        channels = {
            **{name: np.full(alpha.size, value) for name, value in point.items()},
            "alpha": alpha,
        }
        before, after = _quantities(baseline, channels), _quantities(candidate, channels)
        for quantity, axes in QUANTITIES.items():
            inside = _inside([i for i in added if i.axis in axes], channels, candidate)
            inside |= _inside_flown(baseline, candidate, channels)
            flat = _FLAT * _largest_slope(alpha, before[quantity])
            nowhere = np.zeros_like(inside)
            # Where the baseline is flat (beyond its tables edge values are held) its slope has no
            # sign to change, and the slope of any fade dominates.
            silent = np.abs(np.diff(before[quantity]) / np.diff(alpha)) <= flat
            outside = _changes(alpha, after[quantity], inside, flat, silent)
            alike = [
                change
                for change in _changes(alpha, after[quantity], nowhere, flat)
                if change not in outside
            ]
            known = _changes(alpha, before[quantity], nowhere, flat) + flown.setdefault(
                quantity, alike
            )
            for where, rising in outside:
                if not any(up == rising and abs(there - where) <= tolerance for there, up in known):
                    sign_changes.append(SignChange(quantity, where, rising, at))
    return tuple(sign_changes)


def _identity(increment: Increment) -> tuple[object, ...]:
    envelope = tuple(sorted(increment.envelope.items()))
    estimates = tuple(increment.estimates.tolist())
    return (
        increment.axis,
        increment.regressors,
        estimates,
        envelope,
        increment.covariance.tobytes(),
        increment.flights,
    )


def _alphas(databases: Sequence[AeroDatabase], added: Iterable[Increment]) -> tuple[Array, float]:
    """Values of alpha to examine, increasing [rad], and the distance within which two sign changes
    count as one."""
    marks, cells = _breakpoints(databases).get("alpha", []), []
    for increment in added:
        if "alpha" in increment.envelope:
            edge = increment.envelope["alpha"]
            cells.append(edge.cell)
            marks += [edge.low - k * edge.cell for k in (0, 1, 2, _CELLS_BEYOND)]
            marks += [edge.high + k * edge.cell for k in (0, 1, 2, _CELLS_BEYOND)]
    low, high = (min(marks), max(marks)) if marks else (-np.pi / 18, np.pi / 6)
    if high == low:
        low, high = low - np.pi / 18, high + np.pi / 18
    grid = np.unique(np.concatenate([np.linspace(low, high, _POINTS), marks]))
    # Equal marks can differ by rounding, and a slope over such a gap is noise.
    apart = np.concatenate([[True], np.diff(grid) > 1e-9 * (high - low)])
    return grid[apart], max([*cells, 2.0 * (high - low) / _POINTS])


def _breakpoints(databases: Sequence[AeroDatabase]) -> dict[str, list[float]]:
    """Channel -> breakpoints of all tables over it, in the unit of the channel."""
    by_channel: dict[str, list[float]] = {}
    for database in databases:
        for grid in table_grids(database).values():
            for name, values in zip(grid.channels, grid.values, strict=True):
                by_channel.setdefault(name, []).extend(values.tolist())
    return by_channel


def _conditions(
    databases: Sequence[AeroDatabase], added: Iterable[Increment]
) -> list[dict[str, float]]:
    """Inputs that differ from the neutral point: none, then one input at a time at each of its
    marks."""
    marks = {
        name: {min(v), float(np.median(v)), max(v)} for name, v in _breakpoints(databases).items()
    }
    for increment in added:
        for name, interval in increment.envelope.items():
            beyond = 1.5 * interval.cell
            edges = {interval.low - beyond, interval.low, interval.high, interval.high + beyond}
            marks[name] = marks.get(name, set()) | edges
    used = set[str]().union(*(database.inputs for database in databases)) | {
        "p_hat",
        "q_hat",
        "r_hat",
        "alphadot_hat",
    }
    return [
        {},
        *(
            {name: x}
            for name in sorted(marks)
            if name in used and name != "alpha"
            for x in sorted(marks[name])
        ),
    ]


def _quantities(database: AeroDatabase, channels: Mapping[str, Array]) -> dict[str, Array]:
    values = database.predict(channels).coefficients
    alpha = channels["alpha"]
    beta = channels.get("beta", np.zeros_like(alpha))
    _, _, lift = body_to_wind(values["CX"], values["CY"], values["CZ"], alpha, beta)
    return {"C_lift": lift, "Cm": values["Cm"]}


def _inside(
    increments: Sequence[Increment], channels: Mapping[str, Array], candidate: AeroDatabase
) -> NDArray[np.bool_]:
    """(n,) where the flights of every increment have been, with states at their steady value; false
    everywhere without increments."""
    alpha = channels["alpha"]
    inside = np.full(alpha.size, bool(increments))
    for increment in increments:
        values = candidate.resolved(increment.envelope, channels)
        for name, interval in increment.envelope.items():
            inside &= interval.contains(values[name])
    return inside


def _inside_flown(
    baseline: AeroDatabase, candidate: AeroDatabase, channels: Mapping[str, Array]
) -> NDArray[np.bool_]:
    """(n,) where the flights of every parameter with another value have been; false everywhere
    where no parameter has."""
    alpha = channels["alpha"]
    changed = [
        candidate.variables[name].parameter
        for name, value in candidate.parameters.items()
        if baseline.parameters.get(name) != value
    ]
    inside = np.full(alpha.size, bool(changed))
    for parameter in changed:
        flown = {} if parameter is None else parameter.flown
        inside &= "alpha" in flown
        for name, (low, high) in flown.items():
            if name in channels:
                inside &= (low <= channels[name]) & (channels[name] <= high)
    return inside


def _largest_slope(alpha: Array, values: Array) -> float:
    slopes = np.abs(np.diff(values) / np.diff(alpha))
    return float(np.max(slopes[np.isfinite(slopes)], initial=0.0))


def _changes(
    alpha: Array,
    values: Array,
    inside: NDArray[np.bool_],
    flat: float,
    silent: NDArray[np.bool_] | None = None,
) -> list[tuple[float, bool]]:
    """Alphas where the slope changes sign, and whether it rises, between intervals that are not
    `silent`.

    A change between two intervals of which one is inside the data is not counted: at the edge of
    the envelope the slope returns to that of the baseline.
    """
    slopes = np.diff(values) / np.diff(alpha)
    data = inside[:-1] & inside[1:]
    real = np.flatnonzero(np.isfinite(slopes) & (np.abs(slopes) > flat))
    quiet = np.zeros_like(data) if silent is None else silent
    changes = []
    for one, next_one in pairwise(real):
        if slopes[one] * slopes[next_one] < 0 and not (
            data[one] or data[next_one] or quiet[one] or quiet[next_one]
        ):
            changes.append(
                (float((alpha[one + 1] + alpha[next_one]) / 2.0), bool(slopes[next_one] > 0))
            )
    return changes
