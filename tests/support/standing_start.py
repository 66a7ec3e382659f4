"""JSBSim's 737 takes off from a standstill, and loses its left engine on the way: log, vehicle file
and legs as parts."""

from typing import Any, Final

import numpy as np

from tests.support.jsbsim_campaign import NOISE, STATE
from tests.support.jsbsim_flights import FOOT, INCH, POUND, simulator

#: Of the log and of the integration [s]; how long it stands with brakes before.
STEP, INTEGRATION, SETTLING = 0.02, 0.002, 20.0
#: Airspeeds of the failure and of the rotation [m/s]; the log ends at this height [m] (200 ft).
FAILURE, ROTATION, SCREEN = 66.0, 70.0, 61.0
PITCH: Final = np.deg2rad(11.0)
ROLLING: Final = 0.02
_STEER: Final = np.deg2rad(35.0)

_MORE: Final = {
    "velocity_north": ("velocities/v-north-fps", FOOT), "velocity_east": ("velocities/v-east-fps", FOOT),
    "velocity_down": ("velocities/v-down-fps", FOOT), "latitude": ("position/lat-geod-rad", 1.0),
    "longitude": ("position/long-gc-rad", 1.0), "delta_aileron": ("fcs/right-aileron-pos-rad", 1.0),
    "thrust_left": ("propulsion/engine[0]/thrust-lbs", POUND), "thrust_right": ("propulsion/engine[1]/thrust-lbs", POUND),
    "delta_flap": ("fcs/flap-pos-norm", 1.0), "delta_landing_gear": ("gear/gear-pos-norm", 1.0),
    "temperature": ("atmosphere/T-R", 1.0 / 1.8), "static_pressure": ("atmosphere/P-psf", POUND / FOOT**2),
}  # fmt: skip
#: What no log knows of masses.
_HIDDEN: Final = ("mass", "cg_x", "cg_y", "cg_z", "Ixx", "Iyy", "Izz", "Ixz")


def taken_off(failure: float = FAILURE) -> dict[str, np.ndarray]:
    """Channels (n,) [SI] at 50 Hz without noise, from rest to 200 ft above the runway. The left
    engine fails at an airspeed `failure` [m/s]."""
    program = simulator("737")
    program.set_dt(INTEGRATION)
    for name, value in (
        ("ic/h-agl-ft", 7.5), ("ic/terrain-elevation-ft", 1000.0), ("ic/vt-fps", 0.0),
        ("ic/lat-geod-deg", 45.0), ("ic/psi-true-deg", 0.0), ("fcs/flap-cmd-norm", 0.25),
    ):  # fmt: skip
        program[name] = value
    program.run_ic()
    for name, value in (("propulsion/set-running", -1), ("fcs/flap-pos-norm", 0.25)):
        program[name] = value
    rows: dict[str, list[float]] = {}
    pilot = _Pilot(failure)
    for number in range(-round(SETTLING / INTEGRATION), 100_000):
        time = number * INTEGRATION
        brake, steering = pilot.acts(program, time)
        if time >= 0.0 and number % round(STEP / INTEGRATION) == 0:
            row = {name: program[place] * by for name, (place, by) in {**STATE, **_MORE}.items()}
            row |= {"time": time, "steering": steering, "brake": brake}
            for name, value in row.items():
                rows.setdefault(name, []).append(float(value))
            if row["height_above_ground"] > rows["height_above_ground"][0] + SCREEN:
                return {name: np.array(values) for name, values in rows.items()}
        program.run()
    raise AssertionError("JSBSim's 737 does not climb")


