"""Linear models about a trim: A, B, C, D with names and units, and their derivatives by the
version's estimates."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final, Literal

import numpy as np

from aerodb.errors import InputError
from aerodb.physics import quaternion_from_euler
from aerodb.simulation.engine import FlightModel, Simulation, initial_state, simulate
from aerodb.simulation.layout import STATE, SURROUNDINGS
from aerodb.simulation.parameter_covariance import parameter_covariance
from aerodb.simulation.trim import Trim, differences, moved_points, varied
from aerodb.simulation.trim_problem import is_force, load_factors
from aerodb.support import Array
from aerodb.tables import Relay

#: Velocity along body axes, or airspeed and flow angles.
Form = Literal["velocities", "angles"]

_UNITS: Final = {
    "u": "m/s", "v": "m/s", "w": "m/s", "V": "m/s", "alpha": "rad", "beta": "rad", "p": "rad/s",
    "q": "rad/s", "r": "rad/s", "phi": "rad", "theta": "rad", "ax": "m/s2", "ay": "m/s2",
    "az": "m/s2", "ny": "1", "nz": "1", "qbar": "Pa", "mach": "1", "climb_rate": "m/s",
}  # fmt: skip
_FORMS: Final[Mapping[str, tuple[str, ...]]] = {
    "velocities": ("u", "w", "q", "theta", "v", "p", "r", "phi"),
    "angles": ("V", "alpha", "q", "theta", "beta", "p", "r", "phi"),
}
_OUTPUTS: Final = (
    "V", "alpha", "beta", "p", "q", "r", "phi", "theta", "ax", "ay", "az", "ny", "nz", "qbar",
    "mach", "climb_rate",
)  # fmt: skip
#: Motion along the plane of symmetry; the rest is lateral.
LONGITUDINAL: Final = frozenset({"u", "w", "V", "alpha", "q", "theta"})
LATERAL: Final = frozenset({"v", "beta", "p", "r", "phi"})
#: Steps of central differences: of an angle or rate, as a share of airspeed or of a force.
_STEP: Final = 1e-5


@dataclass(frozen=True, eq=False)
class LinearModel:
    """``x' = A x + B u``, ``y = C x + D u`` of small changes x, u, y.

    Parameters
    ----------
    A, B, C, D : (n, n), (n, m), (o, n) and (o, m).
    states, inputs, outputs : names.
    units : name -> SI unit; "1" for inputs of which none is known.
    A_slopes, B_slopes : (n, n, p), (n, m, p), derivatives by the version's estimates, along which
        the trim moves.
    covariance : (p, p) of those estimates.
    """

    A: Array
    B: Array
    C: Array
    D: Array
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    units: Mapping[str, str] = field(default_factory=dict)
    A_slopes: Array | None = None
    B_slopes: Array | None = None
    covariance: Array | None = None

    def standard_errors(self) -> tuple[Array, Array]:
        """Standard errors of A and B, 0 where no estimate has any.

        They are (n, n) and (n, m), in the units of A and B.
        """
        errors = []
        for matrix, slopes in ((self.A, self.A_slopes), (self.B, self.B_slopes)):
            if slopes is None or self.covariance is None:
                errors.append(np.zeros_like(matrix))
            else:
                square = np.einsum("ijk,kl,ijl->ij", slopes, self.covariance, slopes)
                errors.append(np.sqrt(np.maximum(square, 0.0)))
        return errors[0], errors[1]

    def part(self, states: Sequence[str]) -> "LinearModel":
        """The model of some of its states alone, such as those of eq. 2 (u, w, q, theta) or 4 (v,
        p, r, phi) of "Aerodynamic Model Update Using Parameter Identification Supporting a Cessna
        Grand Caravan Engineering Simulation"; the others are held.

        Raises InputError for a name that is no state.
        """
        unknown = [name for name in states if name not in self.states]
        if unknown:
            raise InputError(f"no state '{unknown[0]}'", "linear model", ", ".join(self.states))
        k = [self.states.index(name) for name in states]
        return replace(
            self,
            A=self.A[np.ix_(k, k)],
            B=self.B[k],
            C=self.C[:, k],
            states=tuple(states),
            A_slopes=None if self.A_slopes is None else self.A_slopes[np.ix_(k, k)],
            B_slopes=None if self.B_slopes is None else self.B_slopes[k],
        )


def linear_model(trim: Trim, form: Form = "velocities") -> LinearModel:
    """Return the linear model about a trim, by central differences of the engine, all perturbations
    side by side.

    form : ``velocities`` with states u, w, q, theta, v, p, r, phi ("Aerodynamic Model Update Using
    Parameter Identification Supporting a Cessna Grand Caravan Engineering Simulation", eqs. 1 to
    5); ``angles`` with V, alpha, q, theta, beta, p, r, phi ("Parameter Identification for
    Application within a Fault-Tolerant Flight Control System", eq. 46). States of the database and
    of actuators follow. The density is that of the trim's altitude.

    Inputs are the inputs of the database and what holds the airspeed. Outputs are at the CG.
    Matrices are (s, s), (s, m), (o, s), (o, m), in SI units.
    """
    model = trim.problem.model
    thrust = trim.problem.thrust or "force_x"
    inputs = (*model.inputs, *((thrust,) if thrust not in model.inputs else ()))
    first = _about(trim, form, trim.point[:, None], {}, inputs)
    steps, parameters = varied(model)
    points = moved_points(trim.problem, trim.point, steps) if len(steps) else trim.point[:, None]
    slopes = (
        [differences(matrix, steps) for matrix in _about(trim, form, points, parameters, inputs)]
        if len(steps)
        else [None] * 2
    )
    a, b, c, d = (matrix[..., 0] for matrix in first)
    units = {
        **_UNITS,
        **{name: "rad" if name.startswith("delta_") else "1" for name in model.inputs},
        **({thrust: "N"} if is_force(thrust) else {}),
    }
    states = _states(model, form)
    named = (*states, *inputs, *_OUTPUTS)
    return LinearModel(
        a, b, c, d, states, inputs, _OUTPUTS,
        {name: units.get(name, "1") for name in named},
        slopes[0], slopes[1], parameter_covariance(model) if len(steps) else None,
    )  # fmt: skip


def _states(model: FlightModel, form: Form) -> tuple[str, ...]:
    """Names of the states; relays and actuators without lag have no rate, and are held."""
    held = {state.name for state in model.total.states if isinstance(state.law, Relay)} | {
        name
        for name, (_, _, rate, lag) in zip(model.actuated, model.numbers.actuators, strict=True)
        if lag == 0.0 and rate == np.inf
    }
    return (*_FORMS[form], *(name for name in model.extra_states if name not in held))


def _about(
    trim: Trim,
    form: Form,
    points: Array,
    parameters: Mapping[str, Array],
    inputs: Sequence[str],
) -> list[Array]:
    """A, B, C and D (..., k) about the trims at `points` (u, k) with their `parameters`, (k,)."""
    problem, k = trim.problem, points.shape[1]
    start, series = problem.placed(points)
    rows = {name: np.zeros(k) for name in SURROUNDINGS} | {
        name: value[0] for name, value in series.items()
    }
    base = initial_state(problem.model, start, rows, k)
    extra = base[len(STATE) :]
    speed = trim.problem.condition.V
    states = _states(problem.model, form)
    n, m = len(states), len(inputs)
    steps = np.full(n + m, _STEP)
    for j, name in enumerate((*states, *inputs)):
        if name in ("u", "v", "w", "V"):
            steps[j] = _STEP * max(speed, 1.0)
        elif is_force(name):
            steps[j] = _STEP * problem.inputs["mass"] * 10.0
    lanes = 2 * (n + m)
    # Lane (i, j): perturbation i of the trim j.
    change = np.hstack([np.diag(steps), -np.diag(steps)])[:, :, None]
    at: dict[str, Array] = {name: np.broadcast_to(start[name], (lanes, k)) for name in start}
    air = [base[j] for j in range(3)]
    at |= {name: np.broadcast_to(air["uvw".index(name)], (lanes, k)) for name in "uvw"}
    at |= {
        name: np.broadcast_to(extra[j], (lanes, k))
        for j, name in enumerate(problem.model.extra_states)
    }
    at |= {name: at[name] + change[j] for j, name in enumerate(states)}
    if form == "angles":
        along = at["V"] * np.cos(at["beta"])
        at["u"], at["w"] = along * np.cos(at["alpha"]), along * np.sin(at["alpha"])
        at["v"] = at["V"] * np.sin(at["beta"])
    state = np.array(
        [
            *(at[name].ravel() for name in ("u", "v", "w", "p", "q", "r")),
            *quaternion_from_euler(at["phi"].ravel(), at["theta"].ravel(), np.zeros(lanes * k)),
            *np.repeat(base[10:13][:, None], lanes, axis=1).reshape(3, -1),
            *(at[name].ravel() for name in problem.model.extra_states),
        ]
    )
    moved: dict[str, Any] = {
        name: np.broadcast_to(value, (lanes, k)) for name, value in series.items()
    }
    for j, name in enumerate(inputs):
        moved[name] = moved.get(name, np.zeros((lanes, k))) + change[n + j]
    run = simulate(
        problem.model,
        np.zeros(1),
        state,
        {name: value.reshape(1, -1) for name, value in moved.items()},
        parameters={
            name: np.broadcast_to(value, (lanes, k)).ravel() for name, value in parameters.items()
        },
    )
    both = [
        np.array(values).reshape(-1, lanes, k)
        for values in (_rates(run, at, form, states, problem.model.extra_states), _outputs(run))
    ]
    slopes = [
        (values[:, : n + m] - values[:, n + m :]) / (2 * steps)[None, :, None] for values in both
    ]
    return [slopes[0][:, :n], slopes[0][:, n:], slopes[1][:, :n], slopes[1][:, n:]]


def _rates(
    run: Simulation,
    at: Mapping[str, Array],
    form: Form,
    states: Sequence[str],
    extra: Sequence[str],
) -> list[Array]:
    """Rates of the states, each (lanes,)."""
    flat = {name: value.ravel() for name, value in at.items()}
    rates = dict(zip(STATE, run.rates, strict=False))
    sine, cosine = np.sin(flat["phi"]), np.cos(flat["phi"])
    rates["theta"] = flat["q"] * cosine - flat["r"] * sine
    rates["phi"] = flat["p"] + np.tan(flat["theta"]) * (flat["q"] * sine + flat["r"] * cosine)
    if form == "angles":
        u, v, w = flat["u"], flat["v"], flat["w"]
        du, dv, dw = rates["u"], rates["v"], rates["w"]
        plane, square = u**2 + w**2, u**2 + v**2 + w**2
        rates["V"] = (u * du + v * dv + w * dw) / np.sqrt(square)
        rates["alpha"] = (u * dw - w * du) / plane
        rates["beta"] = (dv * plane - v * (u * du + w * dw)) / (square * np.sqrt(plane))
    rates |= dict(zip(extra, run.rates[len(STATE) :], strict=True))
    return [rates[name] for name in states]


def _outputs(run: Simulation) -> list[Array]:
    """Outputs at the perturbed states, each (lanes,)."""
    ny, nz, _ = load_factors(run)
    own = {"ny": ny, "nz": nz, "climb_rate": -run.channels["velocity_down"][-1]}
    return [own[name] if name in own else run.channels[name][-1] for name in _OUTPUTS]
