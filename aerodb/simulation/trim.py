"""Trim: the steady flight of a database at a stated condition, and how it moves with its estimates.

The accelerations are those of the engine (`simulate`); all perturbations of a Jacobian fly side by
side.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from typing import Any, Final

import numpy as np
from scipy.optimize import least_squares, linear_sum_assignment

from aerodb.errors import InputError, nearest
from aerodb.nomenclature import is_surface
from aerodb.physics import GRAVITY
from aerodb.simulation.engine import FlightModel, Simulation, simulate
from aerodb.simulation.layout import FEEDBACK, SURROUNDINGS
from aerodb.simulation.parameter_covariance import parameter_covariance
from aerodb.support import Array

#: Steady flight: largest acceleration left, as a share of gravity (angular ones by the reference
#: lengths).
TOLERANCE: Final = 1e-7
#: Step of central differences, in rad and in the scale of each unknown.
STEP: Final = 1e-5
_AXES: Final = ("roll", "pitch", "yaw")
#: Bounds of the unknowns that are no deflections [rad, rad/s].
_BOUNDS: Final = {
    "alpha": (-1.0, 1.0), "beta": (-0.7, 0.7), "phi": (-1.55, 1.55), "climb": (-1.5, 1.5),
    "turn_rate": (-3.0, 3.0),
}  # fmt: skip
#: Accelerations that a trim makes zero, with their units for messages.
_RESIDUALS: Final = (
    ("along x", "m/s2"), ("along y", "m/s2"), ("along z", "m/s2"),
    ("in roll", "deg/s2"), ("in pitch", "deg/s2"), ("in yaw", "deg/s2"),
    ("of the load factor", "g"),
)  # fmt: skip

#: A control: each input that it moves, with its gain.
Control = Mapping[str, float]


class NoTrimError(InputError):
    """No steady flight at a condition."""


@dataclass(frozen=True)
class Condition:
    """A steady flight in still air, SI.

    Parameters
    ----------
    V : airspeed [m/s].
    altitude : [m].
    climb : flight-path angle [rad]; None: found, with the thrust as given (gliding flight).
    bank, beta, turn_rate : bank angle, sideslip [rad] and rate of turn [rad/s]. Two of them
        determine the third. One alone: `beta` without turn, the others without sideslip; none:
        straight flight without sideslip.
    load_factor : specific force normal to the flight path in the plane of symmetry, in g: of a turn
        to the right, or with `pull_up` of a pull-up without turn (below 1: a push-over).
    """

    V: float
    altitude: float
    climb: float | None = 0.0
    bank: float | None = None
    beta: float | None = None
    turn_rate: float | None = None
    load_factor: float | None = None
    pull_up: bool = False

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if value is not None and not np.isfinite(value):
                raise InputError(f"{name} is not finite", "trim condition", "give a number")
        if self.V <= 0:
            raise InputError("no airspeed", "trim condition", "give V [m/s] above zero")
        if self.pull_up and self.load_factor is None:
            raise InputError("a pull-up without load factor", "trim condition", "give it in g")
        stated = [name for name in ("bank", "beta", "turn_rate") if getattr(self, name) is not None]
        turning = self.load_factor is not None and not self.pull_up
        if (turning and {"bank", "turn_rate"} & set(stated)) or (
            self.pull_up and "turn_rate" in stated
        ):
            raise InputError(
                f"the load factor and {' and '.join(stated)} together",
                "trim condition",
                "a turn is given by bank, turn rate or load factor; a pull-up does not turn",
            )
        if len(stated) == 3:
            raise InputError(
                "bank, beta and turn_rate together", "trim condition", "give two: the third follows"
            )

    @property
    def fixed(self) -> dict[str, float]:
        """Those of bank (as phi), beta and turn rate that are not found."""
        stated = {"phi": self.bank, "beta": self.beta, "turn_rate": self.turn_rate}
        given = {name: value for name, value in stated.items() if value is not None}
        if self.load_factor is not None and not self.pull_up:
            return {"beta": 0.0, **given}
        if self.pull_up:
            return {"turn_rate": 0.0, **({} if given else {"beta": 0.0}), **given}
        if not given:
            return {"beta": 0.0, "turn_rate": 0.0}
        if len(given) == 1:
            return {"turn_rate": 0.0, **given} if "beta" in given else {"beta": 0.0, **given}
        return given


@dataclass(frozen=True, eq=False)
class Problem:
    """The unknowns of a trim and the accelerations that they must make zero.

    Parameters
    ----------
    inputs : every series of a run [SI].
    controls : by name, the roll, pitch and yaw control.
    thrust : name of the series that holds the airspeed; None: the path angle does.
    unknowns, bounds, scales : names, (u, 2) and (u,) of what is found.
    """

    model: FlightModel
    condition: Condition
    inputs: Mapping[str, float]
    controls: Mapping[str, Control]
    thrust: str | None
    unknowns: tuple[str, ...]
    bounds: Array
    scales: Array

    def placed(self, z: Array) -> tuple[dict[str, Array], dict[str, Array]]:
        """Start and series of runs at the unknowns z (u, k); rates of the start are (k,)."""
        condition, found = self.condition, dict(zip(self.unknowns, z, strict=True))
        at = {name: np.full(z.shape[1], value) for name, value in condition.fixed.items()} | found
        alpha, beta, phi, turn = at["alpha"], at["beta"], at["phi"], at["turn_rate"]
        climb = at["climb"] if condition.climb is None else np.full(z.shape[1], condition.climb)
        # Pitch attitude from path angle: Stevens & Lewis (2003), eq. 3.6-3.
        a = np.cos(alpha) * np.cos(beta)
        b = np.sin(phi) * np.sin(beta) + np.cos(phi) * np.sin(alpha) * np.cos(beta)
        s = np.sin(climb)
        root = np.sqrt(np.maximum(a**2 - s**2 + b**2, 0.0))
        theta = np.arctan2(a * b + s * root, a**2 - s**2)
        pull = 0.0
        if condition.pull_up and condition.load_factor is not None:
            pull = GRAVITY * (condition.load_factor - np.cos(climb)) / condition.V
        start = {
            "V": np.full(z.shape[1], condition.V),
            "altitude": np.full(z.shape[1], condition.altitude),
            "alpha": alpha,
            "beta": beta,
            "phi": phi,
            "theta": theta,
            "p": -turn * np.sin(theta),
            "q": turn * np.sin(phi) * np.cos(theta) + pull,
            "r": turn * np.cos(phi) * np.cos(theta),
        }
        series = {name: np.full((1, z.shape[1]), value) for name, value in self.inputs.items()}
        for name, control in self.controls.items():
            for surface, gain in control.items():
                series[surface] = series[surface] + gain * found[name]
        if self.thrust is not None:
            series[self.thrust] = found[self.thrust][None, :]
        for name in FEEDBACK:
            series[f"reference_{name}"] = start[name][None, :]
        return start, series

    def flown(self, z: Array, parameters: Mapping[str, Array] | None = None) -> Simulation:
        """The runs at z (u, k), one sample each."""
        start, series = self.placed(z)
        return simulate(self.model, np.zeros(1), start, series, parameters=parameters)

    def accelerations(self, z: Array, parameters: Mapping[str, Array] | None = None) -> Array:
        """Accelerations (6, k) [m/s2, rad/s2], and the load factor's error [g] of a turn (7, k)."""
        run = self.flown(z, parameters)
        rows = run.rates[:6]
        condition = self.condition
        if condition.load_factor is None or condition.pull_up:
            return rows
        return np.vstack([rows, load_factors(run)[2] - condition.load_factor])

    def residual(self, z: Array, parameters: Mapping[str, Array] | None = None) -> Array:
        """`accelerations` over gravity, angular ones by half span and chord."""
        reference = self.model.database.reference
        lengths = (reference.span, reference.chord, reference.span)
        weights = np.array([1.0, 1.0, 1.0, *(0.5 * x for x in lengths), GRAVITY]) / GRAVITY
        rows = self.accelerations(z, parameters)
        # Outside the atmosphere nothing is finite: a large number turns the search back.
        return np.nan_to_num(weights[: len(rows), None] * rows, nan=1e3, posinf=1e3, neginf=-1e3)

    def jacobian(self, z: Array) -> Array:
        """Derivative (r, u) of `residual` by central differences."""
        u = len(z)
        steps = STEP * self.scales
        both = z[:, None] + np.hstack([np.diag(steps), -np.diag(steps)])
        values = self.residual(both)
        return np.asarray((values[:, :u] - values[:, u:]) / (2 * steps))


