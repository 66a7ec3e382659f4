"""Integrate the motion from specific force and rates, with its sensitivities.

No aerodynamics enter, so whatever disagrees with this motion is a sensor error or the wind. The
earth is flat, or rotating and oblate for long records (`aerodb.physics.Earth`). States, in this
order (`STATES`): u v w [m/s] velocity over the earth in body axes, phi theta psi [rad], north east
altitude [m]. Inputs (`INPUTS`): specific force ax ay az [m/s2] at the CG and rates p q r [rad/s].
The fourth-order Runge-Kutta rule takes inputs midway between samples from cubics through four of
them: straight lines would lose (w h)^2/12 of a motion of frequency w, 0.3 % at 1.5 Hz and 50 Hz
sampling. The sensitivities are the exact derivatives of that discrete rule, integrated in the same
pass. Attitude is integrated as a quaternion (`motion`), so that any manoeuvre is possible; only if
states are taken from measurement are Euler angles used throughout (here), and the pitch attitude
must then stay away from +-90 deg.
"""

from typing import Final, Literal

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aerodb.consistency.motion import march, quaternion_start
from aerodb.errors import InputError
from aerodb.physics import Earth
from aerodb.support import Array

#: What inputs do between samples.
Between = Literal["cubic", "linear", "held"]

STATES: Final = ("u", "v", "w", "phi", "theta", "psi", "north", "east", "altitude")
INPUTS: Final = ("ax", "ay", "az", "p", "q", "r")

#: Largest pitch attitude (rad) with Euler angles, used only if states are given.
STEEPEST: Final = float(np.deg2rad(88.0))

#: Largest plausible velocity, m/s.
_FASTEST: Final = 1e5


@njit(cache=True, nogil=True)
def _slope(x: Array, u: Array, gravity: float, out: Array) -> None:
    """Time derivative of the states (9,) under inputs (6,): Klein & Morelli (2006), eqs.
    10.1-10.3."""
    cf, sf, ct, st, cp, sp = (
        np.cos(x[3]),
        np.sin(x[3]),
        np.cos(x[4]),
        np.sin(x[4]),
        np.cos(x[5]),
        np.sin(x[5]),
    )
    out[0] = u[5] * x[1] - u[4] * x[2] - gravity * st + u[0]
    out[1] = u[3] * x[2] - u[5] * x[0] + gravity * ct * sf + u[1]
    out[2] = u[4] * x[0] - u[3] * x[1] + gravity * ct * cf + u[2]
    turn = u[4] * sf + u[5] * cf
    out[3] = u[3] + turn * st / ct
    out[4] = u[4] * cf - u[5] * sf
    out[5] = turn / ct
    ahead = x[0] * ct + (x[1] * sf + x[2] * cf) * st
    across = x[1] * cf - x[2] * sf
    out[6] = ahead * cp - across * sp
    out[7] = ahead * sp + across * cp
    out[8] = x[0] * st - (x[1] * sf + x[2] * cf) * ct


@njit(cache=True, nogil=True)
def _slope_along(x: Array, u: Array, gravity: float, dx: Array, du: Array, out: Array) -> None:
    """Derivative of `_slope` in the directions dx (9, k), du (6, k), written to out (9, k)."""
    cf, sf, ct, st, cp, sp = (
        np.cos(x[3]),
        np.sin(x[3]),
        np.cos(x[4]),
        np.sin(x[4]),
        np.cos(x[5]),
        np.sin(x[5]),
    )
    turn, lift = u[4] * sf + u[5] * cf, x[1] * sf + x[2] * cf
    pitching, across = u[4] * cf - u[5] * sf, x[1] * cf - x[2] * sf
    ahead = x[0] * ct + lift * st
    rise = x[0] * st - lift * ct
    for k in range(dx.shape[1]):
        d0, d1, d2, df, dt, dp = dx[0, k], dx[1, k], dx[2, k], dx[3, k], dx[4, k], dx[5, k]
        out[0, k] = (
            u[5] * d1 - u[4] * d2 + x[1] * du[5, k] - x[2] * du[4, k] - gravity * ct * dt + du[0, k]
        )
        out[1, k] = (
            u[3] * d2
            - u[5] * d0
            + x[2] * du[3, k]
            - x[0] * du[5, k]
            + gravity * (ct * cf * df - st * sf * dt)
            + du[1, k]
        )
        out[2, k] = (
            u[4] * d0
            - u[3] * d1
            + x[0] * du[4, k]
            - x[1] * du[3, k]
            - gravity * (ct * sf * df + st * cf * dt)
            + du[2, k]
        )
        dturn = du[4, k] * sf + du[5, k] * cf + pitching * df
        out[3, k] = du[3, k] + dturn * st / ct + turn * dt / (ct * ct)
        out[4, k] = du[4, k] * cf - du[5, k] * sf - turn * df
        out[5, k] = dturn / ct + turn * st * dt / (ct * ct)
        dlift = d1 * sf + d2 * cf + across * df
        dahead = d0 * ct + dlift * st - rise * dt
        dacross = d1 * cf - d2 * sf - lift * df
        out[6, k] = dahead * cp - dacross * sp - (ahead * sp + across * cp) * dp
        out[7, k] = dahead * sp + dacross * cp + (ahead * cp - across * sp) * dp
        out[8, k] = d0 * st - dlift * ct + ahead * dt


