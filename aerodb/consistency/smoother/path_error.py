"""Linear system on a coarse grid for the error of a reconstructed path and the gusts.

The reconstruction integrates the inertial sensors at their full rate; its error and the gusts are
small and slow, and the smoother estimates them.

Error states, in this order: attitude `e` [rad] and velocity `s` [m/s] with ``R = Exp(e) R_path``,
``v = Exp(e) v_path + s`` (R from body to earth, v over the earth), gusts [m/s], gyro drift [rad/s],
accelerometer drift [m/s2], and, where a channel shows it, position [m]; vectors north, east, down,
the drifts in body axes. With the invariant error of Barrau & Bonnabel (IEEE Trans. Autom. Control
62(4), 2017) ``e' = -R b``, ``s' = g x e - v x (R b) - R c`` for drifts b, c: the path enters only
with the noise, so neither large attitude errors nor extreme attitudes matter. Coriolis terms of a
rotating earth are neglected in the error (1e-4 of it per second).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from aerodb.consistency.kinematics import INPUTS, STATES
from aerodb.consistency.output_error import inertial_noise
from aerodb.consistency.reconstructed import ReconstructedPath
from aerodb.consistency.sensors import (
    FlightRecord,
    SensorParameter,
    delays_of,
    earth_to_body,
    outputs_along,
    parameter,
    predict_outputs,
)
from aerodb.errors import InputError
from aerodb.support import Array

#: Indices of the error states.
ATTITUDE, VELOCITY, GUST, GYRO, FORCE, POSITION = (slice(k, k + 3) for k in range(0, 18, 3))

#: Step of the coarse grid, s: short compared with gusts and aircraft motion, and no shorter than a
#: record's own step.
COARSE = 0.05

#: The sensors are linearised again if the linearisation error exceeds this fraction of their noise
#: (rms).
_BENT = 0.1


@dataclass(frozen=True)
class PathError:
    """Linear system of one record: g grid points, m error states, c channels, k unknowns of the
    reconstruction.

    path : the reconstructed record.
    at : (g,), sample indices of the grid points, `size` samples apart.
    channels : c names. air : which of them depend on the wind.
    residual : (g, c), measured minus path, mean of each block, SI.
    count : (g, c), fraction of the block that was measured.
    base : (g, c), outputs along the path.
    observation : (g, c, m), their derivatives by the error states.
    rows, columns, values : off-diagonal part of the transition (`kalman.Transition`).
    block : (g-1, 6, 6), covariance of its noise.
    output_sensitivity : (g, c, k), derivatives of the channels along the path by the unknowns.
    state_sensitivity : (g, m, k), derivatives of the error states by the unknowns.
    prompt_values : parameter name -> value, SI, without delays.
    grid_record : the record on the grid.
    """

    path: ReconstructedPath
    at: np.ndarray
    size: int
    channels: tuple[str, ...]
    air: tuple[bool, ...]
    residual: Array
    count: Array
    base: Array
    observation: Array
    rows: np.ndarray
    columns: np.ndarray
    values: Array
    block: Array
    output_sensitivity: Array
    state_sensitivity: Array
    prompt_values: Mapping[str, float]
    grid_record: FlightRecord

    @property
    def step(self) -> float:
        """Step [s] of the grid, a scalar."""
        return self.grid_record.step

    @property
    def states(self) -> Array:
        """(9, g) states of the path at the grid points, SI, angles 3-2-1 [rad]."""
        return self.path.states[:, self.at]


def path_error(
    path: ReconstructedPath,
    values: Mapping[str, float],
    free: Sequence[SensorParameter],
    coarse: float = COARSE,
    unused: Sequence[str] = (),
) -> PathError:
    """The linear system of one record.

    Parameters
    ----------
    path : the reconstructed record.
    values : parameter name -> value, fixed and estimated, SI.
    free : the k unknowns whose covariance matters; initial states are not among them.
    coarse : step of the grid [s].
    unused : channels that are predicted but not used.

    Raises InputError for records with given states, fewer than eight grid points, or a pitch
    attitude near +-90 deg.
    """
    record = path.record
    if record.given:
        raise InputError(
            "states taken from measurement",
            record.name,
            "a smoother needs all states integrated: use output error",
        )
    size = block_size(record.step, coarse)
    g = len(record.inputs) // size
    at = size * np.arange(g) + size // 2
    grid_record = _thinned(record, at, size, np.asarray(path.states[:, at]))
    prompt = {name: value for name, value in values.items() if not name.endswith("_delay")}
    names = tuple(record.outputs)
    winds = [parameter(f"wind_{axis}", record.flight) for axis in ("north", "east", "down")]
    # a few points tell which channels the wind acts on
    few = at[:: max(1, g // 8)]
    brief = _thinned(record, few, size, np.asarray(path.states[:, few]))
    by_wind = predict_outputs(brief, prompt, path.states[:, few[0]], winds).slopes
    air = tuple(bool(np.abs(by_wind[name]).max() > 0) for name in names)
    residual, count = _blocked_residuals(path, names, values, size, g)
    count[:, [name in unused for name in names]] = 0.0
    none = np.zeros((g, len(names), 0))
    empty = np.zeros((g, 18))
    system = PathError(
        path,
        at,
        size,
        names,
        air,
        residual,
        count,
        empty,
        none,
        *_dynamics(path, at, size),
        none,
        none,
        prompt,
        grid_record,
    )
    base, observation = _sensitivity(system, empty)
    m = 18 if np.any(observation[:, :, POSITION]) else POSITION.start
    moved = (system.rows < m) & (system.columns < m)
    system = replace(
        system,
        base=base,
        observation=np.ascontiguousarray(observation[:, :, :m]),
        rows=system.rows[moved],
        columns=system.columns[moved],
        values=np.ascontiguousarray(system.values[:, moved]),
    )
    output_sensitivity, state_sensitivity = _by_unknowns(system, values, free, m)
    return replace(
        system, output_sensitivity=output_sensitivity, state_sensitivity=state_sensitivity
    )


def block_size(step: float, coarse: float) -> int:
    """Return the number of samples, `step` [s] apart, in a block of about `coarse` [s].

    It is odd, so that the block has a middle sample.
    """
    return 2 * max(0, round((coarse / step - 1) / 2)) + 1


def predicted_outputs(system: PathError, error: Array) -> Array:
    """(g, c) sensor outputs [SI] without delays, on the path corrected by error states (g, m)."""
    return _outputs(system, error, slopes=False)[0]


def _outputs(system: PathError, error: Array, slopes: bool = True) -> tuple[Array, Array]:
    """Sensor outputs (g, c) without delays, and their derivatives (g, c, 9) by the states; those of
    the air data are by the motion relative to the gusts."""
    states = apply_error(system.states, error)
    ridden = np.einsum("ijn,nj->in", earth_to_body(states), error[:, GUST])
    in_gusts = states.copy()
    in_gusts[:3] -= ridden
    g, c = len(error), len(system.channels)
    result, by_state = np.empty((g, c)), np.zeros((g, c if slopes else 0, 9))
    for moving, in_air in ((in_gusts, True), (states, False)):
        names = [
            name for name, flag in zip(system.channels, system.air, strict=True) if flag is in_air
        ]
        record = replace(
            system.grid_record,
            outputs={name: system.grid_record.outputs[name] for name in names},
        )
        outputs, along = outputs_along(record, system.prompt_values, moving, slopes)
        for name in names:
            column = system.channels.index(name)
            result[:, column] = outputs[name]
            if slopes:
                by_state[:, column] = along[name]
    return result, by_state


def _sensitivity(system: PathError, error: Array) -> tuple[Array, Array]:
    """Outputs (g, c) at the error states (g, m), and their derivatives (g, c, m) by these.

    A change of the attitude error e by de turns the corrected attitude by ``w = J(e) de`` about the
    earth's axes, with J the left Jacobian of the rotation vector. As ``v = R' (Exp(e) v_path + s)``
    in body axes, it changes v by ``R' (s x w)``, and likewise the motion relative to the gusts by
    ``R' ((s - gust) x w)``. No output depends on the drifts.
    """
    g, m = error.shape
    here, by_state = _outputs(system, error)
    states = apply_error(system.states, error)
    body = np.moveaxis(earth_to_body(states), 2, 0)
    turn = _left_jacobian(error[:, ATTITUDE].T)
    observation = np.zeros((g, len(system.channels), m))
    over_earth = by_state[:, :, :3] @ body
    observation[:, :, VELOCITY] = over_earth
    if m > POSITION.start:
        observation[:, :, POSITION] = by_state[:, :, 6:] * np.array([1.0, 1.0, -1.0])
    observation[:, :, ATTITUDE] = by_state[:, :, 3:6] @ (_euler_by_turn(states) @ body @ turn)
    along = error[:, VELOCITY], error[:, VELOCITY] - error[:, GUST]
    for in_air, speed in zip((False, True), along, strict=True):
        columns = np.flatnonzero(np.array(system.air) == in_air)
        observation[:, columns, ATTITUDE] += over_earth[:, columns] @ _skew(speed.T) @ turn
    observation[:, system.air, GUST] = -observation[:, system.air, VELOCITY]
    return here, observation


def _left_jacobian(turn: Array) -> Array:
    """(n, 3, 3) of rotation vectors (3, n): the turn per change of the rotation vector."""
    angle = np.sqrt(np.sum(turn**2, axis=0))
    skew = _skew(turn)
    small = angle < 1e-3
    safe = np.where(small, 1.0, angle)
    first = np.where(small, 0.5 - angle**2 / 24.0, (1.0 - np.cos(safe)) / safe**2)
    second = np.where(small, 1.0 / 6.0 - angle**2 / 120.0, (safe - np.sin(safe)) / safe**3)
    return np.asarray(
        np.eye(3) + first[:, None, None] * skew + second[:, None, None] * (skew @ skew)
    )


def delay_of_channel(channel: str, values: Mapping[str, float]) -> float:
    """Delay of a channel, the sum of its parameters (`delays_of`) in `values` [s]."""
    return sum(values.get(name, 0.0) for name in delays_of(channel))


def relinearised(
    system: PathError, error: Array, observation: Array, noise: Array
) -> tuple[Array, Array]:
    """Linearise the measurements about the error states (g, m).

    Returns measurements (g, c) and the observation matrix (g, c, m). The current `observation`
    (g, c, m) is kept if its linearisation error is small compared with the channels' `noise` (c,).
    """
    here = predicted_outputs(system, error)
    step = _circular(here - system.base, system.channels)
    bent = step - np.einsum("gcm,gm->gc", observation, error)
    if np.any(np.sqrt(np.mean(bent**2, axis=0)) > _BENT * noise):
        observation = _sensitivity(system, error)[1]
        bent = step - np.einsum("gcm,gm->gc", observation, error)
    return system.residual - bent, observation


def apply_error(states: Array, error: Array) -> Array:
    """(9, n) states corrected by error states (n, m); bank and heading stay in the same turn."""
    tilt, velocity = error[:, ATTITUDE].T, error[:, VELOCITY].T
    swing = _rotation(tilt)
    to_earth = np.einsum("ijn,kjn->ikn", swing, earth_to_body(states))
    over_earth = np.einsum("jin,jn->in", earth_to_body(states), states[:3])
    result = np.array(states)
    result[:3] = np.einsum(
        "jin,jn->in", to_earth, np.einsum("ijn,jn->in", swing, over_earth) + velocity
    )
    bank, heading = (
        np.arctan2(to_earth[2, 1], to_earth[2, 2]),
        np.arctan2(to_earth[1, 0], to_earth[0, 0]),
    )
    result[3] += np.angle(np.exp(1j * (bank - states[3])))
    result[4] = np.arcsin(np.clip(-to_earth[2, 0], -1.0, 1.0))
    result[5] += np.angle(np.exp(1j * (heading - states[5])))
    if error.shape[1] > POSITION.start:
        result[6:] += error[:, POSITION].T * np.array([[1.0], [1.0], [-1.0]])
    return result


def flow_rows(states: Array, air: Array, wind: Array, m: int) -> Array:
    """Derivatives of V, alpha, beta, phi, theta, psi by the error states.

    As ``a = R' (v_path + s + e x wind - gust)``, attitude errors change the air velocity only in
    proportion to the wind.

    Parameters
    ----------
    states : (9, g), order of `kinematics.STATES`.
    air : (3, g), velocity through the air, body axes [m/s].
    wind : (3, g), including gusts, north, east, down [m/s].
    m : number of error states.

    Returns
    -------
    (g, 6, m).
    """
    body, g = earth_to_body(states), states.shape[1]
    by_air = np.zeros((g, 3, m))
    rotation = np.moveaxis(body, 2, 0)
    by_air[:, :, VELOCITY], by_air[:, :, GUST] = rotation, -rotation
    by_air[:, :, ATTITUDE] = -rotation @ _skew(wind)
    u, v, w = air
    square = u * u + w * w
    speed = np.sqrt(square + v * v)
    zero = np.zeros(g)
    along = np.stack([u, v, w]) / speed
    slip = (np.stack([zero, zero + 1.0, zero]) - (v / speed) * along) / np.sqrt(square)
    flow = np.moveaxis(np.stack([along, np.stack([-w, zero, u]) / square, slip]), 2, 0) @ by_air
    rows = np.zeros((g, 6, m))
    rows[:, :3] = flow
    rows[:, 3:, ATTITUDE] = _euler_by_turn(states) @ rotation
    return rows


def _euler_by_turn(states: Array) -> Array:
    """(g, 3, 3) derivatives of phi, theta, psi by a small turn about the body axes."""
    f, t = states[3], states[4]
    sf, cf, tt, ct = np.sin(f), np.cos(f), np.tan(t), np.cos(t)
    zero, one = np.zeros_like(f), np.ones_like(f)
    rows = np.array([[one, sf * tt, cf * tt], [zero, cf, -sf], [zero, sf / ct, cf / ct]])
    return np.moveaxis(rows, 2, 0)


def _skew(vector: Array) -> Array:
    """(n, 3, 3) of ``vector x`` for (3, n)."""
    x, y, z = vector
    zero = np.zeros_like(x)
    return np.moveaxis(np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]), 2, 0)


def _rotation(turn: Array) -> Array:
    """(3, 3, n) rotation matrices of rotation vectors (3, n), by Rodrigues' formula."""
    angle = np.sqrt(np.sum(turn**2, axis=0))
    skew = _skew(turn)
    first, second = np.sinc(angle / np.pi), 0.5 * np.sinc(angle / (2 * np.pi)) ** 2
    matrix = np.eye(3) + first[:, None, None] * skew + second[:, None, None] * (skew @ skew)
    return np.moveaxis(matrix, 0, 2)


