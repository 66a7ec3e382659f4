"""Flight-path reconstruction by output error: sensor errors, winds and first states that make all
channels one motion.

Maximum likelihood with the measurement noise estimated (Jategaonkar 2015, chapters 4 and 10):
Gauss-Newton with bounds and Levenberg damping, any number of records jointly. Priors keep unknowns
within reason that the manoeuvres cannot tell apart. The covariance is corrected for coloured
residuals (Morelli & Klein, JGCD 20(1), 1997).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from aerodb.consistency.output_error.gauss_newton import (
    Problem,
    gauss_newton,
    information,
    make_problem,
)
from aerodb.consistency.output_error.input_noise import drift_information
from aerodb.consistency.output_error.normal_equations import (
    NormalEquations,
    applies_to,
    first_state,
    record_values,
    residuals,
    usable_samples,
)
from aerodb.consistency.sensors import (
    Parameter,
    Record,
    Response,
    corrected_inputs,
    predict_outputs,
)
from aerodb.errors import InputError
from aerodb.estimation import coloured_sum
from aerodb.support import Array


@dataclass(frozen=True)
class Estimate:
    """One estimated parameter in SI, its standard error (coloured residuals) and that for white
    residuals; `at_bound`."""

    parameter: Parameter
    value: float
    standard_error: float
    white_standard_error: float
    at_bound: bool = False


@dataclass(frozen=True)
class ReconstructedPath:
    """One record reconstructed: `states` (9, n) of kinematics.STATES; `air` (3, n) air-relative
    velocity at the CG; `inputs` (n, 6) corrected; `residuals` and `before` (n,) by channel,
    measured minus reconstructed after and before the estimation (nan where not used); `state_sigma`
    (9, n) and `air_sigma` (3, n) standard errors, of V, alpha, beta the latter."""

    record: Record
    states: Array
    air: Array
    inputs: Array
    residuals: Mapping[str, Array]
    before: Mapping[str, Array]
    state_sigma: Array
    air_sigma: Array

    @property
    def V(self) -> Array:
        """(n,) true airspeed at the CG, m/s."""
        return np.asarray(np.sqrt(np.sum(self.air**2, axis=0)))

    @property
    def alpha(self) -> Array:
        """(n,) angle of attack at the CG, rad."""
        return np.asarray(np.arctan2(self.air[2], self.air[0]))

    @property
    def beta(self) -> Array:
        """(n,) angle of sideslip at the CG, rad."""
        return np.asarray(np.arcsin(self.air[1] / self.V))


@dataclass(frozen=True)
class Reconstruction:
    """A joint reconstruction. `covariance` (k, k) of `estimates` in their order; `noise` one sigma
    of each channel's residual; `converged` and `iterations` of Gauss-Newton; one `paths` per
    record."""

    estimates: tuple[Estimate, ...]
    covariance: Array
    noise: Mapping[str, float]
    paths: tuple[ReconstructedPath, ...]
    converged: bool
    iterations: int

    def __getitem__(self, label: str) -> Estimate:
        """The estimate of a label (``ax_bias``, ``wind_north[flight]``); KeyError when it was not
        estimated."""
        return {estimate.parameter.label: estimate for estimate in self.estimates}[label]


def reconstruct(
    records: Sequence[Record],
    free: Sequence[str],
    *,
    initial: Sequence[str] = ("u", "v", "w", "phi", "theta", "psi", "altitude"),
    fixed: Mapping[str, float] | None = None,
    priors: Mapping[str, float] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    noise_floor: Mapping[str, float] | None = None,
    starts: Sequence[Array] | None = None,
) -> Reconstruction:
    """Estimates sensor errors, winds and first states of all records together.

    Parameters
    ---------- records : stretches of flight, names unique. free : parameter names
    (`parameters.known_names`) to estimate. initial : first states to estimate, per record. fixed :
    other parameters' values, SI. priors : name -> standard deviation about zero of what a
    calibration sheet says. bounds : name -> (lower, upper); without, delays stay within
    LONGEST_DELAY and scales within LARGEST_SCALE. noise_floor : channel -> least noise (one sigma,
    SI) that it is believed to have. starts : (9,) first states; None: `initial.first_states`.

    Nothing is held for want of information: what the manoeuvres cannot tell apart needs a prior,
    which its standard error then shows; without one a LinAlgError of the solver may come.

    Raises InputError when nothing can be estimated or the search leaves all bounds.
    """
    problem = make_problem(records, free, initial, fixed, priors, bounds, noise_floor, starts)
    if not problem.items:
        raise InputError(
            "these records determine none of the parameters",
            records[0].name,
            "fly manoeuvres that move more",
        )
    start = np.zeros(len(problem.items))
    solution = gauss_newton(problem, start, problem.sums(start))
    vector, sums = solution.vector, solution.equations
    covariance, white = _covariances(problem, vector, sums)
    estimates = tuple(
        Estimate(
            item,
            float(vector[number]),
            float(np.sqrt(covariance[number, number])),
            float(np.sqrt(white[number, number])),
            bool(
                vector[number] <= problem.lower[number] or vector[number] >= problem.upper[number]
            ),
        )
        for number, item in enumerate(problem.items)
    )
    # recompute the responses one at a time: those of a long flight do not fit in memory together
    paths = tuple(_path(problem, vector, covariance, number) for number in range(len(records)))
    noise = {
        name: float(np.sqrt(value)) for name, value in sums.variance(problem.noise_floor).items()
    }
    return Reconstruction(
        estimates, covariance, noise, paths, solution.converged, solution.iterations
    )


def _covariances(problem: Problem, vector: Array, sums: NormalEquations) -> tuple[Array, Array]:
    """Covariance (k, k) of the unknowns for coloured residuals and inertial drift, and that for
    white residuals."""
    noise = sums.variance(problem.noise_floor)
    size = np.array([item.size for item in problem.items])
    white = np.asarray(
        np.linalg.inv(information(problem, sums) * np.outer(size, size)) * np.outer(size, size),
        dtype=np.float64,
    )
    middle = np.diag(problem.prior**-2.0)
    drift = np.zeros_like(middle)
    for record, start in zip(problem.records, problem.starts, strict=True):
        index, values, response = _predicted(problem, vector, record, start)
        for name, error in residuals(record, response).items():
            good = usable_samples(record, name, problem.items, values)
            block = coloured_sum(response.slopes[name] * good[:, None], np.where(good, error, 0.0))
            middle[np.ix_(index, index)] += (
                block * len(good) / max(good.sum(), 1) / noise[name] ** 2
            )
        own = [problem.items[number] for number in index]
        part = drift_information(
            record, values, first_state(start, values), own, response.slopes, noise
        )
        drift[np.ix_(index, index)] += part
    covariance = white + white @ drift @ white
    # residuals more coloured than white sensors and inertial drift make them: the estimates are as
    # much less certain
    coloured = np.diag(white @ middle @ white)
    grow = np.sqrt(np.maximum(coloured / np.diag(covariance), 1.0))
    return np.asarray(covariance * np.outer(grow, grow)), white


def _predicted(
    problem: Problem, vector: Array, record: Record, start: Array
) -> tuple[list[int], dict[str, float], Response]:
    """Which unknowns act on a record, their values, and its response with derivatives by them."""
    index = [number for number, item in enumerate(problem.items) if applies_to(item, record)]
    values = record_values(problem.items, vector, record, problem.fixed)
    return (
        index,
        values,
        predict_outputs(
            record, values, first_state(start, values), [problem.items[number] for number in index]
        ),
    )


def _path(problem: Problem, vector: Array, covariance: Array, number: int) -> ReconstructedPath:
    record = problem.records[number]
    index, values, response = _predicted(problem, vector, record, problem.starts[number])
    after = {
        name: np.where(usable_samples(record, name, problem.items, values), residual, np.nan)
        for name, residual in residuals(record, response).items()
    }
    untouched = predict_outputs(record, problem.fixed, problem.starts[number], (), slopes=False)
    own = covariance[np.ix_(index, index)]
    u, v, w = response.air
    speed, square = np.sqrt(u * u + v * v + w * w), u * u + w * w
    du, dv, dw = response.air_slopes
    along = (u[:, None] * du + v[:, None] * dv + w[:, None] * dw) / speed[:, None]
    flow = np.stack(
        [
            along,
            (u / square)[:, None] * dw - (w / square)[:, None] * du,
            (dv - (v / speed)[:, None] * along) / np.sqrt(square)[:, None],
        ]
    )

    def sigma(slopes: Array) -> Array:
        return np.asarray(
            np.sqrt(
                np.maximum(np.einsum("snk,kl,snl->sn", slopes, own, slopes, optimize=True), 0.0)
            )
        )

    return ReconstructedPath(
        record,
        response.states,
        response.air,
        corrected_inputs(record, values),
        after,
        residuals(record, untouched),
        sigma(response.state_slopes),
        sigma(flow),
    )
