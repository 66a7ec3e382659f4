"""Flight-path reconstruction by output error.

Estimates the sensor errors, winds and initial states with which all channels agree with one motion.
Maximum likelihood with estimated measurement noise (Jategaonkar 2015, chapters 4 and 10):
Gauss-Newton with bounds and Levenberg damping, any number of records jointly. Priors limit unknowns
that the manoeuvres cannot separate. The covariance is corrected for coloured residuals (Morelli &
Klein, JGCD 20(1), 1997).
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np

from aerodb.consistency.kinematics import STATES
from aerodb.consistency.output_error.gauss_newton import (
    SMALL_GAIN,
    ReconstructionProblem,
    ReconstructionSolution,
    information,
    make_problem,
    search,
)
from aerodb.consistency.output_error.initial_states import first_states
from aerodb.consistency.output_error.input_noise import drift_information
from aerodb.consistency.output_error.normal_equations import (
    ChannelNormalEquations,
    applies_to,
    first_state,
    record_values,
    residuals,
    usable_samples,
)
from aerodb.consistency.output_error.vertical_air import (
    AirSigns,
    Pull,
    air_columns,
    air_deviation,
    air_information,
    pull_and_signs,
)
from aerodb.consistency.reconstructed import Estimate, ReconstructedPath, Reconstruction
from aerodb.consistency.sensors import (
    FlightRecord,
    RecordPrediction,
    SensorParameter,
    corrected_inputs,
    parameter,
    predict_outputs,
)
from aerodb.errors import InputError
from aerodb.estimation import coloured_sum
from aerodb.support import Array
from aerodb.vehicle import VerticalAir

#: What `_covariances` returns.
_Covariances = tuple[Array, Array, Array, float, tuple[ReconstructedPath, ...]]


def reconstruct(
    records: Sequence[FlightRecord],
    free: Sequence[str],
    *,
    initial: Sequence[str] = ("u", "v", "w", "phi", "theta", "psi", "altitude"),
    fixed: Mapping[str, float] | None = None,
    priors: Mapping[str, float] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    noise_floor: Mapping[str, float] | None = None,
    starts: Sequence[Array] | None = None,
    near: Reconstruction | None = None,
    least_gain: float = SMALL_GAIN,
    vertical_air: VerticalAir | None = None,
    details: bool = True,
    errors: bool = True,
) -> Reconstruction:
    """Estimate sensor errors, winds and initial states of all records together.

    Parameters
    ----------
    records : stretches of flight with unique names.
    free : names of the parameters to estimate (`parameters.known_names`).
    initial : states whose initial value is estimated, per record.
    fixed : other parameters, name -> value, SI.
    priors : name -> standard deviation about zero, SI, as a calibration sheet states it.
    bounds : name -> (lower, upper), SI; by default delays are bounded by `MAX_DELAY` and scales by
        `LARGEST_SCALE`.
    noise_floor : channel -> smallest credible noise (one sigma), SI.
    starts : initial states, (9,) each; None: `initial_states.first_states`.
    near : a reconstruction of some of the same records that is probably close: the search starts
        there.
    least_gain : gain of log-likelihood below which a step ends the search.
    vertical_air : prior of the vertical motion of the air, which widens the covariance; None: none.
    details : whether the paths have standard errors and the residuals before the estimation, for
        which the motion is integrated twice more.
    errors : whether the covariance holds coloured residuals, drift and moving air, which takes as
        long as the search; without, it is that of white residuals until `Reconstruction.whole` is
        asked for. It is for a look at residuals, without details.

    No parameter is fixed for lack of information: those that the manoeuvres cannot separate need a
    prior, and their standard error then shows it.

    Raises
    ------
    InputError : when nothing can be estimated or the search leaves all bounds.
    numpy.linalg.LinAlgError : possible when parameters cannot be separated and have no prior.

    References
    ----------
    Jategaonkar (2015), Flight Vehicle System Identification, chapters 4 and 10; Morelli & Klein,
    JGCD 20(1), 1997 (covariance for coloured residuals).
    """
    found = {} if near is None else _without_others(near, {*free, *(fixed or {})})
    if starts is None and near is not None:
        starts = [_first_state(record, fixed or {}, near, found) for record in records]
    problem = make_problem(records, free, initial, fixed, priors, bounds, noise_floor, starts)
    if not problem.items:
        raise InputError(
            "these records determine none of the parameters",
            records[0].name,
            "fly manoeuvres that move more",
        )
    start = np.zeros(len(problem.items)) if near is None else _start(problem, near, found)
    known = set() if near is None else {path.record.name for path in near.paths}
    close = all(record.name in known for record in records)
    solution = search(problem, start, least_gain, close, None if near is None else near.noise)
    if not errors:
        white = _white(problem, solution.equations)
        paths = tuple(
            _path(problem, solution.vector, number) for number in range(len(problem.records))
        )
        return replace(
            _reconstruction(problem, solution, (white, white, np.zeros_like(white), 0.0, paths)),
            completed=lambda: _completed(problem, solution, vertical_air, details),
        )
    return _completed(problem, solution, vertical_air, details)


def _completed(
    problem: ReconstructionProblem,
    solution: ReconstructionSolution,
    vertical_air: VerticalAir | None,
    details: bool,
) -> Reconstruction:
    """The reconstruction with its covariances."""
    found = _covariances(problem, solution.vector, solution.equations, vertical_air)
    result = _reconstruction(problem, solution, found)
    if not details:
        return result
    paths = tuple(
        _detailed(problem, solution.vector, result.covariance, number, path)
        for number, path in enumerate(result.paths)
    )
    return replace(result, paths=paths)


def _reconstruction(
    problem: ReconstructionProblem, solution: ReconstructionSolution, found: _Covariances
) -> Reconstruction:
    """The reconstruction with covariances and paths as `_covariances` returns them."""
    vector, (still, white, moved, air_sigma, paths) = solution.vector, found
    covariance = still + moved
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
    variance = solution.equations.variance(problem.noise_floor)
    noise = {name: float(np.sqrt(value)) for name, value in variance.items()}
    return Reconstruction(
        estimates,
        covariance,
        still,
        white,
        noise,
        paths,
        solution.converged,
        solution.iterations,
        air_sigma,
    )


def _without_others(near: Reconstruction, names: Collection[str]) -> dict[str, float]:
    """Label -> value of the estimates of a reconstruction if its sensor parameters that are not
    among these names are zero; of an initial state, the change of the value."""
    value = np.array([entry.value for entry in near.estimates])
    gone = [
        number
        for number, entry in enumerate(near.estimates)
        if entry.parameter.kind != "initial" and entry.parameter.name not in names
    ]
    change = np.zeros(len(value))
    if gone:
        spread = near.white[np.ix_(gone, gone)]
        size = np.sqrt(np.diag(spread))
        pushed = np.linalg.lstsq(spread / np.outer(size, size), value[gone] / size, rcond=None)[0]
        change = -near.white[:, gone] @ (pushed / size)
    return {
        entry.parameter.label: float(
            change[number] + (0.0 if entry.parameter.kind == "initial" else value[number])
        )
        for number, entry in enumerate(near.estimates)
    }


def _first_state(
    record: FlightRecord,
    fixed: Mapping[str, float],
    near: Reconstruction,
    found: Mapping[str, float],
) -> Array:
    """Initial state (9,) of a record: as reconstructed before, with its change in `found`,
    otherwise from its first samples, with the wind found before."""
    for path in near.paths:
        if path.record.name == record.name:
            labels = [parameter(f"initial_{name}", record.name).label for name in STATES]
            return path.states[:, 0] + np.array([found.get(label, 0.0) for label in labels])
    return first_states(record, {**_winds(record, near), **fixed})


def _winds(record: FlightRecord, near: Reconstruction) -> dict[str, float]:
    """Name -> value of the winds of a record's flight, or of all flights' mean."""
    own: dict[str, list[float]] = {}
    every: dict[str, list[float]] = {}
    for entry in near.estimates:
        if entry.parameter.kind == "wind":
            every.setdefault(entry.parameter.name, []).append(entry.value)
            if entry.parameter.scope == record.flight:
                own.setdefault(entry.parameter.name, []).append(entry.value)
    return {name: float(np.mean(values)) for name, values in {**every, **own}.items()}


def _start(
    problem: ReconstructionProblem, near: Reconstruction, found: Mapping[str, float]
) -> Array:
    """(k,) values to start from: those found before; initial states are those of the problem."""
    winds = {record.flight: _winds(record, near) for record in problem.records}
    vector = np.array(
        [
            0.0
            if item.kind == "initial"
            else found.get(item.label, winds.get(item.scope, {}).get(item.name, 0.0))
            for item in problem.items
        ]
    )
    return np.clip(vector, problem.lower, problem.upper)


def _covariances(
    problem: ReconstructionProblem,
    vector: Array,
    sums: ChannelNormalEquations,
    air: VerticalAir | None,
) -> _Covariances:
    """Covariance (k, k) of the unknowns for coloured residuals and inertial drift, the one for
    white residuals, what vertical air adds to the first, and the air's standard deviation [m/s];
    and the paths, without details."""
    noise, white = sums.variance(problem.noise_floor), _white(problem, sums)
    middle = np.diag(problem.prior**-2.0)
    drift = np.zeros_like(middle)
    # An accelerometer feels the air's changes as the aircraft does: what is measured in inertial
    # space is not wrong by them, the vane is.
    vane = np.array(["alpha" in item.name for item in problem.items])
    felt: list[tuple[Pull, AirSigns]] = []
    paths: list[ReconstructedPath] = []
    # one response at a time: those of a long flight do not fit in memory together
    for record, start in zip(problem.records, problem.starts, strict=True):
        index, values = _acting(problem, vector, record)
        own = [problem.items[number] for number in index]
        first, (swing, more) = first_state(start, values), _swing(record, own)
        response = predict_outputs(record, values, first, [*own, *more])
        errors = residuals(record, response)
        slopes = {name: slope[:, : len(own)] for name, slope in response.slopes.items()}
        usable = {name: usable_samples(record, name, problem.items, values) for name in errors}
        for name, error in errors.items():
            good = usable[name]
            block = coloured_sum(slopes[name] * good[:, None], np.where(good, error, 0.0))
            middle[np.ix_(index, index)] += (
                block * len(good) / max(good.sum(), 1) / noise[name] ** 2
            )
        columns = None
        if air is not None and air.sigma > 0 and vane.any():
            columns = air_columns(record, values, first, air)
            slopes = columns.beside(slopes)
        part = drift_information(record, values, response, swing, own, slopes, noise)
        drift[np.ix_(index, index)] += part[: len(index), : len(index)]
        if columns is not None:
            felt.append(pull_and_signs(record, columns, slopes, errors, usable, noise, part, index))
        paths.append(_without_details(problem, record, values, response))
    covariance = white + white @ drift @ white
    # enlarge it where residuals are more coloured than white noise and inertial drift explain
    coloured = np.diag(white @ middle @ white)
    grow = np.sqrt(np.maximum(coloured / np.diag(covariance), 1.0))
    covariance = covariance * np.outer(grow, grow)
    moved, sigma = np.zeros_like(white), 0.0
    if air is not None and felt:
        sigma = air_deviation([signs for _, signs in felt], vector, problem.prior, air)
        known = VerticalAir(sigma=sigma, time=air.time)
        total = air_information([pull for pull, _ in felt], known, len(white))
        moved = white @ total @ white * np.outer(vane, vane)
    return np.asarray(covariance), white, moved, sigma, tuple(paths)


def _white(problem: ReconstructionProblem, sums: ChannelNormalEquations) -> Array:
    """Covariance (k, k) of the unknowns for white residuals."""
    size = np.array([item.size for item in problem.items])
    scaled = information(problem, sums) * np.outer(size, size)
    return np.asarray(np.linalg.inv(scaled) * np.outer(size, size), dtype=np.float64)


def _path(problem: ReconstructionProblem, vector: Array, number: int) -> ReconstructedPath:
    """The path of a record, without details."""
    record = problem.records[number]
    _, values = _acting(problem, vector, record)
    first = first_state(problem.starts[number], values)
    response = predict_outputs(record, values, first, (), slopes=False)
    return _without_details(problem, record, values, response)


def _without_details(
    problem: ReconstructionProblem,
    record: FlightRecord,
    values: Mapping[str, float],
    response: RecordPrediction,
) -> ReconstructedPath:
    usable = {
        name: usable_samples(record, name, problem.items, values) for name in response.outputs
    }
    return ReconstructedPath(
        record,
        response.states,
        response.air,
        corrected_inputs(record, values),
        {
            name: np.where(usable[name], error, np.nan)
            for name, error in residuals(record, response).items()
        },
        {},
        np.full(response.states.shape, np.nan),
        np.full(response.air.shape, np.nan),
    )


def _swing(
    record: FlightRecord, own: Sequence[SensorParameter]
) -> tuple[list[int], list[SensorParameter]]:
    """Numbers of the initial values of a record's integrated states among its unknowns `own`, and
    the further parameters for those that are not among them, which follow."""
    known = {item.name: number for number, item in enumerate(own)}
    numbers: list[int] = []
    more: list[SensorParameter] = []
    for state in STATES:
        if state in record.given:
            continue
        name = f"initial_{state}"
        if name not in known:
            more.append(parameter(name, record.name))
        numbers.append(known.get(name, len(own) + len(more) - 1))
    return numbers, more


def _acting(
    problem: ReconstructionProblem, vector: Array, record: FlightRecord
) -> tuple[list[int], dict[str, float]]:
    """Indices of the unknowns that act on a record, and its parameters' values."""
    index = [number for number, item in enumerate(problem.items) if applies_to(item, record)]
    return index, record_values(problem.items, vector, record, problem.fixed)


def _detailed(
    problem: ReconstructionProblem,
    vector: Array,
    covariance: Array,
    number: int,
    path: ReconstructedPath,
) -> ReconstructedPath:
    """A path with its standard errors and the residuals before the estimation."""
    record, start = problem.records[number], problem.starts[number]
    index, values = _acting(problem, vector, record)
    unknowns = [problem.items[k] for k in index]
    response = predict_outputs(record, values, first_state(start, values), unknowns)
    untouched = predict_outputs(record, problem.fixed, start, (), slopes=False)
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

    return replace(
        path,
        before=residuals(record, untouched),
        state_sigma=sigma(response.state_slopes),
        air_sigma=sigma(flow),
    )