def _circular(difference: Array, channels: Sequence[str]) -> Array:
    turning = [name in ("phi", "psi") for name in channels]
    difference[:, turning] = np.angle(np.exp(1j * difference[:, turning]))
    return difference


def _thinned(record: FlightRecord, at: np.ndarray, size: int, states: Array) -> FlightRecord:
    """The record at its grid points with all states given; inputs are block means."""
    if len(at) < 8:
        raise InputError(f"{len(at)} grid points", record.name, "leave records this short out")
    means = record.inputs[: len(at) * size].reshape(len(at), size, 6).mean(axis=1)
    picked = _with_samples(record, lambda values: values[at])
    given = dict(zip(STATES, states, strict=True))
    # where all states are given, nothing is integrated
    return replace(picked, step=record.step * size, inputs=means, given=given, earth=None)


def _with_samples(record: FlightRecord, change: Callable[[Array], Array]) -> FlightRecord:
    """The record with `change` applied to every array that has one value per sample."""
    changed: dict[str, object] = {
        "outputs": {name: change(values) for name, values in record.outputs.items()}
    }
    for entry in fields(record):
        value = getattr(record, entry.name)
        if isinstance(value, np.ndarray):
            changed[entry.name] = change(value)
    return replace(record, given={}, **changed)  # type: ignore[arg-type]


