"""Estimate declared increments from the residuals of several flights (003, eq. 7), with coloured
standard errors, consider parameters and a flown envelope."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.optimize import lsq_linear

from aerodb.coefficients import Comparison, band_limited
from aerodb.errors import InputError
from aerodb.estimation import Regression, least_squares, own_constants, with_mean_constant
from aerodb.flight import Flight
from aerodb.increments.chosen_knots import with_chosen_knots
from aerodb.increments.model_file import CONSTANT, DeclaredIncrement, ModelFile, expand
from aerodb.increments.samples import (
    AxisSamples,
    axis_samples,
    channels_of,
    excited,
    with_model_rates,
)
from aerodb.nomenclature import MOMENT_AXES
from aerodb.signals import Theil, theil
from aerodb.support import Array, Mask
from aerodb.tables import (
    QUANTITIES,
    AeroDatabase,
    Increment,
    Interval,
    continued,
    flown_envelope,
    new_sign_changes,
)

#: Two estimates correlated beyond this cannot be separated by these flights; they are reported as
#: an alias group.
ALIAS_CORRELATION = 0.95

#: Least part of a column, relative to its size, that others do not explain: less is rounding.
_INDEPENDENT = 1e-9
#: Least share of a term in a dependent column, relative to the largest, to be named.
_TAKES_PART = 0.1

#: An increment on one of these axes holds the drag that an increment on the lift induces.
_DRAG = frozenset({"C_drag", "CX"})

#: How often a fade may be doubled in length to keep the sign of a slope.
LENGTHENINGS = 4


@dataclass(frozen=True)
class AxisUpdate:
    """Estimates on one axis.

    Parameters
    ----------
    names, estimates, standard_errors, vif : (k,), per term that was estimated.
    covariance : (k, k), corrected for coloured residuals; correlation : (k, k) from it.
    r_squared : of the fit to the residuals; of another method than regression, of the output that
        it explains least.
    theil : of database + increment against measurement; of another method, of that output.
    outputs : of another method, output -> coefficient of determination; of one that flies, the
        same outputs stand beside every axis.
    at_bound : names of estimates that ended on a bound.
    not_excited : declared terms that these flights do not excite; they were left out.
    dependent : declared terms that were left out because in these flights they are a linear
        combination of others -> these others.
    aliases : groups of estimates that these flights cannot separate.
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
    dependent: Mapping[str, tuple[str, ...]]
    aliases: tuple[tuple[str, ...], ...]
    outputs: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class ConsiderParameter:
    """A constant sensor error that one flight's residual cannot reveal: considered in the
    covariance, not estimated.

    Parameters
    ----------
    name : of the error, such as ``alpha_bias``.
    sigma : one standard error, in the unit of the error.
    shared : true where it is the same error, by `name`, in all flights.
    columns : axis -> (n,), change of the residual per unit of the error.
    """

    name: str
    sigma: float
    shared: bool
    columns: Mapping[str, Array]


@dataclass(frozen=True)
class Update:
    """The candidate database, the estimates per axis, the ids of the identifying flights, and what
    speaks against the method's answer, in sentences."""

    candidate: AeroDatabase
    axes: tuple[AxisUpdate, ...]
    flights: tuple[str, ...]
    reservations: tuple[str, ...] = ()


def estimate_increments(
    flights: Sequence[Flight],
    comparisons: Sequence[Comparison],
    model: ModelFile,
    database: AeroDatabase,
    consider: Mapping[str, Sequence[ConsiderParameter]] | None = None,
) -> Update:
    """Estimate the declared increments on top of `database`.

    Estimates (k,) and covariance (k, k) per axis are in SI units; standard errors rest on the
    autocorrelation of the residuals (Morelli & Klein, 1997), those of
    `aerodb.estimation.regression` on a model of it.

    Parameters
    ----------
    flights, comparisons : in the same order; every comparison is with `database`.
    model : the declared increments.
    consider : flight id -> sensor errors that the standard errors then include; None: none.

    Returns
    -------
    The candidate: `database` with one increment more per declared axis; and the estimates.

    Raises InputError for a term that names an unknown channel, and where a declared axis cannot be
    estimated at all.
    """
    if model.parameters:
        raise InputError(
            f"an update estimates increments, and the model file has {', '.join(model.parameters)}",
            "model file",
            "aerodb close-loop corrects parameters, aerodb estimate prints them",
        )
    model = with_chosen_knots(flights, comparisons, model, database)
    flights = with_model_rates(flights, comparisons, model)
    channels = channels_of(flights, model, database)
    results = [
        _axis(declared, flights, channels, comparisons, database, consider or {})
        for declared in model.increment
    ]
    holds_drag = not _DRAG.isdisjoint(declared.axis for declared in model.increment)
    increments = tuple(
        replace(each, induces_drag=False) if holds_drag and each.axis == "C_lift" else each
        for _, each in results
    )
    candidate = replace(database, increments=(*database.increments, *increments))
    return Update(
        candidate, tuple(axis for axis, _ in results), tuple(flight.id for flight in flights)
    )


