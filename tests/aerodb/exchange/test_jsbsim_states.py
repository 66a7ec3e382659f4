"""States with memory in exported files: JSBSim runs them as a flight here does."""

import numpy as np
import pytest

from aerodb.exchange.jsbsim.check_cases import jsbsim_check_cases
from aerodb.exchange.jsbsim.export import export_jsbsim
from aerodb.exchange.jsbsim.merge import merge_jsbsim
from aerodb.exchange.jsbsim.properties import FOOT
from aerodb.exchange.jsbsim.reader import import_jsbsim
from aerodb.exchange.jsbsim.states import states_for_jsbsim
from aerodb.exchange.state_terms import without_states
from aerodb.storage.writers.jsbsim_executive import loaded_in_jsbsim
from aerodb.tables import AeroDatabase, Rate, ReferenceGeometry, StateModel, Term, parse
from aerodb.tables.state_model import GomanKhrabrov, Kirchhoff
from tests.support.jsbsim_flights import aircraft_file

CHORD = 1.4
#: Thirty chords at 60 m/s are .7 s.
STATES = {
    "lagged lift far behind": StateModel(
        "lagged", Rate(parse("(2.0*alpha - lagged)*V/(30*c_ref)*(1 + 0.2*beta)"))
    ),
    "lagged lift": StateModel("lagged", Rate(parse("(alpha + 0.3*q_hat - lagged)*V/(120*c_ref)"))),
    "attached flow": StateModel("flow_attachment", Kirchhoff(30.0, 0.12, 0.0, 25.0)),
    "tabulated flow": StateModel(
        "flow_attachment", GomanKhrabrov((0.0, 0.1, 0.2), (1.0, 0.6, 0.1), 0.0, 80.0)
    ),
}


def database(state: StateModel) -> AeroDatabase:
    lift = f"(0.2 + 4.5*alpha)*(0.5 + 0.5*{state.name})"
    texts = {
        "C_lift": lift,
        "C_drag": f"0.03 + 0.02*{state.name}",
        "Cm": "-0.05 - 0.6*alpha - 9*q_hat + 0.4*sin(0)",
        "Cl": "-0.4*p_hat - 0.05*beta",
        "Cn": "0.08*beta - 0.1*r_hat",
    }
    free = {"lagged": "lift that follows later"} if state.name == "lagged" else {}
    return AeroDatabase(
        "lagging",
        ReferenceGeometry(12.5, CHORD, 9.1, (0.0, 0.0, 0.0)),
        terms=tuple(Term(axis, axis, parse(text)) for axis, text in texts.items()),
        free_inputs=free,
        states=(state,),
    )


def flown(xml: bytes, seconds: float) -> dict[str, np.ndarray]:
    """A free motion inside JSBSim, from a steep climb that is not trimmed: alpha swings by several
    degrees. Channels in SI."""
    executive = loaded_in_jsbsim(xml)
    executive["ic/h-sl-ft"] = 3000.0
    executive["ic/vt-fps"] = 60.0 / FOOT
    executive["ic/alpha-rad"] = 0.15
    executive["ic/theta-rad"] = 0.3
    executive["ic/q-rad_sec"] = -0.6
    executive.run_ic()
    read = {
        "alpha": ("aero/alpha-rad", 1.0),
        "beta": ("aero/beta-rad", 1.0),
        "V": ("velocities/vt-fps", FOOT),
        "q": ("velocities/q-rad_sec", 1.0),
        "Z": ("forces/fbz-aero-lbs", 1.0),
        "pressure": ("aero/qbar-area", 1.0),
    }
    series: dict[str, list[float]] = {name: [] for name in (*read, "time")}
    while True:
        for name, (path, scale) in read.items():
            series[name].append(executive[path] * scale)
        series["time"].append(executive["simulation/sim-time-sec"])
        if series["time"][-1] > seconds:
            break
        executive.run()
    return {name: np.array(values) for name, values in series.items()}


@pytest.mark.parametrize("kind", STATES)
def test_a_state_takes_the_course_inside_jsbsim_that_it_takes_here(kind: str) -> None:
    state = STATES[kind]
    made = database(state)
    flight = flown(export_jsbsim(made, name="lagging"), 6.0)
    channels = {name: flight[name] for name in ("alpha", "beta", "V", "q")}
    course = made.states_along(flight["time"], channels)[state.name]
    channels |= {name: np.zeros(len(course)) for name in ("p", "r")}
    lift = made.predict({**channels, state.name: course}).coefficients["CZ"]
    settled = without_states(made).predict(channels).coefficients["CZ"]
    memory = float(np.abs(lift - settled).max())
    assert memory > 0.02  # what an export without memory misses
    assert np.abs(lift - flight["Z"] / flight["pressure"]).max() < 0.03 * memory


@pytest.mark.parametrize("kind", STATES)
def test_check_cases_and_imports_have_the_steady_values(kind: str) -> None:
    made = database(STATES[kind])
    plain = states_for_jsbsim(made)
    cases = jsbsim_check_cases(plain, 20)
    again = import_jsbsim(export_jsbsim(made, name="lagging", cases=cases), name="again")
    for case in cases:
        found = again.predict(case.inputs).coefficients
        for axis, value in case.coefficients.items():
            assert found[axis] == pytest.approx(value, rel=1e-9, abs=1e-12)


def test_states_go_into_an_aircraft_with_its_aerodynamics() -> None:
    exported = export_jsbsim(database(STATES["lagged lift"]), name="lagging")
    aircraft = aircraft_file("f16")
    once = merge_jsbsim(aircraft, exported, "f16.xml", lambda _name: b"").xml
    assert once.count(b"states with memory") == 1
    again = merge_jsbsim(once, exported, "f16.xml", lambda _name: b"").xml
    assert again == once
