"""JSBSim's C130 that drops a load: an aircraft with another's mass and forces, as its log shows it."""

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Final
from xml.etree import ElementTree

import numpy as np

from tests.support.jsbsim_campaign import NOISE, PUSHER, SLUG, STATE
from tests.support.jsbsim_flights import FOOT, INCH, POUND, aircraft_file, simulator

LOAD: Final = 4600.0  # kg
#: Where the load is dropped, and the CG without it [m, from JSBSim's origin in body axes].
RAMP: Final = (-18.5, 0.0, -1.0)
#: Where the thrust acts [m].
THRUST_POINT: Final = (-586.5 * INCH, 0.0, 30.0 * INCH)
#: When it leaves in tests [s], and the first sample after it.
DROP, FIRST = 30.013, 30.02
#: Of the log and of the integration [s].
STEP, INTEGRATION = 0.02, 0.005
SETTLING: Final = 60.0  # s
_RATES: Final = ("accelerations/pdot-rad_sec2", "accelerations/qdot-rad_sec2", "accelerations/rdot-rad_sec2")  # fmt: skip


def loaded_file() -> bytes:
    """The aircraft with the load at the ramp."""
    root = ElementTree.fromstring(aircraft_file("C130"))
    balance = root.find("mass_balance")
    assert balance is not None
    point = ElementTree.SubElement(balance, "pointmass", name="load")
    ElementTree.SubElement(point, "weight", unit="KG").text = str(LOAD)
    place = ElementTree.SubElement(point, "location", unit="M", name="POINTMASS")
    for axis, value in zip("xyz", (-RAMP[0], RAMP[1], -RAMP[2]), strict=True):
        ElementTree.SubElement(place, axis).text = str(value)
    outside = ElementTree.SubElement(root, "external_reactions")
    force = ElementTree.SubElement(outside, "force", name="pusher", frame="BODY")
    for tag, unit, values in (("location", "IN", ("586.5", "0", "-30")), ("direction", "", "100")):
        place = ElementTree.SubElement(force, tag, **({"unit": unit} if unit else {}))
        for axis, value in zip("xyz", values, strict=True):
            ElementTree.SubElement(place, axis).text = value
    return ElementTree.tostring(root)


