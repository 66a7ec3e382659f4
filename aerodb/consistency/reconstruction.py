"""Flight-path reconstruction by output error: sensor errors, winds and first states that make all channels one motion.

Maximum likelihood with the measurement noise estimated (Jategaonkar 2015, chapters 4 and 10): Gauss-Newton with bounds and
Levenberg damping, any number of records jointly. Unknowns that the manoeuvres cannot tell apart are held and named. The
covariance is corrected for coloured residuals (Morelli & Klein, JGCD 20(1), 1997).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from aerodb.consistency.initial import first_states
from aerodb.consistency.input_noise import drift_information
from aerodb.consistency.normal import Sums, accumulate, belongs, first_state, residuals, split, usable
from aerodb.consistency.observability import Held, held_back
from aerodb.consistency.parameters import Parameter, unknowns
from aerodb.consistency.sensors import LONGEST_DELAY, Array, Record, Response, corrected_inputs, respond
from aerodb.errors import InputError
from aerodb.estimation.regression import coloured_sum

MOST_ITERATIONS = 40

#: Converged when no step exceeds this share of its standard error, or the log-likelihood gains less than this.
SMALL_STEP, SMALL_GAIN = 1e-3, 1e-4

#: A sensor whose scale is off by more than this shows something else; bounds may be given to say otherwise.
LARGEST_SCALE = 0.5

#: Where the noise is too small to matter, a channel is not trusted beyond this share of its parameter's natural size.
_WEAK = 1e-2


@dataclass(frozen=True)
class Estimate:
    """One estimated parameter in SI, its standard error (coloured residuals) and that for white residuals; `at_bound`."""

    parameter: Parameter
    value: float
    standard_error: float
    white_standard_error: float
    at_bound: bool = False


@dataclass(frozen=True)
class Path:
    """One record reconstructed: `states` (9, n) of kinematics.STATES; `air` (3, n) air-relative velocity at the CG; `inputs`
    (n, 6) corrected; `residuals` and `before` (n,) by channel, measured minus reconstructed after and before the estimation
    (nan where not used); `state_sigma` (9, n) and `air_sigma` (3, n) standard errors, of V, alpha, beta the latter."""

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
    """A joint reconstruction. `covariance` (k, k) of `estimates` in their order; `held` back parameters with reasons;
    `noise` one sigma of each channel's residual; `converged` and `iterations` of Gauss-Newton; one `paths` per record."""

    estimates: tuple[Estimate, ...]
    covariance: Array
    held: tuple[Held, ...]
    noise: Mapping[str, float]
    paths: tuple[Path, ...]
    converged: bool
    iterations: int

    def __getitem__(self, label: str) -> Estimate:
        """The estimate of a label (``ax_bias``, ``wind_north[flight]``); KeyError when it was not estimated."""
        return {estimate.parameter.label: estimate for estimate in self.estimates}[label]


