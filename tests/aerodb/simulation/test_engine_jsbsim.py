"""JSBSim's own aircraft in JSBSim and in the engine, from one imported aerodynamics.

JSBSim trims each aircraft and flies 30 s of doublets on every axis and of the throttle with its own control system,
engines and atmosphere. The engine is given what a flight test would have measured: positions of the
surfaces, the force and moment that are not aerodynamic (engines), mass properties, wind and the
state of the air, and JSBSim's first state. Both integrate with the same rule over a rotating
ellipsoid; JSBSim's field has the harmonic J2, the engine's is normal gravity.
"""

import re
import shutil
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from aerodb.exchange import import_jsbsim
from aerodb.exchange.jsbsim.properties import CHANNEL_PROPERTIES
from aerodb.physics import Earth, standard_atmosphere
from aerodb.simulation import FlightModel, flight_model, simulate
from aerodb.support import Array

jsbsim = pytest.importorskip("jsbsim")

FOOT, POUND, SLUG = 0.3048, 4.4482216152605, 14.593902937206
#: JSBSim's alphadot is that of the step before: its error is proportional to the step.
STEP = 1.0 / 960.0
#: Aircraft -> calibrated airspeed [kt] and amplitudes of the elevator's, aileron's and rudder's
#: doublets, shares of the full command.
AIRCRAFT = {
    "f16": (350.0, 0.2, 0.15, 0.15),
    "c172p": (90.0, 0.3, 0.2, 0.2),
    "737": (280.0, 0.4, 0.15, 0.15),
    "DHC6": (110.0, 0.3, 0.15, 0.15),
    "T37": (220.0, 0.3, 0.15, 0.15),
}
COMPARED = ("alpha", "beta", "p", "q", "r", "phi", "theta", "psi", "V")


class Flown(NamedTuple):
    model: FlightModel
    time: Array
    start: dict[str, float]
    series: dict[str, Array]
    log: dict[str, Array]


def _properties(model: FlightModel) -> dict[str, tuple[str, float]]:
    """Channel -> JSBSim's property and the factor to SI."""
    found = {"V": ("velocities/vt-fps", FOOT), "alpha": ("aero/alpha-rad", 1.0)}
    found |= {"beta": ("aero/beta-rad", 1.0), "mass": ("inertia/mass-slugs", SLUG)}
    found |= {name: (f"velocities/{name}-rad_sec", 1.0) for name in "pqr"}
    found |= {f"{name}_inertial": (f"velocities/{name}i-rad_sec", 1.0) for name in "pqr"}
    found |= {name: (f"attitude/{name}-rad", 1.0) for name in ("phi", "theta", "psi")}
    found |= {"altitude": ("position/geod-alt-ft", FOOT), "height": ("position/h-agl-ft", FOOT)}
    found |= {"rho": ("atmosphere/rho-slugs_ft3", SLUG / FOOT**3)}
    found |= {"temperature": ("atmosphere/T-R", 5.0 / 9.0)}
    for axis, sign in (("x", -0.0254), ("y", 0.0254), ("z", -0.0254)):
        found[f"cg_{axis}"] = (f"inertia/cg-{axis}-in", sign)
    for name in ("Ixx", "Iyy", "Izz", "Ixy", "Iyz"):
        found[name] = (f"inertia/{name.lower()}-slugs_ft2", SLUG * FOOT**2)
    found["Ixz"] = ("inertia/ixz-slugs_ft2", -SLUG * FOOT**2)
    for axis in ("north", "east", "down"):
        found[f"wind_{axis}"] = (f"atmosphere/total-wind-{axis}-fps", FOOT)
    for axis, moment in zip("xyz", "lmn", strict=True):
        for kind in ("total", "aero"):
            found[f"force_{kind}_{axis}"] = (f"forces/fb{axis}-{kind}-lbs", POUND)
            found[f"moment_{kind}_{axis}"] = (f"moments/{moment}-{kind}-lbsft", POUND * FOOT)
    free = model.database.free_inputs
    for name in model.inputs:
        if name in free:
            found[name] = (free[name].split()[2].rstrip(":"), 1.0)
        elif name in CHANNEL_PROPERTIES:
            found[name] = CHANNEL_PROPERTIES[name]
        else:
            found[name] = (f"fcs/{name.removeprefix('delta_')}-pos-rad", 1.0)
    return found


def _doublet(time: float, since: float) -> float:
    """Two smooth half waves of 1 s: what a limited actuator makes of a doublet."""
    return float(np.sin(np.pi * (time - since)) ** 3) if since <= time < since + 2.0 else 0.0