def flown(
    seconds: float,
    drop: float | None,
    seed: int = 0,
    gusts: float = 0.0,
    elevator: Callable[[float], float] = lambda _: 0.0,
) -> dict[str, np.ndarray]:
    """Channels (n,) [SI] at 50 Hz without noise; specific forces at the first CG.

    drop : when the load leaves [s]; None: it stays. gusts : wind at 20 ft of MIL-F-8785C [m/s].
    elevator : of full travel beside what holds the pitch attitude.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "C130" / "C130.xml"
        path.parent.mkdir()
        path.write_bytes(loaded_file())
        program = simulator("C130", aircraft=Path(folder))
    program.set_dt(INTEGRATION)
    for name, value in (
        ("ic/h-sl-ft", 5000.0), ("ic/vt-fps", 330.0), ("ic/gamma-deg", 0.0),
        ("simulation/randomseed", float(seed + 1)),
    ):  # fmt: skip
        program[name] = value
    program.run_ic()
    program["propulsion/set-running"] = 0
    held = 0.0
    if gusts:
        program["atmosphere/turb-type"] = 3
        program["atmosphere/turbulence/milspec/windspeed_at_20ft_AGL-fps"] = gusts / FOOT
        program["atmosphere/turbulence/milspec/severity"] = 3
    first = None
    rows: dict[str, list[float]] = {}
    for number in range(-round(SETTLING / INTEGRATION), round(seconds / INTEGRATION)):
        time = number * INTEGRATION
        if drop is not None and abs(time - drop) < 0.5 * INTEGRATION:
            program["inertia/pointmass-weight-lbs[0]"] = 0.0
        pitch, q = program["attitude/theta-rad"], program["velocities/q-rad_sec"]
        bank, p = program["attitude/phi-rad"], program["velocities/p-rad_sec"]
        climb = float(np.clip(0.1 * (5000.0 - program["position/h-sl-ft"]), -10.0, 10.0))
        miss = 0.03 + 0.003 * (climb - program["velocities/h-dot-fps"]) - pitch
        held = float(np.clip(held - 0.5 * miss * INTEGRATION, -0.8, 0.8))
        program["fcs/elevator-cmd-norm"] = held - 1.5 * miss + 1.5 * q + elevator(time)
        program["fcs/aileron-cmd-norm"] = -0.8 * bank - 0.3 * p
        program[PUSHER] = max(0.0, 9000.0 + 600.0 * (330.0 - program["velocities/vt-fps"]))
        program.run()
        cg = np.array([program[f"inertia/cg-{axis}-in"] for axis in "xyz"]) * [-INCH, INCH, -INCH]
        first = cg if first is None or time < 0.0 else first
        if time < 0.0 or number % round(STEP / INTEGRATION):
            continue
        mass = program["inertia/mass-slugs"] * SLUG
        force = np.array(
            [
                program[f"forces/fb{axis}-{kind}-lbs"]
                for kind in ("aero", "external")
                for axis in "xyz"
            ]
        )
        force = force.reshape(2, 3).sum(axis=0) * POUND
        turning = np.array([program[name] for name in _RATES])
        rate = np.array([program[f"velocities/{name}-rad_sec"] for name in "pqr"])
        arm = first - cg
        felt = force / mass + np.cross(turning, arm) + np.cross(rate, np.cross(rate, arm))
        row = {name: program[place] * scale for name, (place, scale) in STATE.items()}
        row["thrust"] = program[PUSHER] * POUND
        row |= {"delta_aileron": program["fcs/right-aileron-pos-rad"], "time": time}
        row |= dict(zip(("ax_imu", "ay_imu", "az_imu"), felt, strict=True))
        for name, value in row.items():
            rows.setdefault(name, []).append(float(value))
    return {name: np.array(values) for name, values in rows.items()}


def logged(channels: dict[str, np.ndarray], seed: int = 0) -> dict[str, np.ndarray]:
    """With the noise of instruments, and without what no log knows of masses."""
    rng = np.random.default_rng(seed)
    hidden = ("mass", "cg_x", "cg_y", "cg_z", "Ixx", "Iyy", "Izz", "Ixz")
    return {
        name: values
        + NOISE.get(name, 3e-4 if name.startswith("delta_") else 0.0)
        * rng.standard_normal(len(values))
        for name, values in channels.items()
        if name not in hidden
    }


def pilot(time: float) -> float:
    """Doublets of the elevator, of full travel."""
    for start in (5.0, 22.0, 38.0, 50.0):
        if start <= time < start + 3.0:
            return -0.06 if time < start + 1.5 else 0.06
    return 0.0


def vehicle_text(channels: dict[str, np.ndarray], events: str = "") -> str:
    """The vehicle file of the C130 with the mass properties of the first sample; accelerometers at
    its CG."""
    first = {name: float(channels[name][0]) for name in ("mass", "Ixx", "Iyy", "Izz", "Ixz")}
    cg = [float(channels[f"cg_{axis}"][0]) for axis in "xyz"]
    values = "".join(f"{name} = {value!r}\n" for name, value in first.items())
    limits = "".join(
        f'[surfaces.{name}]\nlimits = ["-30 deg", "30 deg"]\n'
        for name in ("elevator", "aileron", "rudder")
    )
    return (
        'name = "c130"\n[reference]\narea = 285.2\nchord = 7.06\nspan = 40.4\n'
        f'[points]\nmoment_reference = "cg"\nimu = {cg}\n[mass]\nsource = "constant"\n'
        f'{values}cg = {cg}\n{events}[thrust]\nsource = "channel"\npoint = {list(THRUST_POINT)}\n{limits}'
        "[configuration]\ndelta_flap = 0.0\ndelta_landing_gear = 0.0\n"
    )
