"""The unknowns of a trim, and the accelerations that they must make zero."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any, Final

import numpy as np
from scipy.optimize import linear_sum_assignment

from aerodb.errors import InputError, nearest
from aerodb.nomenclature import is_surface
from aerodb.physics import GRAVITY, quaternion_from_euler, to_body
from aerodb.simulation.condition import Condition
from aerodb.simulation.engine import FlightModel, Simulation, simulate
from aerodb.simulation.ground import carrying_height, vertical
from aerodb.simulation.layout import FEEDBACK, STATE, SURROUNDINGS
from aerodb.support import Array
from aerodb.tables import Rate

#: Step of central differences, in rad and in the scale of each unknown.
STEP: Final = 1e-5
AXES: Final = ("roll", "pitch", "yaw")
#: What a search may go beyond the limits of a control, as a share of their distance.
_ROOM: Final = 1e-6
#: Bounds of the unknowns that are no deflections [rad, rad/s].
BOUNDS: Final = {
    "alpha": (-1.0, 1.0), "beta": (-0.7, 0.7), "phi": (-1.55, 1.55), "climb": (-1.5, 1.5),
    "turn_rate": (-3.0, 3.0), "theta": (-1.5, 1.5),
}  # fmt: skip

#: A control: each input that it moves, with its gain.
Control = Mapping[str, float]


@dataclass(frozen=True, eq=False)
class TrimProblem:
    """The unknowns of a trim and the accelerations that they must make zero.

    Parameters
    ----------
    inputs : every series of a run [SI].
    controls : by name, the roll, pitch and yaw control.
    thrust : name of the series that holds the airspeed; None: the path angle does.
    unknowns, bounds, scales : names, (u, 2) and (u,) of what is found.
    states : those of the database with a rate, which a trim makes zero; they are unknowns too.
    """

    model: FlightModel
    condition: Condition
    inputs: Mapping[str, float]
    controls: Mapping[str, Control]
    thrust: str | None
    unknowns: tuple[str, ...]
    bounds: Array
    scales: Array
    states: tuple[str, ...] = ()

    def placed(self, z: Array) -> tuple[dict[str, Array], dict[str, Array]]:
        """Start and series of runs at the unknowns z (u, k); rates of the start are (k,).

        Unknowns are angles and deflections [rad], rates [rad/s], and thrust [N].
        """
        condition, found = self.condition, dict(zip(self.unknowns, z, strict=True))
        free = condition.hover or condition.ground
        start = self._hovering(found) if free else self._steady(found, z)
        start |= {name: found[name] for name in self.states}
        series = {name: np.full((1, z.shape[1]), value) for name, value in self.inputs.items()}
        for name, control in self.controls.items():
            for surface, gain in control.items():
                series[surface] = series[surface] + gain * found[name]
        if self.thrust is not None:
            series[self.thrust] = found[self.thrust][None, :]
        for name in FEEDBACK:
            series[f"reference_{name}"] = np.array(start[name])[None, :]
        return start, series

    def _hovering(self, found: Mapping[str, Array]) -> dict[str, Array]:
        """The start of straight flight at an attitude that is found."""
        condition, phi, theta = self.condition, found["phi"], found["theta"]
        still, climb = np.zeros_like(phi), condition.climb or 0.0
        path = condition.V * np.array([np.cos(climb), 0.0, -np.sin(climb)])
        u, v, w = to_body(
            quaternion_from_euler(phi, theta, still),
            np.broadcast_to(path[:, None], (3, len(phi))),
        )
        return {
            "V": still + condition.V,
            "altitude": condition.altitude + found.get("height", still),
            "alpha": np.arctan2(w, u),
            "beta": np.arctan2(v, np.hypot(u, w)),
            "phi": phi,
            "theta": theta,
            "p": still,
            "q": still,
            "r": still,
        }

    def _steady(self, found: Mapping[str, Array], z: Array) -> dict[str, Array]:
        """The start of a flight with its pitch attitude from the path angle."""
        condition = self.condition
        at = {name: np.full(z.shape[1], value) for name, value in condition.fixed.items()}
        at |= found
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
        return {
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

    def flown(self, z: Array, parameters: Mapping[str, Array] | None = None) -> Simulation:
        """Return the runs, channels (1, k) in SI units, at z (u, k), one sample each."""
        start, series = self.placed(z)
        return simulate(self.model, np.zeros(1), start, series, parameters=parameters)

    def accelerations(self, z: Array, parameters: Mapping[str, Array] | None = None) -> Array:
        """Accelerations (6, k) [m/s2, rad/s2], of a turn the load factor's error [g], and the rates
        of `states` [1/s]."""
        run = self.flown(z, parameters)
        condition = self.condition
        rows = [run.rates[:6]]
        if condition.ground:
            found = dict(zip(self.unknowns, z, strict=True))
            still = np.zeros(z.shape[1])
            sinking = vertical(run.rates[:3], found["phi"], found["theta"])
            rows = [np.array([still, still, sinking, *run.rates[3:5], still])]
        if condition.load_factor is not None and not condition.pull_up:
            rows.append(load_factors(run)[2:] - condition.load_factor)
        extra = self.model.extra_states
        rows += [run.rates[len(STATE) + extra.index(name)][None, :] for name in self.states]
        return np.vstack(rows)

    def residual(self, z: Array, parameters: Mapping[str, Array] | None = None) -> Array:
        """`accelerations` over gravity, angular ones by half span and chord.

        It is dimensionless.
        """
        reference = self.model.database.reference
        lengths = (reference.span, reference.chord, reference.span)
        rows = self.accelerations(z, parameters)
        # The load factor's error and rates of states are taken as they are.
        weights = np.array([1.0, 1.0, 1.0, *(0.5 * x for x in lengths)]) / GRAVITY
        weights = np.concatenate([weights, np.ones(len(rows) - len(weights))])
        # Outside the atmosphere nothing is finite: a large number turns the search back.
        return np.nan_to_num(weights[:, None] * rows, nan=1e3, posinf=1e3, neginf=-1e3)

    def jacobian(self, z: Array) -> Array:
        """Derivative (r, u) of `residual` by central differences.

        It is dimensionless per SI unit of an unknown.
        """
        u = len(z)
        steps = STEP * self.scales
        both = z[:, None] + np.hstack([np.diag(steps), -np.diag(steps)])
        values = self.residual(both)
        return np.asarray((values[:, :u] - values[:, u:]) / (2 * steps))


def is_force(name: str) -> bool:
    """Return whether a series is in newton: of force_x, or a thrust."""
    return name.startswith(("force", "thrust"))


def load_factors(run: Simulation) -> Array:
    """Specific force (3, k) at the CG over gravity: ny = ay/g and nz = -az/g in body axes, and
    normal to the flight path in the plane of symmetry.

    They are dimensionless.
    """
    ax, ay, az, alpha = (run.channels[name][-1] for name in ("ax", "ay", "az", "alpha"))
    return np.array([ay, -az, ax * np.sin(alpha) - az * np.cos(alpha)]) / GRAVITY


def control_inputs(
    model: FlightModel,
    condition: Condition,
    inputs: Mapping[str, float],
    free: Sequence[str],
    limits: Mapping[str, tuple[float, float]],
) -> dict[str, Control]:
    """Return the roll, pitch and yaw control among `free` inputs, from their moments.

    Two surfaces of mirrored effect (equal in pitch, opposite in roll and yaw, or the reverse) are
    moved together or against each other. Where their `limits` exclude one of these, as those of
    rudders that each move outwards only, each is a control by itself as well. The three controls
    whose moments span the largest volume are taken; an axis that no input moves has no control.
    Deflections are in [rad], moments dimensionless.
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
                    low, high = _ends(gains, inputs, limits)
                    if low < high:
                        candidates.append((gains, power[:, i] + way * power[:, j]))
                    else:
                        candidates += [({free[k]: 1.0}, power[:, k]) for k in (i, j)]
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
        AXES[axes[row]]: candidates[best[1][column]][0]
        for row, column in zip(rows, columns, strict=True)
    }


