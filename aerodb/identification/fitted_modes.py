"""Modes of the linear models that a fit found, with their errors."""

from collections.abc import Sequence

import numpy as np

from aerodb.estimation import AffineMatrix, Fit, StateSpace, TimeHistory
from aerodb.identification.model_file import StateSpaceFile
from aerodb.simulation import LinearModel, Mode, modes
from aerodb.support import Array

#: States of which a model needs one of each set, or its eigenvalues are of no mode of an aircraft.
_MOTIONS = (
    (frozenset({"w", "alpha"}), frozenset({"q"})),
    (frozenset({"v", "beta"}), frozenset({"r"})),
)


def fitted_modes(
    fit: Fit, file: StateSpaceFile, records: Sequence[TimeHistory]
) -> tuple[Mode, ...]:
    """Return the modes of a linear model at the estimates of a fit, as `aerodb.simulation.modes`.

    Standard errors follow from the covariance of the estimates, to first order (delta method): a
    fixed parameter has none. No modes have a model without the states of a longitudinal or lateral
    oscillation, one whose matrix A differs between records, and a fit that lacks an entry of it or
    did not converge.

    References
    ----------
    "Aerodynamic Model Update Using Parameter Identification Supporting a Cessna Grand Caravan
    Engineering Simulation", tables 3 to 6. Kato, Perturbation Theory for Linear Operators, 1966,
    chapter 2 (derivative of an eigenvalue).
    """
    states = frozenset(file.state_space.states)
    if not fit.converged or not any(all(states & names for names in motion) for motion in _MOTIONS):
        return ()
    made = file.model(records)
    model = made if isinstance(made, StateSpace) else made.model
    values = {each.name: each.value for each in fit.estimates}
    if not all(np.isfinite(values.get(name, np.nan)) for name in model.a.slopes):
        return ()
    a_slopes = _slopes(model, model.a, fit)
    b_known = all(np.isfinite(values.get(name, np.nan)) for name in model.b.slopes)
    a, b = (
        matrix.at({name: np.array(values[name]) for name in matrix.slopes})[0] if known
        else matrix.constant
        for matrix, known in ((model.a, True), (model.b, b_known))
    )  # fmt: skip
    n, m = b.shape
    return modes(
        LinearModel(
            a, b, np.eye(n), np.zeros((n, m)), model.states, model.inputs, model.states,
            A_slopes=a_slopes, covariance=np.nan_to_num(fit.covariance),
        )
    )  # fmt: skip


def _slopes(model: StateSpace, matrix: AffineMatrix, fit: Fit) -> Array:
    """Derivatives of a matrix (r, c, k) by the k parameters that the fit's covariance is of; what
    is tied to one of them moves with it."""
    names = [item.name for item in model.parameters.unknown]
    columns = []
    for name in fit.names:
        slope = np.zeros_like(matrix.constant)
        if name in names:
            moved = model.parameters.jacobian[:, names.index(name)]
            for other, factor in zip(model.parameters.names, moved, strict=True):
                slope = slope + factor * matrix.slope(other)
        columns.append(slope)
    return np.stack(columns, axis=-1) if columns else np.zeros((*matrix.constant.shape, 0))