def keep_slope_signs(update: Update, database: AeroDatabase) -> Update:
    """Lengthen fades until dC_lift/dalpha and dCm/dalpha have no new sign change outside the data.

    An increment fades to the baseline beyond its envelope. Where the baseline's slope is small, the
    slope of the fade can outweigh it. The alpha cell of the increments concerned is doubled until
    no new sign change is left. If LENGTHENINGS doublings do not achieve that, the update is
    returned unchanged, and the gate will refuse it. Slopes are in 1/rad, the cell in rad.
    """
    candidate, first = update.candidate, len(database.increments)
    for doublings in range(LENGTHENINGS + 1):
        changes = new_sign_changes(database, candidate)
        if not changes:
            return replace(update, candidate=candidate)
        axes = frozenset[str]().union(*(QUANTITIES[change.quantity] for change in changes))
        earlier, added = candidate.increments[:first], candidate.increments[first:]
        longer = tuple(
            _fading_slowly(i, 2 ** (doublings + 1)) if i.axis in axes else i for i in added
        )
        candidate = replace(candidate, increments=(*earlier, *longer))
    return update


def _fading_slowly(increment: Increment, cells: int) -> Increment:
    """The increment with its alpha cell doubled; `cells` is its new length in table cells."""
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
    consider: Mapping[str, Sequence[ConsiderParameter]],
) -> tuple[AxisUpdate, Increment]:
    axis, regressors = declared.axis, expand(declared)
    used = axis_samples(declared, flights, channels, comparisons)
    if not used:
        raise InputError(
            f"no flight gives a usable sample on {axis}",
            "update",
            "remove the axis from the model file",
        )
    matrix = np.concatenate([s.columns[s.good] for s in used])
    response = np.concatenate([s.comparison.residual(axis)[s.good] for s in used])
    moved = excited(matrix, regressors)
    not_excited = tuple(r.name for r, moves in zip(regressors, moved, strict=True) if not moves)
    dependent = _dependent(declared, matrix, [r.name for r in regressors], moved, used)
    moved = moved & [regressor.name not in dependent for regressor in regressors]
    chosen = [regressor for regressor, moves in zip(regressors, moved, strict=True) if moves]
    names = [regressor.name for regressor in chosen]
    if not chosen:
        raise InputError(
            f"no declared term on {axis} is excited by these flights",
            "update",
            "fly a manoeuvre that excites one",
        )
    fit = _fitted(declared, matrix[:, moved], response, names, used, consider)
    constrained = _constrained(fit, declared)
    estimates, covariance = constrained.estimates, constrained.covariance
    measured = np.concatenate([s.comparison.measured[axis][s.good] for s in used])
    predicted = measured - response + matrix[:, moved] @ estimates
    ids = tuple(s.comparison.flight for s in used)
    names_used = frozenset[str]().union(*(regressor.expression.names for regressor in chosen))
    increment = continued(
        Increment(
            axis=axis,
            regressors=tuple(regressor.expression for regressor in chosen),
            estimates=estimates,
            covariance=covariance,
            envelope=flown_envelope(names_used, [(s.channels, s.good) for s in used], database),
            flights=ids,
        ),
        database,
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
        at_bound=constrained.at_bound,
        not_excited=not_excited,
        dependent=dependent,
        aliases=alias_groups(names, correlation),
    )
    return result, increment


def _dependent(
    declared: DeclaredIncrement,
    matrix: Array,
    names: Sequence[str],
    moved: Mask,
    used: Sequence[AxisSamples],
) -> dict[str, tuple[str, ...]]:
    """Return the excited terms (of n columns) that are linear combinations of constants, of terms
    with a value of their own (`fixed`, `prior`) or of terms declared before them, and of which."""
    lengths = [samples.count for samples in used]
    if not declared.own_constants:
        lengths = [len(matrix)]
    constants = np.repeat(np.eye(len(lengths)), lengths, axis=0)
    known = CONSTANT in names
    kept, labels = (constants, [CONSTANT] * len(lengths)) if known else (constants[:, :0], [])
    first = declared.fixed.keys() | declared.prior.keys()
    found: dict[str, tuple[str, ...]] = {}
    for k in sorted(np.flatnonzero(moved).tolist(), key=lambda k: names[k] not in first):
        if names[k] == CONSTANT:
            continue
        column = matrix[:, k] / np.linalg.norm(matrix[:, k])
        shares = np.linalg.lstsq(kept, column, rcond=None)[0]
        if names[k] not in first and np.linalg.norm(column - kept @ shares) < _INDEPENDENT:
            sizes = np.abs(shares) * np.linalg.norm(kept, axis=0)
            acting = [n for n, s in zip(labels, sizes, strict=True) if s > _TAKES_PART * max(sizes)]
            found[names[k]] = tuple(dict.fromkeys(acting))
        else:
            kept, labels = np.column_stack([kept, column]), [*labels, names[k]]
    return found


