"""Trim: the steady flight of a database at a stated condition, and how it moves with its estimates.

The accelerations are those of the engine (`simulate`); all perturbations of a Jacobian fly side by
side.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from scipy.optimize import least_squares

from aerodb.errors import InputError
from aerodb.physics import GRAVITY
from aerodb.simulation.condition import Condition
from aerodb.simulation.engine import FlightModel, Simulation
from aerodb.simulation.ground import carrying_height
from aerodb.simulation.parameter_covariance import parameter_covariance
from aerodb.simulation.trim_problem import (
    AXES,
    BOUNDS,
    Control,
    TrimProblem,
    is_force,
    load_factors,
    problem_of,
)
from aerodb.support import Array
from aerodb.tables import STILL_AIR

#: Steady flight: largest acceleration left, as a share of gravity (angular ones by the reference
#: lengths).
TOLERANCE: Final = 1e-7
#: Accelerations that a trim makes zero, with their units for messages.
_RESIDUALS: Final = (
    ("along x", "m/s2"), ("along y", "m/s2"), ("along z", "m/s2"),
    ("in roll", "deg/s2"), ("in pitch", "deg/s2"), ("in yaw", "deg/s2"),
    ("of the load factor", "g"),
)  # fmt: skip


class NoTrimError(InputError):
    """No steady flight at a condition."""


@dataclass(frozen=True, eq=False)
class Trim:
    """A steady flight.

    Parameters
    ----------
    channels : name -> value [SI]: motion, attitude, path (``climb``), ``turn_rate``, load factors
        ``ny``, ``nz`` (body axes) and ``load_factor``, mach, qbar, coefficients.
    deflections : input of the database, and the thrust -> value [SI].
    standard_errors : of both, from the covariance of the version's estimates.
    start, series : for `simulate`.
    notes : what the user must know, such as tables that were left.
    problem, point : what was solved, and the unknowns (u,) found.
    """

    channels: Mapping[str, float]
    deflections: Mapping[str, float]
    standard_errors: Mapping[str, float]
    start: Mapping[str, float]
    series: Mapping[str, float]
    notes: tuple[str, ...]
    problem: TrimProblem = field(repr=False)
    point: Array = field(repr=False)


def trim(
    model: FlightModel,
    condition: Condition,
    inputs: Mapping[str, float],
    *,
    controls: Mapping[str, str | Control] | None = None,
    limits: Mapping[str, tuple[float, float]] | None = None,
    thrust: str = "force_x",
    begin: Trim | None = None,
) -> Trim:
    """Find the steady flight of a model at a condition.

    Parameters
    ----------
    model : over the flat earth.
    inputs : mass properties, configuration and what else is given [SI]; other inputs are 0, and
        surfaces that are not given can be controls.
    controls : roll, pitch, yaw -> input, or inputs with gains; those not named are found from their
        moments (`control_inputs`).
    limits : input -> (lower, upper) [SI]. The thrust is above 0 by default, and surfaces are free.
    thrust : series that holds the airspeed: a force along body x through the CG [N], or an input of
        the model. With `condition.climb` None the path angle does, at the thrust in `inputs`.
    begin : a neighbouring trim to start from.

    Raises NoTrimError with what limits the flight; InputError for unknown names.
    """
    problem = problem_of(model, condition, inputs, controls, limits or {}, thrust)
    point, residual = _solved(problem, begin)
    _check(problem, point, residual, limits or {})
    run = problem.flown(point[:, None])
    start, series = problem.placed(point[:, None])
    channels = _channels(problem, run, point[:, None])
    deflections = {name: float(series[name][0, 0]) for name in _shown(problem)}
    return Trim(
        {name: float(values[0]) for name, values in channels.items()},
        deflections,
        _errors(problem, point),
        {name: float(value[0]) for name, value in start.items()},
        {name: float(value[0, 0]) for name, value in series.items()},
        _notes(model, run),
        problem,
        point,
    )


#: Largest compression of legs [m] at which a start on the ground is looked for.
_DEEPEST: Final = 1.0


def _notes(model: FlightModel, run: Simulation) -> tuple[str, ...]:
    notes = [f"table {name} is left; its edge is held" for name in sorted(run.left)]
    if any(any(increment.folded) for increment in model.database.increments):
        notes.append("estimates that are folded into tables are taken as exact")
    return tuple(notes)


def _shown(problem: TrimProblem) -> list[str]:
    thrust = [problem.thrust] if problem.thrust else []
    return [*problem.model.inputs, *(name for name in thrust if name not in problem.model.inputs)]


def _channels(problem: TrimProblem, run: Simulation, z: Array) -> dict[str, Array]:
    """Values (k,) of what a trim states."""
    names = (
        "V", "alpha", "beta", "p", "q", "r", "phi", "theta", "altitude", "mach", "qbar", "rho",
        "CX", "CY", "CZ", "Cl", "Cm", "Cn",
    )  # fmt: skip
    channels = {name: run.channels[name][-1] for name in names}
    channels["climb"] = np.arcsin(
        np.clip(
            -run.channels["velocity_down"][-1] / np.maximum(channels["V"], STILL_AIR), -1.0, 1.0
        )
    )
    found = dict(zip(problem.unknowns, z, strict=True))
    turn = problem.condition.fixed.get("turn_rate", 0.0)
    channels["turn_rate"] = found.get("turn_rate", np.full(z.shape[1], turn))
    channels |= dict(zip(("ny", "nz", "load_factor"), load_factors(run), strict=True))
    return channels


def _carried(problem: TrimProblem, guess: Mapping[str, float]) -> float:
    """Height [m] at which the legs carry nearly all, at the attitude of a guess."""
    touching = carrying_height(problem.model.database, problem.inputs.get("cg_z", 0.0))
    heights = touching - np.linspace(0.0, _DEEPEST, 101)
    z = np.repeat([[guess[name]] for name in problem.unknowns], len(heights), axis=1)
    z[problem.unknowns.index("height")] = heights
    return float(heights[np.abs(problem.accelerations(z)[2]).argmin()])


def _begins(problem: TrimProblem, begin: Trim | None) -> Iterator[Array]:
    """First guesses (u,) of the unknowns."""
    condition = problem.condition
    guess = dict.fromkeys(problem.unknowns, 0.0)
    rates = problem.model.database.rates
    guess |= {name: rates[name].initial for name in problem.states}
    if condition.load_factor is not None and not condition.pull_up:
        guess["phi"] = float(np.arccos(min(1.0 / max(condition.load_factor, 1.01), 1.0)))
        guess["turn_rate"] = GRAVITY * np.tan(guess["phi"]) / condition.V
    elif condition.bank and "turn_rate" in guess:
        guess["turn_rate"] = GRAVITY * np.tan(condition.bank) / condition.V
    elif condition.turn_rate and "phi" in guess:
        guess["phi"] = float(np.arctan(condition.V * condition.turn_rate / GRAVITY))
    if "height" in guess:
        guess["height"] = _carried(problem, guess)
    if "climb" in guess:
        guess["climb"] = -0.1
    if problem.thrust:
        low, high = problem.bounds[-1]
        weight = problem.scales[-1]
        guess[problem.thrust] = 0.1 * weight if weight > 1 else float(np.clip(0.5, low, high))
    if begin is not None and begin.problem.unknowns == problem.unknowns:
        yield np.asarray(begin.point)
    for alpha in (0.05, 0.15, -0.05, 0.3):
        own = {"theta": 0.05 - alpha, "alpha": alpha}
        yield np.array([{**guess, **own}[name] for name in problem.unknowns])


def _solved(problem: TrimProblem, begin: Trim | None) -> tuple[Array, Array]:
    """Unknowns (u,) and residual (r,) of the best search."""
    low, high = (problem.bounds / problem.scales[:, None]).T

    def function(scaled: Array) -> Array:
        return problem.residual((scaled * problem.scales)[:, None])[:, 0]

    def jacobian(scaled: Array) -> Array:
        return problem.jacobian(scaled * problem.scales) * problem.scales

    best: tuple[Array, Array] | None = None
    for first in _begins(problem, begin):
        margin = np.where(np.isfinite(high - low), 1e-6 * (high - low), 1e-6)
        inside = np.clip(first / problem.scales, low + margin, high - margin)
        found = least_squares(
            function, inside, jacobian, bounds=(low, high), xtol=1e-15, ftol=1e-15, gtol=1e-15,
            max_nfev=200,
        )  # fmt: skip
        residual = function(found.x)
        if best is None or np.abs(residual).max() < np.abs(best[1]).max():
            best = found.x * problem.scales, residual
        if np.abs(residual).max() < TOLERANCE:
            break
    assert best is not None
    if np.abs(best[1]).max() < TOLERANCE:
        return best
    return _balanced(problem, best[0])


def _balanced(problem: TrimProblem, point: Array) -> tuple[Array, Array]:
    """Return where there is no trim: the moments balanced as far as the controls can, so that what
    is left is what limits the flight."""
    k = [problem.unknowns.index(name) for name in problem.controls]

    def whole(controls: Array) -> Array:
        moved = point.copy()
        moved[k] = controls
        return moved

    def moments(controls: Array) -> Array:
        return problem.residual(whole(controls)[:, None])[3:6, 0]

    if k:
        low, high = problem.bounds[k].T
        inside = np.clip(point[k], low + 1e-9, high - 1e-9)
        found = least_squares(moments, inside, bounds=(low, high))
        point = whole(found.x)
    return point, problem.residual(point[:, None])[:, 0]


def _check(
    problem: TrimProblem,
    point: Array,
    residual: Array,
    limits: Mapping[str, tuple[float, float]],
) -> None:
    """Raise NoTrimError unless the flight is steady with every surface inside its limits."""
    condition = problem.condition
    where = (
        f"trim of {problem.model.database.name} at V {condition.V:g} m/s,"
        f" altitude {condition.altitude:g} m"
    )
    reasons = []
    _, series = problem.placed(point[:, None])
    for name, (low, high) in limits.items():
        value = float(series[name][0, 0]) if name in series else 0.0
        slack = 1e-9 * (high - low) if np.isfinite(high - low) else 0.0
        if not low - slack <= value <= high + slack:
            ends = f"{_shown_value(name, low)} to {_shown_value(name, high)}"
            reasons.append(f"{name} would need {_shown_value(name, value)}, its range is {ends}")
    if np.abs(residual).max() < TOLERANCE and not reasons:
        return
    if np.abs(residual).max() >= TOLERANCE:
        for name, value, (low, high) in zip(problem.unknowns, point, problem.bounds, strict=True):
            for end, bound in (("lower", low), ("upper", high)):
                near = 1e-4 * (high - low if np.isfinite(high - low) else max(abs(bound), 1.0))
                if np.isfinite(bound) and abs(value - bound) <= near:
                    reasons.append(f"{name} is at its {end} limit, {_shown_value(name, bound)}")
        if abs(residual[2]) >= max(np.abs(residual).max(), 1e-3):
            how = "too small" if residual[2] > 0 else "too large"
            share = f"{100 * abs(residual[2]):.2g} % of the weight"
            reasons.append(f"at its best the lift is {how} by {share}")
        left_tables = sorted(problem.flown(point[:, None]).left)
        if left_tables:
            reasons.append(f"table {' and '.join(left_tables)} is left, with its edge held")
        turning = np.abs(residual[3:6]).max() > np.abs(residual[:3]).max()
        if len(problem.controls) < len(AXES) and turning and not reasons:
            names = ", ".join(problem.controls) or "none"
            reasons.append(f"roll, pitch and yaw have too few controls: {names}")
    left = problem.accelerations(point[:, None])[:, 0]
    count = len(left) - len(problem.states)
    named = (*_RESIDUALS[:count], *((f"of {name}", "1/s") for name in problem.states))
    shown = [
        f"{np.rad2deg(value) if unit == 'deg/s2' else value:.3g} {unit} {axis}"
        for value, weighted, (axis, unit) in zip(left, residual, named, strict=True)
        if abs(weighted) > max(TOLERANCE, 0.01 * np.abs(residual).max())
    ]
    what = "no steady flight: " + ("; ".join(reasons) if reasons else "no solution was found")
    if np.abs(residual).max() >= TOLERANCE:
        what += f". What is left: {', '.join(shown)}"
    raise NoTrimError(
        what, where, "change airspeed, mass or configuration, or widen what is at its limit"
    )


def _shown_value(name: str, value: float) -> str:
    if is_force(name):
        return f"{value:.4g} N"
    angle = name in BOUNDS or "delta_" in name
    return f"{np.rad2deg(value):.4g} deg{'/s' * (name == 'turn_rate')}" if angle else f"{value:.4g}"


def varied(model: FlightModel) -> tuple[Array, dict[str, Array]]:
    """Parameter sets for central differences over all parameters: the steps (p,), a tenth of each
    standard error, and parameter -> values (2 p,), first the raised ones."""
    steps = 0.1 * np.sqrt(np.diag(parameter_covariance(model)))
    p = len(steps)
    values = np.array(list(model.parameters.values()))[:, None] + np.hstack(
        [np.diag(steps), -np.diag(steps)]
    )
    return steps, {name: values[k] for k, name in enumerate(model.parameters)} if p else {}


def differences(values: Array, steps: Array) -> Array:
    """Derivatives (..., p) from values (..., 2 p) at `varied` parameters; 0 for fixed ones.

    The unit is that of the values over that of the parameter.
    """
    p = len(steps)
    moving = np.where(steps > 0, steps, 1.0)
    return np.asarray(np.where(steps > 0, (values[..., :p] - values[..., p:]) / (2 * moving), 0.0))


def moved_points(problem: TrimProblem, point: Array, steps: Array) -> Array:
    """The unknowns (u, 2 p) of the trims at `varied` parameters, to first order (implicit
    function).

    Unknowns are angles and deflections [rad], rates [rad/s], and thrust [N].
    """
    _, parameters = varied(problem.model)
    lanes = np.repeat(point[:, None], 2 * len(steps), axis=1)
    by_parameter = differences(problem.residual(lanes, parameters), steps)
    # By the pseudo-inverse, an unknown that nothing determines does not move.
    inverse = np.linalg.pinv(problem.jacobian(point) * problem.scales, rcond=1e-9)
    change = -problem.scales[:, None] * (inverse @ by_parameter) * steps
    return np.asarray(point[:, None] + np.hstack([change, -change]))


def _errors(problem: TrimProblem, point: Array) -> dict[str, float]:
    """Standard errors of channels and deflections: the trim moves with the parameters."""
    steps, parameters = varied(problem.model)
    if not len(steps):
        return {}
    points = moved_points(problem, point, steps)
    values = _channels(problem, problem.flown(points, parameters), points)
    _, series = problem.placed(points)
    values |= {name: series[name][0] for name in _shown(problem)}
    covariance = parameter_covariance(problem.model)
    errors = {}
    for name, value in values.items():
        slopes = differences(value, steps)
        error = float(np.sqrt(slopes @ covariance @ slopes))
        # What does not move has the rounding of the differences.
        errors[name] = error if error > 1e-11 * max(1.0, float(np.abs(value[0]))) else 0.0
    return errors
