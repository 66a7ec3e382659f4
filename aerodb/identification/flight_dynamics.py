"""A vehicle that flies on a database, as a model with unknown parameters."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from aerodb.errors import InputError, nearest
from aerodb.estimation import MOST_DELAY, Parameter, Parameters, TimeHistory, Values, delayed
from aerodb.identification.database_parameters import unknown as as_unknown
from aerodb.simulation import FlightModel, FlightStretch, Simulation, simulate
from aerodb.support import Array, Integers, Mask

#: From the CG [m], body axes.
Position = tuple[float, float, float]

#: States of the motion that a model may start from, and that it is compared with.
MOTION: Final = ("V", "alpha", "beta", "p", "q", "r", "phi", "theta")
#: Outputs by default: the motion and the specific force at the CG.
OUTPUTS: Final = (*MOTION, "ax", "ay", "az")
_UNITS: Final = {
    "V": "m/s", "alpha": "rad", "beta": "rad", "p": "rad/s", "q": "rad/s", "r": "rad/s",
    "phi": "rad", "theta": "rad", "ax": "m/s2", "ay": "m/s2", "az": "m/s2",
}  # fmt: skip
#: Longest integration step [s].
_LONGEST_STEP: Final = 0.04
#: Largest scale error that is believable.
_MOST_SCALE: Final = 0.5
#: Moments and products of inertia that may be unknown.
INERTIAS: Final = ("Ixx", "Iyy", "Izz", "Ixz")
#: Ixz lies within this share of the root of Ixx Izz; a moment of inertia within these shares of
#: what the vehicle file states.
_MOST_COUPLED: Final = 0.9
_LEAST: Final = 0.5
_MOST: Final = 2.0
#: Place of a record that is no state: given by its inputs, or by its start.
_PLACE: Final = ("psi", "altitude")


@dataclass(frozen=True, eq=False)
class FlightDynamics:
    """The six-degree-of-freedom equations of the simulation as a `DynamicModel`.

    Unknowns by name: increments' estimates and factors of the flight model; ``initial_<state>``;
    ``bias_<output>`` and ``scale_<output>``, with ``measured = (1 + scale) true + bias``;
    ``delay_<output>`` or ``delay_<input>`` [s], by which it is late; each of all records or, with
    ``[record]`` behind it, of one.

    Parameters
    ----------
    flight : what flies.
    parameters : all parameters.
    outputs : among `OUTPUTS` and other channels of a `Simulation`.
    starts : record -> start of the run, as `simulate` takes it, in place of initial states.
    accelerometer, vane : positions from the CG [m], body axes, at which ax, ay, az and V, alpha,
        beta are measured.
    """

    flight: FlightModel
    parameters: Parameters
    outputs: tuple[str, ...]
    starts: Mapping[str, Mapping[str, float]]
    accelerometer: Position | None = None
    vane: Position | None = None
    states: tuple[str, ...] = field(init=False)
    _flying: tuple[str, ...] = field(init=False)

    def __post_init__(self) -> None:
        own = tuple(state.name for state in self.flight.total.states)
        object.__setattr__(self, "states", (*MOTION, *own))
        flying = (*self.flight.parameters, *_factors(self.flight))
        object.__setattr__(self, "_flying", flying)

    def initial_state(self, values: Values, record: TimeHistory) -> Array:
        """State at the first sample, (s, k), in SI units and rad."""
        own, start = _own(values, record.name), self.starts[record.name]
        rows = [np.atleast_1d(own.get(f"initial_{s}", start.get(s, 0.0))) for s in self.states]
        return np.stack(np.broadcast_arrays(*rows))

    def simulated(self, values: Values, record: TimeHistory) -> Array:
        """Return outputs (n, o, k), SI units and rad, from the initial state on; NaN after a
        divergence."""
        return self.propagated(values, record, self.initial_state(values, record))[0]

    def approximated(self, values: Values, record: TimeHistory) -> Array:
        """Return `simulated`'s outputs (n, o, k), SI units, by Adams and Bashforth's second-order
        rule."""
        own, start = _own(values, record.name), self.initial_state(values, record)
        run = self._flown(own, record, self._series(own, record), record.time, start, method=2)
        return self._measured(own, record, run)

    def propagated(self, values: Values, record: TimeHistory, start: Array) -> tuple[Array, Array]:
        """Outputs (n, o, k) from a state (s, k) on, and the state (s, k) at the last sample, in SI
        units and rad; NaN after a divergence."""
        own = _own(values, record.name)
        run = self._flown(own, record, self._series(own, record), record.time, start)
        last = np.stack([run.channels[name][-1] for name in self.states])
        return self._measured(own, record, run), last

    def rates(self, values: Values, record: TimeHistory, sample: float, state: Array) -> Array:
        """Return time derivatives (s, k), SI units per second, of a state (s, k), in steady wind;
        NaN where it cannot fly."""
        own, lost = _own(values, record.name), ~_flyable(state)
        state = self._replaced(state, lost, record)
        run = self._instant(own, record, sample, state)
        quaternion = np.stack([run.state[j] for j in range(6, 10)])
        spin = _spin(quaternion, run.rates[6:10])
        sine, cosine = np.sin(state[6]), np.cos(state[6])
        alpha, beta, speed = state[1], state[2], state[0]
        direction = np.stack(
            [np.cos(alpha) * np.cos(beta), np.sin(beta), np.sin(alpha) * np.cos(beta)]
        )
        wind = run.state[:3] - speed * direction  # of the air, in body axes that turn
        turned = np.stack(_crossed(spin, wind))
        rows = [
            np.sum(direction * (run.rates[:3] + turned), axis=0),
            run.channels["alphadot"][0],
            run.channels["betadot"][0],
            *run.rates[3:6],
            spin[0] + np.tan(state[7]) * (spin[1] * sine + spin[2] * cosine),
            spin[1] * cosine - spin[2] * sine,
            *run.rates[13 : 13 + len(self.states) - len(MOTION)],
        ]
        return np.where(lost, np.nan, np.stack(rows))

    def observed(self, values: Values, record: TimeHistory, sample: int, state: Array) -> Array:
        """Return outputs (o, k), SI units, at a state (s, k), without delays of outputs; NaN where
        it cannot fly."""
        own, lost = _own(values, record.name), ~_flyable(state)
        run = self._instant(own, record, sample, self._replaced(state, lost, record))
        return np.where(lost, np.nan, self._measured(own, record, run, timely=True)[0])

    def advanced(
        self, values: Values, record: TimeHistory, samples: Integers, state: Array
    ) -> tuple[Array, Array]:
        """Return states (s, m), SI units, one sample later, and outputs (o, m) without delays now,
        of states (s, m) at samples (m,); NaN where they cannot fly. After the last sample inputs
        stay."""
        own, lost = _own(values, record.name), ~_flyable(state)
        state = self._replaced(state, lost, record)
        following = np.minimum(samples + 1, len(record.time) - 1)
        series = {}
        for name, input_ in record.inputs.items():
            if name not in _PLACE:
                late = own.get(f"delay_{name}", np.zeros(1)) / record.step
                series[name] = np.stack([_at(input_, at - late) for at in (samples, following)])
        for name in INERTIAS:
            if name in own:
                series[name] = np.broadcast_to(own[name], (2, len(samples)))
        run = self._flown(own, record, series, record.time[:2], state, samples)
        outputs = self._measured(own, record, run, timely=True)[0]
        later = np.stack([run.channels[name][1] for name in self.states])
        return np.where(lost, np.nan, later), np.where(lost, np.nan, outputs)

    def _replaced(self, state: Array, lost: Mask, record: TimeHistory) -> Array:
        """The state (s, k) with that of the record's start in the runs that are lost."""
        if not lost.any():
            return state
        start = self.starts[record.name]
        first = np.array([start.get(name, 0.0) for name in self.states])
        return np.where(lost, first[:, None], state)

    def _instant(
        self, own: Mapping[str, Array], record: TimeHistory, sample: float, state: Array
    ) -> Simulation:
        low = min(int(sample), len(record.time) - 2)
        share = sample - low
        series = {
            name: (values[low] + share * (values[low + 1] - values[low]))
            for name, values in self._series(own, record).items()
        }
        return self._flown(
            own, record, {name: np.atleast_1d(v)[None] for name, v in series.items()},
            record.time[:1], state, low,
        )  # fmt: skip

    def _flown(
        self,
        own: Mapping[str, Array],
        record: TimeHistory,
        series: Mapping[str, Array],
        time: Array,
        start: Array,
        sample: int | Integers = 0,
        method: int = 4,
    ) -> Simulation:
        k = start.shape[1]
        place: dict[str, Any] = {
            name: np.broadcast_to(record.inputs[name][sample], (k,))
            if name in record.inputs
            else self.starts[record.name].get(name, 0.0)
            for name in _PLACE
        }
        first = dict(zip(self.states, start, strict=True)) | place
        parts = max(1, int(np.ceil(record.step / _LONGEST_STEP - 1e-9)))
        return simulate(
            self.flight,
            time,
            first,
            series,
            parts=parts,
            method=method,
            parameters=_factors(self.flight)
            | {name: own[name] for name in self._flying if name in own},
        )

    def _series(self, own: Mapping[str, Array], record: TimeHistory) -> dict[str, Array]:
        """Return what acts on a run: (n,), or (n, k) where it is delayed."""
        taken = {name: v for name, v in record.inputs.items() if name not in _PLACE}
        for name in self.flight.inputs:
            if f"delay_{name}" in own:
                late = np.atleast_1d(own[f"delay_{name}"]) / record.step
                taken[name] = delayed(taken[name][:, None], late)[0]
        for name in INERTIAS:
            if name in own:
                taken[name] = np.broadcast_to(
                    np.atleast_1d(own[name]), (len(record.time), np.size(own[name]))
                )
        return taken

    def _measured(
        self, own: Mapping[str, Array], record: TimeHistory, run: Simulation, timely: bool = False
    ) -> Array:
        """Outputs (n, o, k) as the instruments give them."""
        channels = _at_points(run.channels, self.accelerometer, self.vane)
        rows = []
        for name in self.outputs:
            value = channels[name]
            if not timely and f"delay_{name}" in own:
                late = np.atleast_1d(own[f"delay_{name}"]) / record.step
                value = delayed(value, late, held=False)[0]
            if f"scale_{name}" in own:
                value = value * (1.0 + own[f"scale_{name}"])
            rows.append(value + own.get(f"bias_{name}", 0.0))
        return np.stack(np.broadcast_arrays(*rows), axis=1)


