"""Trims, linear models and modes of JSBSim's own aircraft, against JSBSim's trim and linearisation.

JSBSim trims over a rotating earth with local gravity, the product over the flat earth: their trims
differ by .07 % of gravity, and by the Coriolis force in bank. JSBSim linearises with engines and
control system: its phugoid has the thrust's slope with speed, and the 737's lateral motion a yaw
damper.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest

from aerodb.simulation import Condition, LinearModel, Trim, flight_model, linear_model, modes, trim
from aerodb.support import Array
from tests.aerodb.simulation.test_engine_jsbsim import AIRCRAFT, FOOT, STEP, Flown, fly_jsbsim

jsbsim = pytest.importorskip("jsbsim")


class Compared(NamedTuple):
    flown: Flown
    trim: Trim
    linear: LinearModel


@pytest.fixture(scope="module", params=("737", "c172p", "T37"))
def compared(request: pytest.FixtureRequest) -> Compared:
    """The first instant of JSBSim's trimmed flight, and the product's trim with the same masses and
    the engines' force and moment, but for the thrust along x."""
    flown = fly_jsbsim(request.param, seconds=STEP)
    model = flight_model(flown.model.database)
    inputs = {
        name: float(values[0])
        for name, values in flown.series.items()
        if not name.startswith(("delta_", "wind_")) and name != "force_x"
    }
    condition = Condition(V=float(flown.log["V"][0]), altitude=float(flown.log["altitude"][0]))
    found = trim(model, condition, inputs)
    return Compared(flown, found, linear_model(found, "angles"))


def test_trims_agree(compared: Compared) -> None:
    flown, found, _ = compared
    for name in ("alpha", "theta"):
        assert found.channels[name] == pytest.approx(float(flown.log[name][0]), abs=2e-4)
    for name in ("delta_elevator", "delta_aileron", "delta_rudder"):
        assert found.deflections[name] == pytest.approx(float(flown.series[name][0]), abs=2e-4)
    thrust = float(flown.series["force_x"][0])
    assert found.deflections["force_x"] == pytest.approx(thrust, rel=2e-3)


def linearised(aircraft: str) -> tuple[Array, tuple[str, ...]]:
    """A of JSBSim's linearisation [ft, rad, s] at the trim of `fly_jsbsim`, with its states."""
    program = jsbsim.FGFDMExec(jsbsim.get_default_root_dir())
    program.set_debug_level(0)
    program.load_model(aircraft)
    program.set_dt(STEP)
    for name, value in {
        "ic/h-sl-ft": 8000.0, "ic/vc-kts": AIRCRAFT[aircraft][0], "ic/lat-geod-deg": 45.0,
        "ic/psi-true-deg": 30.0, "gear/gear-cmd-norm": 0.0, "gear/gear-pos-norm": 0.0,
    }.items():  # fmt: skip
        program[name] = value
    program.run_ic()
    for number in range(program.get_propulsion().get_num_engines()):
        program[f"fcs/mixture-cmd-norm[{number}]"] = 0.9
        program[f"fcs/throttle-cmd-norm[{number}]"] = 0.6
    program["propulsion/set-running"] = -1
    program["simulation/do_simple_trim"] = 1
    linear = jsbsim.FGLinearization(program)
    return np.array(linear.system_matrix), tuple(linear.x_names)


def test_matrices_and_modes_agree(compared: Compared) -> None:
    aircraft = compared.flown.model.database.name
    matrix, states = linearised(aircraft.upper() if aircraft == "t37" else aircraft)
    theirs = {"V": "Vt", "alpha": "Alpha", "q": "Q", "theta": "Theta",
              "beta": "Beta", "p": "P", "r": "R", "phi": "Phi"}  # fmt: skip
    groups = {"plane": ("V", "alpha", "q", "theta"), "lateral": ("beta", "p", "r", "phi")}
    if aircraft == "737":
        del groups["lateral"]
    for group in groups.values():
        mine = compared.linear.part(group)
        k = [states.index(theirs[name]) for name in group]
        feet = np.array([FOOT if name == "V" else 1.0 for name in group])
        other = matrix[np.ix_(k, k)] * feet[:, None] / feet
        # The thrust's slope with speed is JSBSim's; gravity's .07 % and the trims' differences stay.
        assert mine.A[:, group[0] == "V" :] == pytest.approx(
            other[:, group[0] == "V" :], rel=7e-3, abs=5e-3
        )
        adapted = mine.A.copy()
        if group[0] == "V":
            adapted[:, 0] = other[:, 0]
        ours, reference = (
            {mode.name: mode.eigenvalue for mode in modes(replace(mine, A=a))}
            for a in (adapted, other)
        )
        assert set(ours) == set(reference)
        for name, value in ours.items():
            # JSBSim's alphadot is that of the evaluation before; the T37's real roots lie close
            # together, where this counts most.
            tolerance = 0.03 if name == "short period, real root" else 5e-3
            assert abs(value - reference[name]) < tolerance * abs(reference[name]), name
