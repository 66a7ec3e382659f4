"""Predict the sensor outputs along a path, with their derivatives by every unknown.

A sensor shows ``(1 + scale) true(t - delay) + bias``; `models` gives the true quantity.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aerodb.consistency.kinematics import INPUTS, STATES, STEEPEST, Between, integrate
from aerodb.consistency.sensors.models import Installation, SensorModels
from aerodb.consistency.sensors.parameters import (
    FURTHER_OUTPUTS,
    OUTPUTS,
    SensorParameter,
    delays_of,
)
from aerodb.errors import InputError, UnknownNameError, nearest
from aerodb.physics import GRAVITY, Earth
from aerodb.support import Array, Dual

#: Largest delay that is sought, s; for a delayed channel, samples this close to either end of a
#: record are not used.
MAX_DELAY = 0.3


@dataclass(frozen=True)
class FlightRecord:
    """One uninterrupted stretch of flight, n samples.

    name : unique.
    step : sampling interval [s].
    inputs : (n, 6), measured specific force at the CG [m/s2] and rates [rad/s], finite, order of
        `kinematics.INPUTS`.
    outputs : channel of `OUTPUTS` or `FURTHER_OUTPUTS` -> (n,), measured, SI, nan where it must not
        be used.
    flight : the flight that it belongs to (winds are per flight).
    arm : (3,), air-data point relative to the CG, body axes [m].
    given : state -> (n,), taken from measurement instead of integrated.
    density : (n,), [kg/m3], for qbar, raw pressures and port errors.
    pivot : channel -> value about which its scale acts; zero if absent (the scale of a heading
        needs one).
    gravity : [m/s2]; over a rotating earth only for what is not integrated.
    between : of inputs, between samples (`kinematics.integrate`).
    first : index of its first sample in the flight. start : time of that sample in the flight [s].
    installation : of the other sensors.
    pressure : (n,), static pressure behind the density [Pa] (`models.SensorModels`).
    earth : rotating oblate earth, for long records; None: flat.
    input_noise : (6,), one sigma of the inputs' white noise; None: from their second differences.

    Raises InputError when shapes disagree, inputs are not finite, or density or calibration is
    missing, and UnknownNameError for an unknown channel or state.
    """

    name: str
    step: float
    inputs: Array
    outputs: Mapping[str, Array]
    flight: str = ""
    arm: tuple[float, float, float] = (0.0, 0.0, 0.0)
    given: Mapping[str, Array] = field(default_factory=dict)
    density: Array | None = None
    pivot: Mapping[str, float] = field(default_factory=dict)
    gravity: float = GRAVITY
    between: Between = "cubic"
    first: int = 0
    start: float = 0.0
    installation: Installation = field(default_factory=Installation)
    pressure: Array | None = None
    earth: Earth | None = None
    input_noise: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        n = len(self.inputs)
        if self.inputs.shape != (n, 6) or n < 8:
            raise InputError(
                f"inputs have shape {self.inputs.shape}",
                self.name,
                "give (n, 6) with at least 8 samples",
            )
        if not np.isfinite(self.inputs).all():
            raise InputError(
                "specific force or rates are not finite everywhere",
                self.name,
                "bridge or cut the gaps first",
            )
        for known, channels in (((*OUTPUTS, *FURTHER_OUTPUTS), self.outputs), (STATES, self.given)):
            for name, values in channels.items():
                if name not in known:
                    raise UnknownNameError(
                        f"no sensor or state '{name}'", self.name, nearest(name, known)
                    )
                if values.shape != (n,):
                    raise InputError(
                        f"{name} has shape {values.shape}, the inputs {n} samples", self.name
                    )
        for name in ("qbar", "probe_dp_alpha", "probe_dp_beta"):
            if name in self.outputs and self.density is None:
                raise InputError(
                    f"{name} without density", self.name, f"give the density, or leave {name} out"
                )
            if name in self.outputs and name != "qbar" and self.installation.five_hole is None:
                raise InputError(
                    f"{name} without a calibration",
                    self.name,
                    "give [air_data.five_hole], or leave it out",
                )


@dataclass(frozen=True)
class RecordPrediction:
    """Path and predicted outputs of one record, n samples, k unknowns.

    states : (9, n), order of `kinematics.STATES`.
    air : (3, n), velocity of the CG through the air, body axes [m/s].
    outputs : channel -> (n,), SI.
    slopes : channel -> (n, k), derivatives of the outputs by the unknowns.
    path : the path with its derivatives. airflow : `air` with its derivatives by what moves it.
    """

    states: Array
    air: Array
    outputs: Mapping[str, Array]
    slopes: Mapping[str, Array]
    path: "_Path" = field(repr=False)
    airflow: Sequence[Dual] = field(repr=False)

    @cached_property
    def state_slopes(self) -> Array:
        """(9, n, k), derivatives of the states."""
        full = np.zeros((*self.states.shape, len(self.path.wanted)))
        full[:, :, self.path.columns] = self.path.sensitivity
        return full

    @cached_property
    def air_slopes(self) -> Array:
        """(3, n, k), derivatives of `air`."""
        return np.stack([self.path.along(part) for part in self.airflow])


def corrected_inputs(record: FlightRecord, values: Mapping[str, float]) -> Array:
    """Corrected specific force [m/s2] and rates [rad/s], (n, 6): ``(measured - bias) / (1 +
    scale)``."""
    bias = np.array([values.get(f"{name}_bias", 0.0) for name in INPUTS])
    return np.asarray((record.inputs - bias) * _gain(values))


def predict_outputs(
    record: FlightRecord,
    values: Mapping[str, float],
    initial: Array,
    unknowns: Sequence[SensorParameter],
    slopes: bool = True,
    driver: FlightRecord | None = None,
) -> RecordPrediction:
    """Integrate the path of a record and predict its sensor outputs.

    Parameters
    ----------
    record : n samples.
    values : parameter name -> value, SI, for this record.
    initial : (9,), initial state.
    unknowns : k parameters of this record by which to differentiate.
    slopes : whether to compute derivatives.
    driver : the record at its full rate, where `record` holds one of several of its samples
        (`thinned`): its inputs are integrated. None: the record itself.

    Raises InputError when port errors are given without density, or the path leaves all bounds.
    """
    wanted = tuple(unknowns) if slopes else ()
    inputs = corrected_inputs(record, values)
    path = _path(record, values, initial, wanted, inputs, driver)
    sight = SensorModels(
        {
            name: Dual(path.states[number], {name: 1.0} if wanted else {})
            for number, name in enumerate(STATES)
        },
        (_rate("p", inputs, wanted), _rate("q", inputs, wanted), _rate("r", inputs, wanted)),
        values,
        frozenset(item.name for item in wanted),
        record.arm,
        record.installation,
        record.gravity,
        record.density,
        record.pressure,
    )
    if record.density is None and sight.acts(
        "static_port_error", "static_port_offset", "total_port_error"
    ):
        raise InputError(
            "errors of the pressure ports without density",
            record.name,
            "give the density, or leave them out",
        )
    outputs, derivative = {}, {}
    for name in record.outputs:
        true = sight.channel(name)
        outputs[name], derivative[name] = _shown(
            name, _full(true.value, path), path.along(true), values, wanted, record
        )
    air = np.stack([_full(part.value, path) for part in sight.air])
    return RecordPrediction(path.states, air, outputs, derivative, path, sight.air)


def thinned(record: FlightRecord, every: int) -> FlightRecord:
    """The record with one sample of `every`, from the first on: (n,) becomes (n / every,), rounded
    up.

    Its step [s] is `every` times longer.
    """
    return replace(
        record,
        step=record.step * every,
        inputs=record.inputs[::every],
        outputs={name: values[::every] for name, values in record.outputs.items()},
        given={name: values[::every] for name, values in record.given.items()},
        density=None if record.density is None else record.density[::every],
        pressure=None if record.pressure is None else record.pressure[::every],
    )


def outputs_along(
    record: FlightRecord, values: Mapping[str, float], states: Array, slopes: bool = True
) -> tuple[dict[str, Array], dict[str, Array]]:
    """Sensor outputs along known states, and their derivatives by these, without delays.

    Parameters
    ----------
    record : n samples, of which the inputs' rates are used, with the outputs that are wanted.
    values : parameter name -> value, SI; delays are not applied.
    states : (9, n), order of `kinematics.STATES`.
    slopes : whether to compute derivatives.

    Returns
    -------
    outputs : channel -> (n,), SI.
    by_state : channel -> (n, 9); empty without slopes.

    Raises InputError where the pitch attitude comes too close to +-90 deg.
    """
    steep = ~(np.abs(states[4]) < STEEPEST)
    if steep.any():
        raise InputError(
            f"the pitch attitude leaves +-{np.rad2deg(STEEPEST):.0f} deg at sample"
            f" {int(np.argmax(steep))}",
            record.name,
            "leave that part out",
        )
    n = states.shape[1]
    inputs = corrected_inputs(record, values)
    rates = tuple(Dual(inputs[:, number], {}) for number in (3, 4, 5))
    sight = SensorModels(
        {
            name: Dual(states[number], {name: 1.0} if slopes else {})
            for number, name in enumerate(STATES)
        },
        (rates[0], rates[1], rates[2]),
        values,
        frozenset(),
        record.arm,
        record.installation,
        record.gravity,
        record.density,
        record.pressure,
    )
    outputs, by_state = {}, {}
    for name in record.outputs:
        true = sight.channel(name)
        gain = 1.0 + values.get(f"{name}_scale", 0.0)
        pivot = record.pivot.get(name, 0.0)
        shown = gain * (true.value - pivot) + pivot + values.get(f"{name}_bias", 0.0)
        outputs[name] = np.broadcast_to(shown, (n,))
        if slopes:
            by_state[name] = np.zeros((n, 9))
            for state, part in true.by.items():
                by_state[name][:, STATES.index(state)] = gain * part
    return outputs, by_state


def _full(value: Array | float, path: "_Path") -> Array:
    return np.broadcast_to(value, path.states.shape[1:])


def _rate(name: str, inputs: Array, wanted: Sequence[SensorParameter]) -> Dual:
    moved = any(item.subject == name and item.kind in ("bias", "scale") for item in wanted)
    return Dual(inputs[:, INPUTS.index(name)], {name: 1.0} if moved else {})


@dataclass(frozen=True)
class _Path:
    """A path and its derivatives.

    states : (9, n).
    sensitivity : (9, n, m), by the m unknowns that move the path.
    columns : their m indices in `wanted`.
    wanted : the k unknowns.
    rates : p, q, r -> index in `wanted` and effect, (n,) or a number, of each unknown that corrects
        that rate.
    number : unknown's name -> index in `wanted`.
    """

    states: Array
    sensitivity: Array
    columns: list[int]
    wanted: Sequence[SensorParameter]
    rates: Mapping[str, Sequence[tuple[int, Array | float]]]
    number: Mapping[str, int]

    def along(self, signal: Dual) -> Array:
        """(n, k) derivatives of a signal by the unknowns: through states, through rates, direct."""
        n = self.states.shape[1]
        slope = np.zeros((n, len(self.wanted)))
        through = [name for name in signal.by if name in STATES]
        if through and self.columns:
            rows = [STATES.index(name) for name in through]
            parts = np.empty((len(rows), n))
            for row, name in enumerate(through):
                parts[row] = signal.by[name]
            _chain(parts, np.array(rows), self.sensitivity, np.array(self.columns), slope)
        for name, part in signal.by.items():
            if name in self.rates:
                for column, effect in self.rates[name]:
                    slope[:, column] += part * effect
            elif name in self.number:
                slope[:, self.number[name]] += part
        return slope


@njit(cache=True, nogil=True)
def _chain(
    parts: Array, rows: NDArray[np.int64], along: Array, columns: NDArray[np.int64], slope: Array
) -> None:
    """Add the sum over j of parts[j] (n,) times along[rows[j]] (n, m) to the `columns` (m,) of
    slope (n, k)."""
    for i in range(parts.shape[1]):
        for j in range(rows.shape[0]):
            part = parts[j, i]
            for k in range(columns.shape[0]):
                slope[i, columns[k]] += part * along[rows[j], i, k]


def _gain(values: Mapping[str, float]) -> Array:
    return 1.0 / (1.0 + np.array([values.get(f"{name}_scale", 0.0) for name in INPUTS]))


def _path(
    record: FlightRecord,
    values: Mapping[str, float],
    initial: Array,
    wanted: Sequence[SensorParameter],
    inputs: Array,
    driver: FlightRecord | None,
) -> _Path:
    """Integrate the path, with sensitivities to those unknowns that move it."""
    columns, kinds, first = [], [], []
    rates: dict[str, list[tuple[int, Array | float]]] = {name: [] for name in INPUTS[3:]}
    gain = _gain(values)
    for number, item in enumerate(wanted):
        if item.kind == "initial":
            columns.append(number)
            kinds.append(-1)
            first.append(np.eye(9)[STATES.index(item.subject)])
        elif item.subject in INPUTS and item.kind in ("bias", "scale"):
            axis = INPUTS.index(item.subject)
            columns.append(number)
            kinds.append(axis + (6 if item.kind == "scale" else 0))
            first.append(np.zeros(9))
            if item.subject in rates:
                rates[item.subject].append(
                    (number, -gain[axis] * (1.0 if item.kind == "bias" else inputs[:, axis]))
                )
    given = None
    if record.given:
        given = np.full((len(inputs), 9), np.nan)
        for name, measured in record.given.items():
            given[:, STATES.index(name)] = measured
    fine = record if driver is None else driver
    states, along = integrate(
        inputs if driver is None else corrected_inputs(driver, values),
        fine.step,
        initial,
        record.gravity,
        given,
        np.array(first).reshape(-1, 9).T,
        np.array(kinds, dtype=np.int64),
        gain,
        record.between,
        record.earth,
        round(record.step / fine.step),
    )
    return _Path(
        states,
        along,
        columns,
        wanted,
        rates,
        {item.name: number for number, item in enumerate(wanted)},
    )


def earth_to_body(states: Array) -> Array:
    """(3, 3, n) rotation matrices from earth (north, east, down) to body axes.

    states : (9, n), order of `kinematics.STATES`.
    """
    f, t, p = states[3:6]
    cf, sf, ct, st, cp, sp = np.cos(f), np.sin(f), np.cos(t), np.sin(t), np.cos(p), np.sin(p)
    return np.array(
        [[ct * cp, ct * sp, -st],
         [sf * st * cp - cf * sp, sf * st * sp + cf * cp, sf * ct],
         [cf * st * cp + sf * sp, cf * st * sp - sf * cp, cf * ct]]
    )  # fmt: skip


def _shown(
    name: str,
    true: Array,
    slope: Array,
    values: Mapping[str, float],
    wanted: Sequence[SensorParameter],
    record: FlightRecord,
) -> tuple[Array, Array]:
    """Output of a sensor for the true quantity (n,), and its derivatives (n, k): adds delay, scale
    and bias."""
    gain = 1.0 + values.get(f"{name}_scale", 0.0)
    own = {f"{name}_{part}": part for part in ("bias", "scale")}
    by = {own[item.name]: number for number, item in enumerate(wanted) if item.name in own}
    late_by = [number for number, item in enumerate(wanted) if item.name in delays_of(name)]
    delay = sum(values.get(each, 0.0) for each in delays_of(name))
    pivot = record.pivot.get(name, 0.0)
    late, rate = true, true
    if delay != 0.0 or late_by:
        late, slope = delayed(true, delay / record.step), delayed(slope, delay / record.step)
        rate = delayed(true, delay / record.step, derivative=True) / record.step
    shown = slope * gain if gain != 1.0 else slope
    if "bias" in by:
        shown[:, by["bias"]] += 1.0
    if "scale" in by:
        shown[:, by["scale"]] += late - pivot
    for number in late_by:
        shown[:, number] += gain * rate
    return gain * (late - pivot) + pivot + values.get(f"{name}_bias", 0.0), shown


def delayed(values: Array, samples: float, derivative: bool = False) -> Array:
    """Delay `values` (n, ...) by `samples` sampling intervals, by cubic interpolation.

    End values are repeated. derivative : return the derivative by `samples` instead.

    >>> delayed(np.arange(6.0) ** 2, 0.5)[2:4].tolist()
    [2.25, 6.25]
    """
    whole = int(np.floor(-samples))
    x = -samples - whole
    if derivative:
        weight = np.array(
            [
                (-3 * x * x + 6 * x - 2) / 6,
                (3 * x * x - 4 * x - 1) / 2,
                (-3 * x * x + 2 * x + 2) / 2,
                (3 * x * x - 1) / 6,
            ]
        )
        weight = -weight
    else:
        weight = np.array(
            [
                -x * (x - 1) * (x - 2) / 6,
                (x + 1) * (x - 1) * (x - 2) / 2,
                -(x + 1) * x * (x - 2) / 2,
                (x + 1) * x * (x - 1) / 6,
            ]
        )
    table = np.ascontiguousarray(values, dtype=np.float64).reshape(len(values), -1)
    return _weighted(table, whole, np.array(weight)).reshape(values.shape)


@njit(cache=True, nogil=True)
def _weighted(values: Array, whole: int, weight: Array) -> Array:
    """(n, k) sums of four successive rows of `values` (n, k), the first of them `whole` - 1 rows
    ahead; end values are repeated."""
    n, k = values.shape
    total = np.empty((n, k))
    for i in range(n):
        at = i + whole
        a, b = min(max(at - 1, 0), n - 1), min(max(at, 0), n - 1)
        c, d = min(max(at + 1, 0), n - 1), min(max(at + 2, 0), n - 1)
        for j in range(k):
            total[i, j] = (
                weight[0] * values[a, j]
                + weight[1] * values[b, j]
                + weight[2] * values[c, j]
                + weight[3] * values[d, j]
            )
    return total