@njit(cache=True, nogil=True)
def _input_directions(u: Array, kind: NDArray[np.int64], gain: Array, du: Array) -> None:
    """du (6, k): kind -1 none, 0-5 bias and 6-11 scale of that input, where ``true = gain (measured
    - bias)``."""
    for k in range(kind.shape[0]):
        for j in range(6):
            du[j, k] = 0.0
        if 0 <= kind[k] < 6:
            du[kind[k], k] = -gain[kind[k]]
        elif kind[k] >= 6:
            du[kind[k] - 6, k] = -gain[kind[k] - 6] * u[kind[k] - 6]


@njit(cache=True, nogil=True)
def _march(
    inputs: Array, midway: Array, given: Array, given_midway: Array, is_given: NDArray[np.bool_],
    x: Array, dx: Array, kind: NDArray[np.int64], gain: Array, step: float, gravity: float,
    held: bool, states: Array, sensitivity: Array,
) -> None:  # fmt: skip
    """Runge-Kutta integration; fills states (9, n) and sensitivity (9, n, k). `midway` values are
    (n - 1, ...), between the samples."""
    n, columns = inputs.shape[0], kind.shape[0]
    slope, stage, total = np.empty(9), np.empty(9), np.empty(9)
    dslope, dstage, dtotal, du = (
        np.empty((9, columns)),
        np.empty((9, columns)),
        np.empty((9, columns)),
        np.empty((6, columns)),
    )
    u = np.empty(6)
    for j in range(9):
        states[j, 0] = x[j]
        for k in range(columns):
            sensitivity[j, 0, k] = dx[j, k]
    for i in range(n - 1):
        for j in range(9):
            total[j], slope[j] = 0.0, 0.0
            for k in range(columns):
                dtotal[j, k], dslope[j, k] = 0.0, 0.0
        for part in range(4):
            ahead = 0.0 if part == 0 else (1.0 if part == 3 else 0.5)
            late = i + 1 if part == 3 and not held else i
            between = part == 1 or part == 2
            for j in range(6):
                u[j] = midway[i, j] if between else inputs[late, j]
            for j in range(9):
                stage[j] = x[j] + ahead * step * slope[j]
                if is_given[j]:
                    stage[j] = given_midway[i, j] if between else given[late, j]
            weight = step / 6.0 if part == 0 or part == 3 else step / 3.0
            if columns > 0:
                for j in range(9):
                    for k in range(columns):
                        dstage[j, k] = (
                            0.0 if is_given[j] else dx[j, k] + ahead * step * dslope[j, k]
                        )
                _input_directions(u, kind, gain, du)
                _slope_along(stage, u, gravity, dstage, du, dslope)
                for j in range(9):
                    for k in range(columns):
                        dtotal[j, k] += weight * dslope[j, k]
            _slope(stage, u, gravity, slope)
            for j in range(9):
                total[j] += weight * slope[j]
        for j in range(9):
            x[j] = given[i + 1, j] if is_given[j] else x[j] + total[j]
            states[j, i + 1] = x[j]
            for k in range(columns):
                dx[j, k] = 0.0 if is_given[j] else dx[j, k] + dtotal[j, k]
                sensitivity[j, i + 1, k] = dx[j, k]


def _midway(values: Array, between: Between) -> Array:
    """Values (n - 1, k) midway between samples (n, k). Of cubics through the two on either side; of
    parabolas through three in the first and the last step."""
    if between == "held":
        return values[:-1]
    middle = 0.5 * (values[:-1] + values[1:])
    if between == "cubic" and len(values) > 2:
        bend = np.empty_like(middle)
        second = values[2:] - 2.0 * values[1:-1] + values[:-2]
        bend[1:-1] = (second[:-1] + second[1:]) / 16.0
        bend[0], bend[-1] = second[0] / 8.0, second[-1] / 8.0
        middle -= bend
    return middle


