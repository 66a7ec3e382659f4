"""Estimate declared increments from the residuals of several flights (003, eq. 7), with coloured
standard errors, consider parameters and a flown envelope."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from aerodb.coefficients import Comparison
from aerodb.errors import InputError
from aerodb.estimation import Regression, least_squares, own_constants, with_mean_constant
from aerodb.flight import Flight
from aerodb.increments.chosen_knots import with_chosen_knots
from aerodb.increments.considered import ConsiderParameter, consider_covariance
from aerodb.increments.constraints import alias_groups, constrained_fit, correlation_of
from aerodb.increments.model_file import CONSTANT, DeclaredIncrement, ModelFile, Regressor, expand
from aerodb.increments.noisy_deflections import (
    with_deflections,
    with_noise_of,
    without_deflection_noise,
)
from aerodb.increments.parameters import estimate_parameters
from aerodb.increments.samples import (
    AxisSamples,
    axis_samples,
    channels_of,
    excited,
    with_model_rates,
)
from aerodb.nomenclature import is_surface
from aerodb.signals import Theil, theil
from aerodb.support import SMALL, Array, Mask
from aerodb.tables import (
    QUANTITIES,
    AeroDatabase,
    Increment,
    Interval,
    continued,
    flown_envelope,
    new_sign_changes,
)

#: Least part of a column, relative to its size, that others do not explain: less is rounding.
_INDEPENDENT = 1e-9
#: Least share of a term in a dependent column, relative to the largest, to be named.
_TAKES_PART = SMALL

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
class Update:
    """The candidate database, the estimates per axis, the ids of the identifying flights, what
    speaks against the method's answer, in sentences, and the parameters of the database that were
    estimated."""

    candidate: AeroDatabase
    axes: tuple[AxisUpdate, ...]
    flights: tuple[str, ...]
    reservations: tuple[str, ...] = ()
    parameters: tuple[str, ...] = ()


def estimate_increments(
    flights: Sequence[Flight],
    comparisons: Sequence[Comparison],
    model: ModelFile,
    database: AeroDatabase,
    consider: Mapping[str, Sequence[ConsiderParameter]] | None = None,
) -> Update:
    """Estimate the declared increments on top of `database`, or its declared parameters.

    Estimates (k,) and covariance (k, k) per axis are in SI units; standard errors rest on the
    autocorrelation of the residuals (Morelli & Klein, 1997), those of
    `aerodb.estimation.regression` on a model of it.

    Parameters
    ----------
    flights, comparisons : in the same order; every comparison is with `database`.
    model : the declared increments, or parameters of the database.
    consider : flight id -> sensor errors that the standard errors then include; None: none.

    Returns
    -------
    The candidate: `database` with one increment more per declared axis, or with other values of its
    parameters; and the estimates.

    Raises InputError for a term that names an unknown channel, and where a declared axis cannot be
    estimated at all.
    """
    if model.inertias:
        raise InputError(
            f"an update changes a database, not {', '.join(model.inertias)}",
            "model file",
            "estimate it (aerodb estimate), state it in the vehicle file, and leave it out here",
        )
    if model.parameters:
        return _with_parameters(comparisons, model, database, consider or {})
    model = with_chosen_knots(flights, comparisons, model, database)
    flights = with_model_rates(flights, comparisons, model)
    channels = channels_of(flights, model, database)
    results = [
        _axis(declared, flights, channels, comparisons, database, consider or {})
        for declared in model.increment
    ]
    noisy = [f"{axis.axis}: {text}" for axis, _, texts in results for text in texts]
    holds_drag = not _DRAG.isdisjoint(declared.axis for declared in model.increment)
    increments = tuple(
        replace(each, induces_drag=False) if holds_drag and each.axis == "C_lift" else each
        for _, each, _ in results
    )
    candidate = replace(database, increments=(*database.increments, *increments))
    return Update(
        candidate,
        tuple(axis for axis, _, _ in results),
        tuple(flight.id for flight in flights),
        tuple(noisy),
    )


def _with_parameters(
    comparisons: Sequence[Comparison],
    model: ModelFile,
    database: AeroDatabase,
    consider: Mapping[str, Sequence[ConsiderParameter]],
) -> Update:
    """The database with its declared parameters as the flights have them."""
    if model.increment:
        raise InputError(
            "declares parameters and increments",
            "model file",
            "estimate the parameters first, then the increments beside the version that has them",
        )
    found = estimate_parameters(
        comparisons, model.parameters, database, consider, model.own_constants
    )
    flights = tuple(each.flight for each in comparisons)
    return Update(found.database, (), flights, found.reservations, model.parameters)


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
) -> tuple[AxisUpdate, Increment, list[str]]:
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
    fit, noise = _fitted(declared, matrix[:, moved], response, chosen, used, consider)
    constrained = constrained_fit(fit, declared.prior, declared.bounds, declared.fixed)
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
    correlation = correlation_of(covariance)
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
    return result, increment, noise


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
    chosen: Sequence[Regressor],
    used: Sequence[AxisSamples],
    consider: Mapping[str, Sequence[ConsiderParameter]],
) -> tuple[Regression, list[str]]:
    """Least squares on the samples `used`, in order, with one constant for all flights or one each;
    and what noise of the deflections does to it, in sentences, where that is not taken off."""
    axis, columns, names = declared.axis, matrix, [regressor.name for regressor in chosen]
    lengths, named = [samples.count for samples in used], names
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
    parts = [(axis, samples.comparison, samples.good) for samples in used]
    plain = replace(fit, covariance=fit.covariance + consider_covariance(columns, parts, consider))
    fit, said = plain, list[str]()
    surfaces = {n for regressor in chosen for n in regressor.expression.names if is_surface(n)}
    if surfaces:
        beside = [with_deflections(each, surfaces) for each in used]

        def equations(those: Sequence[Comparison]) -> tuple[Array, Array]:
            made = [
                with_noise_of(axis, chosen, samples, one)
                for samples, one in zip(used, those, strict=True)
            ]
            noisier = np.concatenate([part for part, _ in made])
            if constant is not None:
                noisier, _ = own_constants(noisier, lengths, constant)
            left = response - np.concatenate([change for _, change in made])
            return noisier.T @ noisier, noisier.T @ (left - noisier @ plain.estimates)

        fit, said = without_deflection_noise(plain, beside, equations)
    return (fit if constant is None else with_mean_constant(fit, mix, names, constant)), said
