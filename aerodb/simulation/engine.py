"""Fly any database: the model of a vehicle, its start, and runs over given inputs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from aerodb.errors import InputError, nearest
from aerodb.physics import GRAVITY, STANDARD_LAYERS, Earth, quaternion_from_euler, to_body
from aerodb.simulation.layout import (
    FEEDBACK,
    FURTHER_LOADS,
    LOADS,
    MOTION,
    STATE,
    SURROUNDINGS,
    EarthNumbers,
    Numbers,
    ReferenceNumbers,
)
from aerodb.support import Array, in_threads
from aerodb.tables import (
    LOAD_AXES,
    AeroDatabase,
    Expression,
    Rate,
    Relay,
    TotalCoefficients,
    total_coefficients,
)

#: Runs computed side by side in one thread: their numbers stay in the processor's cache.
BLOCK: Final = 16
#: The same for runs of one step, of which there are many.
_SHORT_BLOCK: Final = 128
#: Values of `SURROUNDINGS` that need not be given.
_DEFAULTS: Final = {
    name: 1.0 if name == "density_ratio" else 0.0
    for name in SURROUNDINGS
    if name not in ("mass", "Ixx", "Iyy", "Izz")
}
#: What a start may state, in place of 0.
_START: Final = (
    "V", "alpha", "beta", "p", "q", "r", "phi", "theta", "psi", "north", "east", "altitude",
)  # fmt: skip


@dataclass(frozen=True)
class Actuator:
    """An actuator between a command and a deflection: limits [rad], largest rate [rad/s] and lag
    [s]. Without lag and rate limit the deflection is the limited command."""

    limits: tuple[float, float] = (-np.inf, np.inf)
    rate: float = np.inf
    lag: float = 0.0


@dataclass(frozen=True)
class Propulsion:
    """Thrust [N] as an expression of channels and inputs (a table of the database, an input), along
    `direction` through `point` [m], body axes from the vehicle's datum."""

    thrust: Expression
    point: tuple[float, float, float]
    direction: tuple[float, float, float] = (1.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class FlightModel:
    """A database that can be flown.

    Parameters
    ----------
    database : the version.
    total : its coefficients as a machine.
    numbers : everything in the form of the compiled loops.
    inputs : names of the series that a run needs besides `SURROUNDINGS`: deflections, free inputs.
    actuated : those behind an actuator.
    earth : rotating earth with its origin; None: flat.
    """

    database: AeroDatabase
    total: TotalCoefficients
    numbers: Numbers
    inputs: tuple[str, ...]
    actuated: tuple[str, ...]
    earth: Earth | None = None

    @property
    def parameters(self) -> dict[str, float]:
        """Parameters of the database and estimates of the increments, by name: what a run may vary,
        as scalars, the latter per SI unit of the regressor."""
        return dict(zip(self.total.estimates, self.total.values, strict=True))

    @property
    def extra_states(self) -> tuple[str, ...]:
        """Names of the states after `STATE` (actuators' in [rad]): those of the database and the
        actuators'."""
        return (*(state.name for state in self.total.states), *self.actuated)


def flight_model(
    database: AeroDatabase,
    *,
    engines: Sequence[Propulsion] = (),
    actuators: Mapping[str, Actuator] | None = None,
    feedback: Mapping[tuple[str, str], float] | None = None,
    earth: Earth | None = None,
    factors: Mapping[str, str] | None = None,
) -> FlightModel:
    """Return the model of a vehicle that flies on a database.

    Parameters
    ----------
    database : any version.
    engines : thrust by expression; logged thrust is given to a run as force and moment instead.
    actuators : input -> its actuator; others act as given.
    feedback : (input, channel of `FEEDBACK`) -> gain on (reference - channel), added to the input:
        an artificial stabilisation. References are given as ``reference_<channel>``. Beside inputs,
        the further force and moment of `SURROUNDINGS` (``moment_x``) can be fed back to.
    earth : rotating oblate earth; None: flat, with standard gravity.
    factors : term of the database -> name of a parameter that multiplies it.

    Raises InputError for a name that the database does not read.
    """
    total = total_coefficients(database, [e.thrust for e in engines], factors)
    slots, own = total.machine.inputs, {*MOTION, *SURROUNDINGS}
    inputs = tuple(name for name in total.inputs if name not in own)
    fed_back = [name for name, _ in feedback or {} if name not in FURTHER_LOADS]
    for name in (*(actuators or {}), *fed_back):
        if name not in inputs:
            raise InputError(
                f"the database does not read '{name}'",
                f"database {database.name}",
                nearest(name, inputs),
            )
    actuated = tuple(name for name in inputs if name in (actuators or {}))
    chord = database.reference.chord
    laws = [
        (0.0, s.law.low, s.law.high, s.law.separated)
        if isinstance(s.law, Relay)
        else (-1.0 if isinstance(s.law, Rate) else s.law.relaxation * chord, 0.0, 0.0, 0.0)
        for s in total.states
    ]
    outputs, m = total.machine.outputs, len(total.states)
    loads = len(LOAD_AXES) if database.has_loads else 0
    reference = database.reference
    lines = [(*np.asarray(e.direction) / np.linalg.norm(e.direction), *e.point) for e in engines]
    moved = (
        [(a.limits[0], a.limits[1], a.rate, a.lag) for a in (actuators[name] for name in actuated)]
        if actuators
        else []
    )
    gains = _gains(inputs, feedback or {})
    place = (
        (0.0, 0.0, 1.0, 1.0)
        if earth is None
        else (earth.latitude, earth.height, *earth.metres_per_radian)
    )
    numbers = Numbers(
        program=total.machine.instructions,
        motion=_slots(MOTION, slots),
        surroundings=_slots(SURROUNDINGS, slots),
        inputs=_slots(inputs, slots),
        totals=np.array(outputs[:6], dtype=np.int64),
        states=_slots([s.name for s in total.states], slots, len(total.machine.slots)),
        steady=np.array(outputs[6 : 6 + m], dtype=np.int64),
        laws=np.array(laws, dtype=np.float64).reshape(-1, 4),
        loads=np.array(outputs[6 + m : 6 + m + loads], dtype=np.int64),
        thrust=np.array(outputs[6 + m + loads :], dtype=np.int64),
        lines=np.array(lines, dtype=np.float64).reshape(-1, 6),
        actuated=np.array([inputs.index(name) for name in actuated], dtype=np.int64),
        actuators=np.array(moved, dtype=np.float64).reshape(-1, 4),
        gains=gains,
        reference=ReferenceNumbers(
            reference.area,
            reference.chord,
            reference.span,
            *reference.moment_reference,
            float(reference.pressure or 0.0),
        ),
        earth=EarthNumbers(earth is not None, GRAVITY, *map(float, place)),
        layers=STANDARD_LAYERS,
    )
    return FlightModel(database, total, numbers, inputs, actuated, earth)


def with_feedback(model: FlightModel, feedback: Mapping[tuple[str, str], float]) -> FlightModel:
    """Return the model with other feedback gains, in the input's SI unit per that of the channel;
    see `flight_model`."""
    return replace(model, numbers=model.numbers._replace(gains=_gains(model.inputs, feedback)))


def _gains(inputs: Sequence[str], feedback: Mapping[tuple[str, str], float]) -> Array:
    for _, channel in feedback:
        if channel not in FEEDBACK:
            raise InputError(f"no feedback of '{channel}'", remedy=nearest(channel, FEEDBACK))
    rows = [(_number(inputs, i), FEEDBACK.index(c), g) for (i, c), g in feedback.items()]
    return np.array(rows, dtype=np.float64).reshape(-1, 3)


def _number(inputs: Sequence[str], name: str) -> int:
    """Number of an input; of a load its place in `SURROUNDINGS`, counted back from the inputs."""
    if name in FURTHER_LOADS:
        return SURROUNDINGS.index(name) - len(SURROUNDINGS)
    return inputs.index(name)


def _slots(
    names: Sequence[str], slots: Mapping[str, int], otherwise: int = -1
) -> NDArray[np.int64]:
    return np.array([slots.get(name, otherwise) for name in names], dtype=np.int64)


@dataclass(frozen=True, eq=False)
class Simulation:
    """k runs of n samples.

    Parameters
    ----------
    time : (n,) [s].
    channels : name -> (n, k): `MOTION`, `LOADS`, states of the database and inputs as they acted;
        NaN after the end of a run.
    state : (13 + m + a, k) at the end.
    ended : (k,) number of samples of each run.
    left : table -> (k,) time at which the run first left it [s], NaN where it did not.
    unresolved : number of samples without a solution for alphadot.
    rates : as state, time derivatives at the end.
    """

    time: Array
    channels: Mapping[str, Array]
    state: Array
    ended: NDArray[np.int64]
    left: Mapping[str, Array]
    unresolved: int
    rates: Array

    def notes(self, run: int = 0) -> list[str]:
        """Return what the user must know of a run: divergence and tables that were left, with times
        [s], angles [deg], from its `channels` (n, k)."""
        said = []
        if self.ended[run] < len(self.time):
            last = int(self.ended[run]) - 1
            angle, rates = (
                np.rad2deg(self.channels["alpha"][last, run]),
                max("pqr", key=lambda name: abs(float(self.channels[name][last, run]))),
            )
            said.append(
                f"the run ended at {self.time[last]:.2f} s: the motion left all bounds (alpha"
                f" {angle:.0f} deg, {rates} {np.rad2deg(self.channels[rates][last, run]):.0f}"
                " deg/s); what came before is kept"
            )
        left = {name: float(times[run]) for name, times in self.left.items()}
        for time in sorted({value for value in left.values() if np.isfinite(value)})[:3]:
            names = sorted(name for name, value in left.items() if value == time)
            more = f" and {len(names) - 3} more" if len(names) > 3 else ""
            at = int(np.searchsorted(self.time, time))
            alpha, beta = (np.rad2deg(self.channels[name][at, run]) for name in ("alpha", "beta"))
            said.append(
                f"at {time:.2f} s the motion left table{'s' if more or len(names) > 1 else ''}"
                f" {', '.join(names[:3])}{more}, whose edges were held: alpha {alpha:.1f} deg, beta"
                f" {beta:.1f} deg, V {self.channels['V'][at, run]:.1f} m/s"
            )
        if self.unresolved:
            said.append(f"alphadot was not found at {self.unresolved} samples")
        return said


def simulate(
    model: FlightModel,
    time: Array,
    start: Mapping[str, Any] | Array,
    series: Mapping[str, Any],
    *,
    parts: int = 1,
    method: int = 4,
    parameters: Mapping[str, Any] | None = None,
) -> Simulation:
    """Fly k runs.

    Parameters
    ----------
    time : (n,) [s], uniform.
    start : V [m/s], alpha, beta, p, q, r, phi, theta, psi [rad], north, east, altitude [m]; each a
        number or (k,); states of the database too, which otherwise begin at their steady values.
        Or the whole state (13 + m + a, k).
        p, q and r are relative to inertial space.
    series : mass properties and what else of `SURROUNDINGS` acts, the model's inputs, and
        references of feedback; each a number, (n,) or (n, k), linear between samples.
    parts : integration steps per sample.
    method : 4 for the classical Runge-Kutta rule, 2 for Adams-Bashforth of second order.
    parameters : estimates and factors, by name, that replace the model's own: number or (k,).

    Raises InputError naming missing or unknown inputs, and a start without airspeed.
    """
    unknown = [*set(series) - {*SURROUNDINGS, *model.inputs} - {f"reference_{c}" for c in FEEDBACK}]
    given: dict[str, Any] = {**_DEFAULTS, **series}
    absent = sorted({*SURROUNDINGS, *model.inputs} - set(given))
    where = f"flight simulation of {model.database.name}"
    if absent:
        raise InputError(
            f"inputs missing: {', '.join(absent)}", where, "give each as a number or a series"
        )
    if unknown:
        raise InputError(
            f"it has no input '{sorted(unknown)[0]}'", where, nearest(unknown[0], model.inputs)
        )
    n = len(time)
    k = max(
        [1]
        + [np.shape(v)[1] for v in given.values() if np.ndim(v) == 2]
        + [np.size(v) for v in (parameters or {}).values()]
        + ([start.shape[1]] if isinstance(start, np.ndarray) else [*map(np.size, start.values())])
    )
    rows = (*SURROUNDINGS, *model.inputs, *(f"reference_{c}" for c in FEEDBACK))
    stacked = np.zeros((n, len(rows), k))
    for j, name in enumerate(rows):
        value = np.asarray(given.get(name, 0.0), dtype=np.float64)
        stacked[:, j, :] = value[:, None] if value.ndim == 1 else value
    bad = [name for j, name in enumerate(rows) if not np.isfinite(stacked[:, j]).all()]
    if bad:
        raise InputError(f"inputs are not finite: {', '.join(bad)}", where, "bridge their gaps")
    slots = np.repeat(model.total.machine.slots[:, None], k, axis=1)
    slots = np.concatenate([slots, np.zeros((1, k))])
    _set_parameters(model, slots, parameters or {}, where)
    first = dict(zip(rows, stacked[0], strict=True))
    x = (
        np.array(start, dtype=np.float64)
        if isinstance(start, np.ndarray)
        else initial_state(model, start, first, k)
    )
    tables = model.total.machine.tables
    recorded = np.empty((n, len(MOTION) + len(LOADS), k))
    kept = np.empty((n, len(x) + len(model.inputs), k))
    ended, left = np.empty(k, np.int64), np.empty((len(tables), k), np.int64)
    rates = np.empty_like(x)
    interval = float(time[-1] - time[0]) / max(n - 1, 1) or 1.0
    from aerodb.simulation.integration import integrate  # loads the compiler

    def fly(block: slice) -> int:
        parts_of = [np.ascontiguousarray(a[..., block]) for a in (stacked, x, slots)]
        results = [
            np.ascontiguousarray(a[..., block]) for a in (recorded, kept, ended, left, rates)
        ]
        lost = integrate(
            model.numbers, parts_of[0], interval, parts, method, parts_of[1], parts_of[2], *results
        )
        for whole, part in zip((recorded, kept, ended, left, rates), results, strict=True):
            whole[..., block] = part
        x[:, block] = parts_of[1]
        return int(lost)

    size = BLOCK if n > 2 else _SHORT_BLOCK
    blocks = [slice(b, b + size) for b in range(0, k, size)]
    lost = sum(in_threads(fly, blocks))
    channels = {name: recorded[:, j] for j, name in enumerate((*MOTION, *LOADS))}
    for j, name in enumerate(model.extra_states[: len(model.total.states)]):
        channels[name] = kept[:, len(STATE) + j]
    for j, name in enumerate(model.inputs):
        channels[name] = kept[:, len(x) + j]
    since = np.asarray(time, dtype=np.float64)
    times = {
        table: np.where(left[j] >= 0, since[np.maximum(left[j], 0)], np.nan)
        for j, table in enumerate(tables)
        if (left[j] >= 0).any()
    }
    return Simulation(since, channels, x, ended, times, lost, rates)


def _set_parameters(
    model: FlightModel, slots: Array, parameters: Mapping[str, Any], where: str
) -> None:
    places = model.total.machine.inputs
    for name, value in {**model.parameters, **parameters}.items():
        if name not in places:
            raise InputError(f"no parameter '{name}'", where, nearest(name, places))
        slots[places[name]] = value


def _check_airspeed(model: FlightModel, speed: Array) -> None:
    """Raise InputError for a start without airspeed, unless loads act there."""
    if not np.all(speed >= 0) or not (np.all(speed > 0) or model.database.acts_at_rest):
        raise InputError(
            "the start has no airspeed",
            f"database {model.database.name}",
            "give V [m/s] above zero; only a database with loads (FX to MZ) flies at V = 0",
        )


def initial_state(
    model: FlightModel, start: Mapping[str, Any], first: Mapping[str, Array], k: int
) -> Array:
    """State (13 + m + a, k) from air-relative motion, attitude and place; see `simulate`.

    first : surroundings and inputs at the start, each (k,).
    """
    states = tuple(state.name for state in model.total.states)
    unknown = sorted(set(start) - {*_START, *states})
    if unknown:
        raise InputError(f"a start has no '{unknown[0]}'", remedy=nearest(unknown[0], _START))
    at = {name: np.broadcast_to(np.asarray(start.get(name, 0.0), float), (k,)) for name in _START}
    _check_airspeed(model, at["V"])
    along, side = at["V"] * np.cos(at["beta"]), at["V"] * np.sin(at["beta"])
    air = np.stack([along * np.cos(at["alpha"]), side, along * np.sin(at["alpha"])])
    quaternion = quaternion_from_euler(at["phi"], at["theta"], at["psi"])
    wind = np.stack([first[f"wind_{axis}"] for axis in ("north", "east", "down")])
    gust = np.stack([first[f"gust_{axis}"] for axis in "uvw"])
    base = 0.0 if model.earth is None else model.earth.height
    rows = [
        *(air + to_body(quaternion, wind) + gust),
        at["p"],
        at["q"],
        at["r"],
        *quaternion,
        at["north"],
        at["east"],
        base - at["altitude"],
    ]
    channels = {name: at[name] for name in ("V", "alpha", "beta")}
    for state in model.total.states:
        settled = state.settled(channels, model.database.reference.chord)
        rows.append(np.broadcast_to(np.asarray(start.get(state.name, settled), float), (k,)))
    rows += [first[name] for name in model.actuated]
    return np.array(rows, dtype=np.float64)