@dataclass(frozen=True)
class Problem:
    """What is to be solved: records with first states, unknowns, values held, prior standard deviations (inf: none), bounds,
    and least believable noise by channel."""

    records: tuple[Record, ...]
    starts: tuple[Array, ...]
    items: tuple[Parameter, ...]
    fixed: Mapping[str, float]
    prior: Array
    lower: Array
    upper: Array
    floor: Mapping[str, float]

    def only(self, keep: Sequence[int]) -> "Problem":
        """The same with these unknowns; the others stay at zero."""
        index = list(keep)
        items = tuple(self.items[number] for number in index)
        return Problem(
            self.records, self.starts, items, self.fixed, self.prior[index], self.lower[index], self.upper[index], self.floor
        )

    def sums(self, vector: Array) -> Sums:
        return accumulate(self.records, self.starts, self.items, vector, self.fixed)

    def cost(self, vector: Array, sums: Sums) -> float:
        return sums.cost(self.floor) + 0.5 * float(np.sum((vector / self.prior) ** 2))


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
    hold: bool = True,
) -> Reconstruction:
    """Estimates sensor errors, winds and first states of all records together.

    Parameters
    ----------
    records : stretches of flight, names unique. free : parameter names (`parameters.known_names`) to estimate.
    initial : first states to estimate, per record. fixed : other parameters' values, SI.
    priors : name -> standard deviation about zero of what a calibration sheet says. bounds : name -> (lower, upper);
    without, delays stay within LONGEST_DELAY and scales within LARGEST_SCALE.
    noise_floor : channel -> least noise (one sigma, SI) that it is believed to have.
    starts : (9,) first states; None: `initial.first_states`. hold : hold what cannot be separated; otherwise a ValueError
    of the solver may come.

    Raises InputError when nothing can be estimated or the search leaves all bounds.
    """
    names = [record.name for record in records]
    if not records or len(set(names)) < len(names):
        raise InputError("records must have unique names, and be at least one", "reconstruction", "name them apart")
    measured = {name for record in records for name in record.outputs}
    wanted = [*free, *(f"initial_{state}" for state in initial if not any(state in record.given for record in records))]
    items = unknowns(wanted, [record.flight for record in records], names)
    limit = bounds or {}
    usual = {"delay": (-LONGEST_DELAY, LONGEST_DELAY), "scale": (-LARGEST_SCALE, LARGEST_SCALE)}
    span = np.array([limit.get(item.name, usual.get(item.kind, (-np.inf, np.inf))) for item in items])
    sigma = np.array([(priors or {}).get(item.name, np.inf) for item in items])
    first = tuple(starts) if starts is not None else tuple(first_states(record, fixed) for record in records)
    floor = {name: value for name, value in (noise_floor or {}).items() if name in measured}
    span = span.reshape(-1, 2)
    problem = Problem(tuple(records), first, items, dict(fixed or {}), sigma, span[:, 0], span[:, 1], floor)
    begin = problem.sums(np.zeros(len(items)))
    held: tuple[Held, ...] = ()
    vector, rough = np.zeros(len(items)), 0
    if hold:
        # a first solution under weak priors: noise is only known once the gross errors are out
        sizes = np.array([item.size for item in items])
        soft = Problem(
            problem.records, first, items, problem.fixed, np.minimum(sigma, sizes / _WEAK), span[:, 0], span[:, 1], floor
        )
        vector, sums, _, rough = _gauss_newton(soft, vector, begin)
        keep, held = held_back(items, _information(problem, sums))
        problem, vector = problem.only(keep), vector[keep]
        begin = problem.sums(vector)
    if not problem.items:
        raise InputError("these records determine none of the parameters", names[0], "fly manoeuvres that move more")
    vector, sums, converged, iterations = _gauss_newton(problem, vector, begin)
    return _result(problem, vector, sums, held, converged, rough + iterations)


def _information(problem: Problem, sums: Sums) -> Array:
    noise = sums.variance(problem.floor)
    total = np.diag(problem.prior**-2.0)
    for name, information in sums.information.items():
        total = total + information / noise[name]
    return total


def _gauss_newton(problem: Problem, vector: Array, sums: Sums) -> tuple[Array, Sums, bool, int]:
    """Steps until none matters; damping grows when the likelihood does not improve and fades when it does."""
    damping, cost = 0.0, problem.cost(vector, sums)
    size = np.array([item.size for item in problem.items])
    for iteration in range(1, MOST_ITERATIONS + 1):
        noise = sums.variance(problem.floor)
        matrix = _information(problem, sums)
        slope = sum((sums.gradient[name] / noise[name] for name in noise), np.zeros(len(vector))) - vector / problem.prior**2
        stuck = ((vector <= problem.lower) & (slope < 0)) | ((vector >= problem.upper) & (slope > 0))
        go = np.flatnonzero(~stuck)
        step, error = _step(matrix[np.ix_(go, go)], slope[go], size[go], damping)
        trial = vector.copy()
        trial[go] = np.clip(vector[go] + step, problem.lower[go], problem.upper[go])
        try:
            after = problem.sums(trial)
            better = problem.cost(trial, after)
        except InputError:
            better = np.inf
        if better <= cost + 1e-9 * abs(cost):
            small = len(go) == 0 or bool(np.max(np.abs(trial[go] - vector[go]) / error) < SMALL_STEP)
            small = small or cost - better < SMALL_GAIN
            vector, sums, cost, damping = trial, after, better, 0.0 if damping < 1e-6 else damping / 10
            if small and damping == 0.0:
                return vector, sums, True, iteration
        else:
            damping = max(10 * damping, 1e-4)
            if damping > 1e12:
                break
    return vector, sums, False, iteration


