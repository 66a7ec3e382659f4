"""Parameters of a database from the derivatives of a linear model.

The parameters are moved until the database's own linear model meets the given derivatives, all of
them together: downwash and its lag, slipstream, wing and body take the part that they have in the
database. Single equations (`tail_planes`) leave that to the tail.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from aerodb.errors import InputError
from aerodb.estimation import Parameter, bounds_of, priors_of
from aerodb.identification.conversion import Derivatives
from aerodb.identification.database_parameters import unknown
from aerodb.increments import check_parameters_of
from aerodb.simulation import LinearModel
from aerodb.support import Array
from aerodb.tables import AeroDatabase, ends_about, with_parameters

#: Number of solutions after which the search ends,
_MOST: Final = 20
#: and the step, in standard errors, below which it has settled.
_SETTLED: Final = 1e-3
#: Smallest singular value, as a share of the largest, of parameters that are told apart.
_APART: Final = 1e-6
#: Share of a direction that no derivative shows, from which a parameter takes part in it.
_TAKES_PART: Final = 0.1
#: States of a linear model without those of the database and of actuators.
_MOTION: Final = frozenset({"u", "w", "V", "alpha", "q", "theta", "v", "beta", "p", "r", "phi"})


@dataclass(frozen=True, eq=False)
class BackedOut:
    """What a linear model says of parameters.

    Parameters
    ----------
    names (k,), start (k,), values (k,) and covariance (k, k) of the parameters, in their units.
    at_bound : those that ended at a bound. given : the derivatives (d,). before, after : those of
    the database (d,) with the start values and with the values found, SI. converged : whether the
    values stayed.
    """

    names: tuple[str, ...]
    start: Array
    values: Array
    covariance: Array
    at_bound: tuple[str, ...]
    given: Derivatives
    before: Array
    after: Array
    converged: bool

    @property
    def standard_errors(self) -> Array:
        """(k,), in the units of the parameters."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))


def back_out(
    given: Derivatives,
    database: AeroDatabase,
    names: Sequence[str],
    derivatives_of: Callable[[AeroDatabase], Array],
) -> BackedOut:
    """Return the parameters `names` of a database with which its linear model meets `given`.

    derivatives_of : a database -> those derivatives of its linear model (d,), SI. Least squares in
    standard errors of `given` with the parameters' priors, inside their bounds (Gauss-Newton).

    Raises InputError for an unknown parameter, derivatives without standard errors, and parameters
    that the derivatives do not tell, by name.
    """
    check_parameters_of(names, database)
    for name, error in zip(given.names, given.standard_errors, strict=True):
        if not error > 0.0:
            raise InputError(
                f"{name} has no standard error", "derivatives", f"write {name} = [value, error]"
            )
    items = [unknown(name, database) for name in names]
    root = np.linalg.inv(np.linalg.cholesky(given.covariance))
    mean, sigma = priors_of(items)
    start = np.array([database.parameters[name] for name in names])
    present, before = start, derivatives_of(database)
    converged, met = False, before
    covariance: Array = np.zeros((len(names),) * 2)
    bounds = bounds_of(items)
    for _ in range(_MOST):
        there = with_parameters(database, dict(zip(names, present, strict=True)))
        slopes = _slopes(there, names, derivatives_of)
        jacobian = np.vstack([root @ slopes, np.diag(1.0 / sigma)])
        left = np.concatenate([root @ (given.values - met), (mean - present) / sigma])
        _told_apart(jacobian, items, names)
        covariance = np.asarray(np.linalg.inv(jacobian.T @ jacobian))
        moved = _inside(jacobian, left, present, bounds)
        present = np.clip(present + moved, *bounds)
        met = derivatives_of(with_parameters(database, dict(zip(names, present, strict=True))))
        if np.all(np.abs(moved) <= _SETTLED * np.sqrt(np.diag(covariance))):
            converged = True
            break
    held = tuple(
        name
        for name, value, low, high in zip(names, present, *bounds, strict=True)
        if np.isclose(value, low, rtol=1e-9) or np.isclose(value, high, rtol=1e-9)
    )
    return BackedOut(tuple(names), start, present, covariance, held, given, before, met, converged)


def of_motion(model: LinearModel) -> LinearModel:
    """Return a linear model without the states (n,) of the database and of actuators: those follow
    the motion with their lag, to first order in it.

    With ``z' = A21 x + A22 z + B2 u``, ``z = -A22^-1 (A21 x + B2 u) - A22^-2 A21 x'`` (Kokotovic,
    Khalil & O'Reilly, Singular Perturbation Methods in Control, 1986, section 1.4).
    """
    fast = [k for k, name in enumerate(model.states) if name not in _MOTION]
    if not fast:
        return model
    kept = [k for k in range(len(model.states)) if k not in fast]
    a11, a12 = model.A[np.ix_(kept, kept)], model.A[np.ix_(kept, fast)]
    a21, a22 = model.A[np.ix_(fast, kept)], model.A[np.ix_(fast, fast)]
    inverse = np.linalg.inv(a22)
    behind = np.linalg.inv(np.eye(len(kept)) + a12 @ inverse @ inverse @ a21)
    plain = model.part([model.states[k] for k in kept])
    return replace(
        plain,
        A=behind @ (a11 - a12 @ inverse @ a21),
        B=behind @ (model.B[kept] - a12 @ inverse @ model.B[fast]),
        A_slopes=None,
        B_slopes=None,
        covariance=None,
    )


def _slopes(
    database: AeroDatabase, names: Sequence[str], derivatives_of: Callable[[AeroDatabase], Array]
) -> Array:
    """Changes of the derivatives (d, k) per unit of each parameter."""
    columns = []
    for name in names:
        ends = ends_about(database, name)
        low, high = (derivatives_of(with_parameters(database, {name: end})) for end in ends)
        columns.append((high - low) / (ends[1] - ends[0]))
    return np.column_stack(columns)


def _told_apart(jacobian: Array, items: Sequence[Parameter], names: Sequence[str]) -> None:
    """Raise InputError for parameters that the derivatives and priors do not tell."""
    size = np.linalg.norm(jacobian, axis=0)
    still = [name for name, each in zip(names, size, strict=True) if not each > 0.0]
    if still:
        raise InputError(
            f"{', '.join(still)} changes none of the derivatives",
            "back-out",
            "leave it out, give a derivative that it acts on, or a prior_sigma in the database",
        )
    _, values, rows = np.linalg.svd(jacobian / size, full_matrices=False)
    if values[-1] > _APART * values[0]:
        return
    mixed = [name for name, each in zip(names, rows[-1], strict=True) if abs(each) > _TAKES_PART]
    raise InputError(
        f"{' and '.join(mixed)} are not told apart by these derivatives",
        "back-out",
        "give a prior_sigma of one in the database, leave one out, or give more derivatives",
    )


def _inside(jacobian: Array, left: Array, present: Array, bounds: tuple[Array, Array]) -> Array:
    """The step (k,) of least squares that stays inside the bounds."""
    from scipy.optimize import lsq_linear  # slow to import

    size = np.linalg.norm(jacobian, axis=0)
    low, high = ((end - present) * size for end in bounds)
    # A value at its bound leaves no room for the step: the solver needs some.
    room = 1e-12 * np.maximum(1.0, np.abs(present * size))
    found = lsq_linear(jacobian / size, left, (np.minimum(low, -room), np.maximum(high, room)))
    return np.asarray(found.x / size)
