"""Flights of a helicopter at 60 kt whose derivatives are not those of its database: equations of its own.

The database is that of docs/guides/helicopter.md, read as plain numbers. What flies has in addition another
weathercock to the left than to the right, and lateral derivatives that change with the angle of attack.
Rigid body, Euler angles, Runge-Kutta; many flights at once (columns). Nothing of the program is used.
"""

import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from aerodb.support import Array
from tests.support.helicopter import DERIVATIVES, MASS, WEATHERCOCK
from tests.support.helicopter_flight import CONTROLS, motion, turned, write_log

STEP, EVERY = 0.005, 2
#: What the database lacks beside `WEATHERCOCK` (invented): the slopes over the angle of attack of Cl_beta,
#: Cn_beta and Cn_p.
BY_ALPHA: Final = {"Cl_beta": -0.15, "Cn_beta": -0.10, "Cn_p_hat": 0.25}
#: Standard deviations of the boom: airspeed [m/s], angles [rad]; of the gusts [m/s], and their time [s].
AIRSPEED, FLOW, GUSTS, GUST_TIME = 0.1, 0.002, 0.15, 2.0
#: Sizes of test inputs, collective to pedal [rad]: six quick waves, and two slow ones.
QUICK: Final = np.array([0.003, 0.005, 0.004, 0.008])
SLOW: Final = np.array([0.016, 0.0, 0.006, 0.012])
_AXES: Final = ("CX", "CY", "CZ", "Cl", "Cm", "Cn")


def loads(file: Mapping[str, Any], at: Mapping[str, Array], planted: bool) -> Array:
    """CX ... Cn (6, k) of the derivatives of a file at `at`; `planted`: with what it lacks."""
    of = file["derivatives"]
    still = 0.0 * at["beta"]
    made = np.array([sum((x * at[name] for name, x in of[axis].items()), still) for axis in _AXES])
    if planted:
        beta, alpha = at["beta"], at["alpha"]
        made[3] += BY_ALPHA["Cl_beta"] * alpha * beta
        made[5] += np.where(beta < 0.0, *WEATHERCOCK) * beta - of["Cn"]["beta"] * beta
        made[5] += alpha * (BY_ALPHA["Cn_beta"] * beta + BY_ALPHA["Cn_p_hat"] * at["p_hat"])
    return made


def fly(
    folder: Path, seeds: Sequence[int], seconds: float = 60.0, planted: bool = True
) -> list[Path]:
    """Fly at 60 kt with test inputs on all controls, one flight per seed; write ``cruise-SEED.csv``.

    planted : what flies has what the database lacks.
    """
    file = tomllib.loads(DERIVATIVES)
    known = {
        name: float(each["expression"])
        for name, each in file["variables"].items()
        if name.endswith("_0")
    }
    area, chord, span = (file["reference"][name] for name in ("area", "chord", "span"))
    force = float(file["reference"]["pressure"].split()[0]) * area
    arms = np.array([span, chord, span])[:, None]
    trim = np.array([known[f"{name}_0"] for name in CONTROLS])[:, None]
    speed_0, alpha_0, phi_0 = known["V_0"], known["alpha_0"], -0.0246
    k, steps = len(seeds), round(seconds / STEP)
    draws = [np.random.default_rng([7, seed]) for seed in seeds]
    omega = np.array([d.uniform(0.8, 9.0, (6, 4)) for d in draws])
    phase = np.array([d.uniform(0.0, 6.28, (8, 4)) for d in draws])
    slow = np.array([d.uniform(0.25, 0.6, (2, 4)) for d in draws])
    blow = np.array([d.standard_normal((steps, 3)) for d in draws])
    state, air, decay = np.zeros((9, k)), np.zeros((3, k)), np.exp(-STEP / GUST_TIME)
    state[0], state[3], state[4] = speed_0, phi_0, alpha_0

    def rates(now: Array, controls: Array) -> tuple[Array, Array, Array]:
        turn = turned(now[3:6])
        u, v, w = np.einsum("ji...,j...->i...", turn, now[0:3] - air)
        p, q, r = now[6:9] / (2.0 * speed_0)
        flow = np.array(
            [np.sqrt(u**2 + v**2 + w**2), np.arctan2(w, u), np.arctan2(v, np.hypot(u, w))]
        )
        at = {
            "1": np.ones(k), "V": flow[0] / speed_0 - 1.0, "alpha": flow[1] - alpha_0, "beta": flow[2],
            "p_hat": p * span, "q_hat": q * chord, "r_hat": r * span,
            **dict(zip(CONTROLS, controls - trim, strict=True)),
        }  # fmt: skip
        named = {"d_V": at["V"], "d_alpha": at["alpha"], **{f"d_{c}": at[c] for c in CONTROLS}}
        body = force * loads(file, at | named, planted)
        return motion(now, turn, body[:3], arms * body[3:]), body[:3] / MASS, flow

    rows: list[tuple[Array, ...]] = []
    for number in range(steps):
        time = number * STEP
        begin = min(1.0, time / 3.0)
        waves = QUICK * np.sin(omega * time + phase[:, :6]).sum(axis=1)
        waves += SLOW * np.sin(slow * time + phase[:, 6:]).sum(axis=1)
        ahead = np.cos(state[5]) * state[0] + np.sin(state[5]) * state[1]
        pitch = alpha_0 + np.clip(0.03 * (ahead - speed_0), -0.1, 0.1)
        held = np.array([
            0.02 * state[2],
            -0.12 * (phi_0 - state[3]) + 0.02 * state[6],
            0.25 * (pitch - state[4]) - 0.10 * state[7],
            0.05 * state[8],
        ])  # fmt: skip
        controls = trim + np.clip(held, -0.1, 0.1) + begin * waves.T
        first, felt, flow = rates(state, controls)
        if number % EVERY == 0:
            rows.append((state, controls, felt, flow))
        second = rates(state + 0.5 * STEP * first, controls)[0]
        third = rates(state + 0.5 * STEP * second, controls)[0]
        fourth = rates(state + STEP * third, controls)[0]
        state = state + STEP / 6.0 * (first + 2.0 * second + 2.0 * third + fourth)
        air = decay * air + GUSTS * np.sqrt(1.0 - decay**2) * blow[:, number].T
    states, deflections, specific, flows = (np.array([row[j] for row in rows]) for j in range(4))
    made = []
    for j, seed in enumerate(seeds):
        rng = np.random.default_rng([8, seed])
        boom = flows[..., j] + [AIRSPEED, FLOW, FLOW] * rng.standard_normal((len(rows), 3))
        columns = dict(zip(("V [m/s]", "alpha [rad]", "beta [rad]"), boom.T, strict=True))
        path = folder / f"cruise-{seed}.csv"
        made.append(write_log(path, seed, STEP * EVERY, states[..., j], deflections[..., j],
                              specific[..., j], columns))  # fmt: skip
    return made