def _ends(
    control: Control, inputs: Mapping[str, float], limits: Mapping[str, tuple[float, float]]
) -> tuple[float, float]:
    """Lowest and highest value of a control [rad] at which its inputs are within their limits."""
    low, high = -np.inf, np.inf
    for name, gain in control.items():
        ends = (np.array(limits.get(name, (-np.inf, np.inf))) - inputs.get(name, 0.0)) / gain
        low, high = max(low, float(ends.min())), min(high, float(ends.max()))
    return low, high


def problem_of(
    model: FlightModel,
    condition: Condition,
    inputs: Mapping[str, float],
    controls: Mapping[str, str | Control] | None,
    limits: Mapping[str, tuple[float, float]],
    thrust: str,
) -> TrimProblem:
    """Return the problem of a trim, in SI units; its arguments are those of `trim`. Raises
    InputError for a rotating earth, an unknown input or axis, and limits in the wrong order."""
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
    if condition.ground:
        return _ground_problem(model, condition, given)
    if condition.hover:
        if controls:
            raise InputError(
                "controls are stated for a hover", where, "leave them out: its mixes are found"
            )
        return _hover_problem(model, condition, given, inputs, limits, where)
    chosen: dict[str, Control] = {}
    for axis, named in (controls or {}).items():
        if axis not in AXES:
            raise InputError(f"no control of '{axis}'", where, nearest(axis, AXES))
        chosen[axis] = {named: 1.0} if isinstance(named, str) else dict(named)
        for name in chosen[axis]:
            if name not in model.inputs:
                raise InputError(f"it has no input '{name}'", where, nearest(name, model.inputs))
    missing = [axis for axis in AXES if axis not in chosen]
    if missing:
        taken = {name for control in chosen.values() for name in control}
        free = [n for n in model.inputs if is_surface(n) and n not in inputs and n not in taken]
        found = control_inputs(model, condition, given, free, limits)
        chosen |= {axis: found[axis] for axis in missing if axis in found}
    named_controls = {_name_of(control): control for control in chosen.values()}
    fixed = condition.fixed
    unknowns = ["alpha"] + [name for name in ("beta", "phi", "turn_rate") if name not in fixed]
    states = _states_with_rate(model)
    unknowns += states
    bounds = [BOUNDS.get(name, (-np.inf, np.inf)) for name in unknowns]
    scales = [1.0] * len(unknowns)
    for name, control in named_controls.items():
        low, high = _ends(control, given, limits)
        if low >= high:
            raise InputError(
                f"the limits of {' and '.join(control)} leave no common movement",
                where,
                "name one of them as the control",
            )
        # A search inside its bounds reaches a deflection at a limit, such as 0 of a rudder that
        # moves outwards only; `trim` tells what is beyond.
        room = _ROOM * (high - low) if np.isfinite(high - low) else 0.0
        unknowns.append(name)
        bounds.append((low - room, high + room))
        scales.append(1.0)
    if condition.climb is None:
        unknowns.append("climb")
        bounds.append(BOUNDS["climb"])
        scales.append(1.0)
    else:
        unknowns.append(thrust)
        bounds.append(limits.get(thrust, (0.0, np.inf)))
        scales.append(given.get("mass", 1.0) * GRAVITY if is_force(thrust) else 1.0)
    return TrimProblem(
        model,
        condition,
        given,
        named_controls,
        None if condition.climb is None else thrust,
        tuple(unknowns),
        np.array(bounds, dtype=np.float64),
        np.array(scales),
        states,
    )


