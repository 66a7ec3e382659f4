"""Covariance of the estimates that a run may vary: the increments' own."""

import numpy as np

from aerodb.simulation.engine import FlightModel
from aerodb.support import Array


def parameter_covariance(model: FlightModel) -> Array:
    """Return the covariance (p, p) of `FlightModel.parameters`, in their order.

    Increments are identified one by one: estimates of different increments have no covariance.
    Estimates that are folded into a table are no parameters, and are left out.
    """
    parts = [
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