def _blocked_residuals(
    path: ReconstructedPath, names: Sequence[str], values: Mapping[str, float], size: int, g: int
) -> tuple[Array, Array]:
    """(g, c) mean residual per block and fraction of its samples; delayed outputs belong to an
    earlier block."""
    residual, count = np.zeros((g, len(names))), np.zeros((g, len(names)))
    for column, name in enumerate(names):
        late = round(delay_of_channel(name, values) / path.record.step)
        good = np.flatnonzero(np.isfinite(path.residuals[name]))
        good = good[(good - late >= 0) & (good - late < g * size)]
        block = (good - late) // size
        hits = np.bincount(block, minlength=g)
        total = np.bincount(block, path.residuals[name][good], minlength=g)
        residual[:, column] = total / np.maximum(hits, 1)
        count[:, column] = hits / size
    return residual, count


def _dynamics(
    path: ReconstructedPath, at: np.ndarray, size: int
) -> tuple[np.ndarray, np.ndarray, Array, Array]:
    """Rows, columns and values (g-1, e) of the transition off its diagonal, and covariance
    (g-1, 6, 6) of the inertial sensors' noise."""
    record = path.record
    step = record.step * size
    middle = path.states[:, at[:-1] + (size + 1) // 2]
    to_earth = np.moveaxis(earth_to_body(middle), 2, 0).transpose(0, 2, 1)
    speed = _skew(np.einsum("nij,jn->in", to_earth, middle[:3]))
    full = np.zeros((len(middle[0]), 18, 18))
    full[:, ATTITUDE, GYRO] = -to_earth
    full[:, VELOCITY, GYRO] = -speed @ to_earth
    full[:, VELOCITY, FORCE] = -to_earth
    full[:, VELOCITY, ATTITUDE] = _skew(np.array([[0.0], [0.0], [record.gravity]]))
    full[:, POSITION, VELOCITY] = np.eye(3)
    full[:, POSITION, ATTITUDE] = -speed
    pattern = np.any(full != 0, axis=0)
    rows, columns = np.nonzero(pattern)
    noise = inertial_noise(record)
    kick = np.zeros((len(full), 6, 6))
    kick[:, :3, 3:], kick[:, 3:, 3:] = (
        full[:, ATTITUDE, GYRO] * noise[3:],
        full[:, VELOCITY, GYRO] * noise[3:],
    )
    kick[:, 3:, :3] = full[:, VELOCITY, FORCE] * noise[:3]
    block = step * record.step * kick @ kick.transpose(0, 2, 1)
    return rows, columns, np.ascontiguousarray(step * full[:, rows, columns]), block


def _by_unknowns(
    system: PathError, values: Mapping[str, float], free: Sequence[SensorParameter], m: int
) -> tuple[Array, Array]:
    """Derivatives of the channels (g, c, k) and of the error states (g, m, k) by the unknowns, with
    the initial state fixed."""
    g, k = len(system.at), len(free)
    if not free:
        return np.zeros((g, len(system.channels), 0)), np.zeros((g, m, 0))
    plain = replace(system.grid_record, given={}, earth=system.path.record.earth)
    response = predict_outputs(plain, system.prompt_values, system.states[:, 0], free)
    output_sensitivity = np.stack(
        [response.slopes[name] for name in system.channels], axis=1
    ).reshape(g, len(system.channels), k)
    state_sensitivity = np.zeros((g, m, k))
    d = response.state_slopes
    f, t = system.states[3][:, None], system.states[4][:, None]
    turn = np.stack([d[3] - d[5] * np.sin(t), d[4] * np.cos(f) + d[5] * np.sin(f) * np.cos(t),
                     -d[4] * np.sin(f) + d[5] * np.cos(f) * np.cos(t)])  # fmt: skip
    body = earth_to_body(system.states)
    state_sensitivity[:, ATTITUDE] = np.einsum("jig,jgk->gik", body, turn)
    state_sensitivity[:, VELOCITY] = np.einsum("jig,jgk->gik", body, d[:3])
    if m > POSITION.start:
        state_sensitivity[:, POSITION] = (
            np.moveaxis(d[6:], 0, 1) * np.array([1.0, 1.0, -1.0])[:, None]
        )
    for number, item in enumerate(free):
        if item.kind == "wind":
            state_sensitivity[
                :, GUST.start + ("north", "east", "down").index(item.subject), number
            ] += 1.0
        if item.subject in INPUTS:
            index = INPUTS.index(item.subject)
            gain = 1.0 / (1.0 + values.get(f"{item.subject}_scale", 0.0))
            true = gain * (
                system.grid_record.inputs[:, index] - values.get(f"{item.subject}_bias", 0.0)
            )
            state_sensitivity[:, (FORCE if index < 3 else GYRO).start + index % 3, number] += (
                gain * (true if item.kind == "scale" else 1.0)
            )
    return output_sensitivity, state_sensitivity