def is_force(name: str) -> bool:
    """Whether a series is in newton: of force_x, or a thrust."""
    return name.startswith(("force", "thrust"))


def load_factors(run: Simulation) -> Array:
    """Specific force (3, k) at the CG over gravity: ny = ay/g and nz = -az/g in body axes, and
    normal to the flight path in the plane of symmetry."""
    ax, ay, az, alpha = (run.channels[name][-1] for name in ("ax", "ay", "az", "alpha"))
    return np.array([ay, -az, ax * np.sin(alpha) - az * np.cos(alpha)]) / GRAVITY


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
    problem: Problem = field(repr=False)
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
    problem = _problem(model, condition, inputs, controls, limits or {}, thrust)
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


def _notes(model: FlightModel, run: Simulation) -> tuple[str, ...]:
    notes = [f"table {name} is left; its edge is held" for name in sorted(run.left)]
    if any(any(increment.folded) for increment in model.database.increments):
        notes.append("estimates that are folded into tables are taken as exact")
    return tuple(notes)


def _shown(problem: Problem) -> list[str]:
    thrust = [problem.thrust] if problem.thrust else []
    return [*problem.model.inputs, *(name for name in thrust if name not in problem.model.inputs)]


def _channels(problem: Problem, run: Simulation, z: Array) -> dict[str, Array]:
    """Values (k,) of what a trim states."""
    names = (
        "V", "alpha", "beta", "p", "q", "r", "phi", "theta", "altitude", "mach", "qbar", "rho",
        "CX", "CY", "CZ", "Cl", "Cm", "Cn",
    )  # fmt: skip
    channels = {name: run.channels[name][-1] for name in names}
    channels["climb"] = np.arcsin(
        np.clip(-run.channels["velocity_down"][-1] / channels["V"], -1.0, 1.0)
    )
    found = dict(zip(problem.unknowns, z, strict=True))
    turn = problem.condition.fixed.get("turn_rate", 0.0)
    channels["turn_rate"] = found.get("turn_rate", np.full(z.shape[1], turn))
    channels |= dict(zip(("ny", "nz", "load_factor"), load_factors(run), strict=True))
    return channels