def _states_with_rate(model: FlightModel) -> tuple[str, ...]:
    return tuple(s.name for s in model.total.states if isinstance(s.law, Rate))


def _ground_problem(
    model: FlightModel, condition: Condition, given: dict[str, float]
) -> TrimProblem:
    """The problem of a vehicle on its legs, with its inputs as they are given."""
    carrying_height(model.database, given.get("cg_z", 0.0))  # it has legs
    if given.get("ground_altitude", condition.altitude) != condition.altitude:
        raise InputError(
            "a ground altitude beside that of a start on the ground",
            f"trim of {model.database.name}",
            "leave out ground_altitude: the altitude of the condition is the runway's",
        )
    given["ground_altitude"] = condition.altitude
    states = _states_with_rate(model)
    unknowns = ("phi", "theta", "height", *states)
    return TrimProblem(
        model,
        condition,
        given,
        {},
        None,
        unknowns,
        np.array([BOUNDS.get(name, (-np.inf, np.inf)) for name in unknowns]),
        np.ones(len(unknowns)),
        states,
    )


def _hover_problem(
    model: FlightModel,
    condition: Condition,
    given: dict[str, float],
    inputs: Mapping[str, float],
    limits: Mapping[str, tuple[float, float]],
    where: str,
) -> TrimProblem:
    """The problem of a hover: attitude, collective and mixes, at inputs that begin in the middle
    of their limits."""
    free = [name for name in model.inputs if name not in inputs]
    for name in free:
        low, high = limits.get(name, (-np.inf, np.inf))
        if np.isfinite(high - low):
            given[name] = 0.5 * (low + high)
        elif not is_surface(name):
            given[name] = 0.5
    mixes = hover_mixes(model, condition, given, free)
    if "collective" not in mixes:
        raise InputError(
            "no free input lifts it",
            where,
            "a hover needs rotors with speeds over inputs; leave these out of --set",
        )
    states = _states_with_rate(model)
    unknowns = ("phi", "theta", *states, *mixes)
    return TrimProblem(
        model,
        condition,
        given,
        mixes,
        None,
        unknowns,
        np.array([BOUNDS.get(name, (-np.inf, np.inf)) for name in unknowns]),
        np.ones(len(unknowns)),
        states,
    )