class _Pilot:
    """Holds the runway by nose wheel and rudder, rotates, holds pitch and bank."""

    def __init__(self, failure: float) -> None:
        self.failure, self.failed, self.held, self.target = failure, False, 0.0, 0.0

    def acts(self, program: Any, time: float) -> tuple[float, float]:
        """Set the controls; return brake and steering [rad]."""
        speed = program["velocities/vt-fps"] * FOOT
        phi, theta, psi = (program[f"attitude/{name}-rad"] for name in ("phi", "theta", "psi"))
        p, q, r = (program[f"velocities/{name}-rad_sec"] for name in "pqr")
        psi = np.arctan2(np.sin(psi), np.cos(psi))
        self.failed |= time > 0.0 and speed > self.failure
        if self.failed:
            program["propulsion/engine[0]/set-running"] = 0
        for engine in range(2):
            lever = 0.0 if self.failed and engine == 0 else np.clip(time / 3.0, 0.0, 1.0)
            program[f"fcs/throttle-cmd-norm[{engine}]"] = lever
        brake = float(time < -1.0)
        for side in ("left", "right"):
            program[f"fcs/{side}-brake-cmd-norm"] = brake
        steering = float(np.clip(-2.0 * psi - r, -0.1, 0.1) * max(0.0, 1.0 - speed / 60.0))
        program["fcs/steer-cmd-norm"] = steering / _STEER
        program["fcs/rudder-cmd-norm"] = np.clip(6.0 * (psi + r), -1.0, 1.0) * (speed > 20.0)
        program["fcs/aileron-cmd-norm"] = np.clip(-1.5 * phi - 0.8 * p, -1.0, 1.0)
        if speed > ROTATION:
            self.target = min(PITCH, self.target + np.deg2rad(3.0) * INTEGRATION)
            miss = self.target - theta
            self.held = float(np.clip(self.held - 0.6 * miss * INTEGRATION, -0.8, 0.8))
            program["fcs/elevator-cmd-norm"] = self.held - 2.0 * miss + 2.0 * q
        return brake, steering


def logged(channels: dict[str, np.ndarray], seed: int) -> dict[str, np.ndarray]:
    """With the noise of instruments, and without what no log knows of masses."""
    rng = np.random.default_rng(seed)
    return {
        name: values + NOISE.get(name, 0.0) * rng.standard_normal(len(values))
        for name, values in channels.items()
        if name not in _HIDDEN
    }


def vehicle_text(channels: dict[str, np.ndarray]) -> str:
    """The vehicle file, with the mass properties of the first sample."""
    at = {name: float(channels[name][0]) for name in _HIDDEN}
    engines = "".join(
        f"[thrust.engines.{name}]\ndirection = [1.0, 0.0, 0.0]\n"
        f"point = [{-540.0 * INCH}, {side * 193.0 * INCH}, {40.0 * INCH}]\n"
        for name, side in (("left", -1.0), ("right", 1.0))
    )
    surfaces = "".join(
        f'[surfaces.{name}]\nlimits = ["-20.5 deg", "20.5 deg"]\n'
        for name in ("elevator", "aileron", "rudder")
    )
    inertia = "\n".join(f"{name} = {at[name]}" for name in ("Ixx", "Iyy", "Izz", "Ixz"))
    return f"""\
name = "b737"
[reference]
area = {1171.0 * FOOT**2}
chord = {12.31 * FOOT}
span = {94.7 * FOOT}
[points]
moment_reference = [{-625.0 * INCH}, 0.0, {-24.0 * INCH}]
[mass]
source = "constant"
mass = {at["mass"]}
cg = [{at["cg_x"]}, {at["cg_y"]}, {at["cg_z"]}]
{inertia}
[thrust]
source = "channel"
{engines}{surfaces}"""


def legs_text(rolling: float) -> str:
    """The legs of JSBSim's file as parts, with a rolling friction; brakes take the wheels from it
    to the static friction of .8. The side force begins as that of its tyre (Pacejka) does."""
    per_foot = POUND / FOOT
    slope = 0.8 * 2.8 * 0.06 * 180.0 / np.pi
    legs = ""
    for name, x, y, spring, damping, more in (
        ("nose", 158.0, 0.0, 90e3, 4e3, 'steering = "steering"'),
        ("main", 648.0, 100.0, 120e3, 10e3, "mirror = true"),
    ):
        legs += f"""\
[parts.{name}]
kind = "leg"
position = [{-x * INCH}, {y * INCH}, {84.0 * INCH}]
spring = {spring * per_foot}
damping = "{damping * per_foot}*(1.0 + step(-closing))"
along = "mu_roll{" + 0.78*brake" if y else ""}"
cornering = {slope}
side_limit = 0.8
{more}
"""
    return f"""\
name = "legs"
[free_inputs]
brake = "1"
steering = "rad"
[parameters]
mu_roll = {{ value = {rolling}, bounds = [0.0, 0.2], description = "rolling friction" }}
{legs}"""