def control_inputs(
    model: FlightModel, condition: Condition, inputs: Mapping[str, float], free: Sequence[str]
) -> dict[str, Control]:
    """Return the roll, pitch and yaw control among `free` inputs, from their moments.

    Two surfaces of mirrored effect (equal in pitch, opposite in roll and yaw, or the reverse) are
    moved together or against each other. The three controls whose moments span the largest volume
    are taken; an axis that no input moves has no control.
    """
    if not free:
        return {}
    m = len(free)
    lanes = np.hstack([np.eye(m), -np.eye(m)]) * 0.01
    series: dict[str, Any] = {**inputs}
    for k, name in enumerate(free):
        series[name] = (inputs.get(name, 0.0) + lanes[k])[None, :]
    start = {"V": condition.V, "altitude": condition.altitude, "alpha": 0.05}
    run = simulate(model, np.zeros(1), start, series)
    moments = np.array([run.channels[name][-1] for name in ("Cl", "Cm", "Cn")])
    power = np.nan_to_num((moments[:, :m] - moments[:, m:]) / 0.02)
    candidates: list[tuple[Control, Array]] = []
    paired: set[int] = set()
    mirror = np.array([-1.0, 1.0, -1.0])
    for i, j in combinations(range(m), 2):
        size = np.linalg.norm(power[:, i])
        if {i, j} & paired or size < 1e-9:
            continue
        for sign in (1.0, -1.0):
            if np.linalg.norm(power[:, j] - sign * mirror * power[:, i]) < 0.01 * size:
                paired |= {i, j}
                for way in (1.0, -1.0):
                    gains = {free[i]: 1.0, free[j]: way}
                    candidates.append((gains, power[:, i] + way * power[:, j]))
                break
    candidates += [({free[k]: 1.0}, power[:, k]) for k in range(m) if k not in paired]
    effects = np.array([effect for _, effect in candidates]).T
    largest = np.abs(effects).max(axis=1, keepdims=True)
    axes = [a for a in range(3) if largest[a, 0] > 1e-9]
    scaled = effects[axes] / largest[axes]
    best: tuple[float, tuple[int, ...]] = (0.0, ())
    for count in range(min(len(axes), len(candidates)), 0, -1):
        for chosen in combinations(range(len(candidates)), count):
            part = scaled[:, chosen]
            volume = float(np.sqrt(max(np.linalg.det(part.T @ part), 0.0)))
            if volume > max(best[0], 1e-6):
                best = (volume, chosen)
        if best[1]:
            break
    rows, columns = linear_sum_assignment(-np.abs(scaled[:, best[1]]))
    return {
        _AXES[axes[row]]: candidates[best[1][column]][0]
        for row, column in zip(rows, columns, strict=True)
    }