def flight_dynamics(
    model: FlightModel,
    stretches: Mapping[str, FlightStretch],
    unknown: Sequence[str],
    *,
    outputs: Sequence[str] = OUTPUTS,
    initial: Sequence[str] = MOTION,
    biases: Sequence[str] = (),
    scales: Sequence[str] = (),
    delays: Sequence[str] = (),
    inertias: Sequence[str] = (),
    accelerometer: Position | None = None,
    vane: Position | None = None,
) -> tuple[FlightDynamics, list[TimeHistory]]:
    """Return the model of some stretches of flight, and their records.

    Parameters
    ----------
    stretches : name of a record -> `stretch_of` a flight.
    unknown : increments' estimates and factors of the flight model that are to be estimated.
    initial : states whose first value is unknown in each record; others start as measured.
    biases : outputs with an unknown bias in each record. scales : outputs with one unknown scale.
    delays : outputs and inputs with one unknown delay.
    inertias : moments and products of inertia [kg m2] that are unknown, constant, and the same in
    all records; they start at the mean of the stretches.
    accelerometer, vane : see `FlightDynamics`.

    Raises InputError for a name that is none of these.
    """
    known = {**model.parameters, **_factors(model)}
    states = (*MOTION, *(state.name for state in model.total.states))
    for names, allowed, what in (
        (unknown, tuple(known), "parameter"),
        (initial, states, "state"),
        ((*biases, *scales), tuple(outputs), "output"),
        (delays, (*outputs, *model.inputs), "output or input"),
    ):
        for name in names:
            if name not in allowed:
                raise InputError(f"no {what} '{name}'", "flight dynamics", nearest(name, allowed))
    own = model.database.parameters
    items = [
        as_unknown(name, model.database) if name in own else Parameter(name, known[name])
        for name in unknown
    ]
    items += [
        Parameter(f"scale_{name}", 0.0, "1", lower=-_MOST_SCALE, upper=_MOST_SCALE)
        for name in scales
    ]
    items += [
        Parameter(f"delay_{name}", 0.0, "s", lower=-MOST_DELAY, upper=MOST_DELAY) for name in delays
    ]
    items += [_inertia(name, stretches) for name in inertias]
    records = []
    for name, stretch in stretches.items():
        items += [
            Parameter(f"initial_{s}[{name}]", float(stretch.start.get(s, 0.0)), _UNITS.get(s, "1"))
            for s in initial
        ]
        items += [Parameter(f"bias_{o}[{name}]", 0.0, _UNITS.get(o, "1")) for o in biases]
        records.append(_record(name, stretch, outputs))
    made = FlightDynamics(
        model,
        Parameters(tuple(items)),
        tuple(outputs),
        {name: stretch.start for name, stretch in stretches.items()},
        accelerometer,
        vane,
    )
    return made, records


