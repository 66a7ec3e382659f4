"""The estimates of any method as a candidate database."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from aerodb.errors import InputError
from aerodb.estimation import Fit
from aerodb.identification.equations import parameter_name
from aerodb.identification.identification_flight import IdentificationFlight
from aerodb.identification.methods import Method
from aerodb.identification.problem import fits_of
from aerodb.increments import AxisUpdate, ConsiderParameter, ModelFile, Update, estimate_increments
from aerodb.support import Array
from aerodb.tables import AeroDatabase


def update_by(
    method: Method,
    flights: Sequence[IdentificationFlight],
    model: ModelFile,
    database: AeroDatabase,
    consider: Mapping[str, Sequence[ConsiderParameter]] | None = None,
) -> Update:
    """Estimate the declared increments on `database` by a method.

    consider : flight id -> sensor errors that standard errors of equation error then include, as
    `estimate_increments` computes them; a dynamic method has sensor errors of its own.

    Raises InputError where the method gives no estimate of a term.
    """
    logs, comparisons = [f.flight for f in flights], [f.comparison for f in flights]
    plain = estimate_increments(logs, comparisons, model, database)
    update = with_fitted_estimates(
        plain, fits_of(method, flights, _without_dependent(plain, model), database)
    )
    if not consider or method.kind != "equation error":
        return update
    widened = estimate_increments(logs, comparisons, model, database, consider)
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


def with_fitted_estimates(update: Update, fits: Sequence[Fit]) -> Update:
    """Return the update with the estimates and covariances of `fits` in place of its own.

    update : of `estimate_increments`, whose increments, envelopes and flights stay. The terms of an
    axis must be in one fit.

    Raises InputError naming a term that the method gives no estimate of.
    """
    axes = []
    for axis in update.axes:
        values, covariance = _fitted(axis, fits)
        axes.append(replace(axis, estimates=values, covariance=covariance))
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
            )
        )
        increments[first + k] = replace(
            increments[first + k], estimates=axis.estimates, covariance=covariance
        )
    candidate = replace(update.candidate, increments=tuple(increments))
    return replace(update, candidate=candidate, axes=tuple(axes))


def _fitted(axis: AxisUpdate, fits: Sequence[Fit]) -> tuple[Array, Array]:
    """Estimates (k,) and covariance (k, k) of the terms of an axis; a constant of its own for each
    flight counts as their mean."""
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
                return values, mix @ fit.covariance @ mix.T
        missing = [n for n, v in zip(wanted, values, strict=True) if not np.isfinite(v)]
        raise InputError(
            f"{fit.method} gives no estimate of {', '.join(missing) or name}",
            f"update of {axis.axis}",
            "leave the term out of the model file, or use another method",
        )
    raise InputError(f"the method gives no estimate on {axis.axis}", "update", "use another method")
