"""Covariance of what a run may vary: the database's parameters, and the increments' estimates."""

import numpy as np

from aerodb.simulation.engine import FlightModel
from aerodb.support import Array
from aerodb.tables import covariance_of


def parameter_covariance(model: FlightModel) -> Array:
    """Return the covariance (p, p) of `FlightModel.parameters`, in their order.

    Parameters have their standard errors and correlations, before flight their priors. Increments
    are identified one by one: estimates of different increments have no covariance. Estimates that
    are folded into a table are no parameters, and are left out.
    """
    database = model.database
    acting = [name for name in model.total.estimates if name in database.parameters]
    own = covariance_of({name: database.variables[name].uncertainty for name in acting})
    parts = [own] + [
        increment.covariance[np.ix_(kept, kept)]
        for increment in model.database.increments
        if increment.acts_as_layer
        for kept in [[k for k, table in enumerate(increment.folded) if not table]]
    ]
    result = np.zeros((sum(map(len, parts)),) * 2)
    start = 0
    for part in parts:
        end = start + len(part)
        result[start:end, start:end] = part
        start = end
    return result