def _inertia(name: str, stretches: Mapping[str, FlightStretch]) -> Parameter:
    """An inertia as an unknown: from the mean of the stretches, within what a body can have."""
    mean = {
        each: float(np.mean([np.mean(s.series[each]) for s in stretches.values()]))
        for each in INERTIAS
    }
    most = _MOST_COUPLED * float(np.sqrt(mean["Ixx"] * mean["Izz"]))
    low, high = (-most, most) if name == "Ixz" else (_LEAST * mean[name], _MOST * mean[name])
    return Parameter(name, mean[name], "kg*m**2", lower=low, upper=high)


def _record(name: str, stretch: FlightStretch, outputs: Sequence[str]) -> TimeHistory:
    """The stretch as a record; outputs that it cannot judge are not compared."""
    n = len(stretch.time)
    inputs = {key: np.broadcast_to(value, (n,)) for key, value in stretch.series.items()}
    for place in _PLACE:
        values = stretch.flown.get(place)
        good = np.flatnonzero(np.isfinite(values)) if values is not None else np.zeros(0, int)
        if values is not None and len(good):
            inputs[place] = np.interp(np.arange(n), good, values[good])
    empty = np.full(n, np.nan)
    measured = {
        output: empty if output in stretch.free else stretch.flown.get(output, empty)
        for output in outputs
    }
    return TimeHistory(name, stretch.time, inputs, measured)