def integrate(
    inputs: Array,
    step: float,
    initial: Array,
    gravity: float,
    given: Array | None = None,
    initial_directions: Array | None = None,
    input_kind: NDArray[np.int64] | None = None,
    gain: Array | None = None,
    between: Between = "cubic",
    earth: Earth | None = None,
    every: int = 1,
) -> tuple[Array, Array]:
    """States and their sensitivities along a record.

    Parameters
    ----------
    inputs : (n, 6), corrected specific force at the CG [m/s2] and rates [rad/s], order of `INPUTS`.
    step : sampling interval [s].
    initial : (9,), initial state.
    gravity : [m/s2].
    given : (n, 9), states taken from measurement instead of integrated; columns of nan are
        integrated. None: all are integrated.
    initial_directions : (9, k), derivatives of the initial state by k parameters; None: no
        sensitivities.
    input_kind : (k,), which input each parameter corrects: 0-5 its bias, 6-11 its scale, -1 none.
    gain : (6,), of ``true = gain (measured - bias)``; None: ones.
    between : what inputs do between samples. ``cubic``: the smooth motion that was sampled;
        ``linear``, ``held`` (until the next sample): as published analyses take them.
    earth : rotating oblate earth with its local origin; its own gravity replaces `gravity`, and
        rates are relative to inertial space, as gyros measure them. None: flat earth.
    every : one sample of so many is returned, from the first on; all are integrated. Only for
        states that are all integrated.

    Returns
    -------
    states : (9, n). Bank and heading are continuous except where the path passes the vertical;
        there both jump by 180 deg, as Euler angles do.
    sensitivities : (9, n, k), derivatives of the states by the parameters.

    Raises
    ------
    InputError : when the velocity leaves all bounds; with given states also on a rotating earth or
        when the pitch attitude comes too close to +-90 deg.

    References
    ----------
    Klein & Morelli (2006), Aircraft System Identification, eqs. 10.1-10.3; Groves (2013), sections
    5.3 and 5.4 (rotating earth).
    """
    n = len(inputs)
    start = (
        np.zeros((9, 0))
        if initial_directions is None
        else np.ascontiguousarray(initial_directions, dtype=np.float64)
    )
    kind = np.full(start.shape[1], -1, dtype=np.int64) if input_kind is None else input_kind
    scale = np.ones(6) if gain is None else gain
    kept = (n - 1) // every + 1
    sampled = np.ascontiguousarray(inputs)
    midway, held = _midway(sampled, between), between == "held"
    states, sensitivity = np.empty((9, kept)), np.empty((9, kept, start.shape[1]))
    taken = np.zeros(9, dtype=np.bool_) if given is None else np.isfinite(given[0])
    if given is None or not taken.any():
        place = (
            None
            if earth is None
            else np.array((earth.latitude, earth.height, *earth.metres_per_radian))
        )
        states[:, 0] = initial
        x, dx = quaternion_start(np.asarray(initial, dtype=np.float64), start)
        march(
            sampled,
            midway,
            x,
            dx,
            kind,
            scale,
            step,
            gravity,
            place,
            held,
            every,
            states,
            sensitivity,
        )
    else:
        if earth is not None:
            raise InputError(
                "states given on a rotating earth",
                "flight-path reconstruction",
                "leave earth or given states out",
            )
        x, dx = np.array(initial, dtype=np.float64), start.copy()
        table = np.nan_to_num(given)
        x[taken], dx[taken] = table[0][taken], 0.0
        _march(
            sampled,
            midway,
            table,
            _midway(table, between),
            taken,
            x,
            dx,
            kind,
            scale,
            step,
            gravity,
            held,
            states,
            sensitivity,
        )
        steep = ~(np.abs(states[4]) < STEEPEST)
        if steep.any():
            what = (
                f"the integrated pitch attitude leaves +-{np.rad2deg(STEEPEST):.0f} deg at sample"
                f" {int(np.argmax(steep))}"
            )
            raise InputError(
                what,
                "flight-path reconstruction",
                "check units and signs of the rates, or leave that part out",
            )
    lost = ~(np.abs(states[:3]).max(axis=0) < _FASTEST)
    if lost.any():
        what = f"the integrated velocity leaves all bounds at sample {int(np.argmax(lost))}"
        raise InputError(
            what, "flight-path reconstruction", "check units and signs of specific force and rates"
        )
    return states, sensitivity
