"""Parameters of a database with what flights have estimated."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from aerodb.support import Array
from aerodb.tables.analysis.sensitivity import parameter_inside, with_parameters
from aerodb.tables.database import AeroDatabase
from aerodb.tables.increment import Interval
from aerodb.tables.parameter import Parameter, covariance_of, normal


def with_estimated_parameters(
    database: AeroDatabase,
    values: Mapping[str, float],
    covariance: Array,
    flights: Sequence[str],
    flown: Mapping[str, Interval],
) -> AeroDatabase:
    """Return the database with estimated values of some of its parameters.

    values : name -> value, in the parameter's unit; it stays inside the bounds. covariance :
    (k, k), in their order; correlations are kept between those that are estimated together. flights
    : ids of those that estimated them. flown : variable -> interval, SI. Raises InputError for a
    covariance that is not finite.
    """
    names = list(values)
    inside = {name: parameter_inside(database, name, values[name]) for name in names}
    ends = {name: (interval.low, interval.high) for name, interval in sorted(flown.items())}
    changed = dict(with_parameters(database, inside).variables)
    for name in names:
        known = changed[name].parameter or Parameter()
        changed[name] = replace(
            changed[name], parameter=replace(known, flights=tuple(flights), flown=ends)
        )
    return with_parameter_covariance(replace(database, variables=changed), names, covariance)


def parameter_covariance(database: AeroDatabase, names: Sequence[str]) -> Array:
    """Return the covariance (k, k) of some parameters of a database, in their order and units; 0
    where nothing is known."""
    return covariance_of({name: database.variables[name].uncertainty for name in names})


def with_parameter_covariance(
    database: AeroDatabase, names: Sequence[str], covariance: Array
) -> AeroDatabase:
    """Return the database with another covariance (k, k) of some of its parameters, in their order
    and units. Raises InputError for one that is not finite."""
    sigma, changed = np.sqrt(np.diag(covariance)), dict(database.variables)
    for row, name in enumerate(names):
        correlations = [
            float(covariance[row, other] / (sigma[row] * sigma[other])) for other in range(row)
        ]
        known = normal(float(sigma[row]), names[:row], correlations)
        changed[name] = replace(changed[name], uncertainty=known)
    return replace(database, variables=changed)
