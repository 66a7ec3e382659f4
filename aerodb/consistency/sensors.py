"""What each sensor would have shown along a reconstructed path, and how that depends on every unknown.

Air data are those of the air-data point: ``v - C w + omega x r`` with the wind w, attitude C and arm r from the CG;
``alpha = atan2(w, u)``, ``beta = asin(v / V)``, ``qbar = rho V^2 / 2``. A sensor shows ``(1 + scale) true(t - delay) + bias``
(Klein & Morelli 2006, section 10.2; Jategaonkar 2015, section 10.3).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from aerodb.consistency.kinematics import INPUTS, STATES, integrate
from aerodb.consistency.parameters import OUTPUTS, Parameter
from aerodb.errors import InputError, UnknownNameError, nearest

Array = NDArray[np.float64]

#: Delays are sought within this (s); samples that near to either end of a record are left out for a delayed channel.
LONGEST_DELAY = 0.3


@dataclass(frozen=True)
class Record:
    """One uninterrupted stretch of flight as the reconstruction sees it.

    name : unique. flight : which flight it is a part of (winds are per flight). step : s.
    inputs : (n, 6) measured specific force [m/s2] at the CG and rates [rad/s], finite, order of `kinematics.INPUTS`.
    outputs : measured channels of `OUTPUTS` -> (n,), nan where they must not be used. arm : (3,) air-data point from the
    CG, m, body axes. given : states -> (n,) taken from measurement instead of integrated. density : (n,) kg/m3 for qbar.
    pivot : value of a channel about which its scale acts, zero unless given (a heading's scale needs one).
    held : inputs are taken to hold until the next sample instead of being linear between samples.
    first : number of its first sample in the flight.
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
    gravity: float = 9.80665
    held: bool = False
    first: int = 0

    def __post_init__(self) -> None:
        n = len(self.inputs)
        if self.inputs.shape != (n, 6) or n < 8:
            raise InputError(f"inputs have shape {self.inputs.shape}", self.name, "give (n, 6) with at least 8 samples")
        if not np.isfinite(self.inputs).all():
            raise InputError("specific force or rates are not finite everywhere", self.name, "bridge or cut the gaps first")
        for known, channels in ((OUTPUTS, self.outputs), (STATES, self.given)):
            for name, values in channels.items():
                if name not in known:
                    raise UnknownNameError(f"no sensor or state '{name}'", self.name, nearest(name, known))
                if values.shape != (n,):
                    raise InputError(f"{name} has shape {values.shape}, the inputs {n} samples", self.name)
        if "qbar" in self.outputs and self.density is None:
            raise InputError("qbar without density", self.name, "give the density, or leave qbar out")


@dataclass(frozen=True)
class Response:
    """Along one record: `states` (9, n); `air` (3, n) air-relative velocity at the CG, body axes; `outputs` and their
    derivatives `slopes` (n, k) by the unknowns, both by channel; `state_slopes` (9, n, k); `air_slopes` (3, n, k)."""

    states: Array
    air: Array
    outputs: Mapping[str, Array]
    slopes: Mapping[str, Array]
    state_slopes: Array
    air_slopes: Array


def corrected_inputs(record: Record, values: Mapping[str, float]) -> Array:
    """(n, 6) ``(measured - bias) / (1 + scale)`` of the specific force and rates."""
    bias = np.array([values.get(f"{name}_bias", 0.0) for name in INPUTS])
    return np.asarray((record.inputs - bias) * _gain(values))


def respond(
    record: Record, values: Mapping[str, float], initial: Array, unknowns: Sequence[Parameter], slopes: bool = True
) -> Response:
    """Path and sensor outputs of a record.

    values : parameter name -> value, of this record's scope. initial : (9,) first state. unknowns : k parameters of this
    record by which to differentiate.
    """
    wanted = tuple(unknowns) if slopes else ()
    k, n = len(wanted), len(record.inputs)
    inputs = corrected_inputs(record, values)
    states, along, columns = _path(record, values, initial, wanted, inputs)
    full = np.zeros((9, n, k))
    full[:, :, columns] = along
    turn, dturn = inputs[:, 3:].T, _rate_slopes(inputs, wanted, _gain(values))
    air, dair = _air_velocity(states, full, values, wanted)
    arm = np.array(record.arm) + [values.get(f"air_data_{axis}", 0.0) for axis in "xyz"]
    probe, dprobe = _at_arm(air, dair, turn, dturn, arm, wanted)
    outputs, derivative = {}, {}
    for name in record.outputs:
        true, slope = _true(name, states, full, probe, dprobe, record.density)
        outputs[name], derivative[name] = _shown(name, true, slope, values, wanted, record)
    return Response(states, air, outputs, derivative, full, dair)


def _gain(values: Mapping[str, float]) -> Array:
    return 1.0 / (1.0 + np.array([values.get(f"{name}_scale", 0.0) for name in INPUTS]))


def _path(
    record: Record, values: Mapping[str, float], initial: Array, wanted: Sequence[Parameter], inputs: Array
) -> tuple[Array, Array, list[int]]:
    """States, their sensitivities, and which unknowns these columns are: only those that move the path are integrated."""
    columns, kinds, first = [], [], []
    for number, item in enumerate(wanted):
        if item.kind == "initial":
            columns.append(number)
            kinds.append(-1)
            first.append(np.eye(9)[STATES.index(item.subject)])
        elif item.subject in INPUTS and item.kind in ("bias", "scale"):
            columns.append(number)
            kinds.append(INPUTS.index(item.subject) + (6 if item.kind == "scale" else 0))
            first.append(np.zeros(9))
    given = None
    if record.given:
        given = np.full((len(inputs), 9), np.nan)
        for name, measured in record.given.items():
            given[:, STATES.index(name)] = measured
    directions = np.array(first).reshape(-1, 9).T
    states, along = integrate(
        inputs,
        record.step,
        initial,
        record.gravity,
        given,
        directions,
        np.array(kinds, dtype=np.int64),
        _gain(values),
        record.held,
    )
    return states, along, columns


def _rate_slopes(inputs: Array, wanted: Sequence[Parameter], gain: Array) -> Array:
    slope = np.zeros((3, len(inputs), len(wanted)))
    for number, item in enumerate(wanted):
        if item.subject in INPUTS[3:] and item.kind in ("bias", "scale"):
            axis = INPUTS.index(item.subject) - 3
            slope[axis, :, number] = -gain[axis + 3] * (1.0 if item.kind == "bias" else inputs[:, axis + 3])
    return slope


def to_body(states: Array) -> Array:
    """(3, 3, n) rotation from earth (NED) to body axes along states (9, n)."""
    f, t, p = states[3:6]
    cf, sf, ct, st, cp, sp = np.cos(f), np.sin(f), np.cos(t), np.sin(t), np.cos(p), np.sin(p)
    return np.array(
        [[ct * cp, ct * sp, -st],
         [sf * st * cp - cf * sp, sf * st * sp + cf * cp, sf * ct],
         [cf * st * cp + sf * sp, cf * st * sp - sf * cp, cf * ct]]
    )  # fmt: skip


def _turned(states: Array, slopes: Array) -> Array:
    """(3, n, k) rotation vector of the body axes, in body axes, that each unknown causes: Euler rates to body rates."""
    f, t = states[3], states[4]
    df, dt, dp = slopes[3], slopes[4], slopes[5]
    cf, sf, ct, st = (x[:, None] for x in (np.cos(f), np.sin(f), np.cos(t), np.sin(t)))
    return np.stack([df - dp * st, dt * cf + dp * sf * ct, -dt * sf + dp * cf * ct])


def _cross(a: Array, b: Array) -> Array:
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def _air_velocity(states: Array, slopes: Array, values: Mapping[str, float], wanted: Sequence[Parameter]) -> tuple[Array, Array]:
    """Velocity through the air at the CG, body axes, (3, n), and its derivatives (3, n, k)."""
    wind = np.array([values.get(f"wind_{axis}", 0.0) for axis in ("north", "east", "down")])
    blowing = any(item.kind == "wind" for item in wanted)
    if not blowing and not wind.any():
        return states[:3], slopes[:3]
    rotation = to_body(states)
    in_body = np.einsum("ijn,j->in", rotation, wind)
    slope = slopes[:3] - _cross(in_body[:, :, None], _turned(states, slopes))
    for number, item in enumerate(wanted):
        if item.kind == "wind":
            slope[:, :, number] -= rotation[:, ("north", "east", "down").index(item.subject)]
    return states[:3] - in_body, slope


def _at_arm(air: Array, dair: Array, turn: Array, dturn: Array, arm: Array, wanted: Sequence[Parameter]) -> tuple[Array, Array]:
    """``v + omega x r``, (3, n), and its derivatives (3, n, k)."""
    moving = [number for number, item in enumerate(wanted) if item.kind == "arm"]
    if not arm.any() and not moving:
        return air, dair
    slope = dair + _cross(dturn, np.broadcast_to(arm[:, None, None], (3, 1, 1)))
    for number in moving:
        unit = np.eye(3)["xyz".index(wanted[number].subject)]
        slope[:, :, number] += _cross(turn, np.broadcast_to(unit[:, None], turn.shape))
    return air + _cross(turn, arm[:, None]), slope


def _true(name: str, states: Array, slopes: Array, probe: Array, dprobe: Array, density: Array | None) -> tuple[Array, Array]:
    """The physical quantity (n,) that a sensor looks at, and its derivatives (n, k)."""
    if name in STATES:
        index = STATES.index(name)
        return states[index], slopes[index]
    if name.startswith("velocity_"):
        row = to_body(states)[:, ("velocity_north", "velocity_east", "velocity_down").index(name)]
        total = slopes[:3] + _cross(_turned(states, slopes), states[:3, :, None])
        return np.einsum("in,in->n", row, states[:3]), np.einsum("in,ink->nk", row, total)
    a, b, c = probe
    square = a * a + c * c
    if name == "alpha":
        return np.arctan2(c, a), (a / square)[:, None] * dprobe[2] - (c / square)[:, None] * dprobe[0]
    speed = np.sqrt(square + b * b)
    slope = (a[:, None] * dprobe[0] + b[:, None] * dprobe[1] + c[:, None] * dprobe[2]) / speed[:, None]
    if name == "V":
        return speed, slope
    if name == "beta":
        return np.arcsin(b / speed), (dprobe[1] - (b / speed)[:, None] * slope) / np.sqrt(square)[:, None]
    assert density is not None  # Record refuses qbar without it
    return 0.5 * density * speed**2, (density * speed)[:, None] * slope


def _shown(
    name: str, true: Array, slope: Array, values: Mapping[str, float], wanted: Sequence[Parameter], record: Record
) -> tuple[Array, Array]:
    """What the sensor shows of the truth (n,), and its derivatives (n, k)."""
    gain = 1.0 + values.get(f"{name}_scale", 0.0)
    by = {item.kind: number for number, item in enumerate(wanted) if item.subject == name and item.kind != "initial"}
    delay = values.get(f"{name}_delay", 0.0)
    pivot = record.pivot.get(name, 0.0)
    late, rate = true, true
    if delay != 0.0 or "delay" in by:
        late, slope = delayed(true, delay / record.step), delayed(slope, delay / record.step)
        rate = delayed(true, delay / record.step, derivative=True) / record.step
    shown = slope * gain if by or gain != 1.0 else slope
    if "bias" in by:
        shown[:, by["bias"]] += 1.0
    if "scale" in by:
        shown[:, by["scale"]] += late - pivot
    if "delay" in by:
        shown[:, by["delay"]] += gain * rate
    return gain * (late - pivot) + pivot + values.get(f"{name}_bias", 0.0), shown


def delayed(values: Array, samples: float, derivative: bool = False) -> Array:
    """`values` (n, ...) as seen `samples` sampling intervals later, by cubic interpolation; end values are repeated.

    derivative : by `samples` instead.

    >>> delayed(np.arange(6.0) ** 2, 0.5)[2:4].tolist()
    [2.25, 6.25]
    """
    whole = int(np.floor(-samples))
    x = -samples - whole
    if derivative:
        weight = np.array(
            [(-3 * x * x + 6 * x - 2) / 6, (3 * x * x - 4 * x - 1) / 2, (-3 * x * x + 2 * x + 2) / 2, (3 * x * x - 1) / 6]
        )
        weight = -weight
    else:
        weight = np.array(
            [-x * (x - 1) * (x - 2) / 6, (x + 1) * (x - 1) * (x - 2) / 2, -(x + 1) * x * (x - 2) / 2, (x + 1) * x * (x - 1) / 6]
        )
    index = np.arange(len(values)) + whole
    total = np.zeros_like(values)
    for offset, part in zip((-1, 0, 1, 2), weight, strict=True):
        total += part * values[np.clip(index + offset, 0, len(values) - 1)]
    return total