def _factors(model: FlightModel) -> dict[str, float]:
    """Parameters of the model that are no estimates: factors of terms, 1 each."""
    states = {state.name for state in model.total.states}
    own = {*model.total.inputs, *model.parameters, *states}
    return {name: 1.0 for name in model.total.machine.inputs if name not in own}


def _flyable(state: Array) -> Mask:
    """Runs (k,) whose state (s, k) has airspeed and is finite."""
    with np.errstate(invalid="ignore"):
        return np.asarray(np.isfinite(state).all(axis=0) & (state[0] > 0.0))


def _own(values: Values, record: str) -> dict[str, Array]:
    """Values without the brackets of the parameters of this record; others' are left out."""
    own = {name: value for name, value in values.items() if not name.endswith("]")}
    return own | {
        name.split("[", 1)[0]: value
        for name, value in values.items()
        if name.endswith(f"[{record}]")
    }


def _at(series: Array, place: Array) -> Array:
    """A series (n,) at places (m,) between its samples, linear; its ends are held."""
    return np.interp(place, np.arange(len(series)), series)


def _spin(quaternion: Array, rate: Array) -> Array:
    """Angular velocity (3, k) in body axes that turns a quaternion (4, k) at its rate (4, k)."""
    a, b, c, d = quaternion
    e, f, g, h = rate
    return 2.0 * np.stack(
        [
            a * f - b * e - c * h + d * g,
            a * g + b * h - c * e - d * f,
            a * h - b * g + c * f - d * e,
        ]
    )


def _crossed(a: Sequence[Array] | Array, b: Sequence[Any] | Array) -> list[Array]:
    """Vector product of a with b, whose components may be numbers."""
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def _at_points(
    channels: Mapping[str, Array], accelerometer: Position | None, vane: Position | None
) -> Mapping[str, Array]:
    """Channels with specific force and air data at the instruments' positions."""
    found = dict(channels)
    rates = channels["p"], channels["q"], channels["r"]
    if accelerometer is not None:
        turning = tuple(channels[f"{axis}dot"] for axis in "pqr")
        swung = _crossed(turning, accelerometer)
        pulled = _crossed(rates, _crossed(rates, accelerometer))
        for axis, more, yet in zip("xyz", swung, pulled, strict=True):
            found[f"a{axis}"] = channels[f"a{axis}"] + more + yet
    if vane is not None:
        alpha, beta = channels["alpha"], channels["beta"]
        along = channels["V"] * np.cos(beta)
        moved = _crossed(rates, vane)
        u, v, w = (
            along * np.cos(alpha) + moved[0],
            channels["V"] * np.sin(beta) + moved[1],
            along * np.sin(alpha) + moved[2],
        )
        speed = np.sqrt(u**2 + v**2 + w**2)
        found |= {"V": speed, "alpha": np.arctan2(w, u), "beta": np.arcsin(v / speed)}
    return found
