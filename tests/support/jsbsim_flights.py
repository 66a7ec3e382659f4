"""JSBSim in the same process, for tests: its aircraft, random conditions, its own coefficients.

The aircraft files come from the installed package. JSBSim evaluates functions when they are asked
for, and right after `run_ic` its state, its controls and its forces belong together.
"""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aerodb.nomenclature import AXES
from aerodb.tables.database import AeroDatabase
from aerodb.tables.reference import transfer_moments

jsbsim = pytest.importorskip("jsbsim")

FOOT, POUND = 0.3048, 4.4482216152605
INCH = FOOT / 12
FORCES = [f"forces/fb{axis}-aero-lbs" for axis in "xyz"]
MOMENTS = [f"moments/{axis}-aero-lbsft" for axis in "lmn"]


def aircraft_file(name: str) -> bytes:
    return (Path(jsbsim.get_default_root_dir()) / "aircraft" / name / f"{name}.xml").read_bytes()


def simulator(name: str, planet: Path | None = None, aircraft: Path | None = None) -> Any:
    """An aircraft ready to be flown, over another `planet` than the earth when its file is given,
    and from another folder of `aircraft` than JSBSim's own."""
    executive = jsbsim.FGFDMExec(jsbsim.get_default_root_dir())
    executive.set_debug_level(0)
    assert planet is None or executive.load_planet(str(planet), False)
    if aircraft is not None:
        executive.set_aircraft_path(str(aircraft))
    assert executive.load_model(name)
    executive.disable_output()
    executive["propulsion/set-running"] = -1
    return executive


def own_coefficients(executive: Any) -> list[float]:
    """JSBSim's forces and moments about the CG as coefficients on AXES."""
    force = executive["aero/qbar-psf"] * executive["metrics/Sw-sqft"]
    lengths = [executive[f"metrics/{name}"] for name in ("bw-ft", "cbarw-ft", "bw-ft")]
    moments = [
        executive[name] / force / length for name, length in zip(MOMENTS, lengths, strict=True)
    ]
    return [executive[name] / force for name in FORCES] + moments


def centre_of_gravity(executive: Any) -> list[float]:
    """CG in m, body axes from the structural origin."""
    x, y, z = (executive[f"inertia/cg-{axis}-in"] * INCH for axis in "xyz")
    return [-x, y, -z]


def random_condition(executive: Any, rng: np.random.Generator) -> None:
    executive["ic/h-sl-ft"] = rng.uniform(500, 15000)
    executive["ic/vt-fps"] = rng.uniform(120, 350)
    executive["ic/alpha-deg"] = rng.uniform(-25, 45)
    executive["ic/beta-deg"] = rng.uniform(-25, 25)
    for rate in "pqr":
        executive[f"ic/{rate}-rad_sec"] = rng.uniform(-0.6, 0.6)
    for control in ("elevator", "aileron", "rudder"):
        executive[f"fcs/{control}-cmd-norm"] = rng.uniform(-1, 1)
    executive["fcs/throttle-cmd-norm"] = rng.uniform(0, 1)


_MEANING = {
    "V": ("velocities/vt-fps", FOOT),
    "alpha": ("aero/alpha-rad", 1.0),
    "beta": ("aero/beta-rad", 1.0),
    "alphadot": ("aero/alphadot-rad_sec", 1.0),
    "betadot": ("aero/betadot-rad_sec", 1.0),
    "mach": ("velocities/mach", 1.0),
    **{rate: (f"velocities/{rate}-aero-rad_sec", 1.0) for rate in "pqr"},
    "qbar": ("aero/qbar-psf", POUND / FOOT**2),
    "rho": ("atmosphere/rho-slugs_ft3", POUND / FOOT**4),
    "temperature": ("atmosphere/T-R", 1.0 / 1.8),
    "static_pressure": ("atmosphere/P-psf", POUND / FOOT**2),
    "altitude": ("position/h-sl-ft", FOOT),
    "height_above_ground": ("position/h-agl-ft", FOOT),
    "phi": ("attitude/phi-rad", 1.0),
    "theta": ("attitude/theta-rad", 1.0),
    "calibrated_airspeed": ("velocities/vc-fps", FOOT),
    "mass": ("inertia/mass-slugs", POUND / FOOT),
    "cg_x": ("inertia/cg-x-in", -INCH),
    "cg_y": ("inertia/cg-y-in", INCH),
    "cg_z": ("inertia/cg-z-in", -INCH),
    "delta_elevator": ("fcs/elevator-pos-rad", 1.0),
    "delta_aileron": ("fcs/left-aileron-pos-rad", -1.0),
    "delta_rudder": ("fcs/rudder-pos-rad", 1.0),
    "delta_flap": ("fcs/flap-pos-deg", np.pi / 180),
    "delta_speedbrake": ("fcs/speedbrake-pos-deg", np.pi / 180),
    "delta_spoiler": ("fcs/spoiler-pos-deg", np.pi / 180),
    "delta_landing_gear": ("gear/gear-pos-norm", 1.0),
}


def channels_of(executive: Any, database: AeroDatabase) -> dict[str, float]:
    """What `database` needs, each by its physical meaning; its free inputs by the property that
    they name."""
    free = {
        name: text.removeprefix("JSBSim property ").split(":")[0]
        for name, text in database.free_inputs.items()
    }
    sources = {
        name: (free[name], 1.0) if name in free else _MEANING[name] for name in database.inputs
    }
    return {name: executive[path] * scale for name, (path, scale) in sources.items()}


def compare(
    database: AeroDatabase, channels: dict[str, Any], cg: np.ndarray, theirs: np.ndarray
) -> dict[str, float]:
    """Largest error per axis over its tolerance of 1e-9 max(|C|, 1e-3)."""
    ours = database.predict(channels).coefficients
    ours = transfer_moments(ours, database.reference.moment_reference, cg, database.reference)
    errors = {}
    for k, axis in enumerate(AXES):
        tolerance = 1e-9 * np.maximum(np.abs(theirs[:, k]), 1e-3)
        errors[axis] = float(np.max(np.abs(ours[axis] - theirs[:, k]) / tolerance))
    return errors
