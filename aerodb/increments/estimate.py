"""Declared increments from the residuals of several flights (003, eq. 7): estimate, doubt, and
fence them in."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import lsq_linear

from aerodb.coefficients import Comparison, band_limited
from aerodb.errors import InputError
from aerodb.estimation import (
    Regression,
    Theil,
    least_squares,
    own_constants,
    theil,
    with_mean_constant,
)
from aerodb.flight import Flight
from aerodb.increments.model_file import (
    CONSTANT,
    DeclaredIncrement,
    ModelFile,
    Regressor,
    check_channels,
    expand,
)
from aerodb.nomenclature import MOMENT_AXES
from aerodb.support import Array
from aerodb.tables import (
    HAT_RATES,
    QUANTITIES,
    AeroDatabase,
    Increment,
    Interval,
    evaluate,
    flown_envelope,
    hat_rate,
    new_sign_changes,
)

#: Two estimates correlated beyond this cannot be told apart by these flights: reported as an alias
#: group.
ALIAS_CORRELATION = 0.95

#: What one flight gives to an axis: its channels, its samples that are used, its comparison.
_Used = tuple[Mapping[str, Array], np.ndarray, Comparison]

#: How often a fade is made twice as long to keep the sign of a slope.
LENGTHENINGS = 4


@dataclass(frozen=True)
class AxisUpdate:
    """What was estimated on one axis.

    names, estimates, standard_errors, vif: (k,); covariance (k, k), coloured. `at_bound` names
    estimates that ended on a bound; `not_excited` names declared terms that these flights do not
    move, which were left out; `aliases` are groups of estimates that these flights cannot separate.
    theil compares database + increment with measurement.
    """

    axis: str
    names: tuple[str, ...]
    estimates: Array
    standard_errors: Array
    covariance: Array
    correlation: Array
    vif: Array
    r_squared: float
    theil: Theil
    at_bound: tuple[str, ...]
    not_excited: tuple[str, ...]
    aliases: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class ConsiderParameter:
    """A constant error that one flight's channels may still have, invisible in its residual:
    `sigma`, one standard error; axis -> (n,) `columns`, by how much it moves the residual per unit;
    `shared`: the same error, by `name`, in all flights."""

    name: str
    sigma: float
    shared: bool
    columns: Mapping[str, Array]


@dataclass(frozen=True)
class Update:
    """The candidate database and what was estimated for it, axis by axis."""

    candidate: AeroDatabase
    axes: tuple[AxisUpdate, ...]
    flights: tuple[str, ...]


def estimate_increments(
    flights: Sequence[Flight],
    comparisons: Sequence[Comparison],
    model: ModelFile,
    database: AeroDatabase,
    doubts: Mapping[str, Sequence[ConsiderParameter]] | None = None,
) -> Update:
    """Estimates the declared increments on top of `database` from flights and their comparisons
    (same order).

    doubts : flight -> what its sensors may have left wrong, which the standard errors then hold as
    well. Raises InputError for a term that names an unknown channel, and where a declared axis
    cannot be estimated at all.
    """
    channels = [_with_hat_rates(flight.channels, database) for flight in flights]
    shared = set.intersection(*(set(c) for c in channels)) if channels else set()
    check_channels(model, shared)
    results = [
        _axis(declared, flights, channels, comparisons, database, doubts or {})
        for declared in model.increment
    ]
    increments = tuple(increment for _, increment in results)
    candidate = replace(database, increments=(*database.increments, *increments))
    return Update(
        candidate, tuple(axis for axis, _ in results), tuple(flight.id for flight in flights)
    )


def keep_slope_signs(update: Update, database: AeroDatabase) -> Update:
    """The update with fades lengthened where, over one table cell, dC_lift/dalpha or dCm/dalpha
    would change sign outside the data.

    An increment of either sign fades to the baseline somewhere, and where the baseline's slope is
    small its own fade can outweigh it. The cell of alpha of the increments concerned is doubled
    until no new sign change is left; where LENGTHENINGS doublings do not reach that, the update is
    returned as it came, and the gate will say so.
    """
    candidate, first = update.candidate, len(database.increments)
    for doublings in range(LENGTHENINGS + 1):
        changes = new_sign_changes(database, candidate)
        if not changes:
            return replace(update, candidate=candidate)
        axes = frozenset[str]().union(*(QUANTITIES[change.quantity] for change in changes))
        kept, added = candidate.increments[:first], candidate.increments[first:]
        longer = tuple(
            _fading_slowly(i, 2 ** (doublings + 1)) if i.axis in axes else i for i in added
        )
        candidate = replace(candidate, increments=(*kept, *longer))
    return update


def _fading_slowly(increment: Increment, cells: int) -> Increment:
    """The increment with its alpha cell doubled; `cells` says how many table cells long that is."""
    if "alpha" not in increment.envelope:
        return increment
    interval = increment.envelope["alpha"]
    longer = Interval(interval.low, interval.high, 2.0 * interval.cell)
    return replace(
        increment, envelope={**increment.envelope, "alpha": longer}, lengthened_cells=cells
    )


def _axis(
    declared: DeclaredIncrement,
    flights: Sequence[Flight],
    channels: Sequence[Mapping[str, Array]],
    comparisons: Sequence[Comparison],
    database: AeroDatabase,
    doubts: Mapping[str, Sequence[ConsiderParameter]],
) -> tuple[AxisUpdate, Increment]:
    axis, regressors = declared.axis, expand(declared)
    records = zip(flights, channels, comparisons, strict=True)
    used = [
        (c, k.usable[axis] & _clean(f, regressors), k) for f, c, k in records if axis in k.usable
    ]
    used = [entry for entry in used if entry[1].any()]
    if not used:
        raise InputError(
            f"no flight gives a usable sample on {axis}",
            "update",
            "remove the axis from the model file",
        )
    matrix = np.concatenate([_columns(axis, regressors, c, k)[good] for c, good, k in used])
    response = np.concatenate([k.residual(axis)[good] for _, good, k in used])
    moving = _excited(matrix, regressors)
    kept = [regressor for regressor, moves in zip(regressors, moving, strict=True) if moves]
    names = [regressor.name for regressor in kept]
    if not kept:
        raise InputError(
            f"no declared term on {axis} is excited by these flights",
            "update",
            "fly a manoeuvre that moves one",
        )
    fit = _fitted(declared, matrix[:, moving], response, names, used, doubts)
    estimates, covariance, at_bound = _constrained(fit, declared)
    measured = np.concatenate([k.measured[axis][good] for _, good, k in used])
    predicted = measured - response + matrix[:, moving] @ estimates
    ids = tuple(k.flight for _, _, k in used)
    names_used = frozenset[str]().union(*(regressor.expression.names for regressor in kept))
    increment = Increment(
        axis=axis,
        regressors=tuple(regressor.expression for regressor in kept),
        estimates=estimates,
        covariance=covariance,
        envelope=flown_envelope(names_used, [(c, good) for c, good, _ in used], database),
        flights=ids,
    )
    deviation = np.sqrt(np.diag(covariance))
    correlation = _correlation(covariance)
    result = AxisUpdate(
        axis=axis,
        names=tuple(names),
        estimates=estimates,
        standard_errors=deviation,
        covariance=covariance,
        correlation=correlation,
        vif=fit.vif,
        r_squared=fit.r_squared,
        theil=theil(predicted, measured),
        at_bound=at_bound,
        not_excited=tuple(r.name for r, moves in zip(regressors, moving, strict=True) if not moves),
        aliases=_aliases(names, correlation),
    )
    return result, increment


def _fitted(
    declared: DeclaredIncrement,
    matrix: Array,
    response: Array,
    names: Sequence[str],
    used: Sequence[_Used],
    doubts: Mapping[str, Sequence[ConsiderParameter]],
) -> Regression:
    """Least squares on the samples of the flights `used`, in order, with one constant or one for
    each of them."""
    axis, lengths, columns, named = (
        declared.axis,
        [int(good.sum()) for _, good, _ in used],
        matrix,
        list(names),
    )
    constant = names.index(CONSTANT) if declared.own_constants else None
    if constant is not None:
        columns, mix = own_constants(matrix, lengths, constant)
        named = [name for name in names if name != CONSTANT] + [
            f"{CONSTANT} of {k.flight}" for _, _, k in used
        ]
    try:
        fit = least_squares(columns, response, named, lengths)
    except ValueError as error:
        remedy = "declare one of them only, or fly them apart"
        raise InputError(f"increment on {axis}: {error}", "update", remedy) from error
    fit = replace(fit, covariance=fit.covariance + _doubted(axis, columns, used, doubts))
    return fit if constant is None else with_mean_constant(fit, mix, names, constant)


def _doubted(
    axis: str,
    matrix: Array,
    used: Sequence[_Used],
    doubts: Mapping[str, Sequence[ConsiderParameter]],
) -> Array:
    """Covariance (k, k) of least-squares estimates that constant errors of the sensors cause;
    matrix (n, k), samples of the flights `used` in order.

    Estimates move by ``(X'X)^-1 X' d`` with what an error of one sigma adds to the residual, d:
    consider covariance (Bierman, *Factorization Methods*, 1977, chapter VIII). One error in all
    flights moves them together, others each on its own.
    """
    gain, start = np.linalg.pinv(matrix), 0
    total = np.zeros((matrix.shape[1], matrix.shape[1]))
    together: dict[str, Array] = {}
    for _, good, comparison in used:
        part, start = slice(start, start + int(good.sum())), start + int(good.sum())
        for doubt in doubts.get(comparison.flight, ()):
            if axis not in doubt.columns:
                continue
            column = doubt.sigma * doubt.columns[axis]
            if axis in MOMENT_AXES and comparison.bandwidth is not None:
                step = float(comparison.time[-1] - comparison.time[0]) / (len(comparison.time) - 1)
                column = band_limited(column, step, comparison.bandwidth)
            moved = gain[:, part] @ column[good]
            if doubt.shared:
                together[doubt.name] = together.get(doubt.name, 0.0) + moved
            else:
                total += np.outer(moved, moved)
    return total + sum(
        (np.outer(moved, moved) for moved in together.values()), np.zeros_like(total)
    )


def _correlation(covariance: Array) -> Array:
    """Correlation (k, k); an estimate that was fixed has none with the others."""
    deviation = np.sqrt(np.diag(covariance))
    scale = np.where(deviation > 0, deviation, 1.0)
    return np.asarray(
        covariance / np.outer(scale, scale) + np.diag(np.where(deviation > 0, 0.0, 1.0))
    )


def _with_hat_rates(channels: Mapping[str, Array], database: AeroDatabase) -> dict[str, Array]:
    """The channels and the rates without dimension that can be made of them, over the database's
    own lengths."""
    hats = {
        name: hat_rate(name, channels, database.reference)
        for name, (rate, _) in HAT_RATES.items()
        if {rate, "V"} <= set(channels)
    }
    return {**channels, **{name: values for name, values in hats.items() if name not in channels}}


def _clean(flight: Flight, regressors: Sequence[Regressor]) -> np.ndarray:
    """Where all channels of the declared terms are good: a comparison knows only those that the
    database needs."""
    names = {name for regressor in regressors for name in regressor.expression.names}
    logged = {
        part
        for name in names
        for part in ((HAT_RATES[name][0], "V") if name in HAT_RATES else (name,))
    }
    return flight.usable(sorted(name for name in logged | names if name in flight))


def _columns(
    axis: str,
    regressors: Sequence[Regressor],
    channels: Mapping[str, Array],
    comparison: Comparison,
) -> Array:
    """Regressors (n, k) of one flight, band-limited like the residual that they are to explain."""
    n = len(comparison.time)
    columns = [
        np.broadcast_to(evaluate(regressor.expression, channels), (n,)) for regressor in regressors
    ]
    if axis in MOMENT_AXES and comparison.bandwidth is not None:
        step = float(comparison.time[-1] - comparison.time[0]) / (n - 1)
        columns = [band_limited(column, step, comparison.bandwidth) for column in columns]
    return np.column_stack(columns)


def _excited(matrix: Array, regressors: Sequence[Regressor]) -> np.ndarray:
    """Which columns move: a constant always does; others must vary beyond rounding about their
    mean."""
    constant = np.array([not regressor.expression.names for regressor in regressors])
    spread = matrix.std(axis=0)
    return constant | (spread > 1e-9 * np.maximum(np.abs(matrix).max(axis=0), 1e-12))


def _constrained(
    fit: Regression, declared: DeclaredIncrement
) -> tuple[Array, Array, tuple[str, ...]]:
    """Estimates and covariance with priors combined, bounds and fixed values kept, all in the
    metric of the coloured covariance: minimise ``(x - x0)' C^-1 (x - x0)`` over what is allowed."""
    names, estimates, covariance = fit.names, fit.estimates, fit.covariance
    information = np.linalg.inv(covariance)
    right = information @ estimates
    for name, (value, sigma) in declared.prior.items():
        if name in names:
            k = names.index(name)
            information[k, k] += sigma**-2
            right[k] += value * sigma**-2
    if declared.prior:
        covariance = np.linalg.inv(information)
        estimates = covariance @ right
    low, high = np.full(len(names), -np.inf), np.full(len(names), np.inf)
    for name, (lower, upper) in declared.bounds.items():
        if name in names:
            low[names.index(name)], high[names.index(name)] = lower, upper
    held = {names.index(name): value for name, value in declared.fixed.items() if name in names}
    free = [k for k in range(len(names)) if k not in held]
    if held:
        index = list(held)
        shift = np.array([held[k] for k in index]) - estimates[index]
        gain = covariance[:, index] @ np.linalg.inv(covariance[np.ix_(index, index)])
        estimates = estimates + gain @ shift
        covariance = covariance - gain @ covariance[index, :]
        covariance[index, :] = covariance[:, index] = 0.0
        estimates[index] = [held[k] for k in index]
    if np.all((estimates >= low) & (estimates <= high)):
        return estimates, covariance, ()
    root = np.linalg.cholesky(np.linalg.inv(covariance[np.ix_(free, free)])).T
    bounded = lsq_linear(root, root @ estimates[free], bounds=(low[free], high[free]), tol=1e-12).x
    estimates = estimates.copy()
    estimates[free] = bounded
    touching = (np.isclose(estimates, low) | np.isclose(estimates, high)) & np.isfinite(low)
    return (
        estimates,
        covariance,
        tuple(name for name, touches in zip(names, touching, strict=True) if touches),
    )


def _aliases(names: Sequence[str], correlation: Array) -> tuple[tuple[str, ...], ...]:
    """Groups of estimates linked by correlations beyond ALIAS_CORRELATION; the constant is nobody's
    rival."""
    groups: list[set[str]] = []
    for i, one in enumerate(names):
        for j in range(i + 1, len(names)):
            if "1" in (one, names[j]) or abs(correlation[i, j]) < ALIAS_CORRELATION:
                continue
            touching = [g for g in groups if one in g or names[j] in g]
            groups = [g for g in groups if g not in touching]
            groups.append({one, names[j]}.union(*touching))
    return tuple(tuple(sorted(group)) for group in groups)