def _problem(
    model: FlightModel,
    condition: Condition,
    inputs: Mapping[str, float],
    controls: Mapping[str, str | Control] | None,
    limits: Mapping[str, tuple[float, float]],
    thrust: str,
) -> Problem:
    where = f"trim of {model.database.name}"
    if model.earth is not None:
        raise InputError(
            "its earth rotates", where, "make the model without earth: steady flight is over a flat"
        )
    known = {*SURROUNDINGS, *model.inputs}
    for name in (*inputs, *limits, thrust):
        if name not in known:
            raise InputError(f"it has no input '{name}'", where, nearest(name, known))
    if any(low >= high for low, high in limits.values()):
        raise InputError("a lower limit that is not below the upper one", where, "swap them")
    given = dict.fromkeys(model.inputs, 0.0) | dict(inputs)
    chosen: dict[str, Control] = {}
    for axis, named in (controls or {}).items():
        if axis not in _AXES:
            raise InputError(f"no control of '{axis}'", where, nearest(axis, _AXES))
        chosen[axis] = {named: 1.0} if isinstance(named, str) else dict(named)
        for name in chosen[axis]:
            if name not in model.inputs:
                raise InputError(f"it has no input '{name}'", where, nearest(name, model.inputs))
    missing = [axis for axis in _AXES if axis not in chosen]
    if missing:
        taken = {name for control in chosen.values() for name in control}
        free = [n for n in model.inputs if is_surface(n) and n not in inputs and n not in taken]
        found = control_inputs(model, condition, given, free)
        chosen |= {axis: found[axis] for axis in missing if axis in found}
    named_controls = {_name_of(control): control for control in chosen.values()}
    fixed = condition.fixed
    unknowns = ["alpha"] + [name for name in ("beta", "phi", "turn_rate") if name not in fixed]
    bounds = [_BOUNDS[name] for name in unknowns]
    scales = [1.0] * len(unknowns)
    for name, control in named_controls.items():
        low, high = -np.inf, np.inf
        for surface, gain in control.items():
            ends = (np.array(limits.get(surface, (-np.inf, np.inf))) - given[surface]) / gain
            low, high = max(low, ends.min()), min(high, ends.max())
        unknowns.append(name)
        bounds.append((low, high))
        scales.append(1.0)
    if condition.climb is None:
        unknowns.append("climb")
        bounds.append(_BOUNDS["climb"])
        scales.append(1.0)
    else:
        unknowns.append(thrust)
        bounds.append(limits.get(thrust, (0.0, np.inf)))
        scales.append(given.get("mass", 1.0) * GRAVITY if is_force(thrust) else 1.0)
    return Problem(
        model,
        condition,
        given,
        named_controls,
        None if condition.climb is None else thrust,
        tuple(unknowns),
        np.array(bounds, dtype=np.float64),
        np.array(scales),
    )


