"""A JSBSim export flies there as the database flies here: same inputs, same trajectory."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aerodb.exchange import MassBalance, export_jsbsim, import_jsbsim
from aerodb.exchange.jsbsim.export import input_properties
from aerodb.physics import Earth, standard_atmosphere
from aerodb.simulation import flight_model, simulate
from aerodb.storage.writers.jsbsim_executive import loaded_in_jsbsim
from aerodb.tables import AeroDatabase, Increment, Interval, parse
from tests.support.parts import aircraft

jsbsim = pytest.importorskip("jsbsim")

FOOT, SLUG, STEP = 0.3048, 14.593902937206, 1.0 / 480.0


def updated() -> AeroDatabase:
    """JSBSim's T37, with increments in body and wind axes inside an envelope."""
    folder = Path(jsbsim.get_default_root_dir()) / "aircraft" / "T37"
    base = import_jsbsim(
        (folder / "T37.xml").read_bytes(),
        name="t37",
        loader=lambda name: (folder / name).read_bytes(),
    )
    envelope = {"alpha": Interval(-0.05, 0.15, 0.03)}
    increments = [
        Increment("Cm", (parse("alpha"),), np.array([-0.2]), np.eye(1), envelope),
        Increment("C_lift", (parse("alpha"),), np.array([0.4]), np.eye(1), envelope),
        Increment("Cl", (parse("p_hat"),), np.array([-0.1]), np.eye(1)),
    ]
    return replace(base, increments=tuple(increments))


@pytest.mark.parametrize(
    ("database", "kilograms", "inertia", "knots"),
    [
        pytest.param(updated, 2800.0, (6000.0, 5600.0, 11000.0, 900.0), 200.0, id="increments"),
        pytest.param(aircraft, 1100.0, (1300.0, 1800.0, 2700.0, 90.0), 105.0, id="parts"),
    ],
)
def test_an_export_flies_in_jsbsim_with_the_vehicles_mass_as_it_flies_here(
    database: Callable[[], AeroDatabase],
    kilograms: float,
    inertia: tuple[float, float, float, float],
    knots: float,
) -> None:
    """A database with increments in wind axes, and one of 40 strips with a propeller, which are
    loads."""
    _flies_alike(database(), kilograms, inertia, knots)


def _flies_alike(
    database: AeroDatabase,
    kilograms: float,
    inertia: tuple[float, float, float, float],
    knots: float,
) -> None:
    x, y, z = database.reference.moment_reference
    # The CG is ahead of the reference point, and the principal axes are not the body axes.
    mass = MassBalance(kilograms, (x + 0.1, y, z + 0.05), inertia, "weighed")
    program = loaded_in_jsbsim(export_jsbsim(database, name="t37", mass=mass))
    for name, value in {
        "ic/h-sl-ft": 8000.0, "ic/vc-kts": knots, "ic/lat-geod-deg": 45.0, "ic/psi-true-deg": 30.0,
        "ic/alpha-deg": 2.0, "inertia/pointmass-weight-lbs[0]": 0.0,
    }.items():  # fmt: skip
        if program.get_property_manager().hasNode(name):
            program[name] = value
    program.set_dt(STEP)
    program.run_ic()
    for state in ("rate", "position"):
        for kind in ("rotational", "translational"):
            program[f"simulation/integrator/{state}/{kind}"] = 4
    latitude = program["position/lat-geod-rad"]
    model = flight_model(database, earth=Earth(latitude, program["position/long-gc-rad"]))
    known = input_properties(database)
    inputs = {name: known[name] for name in model.inputs}
    log = {"V": ("velocities/vt-fps", FOOT), "altitude": ("position/geod-alt-ft", FOOT)}
    log |= {name: (f"aero/{name}-rad", 1.0) for name in ("alpha", "beta")}
    log |= {name: (f"attitude/{name}-rad", 1.0) for name in ("phi", "theta", "psi")}
    log |= {name: (f"velocities/{name}-rad_sec", 1.0) for name in "pqr"}
    log |= {f"{name}_inertial": (f"velocities/{name}i-rad_sec", 1.0) for name in "pqr"}
    log |= {
        "rho": ("atmosphere/rho-slugs_ft3", SLUG / FOOT**3),
        "mass": ("inertia/mass-slugs", SLUG),
    }
    log |= {"temperature": ("atmosphere/T-R", 5.0 / 9.0)}
    log |= {
        f"cg_{a}": (f"inertia/cg-{a}-in", s * 0.0254) for a, s in (("x", -1), ("y", 1), ("z", -1))
    }
    inertias = dict(zip(("Ixx", "Iyy", "Izz", "Ixz"), mass.inertia, strict=True))
    log |= inputs
    surfaces = [
        name for name in ("delta_elevator", "delta_aileron", "delta_rudder") if name in inputs
    ]
    assert surfaces
    if "throttle" in inputs:
        program[inputs["throttle"][0]] = 0.75
    rows = []
    for i in range(int(8.0 / STEP)):
        time = i * STEP
        for name, since in zip(surfaces, (1.0, 3.0, 5.0), strict=False):
            wave = np.sin(np.pi * (time - since)) ** 3 if since <= time < since + 2.0 else 0.0
            program[inputs[name][0]] = 0.03 * wave / inputs[name][1]
        program.run()
        rows.append([program[name] * factor for name, factor in log.values()])
    # JSBSim's alphadot is that of the step before, and zero at first: half a second is left out.
    rows = rows[int(0.5 / STEP) :]
    told = dict(zip(log, np.array(rows).T, strict=True))
    air = standard_atmosphere(told["altitude"])
    np.testing.assert_allclose(told["mass"], mass.mass, rtol=1e-7)
    for name, value in zip(("cg_x", "cg_y", "cg_z"), mass.cg, strict=True):
        np.testing.assert_allclose(told[name], value, atol=1e-9)
    series = {name: told[name] for name in (*inputs, "mass", "cg_x", "cg_y", "cg_z")}
    series |= {name: np.full(len(rows), value) for name, value in inertias.items()}
    series["density_ratio"] = told["rho"] / air.density
    series["temperature_offset"] = told["temperature"] - air.temperature
    start = {
        name: told[name][0] for name in ("V", "alpha", "beta", "phi", "theta", "psi", "altitude")
    }
    start |= {name: told[f"{name}_inertial"][0] for name in "pqr"}
    flown = simulate(model, np.arange(len(rows)) * STEP, start, series)
    for name in ("V", "alpha", "beta", "p", "q", "r", "phi", "theta", "psi"):
        ours, theirs = flown.channels[name][:, 0], told[name]
        assert np.ptp(theirs) > 1e-3, name
        assert np.abs(ours - theirs).max() < 1e-3 * np.ptp(theirs), name