def fly_jsbsim(
    aircraft: str, *, disturbed: bool = False, folder: Path | None = None, seconds: float = 30.0
) -> Flown:
    """folder: of aircraft other than JSBSim's own, each in its folder."""
    root = Path(jsbsim.get_default_root_dir())
    aircraft_folder = folder or root / "aircraft"
    speed, *amplitudes = AIRCRAFT[aircraft]
    program = jsbsim.FGFDMExec(str(root))
    program.set_debug_level(0)
    program.load_model_with_paths(
        aircraft, str(aircraft_folder), str(root / "engine"), str(root / "systems")
    )
    program.set_dt(STEP)
    for name, value in {
        "ic/h-sl-ft": 8000.0, "ic/vc-kts": speed, "ic/lat-geod-deg": 45.0,
        "ic/psi-true-deg": 30.0, "gear/gear-cmd-norm": 0.0, "gear/gear-pos-norm": 0.0,
    }.items():  # fmt: skip
        program[name] = value
    program.run_ic()
    for state in ("rate", "position"):
        for kind in ("rotational", "translational"):
            program[f"simulation/integrator/{state}/{kind}"] = 4
    for number in range(program.get_propulsion().get_num_engines()):
        program[f"fcs/mixture-cmd-norm[{number}]"] = 0.9
        program[f"fcs/throttle-cmd-norm[{number}]"] = 0.6
    program["propulsion/set-running"] = -1
    program["simulation/do_simple_trim"] = 1
    own = aircraft_folder / aircraft
    database = import_jsbsim(
        (own / f"{aircraft}.xml").read_bytes(),
        name=aircraft.lower(),
        loader=lambda name: (own / name).read_bytes(),
    )
    latitude = program["position/lat-geod-rad"]
    model = flight_model(database, earth=Earth(latitude, program["position/long-gc-rad"]))
    properties = _properties(model)
    commands = [f"fcs/{name}-cmd-norm" for name in ("elevator", "aileron", "rudder", "throttle")]
    trimmed = [program[name] for name in commands]
    fuel = program["propulsion/tank[0]/contents-lbs"]
    rows = []
    for i in range(round(seconds / STEP) + 1):
        time = i * STEP
        for name, base, amplitude, since in zip(
            commands, trimmed, (*amplitudes, -0.2), (2.0, 10.0, 17.0, 6.0), strict=True
        ):
            program[name] = base + amplitude * _doublet(time, since)
        if disturbed:
            gust = 1.0 - np.cos(np.pi * np.clip(time - 5.0, 0.0, 2.0))
            program["atmosphere/wind-down-fps"] = -5.0 * gust
            program["atmosphere/wind-east-fps"] = 10.0 * np.clip((time - 12.0) / 3.0, 0.0, 1.0)
            program["propulsion/tank[0]/contents-lbs"] = fuel * (1.0 - max(time - 5.0, 0.0) / 50.0)
        program.run()
        rows.append([program[name] * factor for name, factor in properties.values()])
    log = dict(zip(properties, np.array(rows).T, strict=True))
    air = standard_atmosphere(log["altitude"])
    series = {
        name: log[name]
        for name in ("mass", "cg_x", "cg_y", "cg_z", "Ixx", "Iyy", "Izz", "Ixz", "Ixy", "Iyz",
                     "wind_north", "wind_east", "wind_down", *model.inputs)
    }  # fmt: skip
    for kind in ("force", "moment"):
        for axis in "xyz":
            series[f"{kind}_{axis}"] = log[f"{kind}_total_{axis}"] - log[f"{kind}_aero_{axis}"]
    series |= {
        "density_ratio": log["rho"] / air.density,
        "temperature_offset": log["temperature"] - air.temperature,
        "ground_altitude": log["altitude"] - log["height"],
    }
    start = {
        name: float(log[name][0])
        for name in ("V", "alpha", "beta", "phi", "theta", "psi", "altitude")
    } | {name: float(log[f"{name}_inertial"][0]) for name in "pqr"}
    return Flown(model, np.arange(len(rows)) * STEP, start, series, log)


def differences(flown: Flown) -> dict[str, float]:
    """Greatest difference of each channel, as a share of its range."""
    mine = simulate(flown.model, flown.time, flown.start, flown.series)
    assert mine.ended[0] == len(flown.time)
    found = {}
    for name in COMPARED:
        theirs, ours = flown.log[name], mine.channels[name][:, 0]
        if name == "psi":
            theirs, ours = np.unwrap(theirs), np.unwrap(ours)
        found[name] = float(np.abs(ours - theirs).max() / np.ptp(theirs))
    return found


@pytest.mark.parametrize("aircraft", AIRCRAFT)
def test_an_aircraft_of_jsbsim_flies_here_as_it_does_there(aircraft: str) -> None:
    shares = differences(fly_jsbsim(aircraft))
    assert max(shares.values()) < 1e-3, shares


@pytest.mark.parametrize(
    "aircraft",
    [pytest.param(name, marks=[] if name == "f16" else pytest.mark.campaign) for name in AIRCRAFT],
)
def test_gusts_and_a_changing_mass_act_alike(aircraft: str, tmp_path: Path) -> None:
    """A vertical gust of 3 m/s, a crosswind of 3 m/s, and half a tank of fuel in 25 s.

    JSBSim's alphadot leaves out the rate of the wind, the engine's does not: both fly the aircraft
    without its alphadot terms."""
    root = Path(jsbsim.get_default_root_dir()) / "aircraft"
    shutil.copytree(root / aircraft, tmp_path / aircraft)
    for file in (tmp_path / aircraft).glob("*.xml"):
        text = file.read_text(encoding="utf-8", errors="replace")
        still = re.sub(
            r"<property>\s*aero/alphadot-rad_sec\s*</property>", "<value>0</value>", text
        )
        file.write_text(still, encoding="utf-8")
    shares = differences(fly_jsbsim(aircraft, disturbed=True, folder=tmp_path))
    assert max(shares.values()) < 1e-3, shares