def _name_of(control: Control) -> str:
    """``delta_elevator``, or ``delta_left - delta_right`` of a pair."""
    text = ""
    for name, gain in control.items():
        size = "" if abs(gain) == 1.0 else f"{abs(gain):g} "
        sign = ("-" if gain < 0 else "") if not text else (" - " if gain < 0 else " + ")
        text += f"{sign}{size}{name}"
    return text


def _begins(problem: Problem, begin: Trim | None) -> Iterator[Array]:
    """First guesses (u,) of the unknowns."""
    condition = problem.condition
    guess = dict.fromkeys(problem.unknowns, 0.0)
    if condition.load_factor is not None and not condition.pull_up:
        guess["phi"] = float(np.arccos(min(1.0 / max(condition.load_factor, 1.01), 1.0)))
        guess["turn_rate"] = GRAVITY * np.tan(guess["phi"]) / condition.V
    elif condition.bank and "turn_rate" in guess:
        guess["turn_rate"] = GRAVITY * np.tan(condition.bank) / condition.V
    elif condition.turn_rate and "phi" in guess:
        guess["phi"] = float(np.arctan(condition.V * condition.turn_rate / GRAVITY))
    if "climb" in guess:
        guess["climb"] = -0.1
    if problem.thrust:
        low, high = problem.bounds[-1]
        weight = problem.scales[-1]
        guess[problem.thrust] = 0.1 * weight if weight > 1 else float(np.clip(0.5, low, high))
    if begin is not None and begin.problem.unknowns == problem.unknowns:
        yield np.asarray(begin.point)
    for alpha in (0.05, 0.15, -0.05, 0.3):
        yield np.array([{**guess, "alpha": alpha}[name] for name in problem.unknowns])


def _solved(problem: Problem, begin: Trim | None) -> tuple[Array, Array]:
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


def _balanced(problem: Problem, point: Array) -> tuple[Array, Array]:
    """Where there is no trim: the moments balanced as far as the controls can, so that what is left
    is what limits the flight."""
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
    problem: Problem,
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
        if len(problem.controls) < len(_AXES) and turning and not reasons:
            names = ", ".join(problem.controls) or "none"
            reasons.append(f"roll, pitch and yaw have too few controls: {names}")
    left = problem.accelerations(point[:, None])[:, 0]
    shown = [
        f"{np.rad2deg(value) if unit == 'deg/s2' else value:.3g} {unit} {axis}"
        for value, weighted, (axis, unit) in zip(left, residual, _RESIDUALS, strict=False)
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
    angle = name in _BOUNDS or "delta_" in name
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
    """Derivatives (..., p) from values (..., 2 p) at `varied` parameters; 0 for fixed ones."""
    p = len(steps)
    moving = np.where(steps > 0, steps, 1.0)
    return np.asarray(np.where(steps > 0, (values[..., :p] - values[..., p:]) / (2 * moving), 0.0))


def moved_points(problem: Problem, point: Array, steps: Array) -> Array:
    """The unknowns (u, 2 p) of the trims at `varied` parameters, to first order (implicit
    function)."""
    _, parameters = varied(problem.model)
    lanes = np.repeat(point[:, None], 2 * len(steps), axis=1)
    by_parameter = differences(problem.residual(lanes, parameters), steps)
    # By the pseudo-inverse, an unknown that nothing determines does not move.
    inverse = np.linalg.pinv(problem.jacobian(point) * problem.scales, rcond=1e-9)
    change = -problem.scales[:, None] * (inverse @ by_parameter) * steps
    return np.asarray(point[:, None] + np.hstack([change, -change]))


def _errors(problem: Problem, point: Array) -> dict[str, float]:
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
