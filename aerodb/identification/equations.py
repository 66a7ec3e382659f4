"""Declared increments as equations that are linear in their parameters, one per axis."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Final

import numpy as np

from aerodb.coefficients import Coefficients, Comparison
from aerodb.errors import InputError
from aerodb.estimation import EquationRecord, LinearEquation, Parameter, Parameters
from aerodb.flight import Flight
from aerodb.increments import (
    CONSTANT,
    AxisSamples,
    DeclaredIncrement,
    ModelFile,
    axis_samples,
    channels_of,
    expand,
    with_chosen_knots,
    with_model_rates,
)
from aerodb.support import Array, Mask
from aerodb.tables import AeroDatabase, ReferenceGeometry
from aerodb.vehicle import Reference as VehicleReference

#: Shortest stretch of usable samples that makes a record [s]: methods of the frequency domain and
#: recursive ones need samples in a row, and all methods get the same ones.
SHORTEST: Final = 2.0


def parameter_name(axis: str, term: str) -> str:
    """Name of the estimate of a term.

    >>> parameter_name("Cm", "alpha")
    'Cm_alpha'
    """
    return f"{axis}_{'0' if term == CONSTANT else term}"


def no_database(reference: ReferenceGeometry) -> AeroDatabase:
    """Return a database of zeros: increments on it are the whole derivatives (dimensionless
    coefficients, `ReferenceGeometry` [m], [m²])."""
    return AeroDatabase("none", reference, description="zero on all axes")


def no_database_beside(coefficients: Coefficients, own: VehicleReference) -> AeroDatabase:
    """Return a database of zeros in a vehicle's reference geometry, about the moment reference of
    the coefficients of its flight, or its mean [m] over (n, 3) where that is the moving CG."""
    x, y, z = (float(value) for value in coefficients.moment_reference.mean(axis=0))
    return no_database(ReferenceGeometry(own.area, own.chord, own.span, (x, y, z), own.pressure))


def axis_equations(
    flights: Sequence[Flight],
    comparisons: Sequence[Comparison],
    model: ModelFile,
    database: AeroDatabase,
) -> tuple[LinearEquation, ...]:
    """Return one equation per declared axis: residual against regressors.

    flights, comparisons : in the same order; every comparison is with `database`. Each stretch of
    usable samples of at least `SHORTEST` is a record, named after the flight and its number there.
    With `own_constants` each flight has its own constant, ``CZ_0[flight]``.

    Raises InputError for a term that names an unknown channel, and where an axis has no record.

    Regressors (n, k) are terms of channels in SI units; the response (n,) is a dimensionless
    coefficient.
    """
    model = with_chosen_knots(flights, comparisons, model, database)
    flights = with_model_rates(flights, comparisons, model)
    channels = channels_of(flights, model, database)
    return tuple(
        _equation(declared, axis_samples(declared, flights, channels, comparisons))
        for declared in model.increment
    )


def _equation(declared: DeclaredIncrement, samples: Sequence[AxisSamples]) -> LinearEquation:
    terms = [regressor.name for regressor in expand(declared)]
    parameters = [_parameter(declared, term) for term in terms]
    own = terms.index(CONSTANT) if declared.own_constants else None
    pieces: list[tuple[int, str, Array, Array, Array]] = []
    for number, each in enumerate(samples):
        residual = each.comparison.residual(declared.axis)
        runs = usable_runs(each.good, each.comparison.time)
        for count, run in enumerate(runs):
            name = each.comparison.flight + (f"#{count + 1}" if len(runs) > 1 else "")
            columns = each.columns[run]
            pieces.append((number, name, each.comparison.time[run], columns, residual[run]))
    if not pieces:
        raise InputError(
            f"no flight gives {SHORTEST:g} s of usable samples in a row on {declared.axis}",
            "estimate",
            "remove the axis from the model file, or fly longer manoeuvres",
        )
    if own is not None:
        flown = sorted({number for number, *_ in pieces})
        constants = [
            Parameter(f"{parameters[own].name}[{samples[k].comparison.flight}]", 0.0) for k in flown
        ]
        parameters = [*(p for k, p in enumerate(parameters) if k != own), *constants]
        pieces = [
            (
                number,
                name,
                time,
                np.column_stack(
                    [
                        np.delete(columns, own, axis=1),
                        *(np.full(len(time), float(k == number)) for k in flown),
                    ]
                ),
                residual,
            )
            for number, name, time, columns, residual in pieces
        ]
    records = tuple(EquationRecord(name, t, x, z) for _, name, t, x, z in pieces)
    return LinearEquation(declared.axis, Parameters(tuple(parameters)), records)


def _parameter(declared: DeclaredIncrement, term: str) -> Parameter:
    """The parameter of a term, with what the model file says of it."""
    low, high = declared.bounds.get(term, (-np.inf, np.inf))
    prior, sigma = declared.prior.get(term, (None, None))
    value = declared.fixed.get(term, float(np.clip(0.0, low, high)))
    return Parameter(
        parameter_name(declared.axis, term),
        value,
        free=term not in declared.fixed,
        lower=low if term not in declared.fixed else -np.inf,
        upper=high if term not in declared.fixed else np.inf,
        prior=prior,
        prior_error=sigma,
    )


def usable_runs(good: Mask, time: Array) -> list[slice]:
    """Return the stretches of usable samples (`good`, (n,)) of at least `SHORTEST`, evenly sampled
    in time [s]."""
    step = float(np.median(np.diff(time)))
    torn = np.flatnonzero(~good[1:] | ~good[:-1] | (np.abs(np.diff(time) - step) > 1e-3 * step)) + 1
    edges = [0, *torn.tolist(), len(good)]
    return [
        slice(start, end)
        for start, end in pairwise(edges)
        if good[start] and (end - start - 1) * step >= SHORTEST
    ]