def _step(matrix: Array, slope: Array, size: Array, damping: float) -> tuple[Array, Array]:
    """Damped Newton step (k,) and standard errors (k,), solved in natural sizes."""
    scaled = matrix * np.outer(size, size)
    ridge = damping * np.diag(np.diag(scaled)) + 1e-12 * np.trace(scaled) / max(len(size), 1) * np.eye(len(size))
    inverse = np.linalg.inv(scaled + ridge)
    return size * (inverse @ (size * slope)), size * np.sqrt(np.diag(inverse))


def _result(
    problem: Problem, vector: Array, sums: Sums, held: tuple[Held, ...], converged: bool, iterations: int
) -> Reconstruction:
    noise = sums.variance(problem.floor)
    size = np.array([item.size for item in problem.items])
    white = np.linalg.inv(_information(problem, sums) * np.outer(size, size)) * np.outer(size, size)
    middle = np.diag(problem.prior**-2.0)
    drift = np.zeros_like(middle)
    for record, start in zip(problem.records, problem.starts, strict=True):
        index, values, response = _along(problem, vector, record, start)
        for name, error in residuals(record, response).items():
            good = usable(record, name, problem.items, values)
            block = coloured_sum(response.slopes[name] * good[:, None], np.where(good, error, 0.0))
            middle[np.ix_(index, index)] += block * len(good) / max(good.sum(), 1) / noise[name] ** 2
        own = [problem.items[number] for number in index]
        part = drift_information(record, values, first_state(start, values), own, response.slopes, noise)
        drift[np.ix_(index, index)] += part
    covariance = white + white @ drift @ white
    # residuals more coloured than white sensors and inertial drift make them: the estimates are as much less certain
    coloured = np.diag(white @ middle @ white)
    grow = np.sqrt(np.maximum(coloured / np.diag(covariance), 1.0))
    covariance = covariance * np.outer(grow, grow)
    estimates = tuple(
        Estimate(
            item,
            float(vector[number]),
            float(np.sqrt(covariance[number, number])),
            float(np.sqrt(white[number, number])),
            bool(vector[number] <= problem.lower[number] or vector[number] >= problem.upper[number]),
        )
        for number, item in enumerate(problem.items)
    )
    # responses are made again, one at a time: together they would not fit in memory for a long flight
    paths = tuple(_path(problem, vector, covariance, number) for number in range(len(problem.records)))
    return Reconstruction(
        estimates, covariance, held, {name: float(np.sqrt(value)) for name, value in noise.items()}, paths, converged, iterations
    )


def _along(problem: Problem, vector: Array, record: Record, start: Array) -> tuple[list[int], dict[str, float], Response]:
    """Which unknowns act on a record, their values, and its response with derivatives by them."""
    index = [number for number, item in enumerate(problem.items) if belongs(item, record)]
    values = split(problem.items, vector, record, problem.fixed)
    return index, values, respond(record, values, first_state(start, values), [problem.items[number] for number in index])


def _path(problem: Problem, vector: Array, covariance: Array, number: int) -> Path:
    record = problem.records[number]
    index, values, response = _along(problem, vector, record, problem.starts[number])
    after = {
        name: np.where(usable(record, name, problem.items, values), residual, np.nan)
        for name, residual in residuals(record, response).items()
    }
    untouched = respond(record, problem.fixed, problem.starts[number], (), slopes=False)
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
        return np.asarray(np.sqrt(np.maximum(np.einsum("snk,kl,snl->sn", slopes, own, slopes, optimize=True), 0.0)))

    return Path(
        record,
        response.states,
        response.air,
        corrected_inputs(record, values),
        after,
        residuals(record, untouched),
        sigma(response.state_slopes),
        sigma(flow),
    )