def hover_mixes(
    model: FlightModel, condition: Condition, inputs: Mapping[str, float], free: Sequence[str]
) -> dict[str, Control]:
    """Return the collective, roll, pitch and yaw mix of the `free` inputs at `inputs` [SI].

    Each changes one acceleration alone, by the smallest change of inputs (pseudo-inverse); its
    largest gain is 1. An axis that no input moves has no mix.
    """
    m = len(free)
    lanes = np.hstack([np.eye(m), -np.eye(m)]) * 0.01
    series: dict[str, Any] = {**inputs}
    for k, name in enumerate(free):
        series[name] = (inputs[name] + lanes[k])[None, :]
    start: dict[str, Any] = {"V": condition.V, "altitude": condition.altitude}
    if not m:
        return {}
    states = _states_with_rate(model)
    if states:  # an input acts through them: they have followed it
        run = simulate(model, np.zeros(1), start, series)
        at = {name: values[0] for name, values in run.channels.items() if name not in states}
        settled = model.database.resolved(states, at | {n: series[n][0] for n in free})
        start |= {name: np.broadcast_to(settled[name], (2 * m,)) for name in states}
    rates = simulate(model, np.zeros(1), start, series).rates[[2, 3, 4, 5]]
    reference = model.database.reference
    lengths = 0.5 * np.array([2.0, reference.span, reference.chord, reference.span])
    power = (rates[:, :m] - rates[:, m:]) / 0.02 * lengths[:, None]
    inverse = np.linalg.pinv(power, rcond=1e-6)
    reached = np.diag(power @ inverse) > 0.5
    return {
        axis: dict(zip(free, (gains / np.abs(gains).max()).tolist(), strict=True))
        for axis, gains, own in zip(("collective", *AXES), inverse.T, reached, strict=True)
        if own
    }


def _name_of(control: Control) -> str:
    """``delta_elevator``, or ``delta_left - delta_right`` of a pair."""
    text = ""
    for name, gain in control.items():
        size = "" if abs(gain) == 1.0 else f"{abs(gain):g} "
        sign = ("-" if gain < 0 else "") if not text else (" - " if gain < 0 else " + ")
        text += f"{sign}{size}{name}"
    return text
