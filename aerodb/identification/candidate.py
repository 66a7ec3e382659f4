"""The estimates of any method as a candidate database."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np

from aerodb.errors import InputError
from aerodb.estimation import Fit
from aerodb.identification.database_parameters import within_bounds
from aerodb.identification.equations import parameter_name
from aerodb.identification.identification_flight import IdentificationFlight
from aerodb.identification.method_comparison import reservations_of
from aerodb.identification.methods import Method
from aerodb.identification.problem import fits_of
from aerodb.increments import (
    CONSTANT,
    AxisUpdate,
    ConsiderParameter,
    ModelFile,
    Update,
    alias_groups,
    estimate_increments,
)
from aerodb.signals import Theil, theil
from aerodb.support import Array
from aerodb.tables import (
    AeroDatabase,
    parameter_covariance,
    with_parameter_covariance,
    with_parameters,
)


def update_by(
    method: Method,
    flights: Sequence[IdentificationFlight],
    model: ModelFile,
    database: AeroDatabase,
    consider: Mapping[str, Sequence[ConsiderParameter]] | None = None,
) -> Update:
    """Estimate the declared increments on `database`, or its declared parameters, by a method.

    consider : flight id -> sensor errors that standard errors of equation error then include, as
    `estimate_increments` computes them; a dynamic method has sensor errors of its own.

    Raises InputError where the method gives no estimate of a term.
    """
    logs, comparisons = [f.flight for f in flights], [f.comparison for f in flights]
    plain = estimate_increments(logs, comparisons, model, database)
    fits = fits_of(method, flights, _without_dependent(plain, model), database)
    if model.parameters:
        fitted = _with_fitted_parameters(plain, fits[0])
    else:
        fitted = with_fitted_estimates(plain, fits)
    estimated = frozenset[str]().union(*(flight.estimated for flight in flights))
    update = replace(
        fitted,
        reservations=reservations_of(method.name, fits, estimated),
    )
    if not consider or method.kind != "equation error":
        return update
    widened = estimate_increments(logs, comparisons, model, database, consider)
    if model.parameters:
        own, wide, narrow = (
            parameter_covariance(each.candidate, model.parameters)
            for each in (update, widened, plain)
        )
        candidate = with_parameter_covariance(
            update.candidate, model.parameters, own + wide - narrow
        )
        return replace(update, candidate=candidate)
    return _with_covariances(
        update,
        [
            own.covariance + wide.covariance - narrow.covariance
            for own, wide, narrow in zip(update.axes, widened.axes, plain.axes, strict=True)
        ],
    )


def _without_dependent(update: Update, model: ModelFile) -> ModelFile:
    """The model file without the terms that `update` left out as combinations of others."""
    dependent = {axis.axis: axis.dependent for axis in update.axes}
    return model.model_copy(
        update={
            "increment": tuple(
                each.model_copy(
                    update={"terms": tuple(t for t in each.terms if t not in dependent[each.axis])}
                )
                for each in model.increment
            )
        }
    )


def _with_fitted_parameters(update: Update, fit: Fit) -> Update:
    """The update with the parameters of the database that a method estimated."""
    names = list(update.parameters)
    values = within_bounds(fit, update.candidate)
    missing = [name for name in names if name not in fit.names or name not in values]
    if missing:
        raise InputError(
            f"{fit.method} gives no estimate of {', '.join(missing)}",
            "update",
            "choose another method, or leave them out",
        )
    chosen = [fit.names.index(name) for name in names]
    candidate = with_parameters(update.candidate, {name: values[name] for name in names})
    covariance = fit.covariance[np.ix_(chosen, chosen)]
    return replace(update, candidate=with_parameter_covariance(candidate, names, covariance))


def with_fitted_estimates(update: Update, fits: Sequence[Fit]) -> Update:
    """Return the update with the estimates and covariances of `fits` in place of its own, and what
    the method's own information and outputs say of collinearity and fit.

    update : of `estimate_increments`, whose increments, envelopes and flights stay. The terms of an
    axis must be in one fit.

    Raises InputError naming a term that the method gives no estimate of.
    """
    axes = []
    slopes = {
        parameter_name(axis.axis, term)
        for axis in update.axes
        for term in axis.names
        if term != CONSTANT
    }
    for axis in update.axes:
        fit, values, covariance = _fitted(axis, fits)
        inflation = _variance_inflation(fit, slopes)
        explained, followed = _explained(fit)
        axes.append(
            replace(
                axis,
                estimates=values,
                covariance=covariance,
                vif=np.array(
                    [inflation.get(parameter_name(axis.axis, term), 1.0) for term in axis.names]
                ),
                r_squared=min(explained.values(), default=np.nan),
                theil=followed,
                outputs=explained,
            )
        )
    return _with_covariances(replace(update, axes=tuple(axes)), [a.covariance for a in axes])


def _with_covariances(update: Update, covariances: Sequence[Array]) -> Update:
    """The update with these covariances, and its increments with the estimates of its axes."""
    first = len(update.candidate.increments) - len(update.axes)
    increments, axes = list(update.candidate.increments), []
    for k, (axis, covariance) in enumerate(zip(update.axes, covariances, strict=True)):
        deviation = np.sqrt(np.diag(covariance))
        scale = np.where(deviation > 0, deviation, 1.0)
        correlation = covariance / np.outer(scale, scale)
        np.fill_diagonal(correlation, 1.0)
        axes.append(
            replace(
                axis,
                covariance=covariance,
                standard_errors=deviation,
                correlation=correlation,
                aliases=alias_groups(axis.names, correlation),
            )
        )
        increments[first + k] = replace(
            increments[first + k], estimates=axis.estimates, covariance=covariance
        )
    candidate = replace(update.candidate, increments=tuple(increments))
    return replace(update, candidate=candidate, axes=tuple(axes))


def _variance_inflation(fit: Fit, slopes: Collection[str]) -> dict[str, float]:
    """Slope -> how many times its variance is what it would be if the other slopes were known, with
    constants, initial states and biases unknown in both cases."""
    index = [k for k, n in enumerate(fit.names) if n in slopes and fit.covariance[k, k] > 0.0]
    if not index:
        return {}
    correlation = fit.correlation[np.ix_(index, index)]
    factors = np.diag(np.linalg.pinv(correlation))
    return {fit.names[k]: max(1.0, float(v)) for k, v in zip(index, factors, strict=True)}


def _explained(fit: Fit) -> tuple[dict[str, float], Theil]:
    """Output -> coefficient of determination over all records, about the mean; and Theil's
    statistics of the output that is explained least."""
    shares: dict[str, tuple[float, Theil]] = {}
    for name in dict.fromkeys(n for record in fit.residuals.values() for n in record):
        held = [r for r in fit.residuals if name in fit.residuals[r]]
        left = np.concatenate([fit.residuals[r][name] for r in held])
        model = np.concatenate([fit.fitted[r][name] for r in held])
        seen = np.isfinite(left) & np.isfinite(model)
        measured = (model + left)[seen]
        power = float(np.sum((measured - measured.mean()) ** 2)) if seen.any() else 0.0
        if power > 0.0:
            share = 1.0 - float(left[seen] @ left[seen]) / power
            shares[name] = share, theil(model[seen], measured)
    if not shares:
        raise InputError(f"{fit.method} explains no output", "update", "use another method")
    least = min(shares, key=lambda name: shares[name][0])
    return {name: share for name, (share, _) in shares.items()}, shares[least][1]


def _fitted(axis: AxisUpdate, fits: Sequence[Fit]) -> tuple[Fit, Array, Array]:
    """The fit that holds the terms of an axis, their estimates (k,) and covariance (k, k); a
    constant of its own for each flight counts as their mean."""
    wanted = [parameter_name(axis.axis, term) for term in axis.names]
    for fit in fits:
        own = [[n for n in fit.names if n == name or n.startswith(f"{name}[")] for name in wanted]
        known = {e.name: e.value for e in fit.estimates}
        if not any(name in known or names for name, names in zip(wanted, own, strict=True)):
            continue
        mix = np.zeros((len(wanted), len(fit.names)))
        values = np.zeros(len(wanted))
        for row, (name, names) in enumerate(zip(wanted, own, strict=True)):
            if not names and name not in known:
                break
            for each in names:
                mix[row, fit.names.index(each)] = 1.0 / len(names)
            values[row] = np.mean([known[each] for each in names]) if names else known[name]
        else:
            if np.isfinite(values).all():
                return fit, values, mix @ fit.covariance @ mix.T
        missing = [n for n, v in zip(wanted, values, strict=True) if not np.isfinite(v)]
        raise InputError(
            f"{fit.method} gives no estimate of {', '.join(missing) or name}",
            f"update of {axis.axis}",
            "leave the term out of the model file, or use another method",
        )
    raise InputError(f"the method gives no estimate on {axis.axis}", "update", "use another method")