def _fitted(
    declared: DeclaredIncrement,
    matrix: Array,
    response: Array,
    names: Sequence[str],
    used: Sequence[AxisSamples],
    consider: Mapping[str, Sequence[ConsiderParameter]],
) -> Regression:
    """Least squares on the samples `used`, in order, with one constant for all flights or one
    each."""
    axis, columns, named = declared.axis, matrix, list(names)
    lengths = [samples.count for samples in used]
    constant = names.index(CONSTANT) if declared.own_constants else None
    if constant is not None:
        columns, mix = own_constants(matrix, lengths, constant)
        named = [name for name in names if name != CONSTANT] + [
            f"{CONSTANT} of {samples.comparison.flight}" for samples in used
        ]
    try:
        fit = least_squares(columns, response, named, lengths)
    except ValueError as error:
        remedy = "declare only one of them, or fly manoeuvres that separate them"
        raise InputError(f"increment on {axis}: {error}", "update", remedy) from error
    fit = replace(
        fit, covariance=fit.covariance + _consider_covariance(axis, columns, used, consider)
    )
    return fit if constant is None else with_mean_constant(fit, mix, names, constant)


def _consider_covariance(
    axis: str,
    matrix: Array,
    used: Sequence[AxisSamples],
    consider: Mapping[str, Sequence[ConsiderParameter]],
) -> Array:
    """Covariance (k, k) of least-squares estimates due to constant sensor errors.

    matrix : X (n, k), samples of the flights `used` in order. An error of one sigma that adds d to
    the residual moves the estimates by ``(X'X)^-1 X' d``: consider covariance (Bierman,
    *Factorization Methods*, 1977, chapter VIII). For an error that all flights share these changes
    add before they are squared; other errors are independent.
    """
    gain, start = np.linalg.pinv(matrix), 0
    total = np.zeros((matrix.shape[1], matrix.shape[1]))
    together: dict[str, Array] = {}
    for samples in used:
        comparison = samples.comparison
        part, start = slice(start, start + samples.count), start + samples.count
        for parameter in consider.get(comparison.flight, ()):
            if axis not in parameter.columns:
                continue
            column = parameter.sigma * parameter.columns[axis]
            if axis in MOMENT_AXES and comparison.bandwidth is not None:
                step = float(comparison.time[-1] - comparison.time[0]) / (len(comparison.time) - 1)
                column = band_limited(column, step, comparison.bandwidth)
            moved = gain[:, part] @ column[samples.good]
            if parameter.shared:
                together[parameter.name] = together.get(parameter.name, 0.0) + moved
            else:
                total += np.outer(moved, moved)
    return total + sum(
        (np.outer(moved, moved) for moved in together.values()), np.zeros_like(total)
    )


def _correlation(covariance: Array) -> Array:
    """Correlation matrix (k, k); a fixed estimate is uncorrelated with the others."""
    deviation = np.sqrt(np.diag(covariance))
    scale = np.where(deviation > 0, deviation, 1.0)
    return np.asarray(
        covariance / np.outer(scale, scale) + np.diag(np.where(deviation > 0, 0.0, 1.0))
    )


@dataclass(frozen=True)
class _Constrained:
    """Estimates, their covariance, and the names of those at a bound."""

    estimates: Array
    covariance: Array
    at_bound: tuple[str, ...]


def _constrained(fit: Regression, declared: DeclaredIncrement) -> _Constrained:
    """The estimates of a fit with priors, bounds and fixed values applied.

    Minimises ``(x - x0)' C^-1 (x - x0)`` over the allowed x, with C the coloured covariance.
    """
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
        change = np.array([held[k] for k in index]) - estimates[index]
        gain = covariance[:, index] @ np.linalg.inv(covariance[np.ix_(index, index)])
        estimates = estimates + gain @ change
        covariance = covariance - gain @ covariance[index, :]
        covariance[index, :] = covariance[:, index] = 0.0
        estimates[index] = [held[k] for k in index]
    if np.all((estimates >= low) & (estimates <= high)):
        return _Constrained(estimates, covariance, ())
    root = np.linalg.cholesky(np.linalg.inv(covariance[np.ix_(free, free)])).T
    bounded = lsq_linear(root, root @ estimates[free], bounds=(low[free], high[free]), tol=1e-12).x
    estimates = estimates.copy()
    estimates[free] = bounded
    touching = (np.isclose(estimates, low) | np.isclose(estimates, high)) & np.isfinite(low)
    at_bound = tuple(name for name, touches in zip(names, touching, strict=True) if touches)
    return _Constrained(estimates, covariance, at_bound)


def alias_groups(names: Sequence[str], correlation: Array) -> tuple[tuple[str, ...], ...]:
    """Return the groups of estimates, by their names (k,), that are linked by correlations (k, k)
    beyond `ALIAS_CORRELATION`, without the constant."""
    groups: list[set[str]] = []
    for i, one in enumerate(names):
        for j in range(i + 1, len(names)):
            if "1" in (one, names[j]) or abs(correlation[i, j]) < ALIAS_CORRELATION:
                continue
            touching = [g for g in groups if one in g or names[j] in g]
            groups = [g for g in groups if g not in touching]
            groups.append({one, names[j]}.union(*touching))
    return tuple(tuple(sorted(group)) for group in groups)
