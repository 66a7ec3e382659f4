"""Loads in N and N m: beside coefficients they give closed solutions in flight, the same numbers
everywhere, and nothing where there are none."""

from dataclasses import replace

import numpy as np
import pytest

from aerodb.errors import InputError
from aerodb.exchange.daveml.export import export_daveml
from aerodb.exchange.daveml.reader import import_daveml
from aerodb.exchange.jsbsim.check_cases import check_in_jsbsim, jsbsim_check_cases
from aerodb.exchange.jsbsim.export import export_jsbsim, input_properties
from aerodb.exchange.jsbsim.reader import import_jsbsim
from aerodb.exchange.native import from_document, read_native, to_document
from aerodb.nomenclature import AXES
from aerodb.physics import GRAVITY
from aerodb.simulation import Condition, Propulsion, flight_model, simulate, trim
from aerodb.storage.writers.jsbsim_executive import loaded_in_jsbsim
from aerodb.tables import (
    AeroDatabase,
    Increment,
    ReferenceGeometry,
    Term,
    consolidate,
    evaluate_database,
    neutral_point,
    parse,
    slopes_by,
    total_coefficients,
    unstated_inputs,
)
from aerodb.tables.machine import execute
from tests.support.build_up import build_up

REFERENCE = ReferenceGeometry(12.0, 1.3, 9.0, (-2.0, 0.1, 0.2))
MASSES = {"mass": 500.0, "Ixx": 700.0, "Iyy": 900.0, "Izz": 1400.0}
LOADS = {
    "FX": "900*throttle - 0.2*rho*V",
    "FY": "-15*beta*V",
    "FZ": "-40 + 3*q*V",
    "MX": "-30*p*V",
    "MY": "120*throttle - 2*alpha*V",
    "MZ": "20*beta*V",
}
COEFFICIENTS = {"CX": "-0.03 - 0.1*alpha", "CZ": "-0.2 - 4.5*alpha", "Cm": "-0.6*alpha - 8*q_hat"}


def database(loads: dict[str, str], coefficients: dict[str, str]) -> AeroDatabase:
    terms = [Term(f"{axis} load", axis, parse(text)) for axis, text in loads.items()]
    terms += [Term(axis, axis, parse(text)) for axis, text in coefficients.items()]
    return AeroDatabase("loaded", REFERENCE, terms=tuple(terms), free_inputs={"throttle": "0 to 1"})


def test_a_load_adds_its_share_of_the_coefficient() -> None:
    rng = np.random.default_rng(2)
    x = {n: rng.uniform(-0.2, 0.2, 9) for n in ("alpha", "beta", "p", "q", "throttle")}
    x |= {n: rng.uniform(*r, 9) for n, r in (("V", (30, 60)), ("rho", (0.9, 1.2)))}
    x["qbar"] = rng.uniform(500.0, 900.0, 9)
    found = database(LOADS, COEFFICIENTS).predict(x).coefficients
    force = x["qbar"] * 12.0
    hand = {
        "CX": -0.03 - 0.1 * x["alpha"] + (900 * x["throttle"] - 0.2 * x["rho"] * x["V"]) / force,
        "CY": -15 * x["beta"] * x["V"] / force,
        "CZ": -0.2 - 4.5 * x["alpha"] + (-40 + 3 * x["q"] * x["V"]) / force,
        "Cl": -30 * x["p"] * x["V"] / (force * 9.0),
        "Cm": -0.6 * x["alpha"]
        - 8 * x["q"] * 1.3 / (2 * x["V"])
        + (120 * x["throttle"] - 2 * x["alpha"] * x["V"]) / (force * 1.3),
        "Cn": 20 * x["beta"] * x["V"] / (force * 9.0),
    }
    for axis in AXES:
        np.testing.assert_allclose(found[axis], hand[axis], rtol=1e-12, atol=1e-14)


def test_what_flies_has_the_same_numbers() -> None:
    total = total_coefficients(database(LOADS, COEFFICIENTS))
    rng = np.random.default_rng(3)
    values = {name: rng.uniform(0.1, 0.9, 5) for name in (*total.inputs, "qbar")}
    slots = np.repeat(total.machine.slots[:, None], 5, axis=1)
    for name, slot in total.machine.inputs.items():
        slots[slot] = values[name]
    execute(
        total.machine.instructions, slots, np.zeros((8, 5), np.int64), np.zeros((0, 5), bool), 5
    )
    found = database(LOADS, COEFFICIENTS).predict(values).coefficients
    assert "qbar" not in total.inputs  # loads exist at V = 0
    outputs, lengths = slots[list(total.machine.outputs)], (1.0, 1.0, 1.0, 9.0, 1.3, 9.0)
    for k, (axis, length) in enumerate(zip(AXES, lengths, strict=True)):
        share = outputs[6 + k] / (values["qbar"] * 12.0 * length)
        np.testing.assert_allclose(outputs[k] + share, found[axis], rtol=1e-13)


def test_a_load_moves_a_body_at_any_speed_as_newton_says() -> None:
    """Weight carried by a load, 100 N along x: the speed grows linearly from 2 m/s, in level
    flight. The moment is that of the loads about the CG, 2 m behind the moment reference."""
    weight = MASSES["mass"] * GRAVITY
    model = flight_model(
        replace(
            database({"FX": "100", "FZ": f"-{weight!r}"}, {}),
            reference=ReferenceGeometry(12.0, 1.3, 9.0, (0.0, 0.0, 0.0)),
        )
    )
    time = np.arange(0.0, 10.001, 0.01)
    run = simulate(model, time, {"V": 2.0, "altitude": 300.0}, MASSES)
    np.testing.assert_allclose(run.channels["V"][:, 0], 2.0 + 0.2 * time, rtol=1e-12)
    np.testing.assert_allclose(run.channels["altitude"][:, 0], 300.0, rtol=1e-12)
    behind = simulate(model, time[:1], {"V": 2.0, "altitude": 300.0}, {**MASSES, "cg_x": -2.0})
    # Up at a point 2 m ahead of the CG: nose up.
    assert behind.channels["qdot"][0, 0] == pytest.approx(2.0 * weight / MASSES["Iyy"])


#: Terms that divide by the airspeed, of which nothing may be left at V = 0.
BY_AIRSPEED = {"CZ": "-4*alpha - 3*alphadot_hat", "Cl": "-0.4*p_hat - 0.1*beta", "Cm": "-8*q_hat"}


def test_a_body_begins_at_rest() -> None:
    """At V = 0 there is no division by the dynamic pressure: 100 N along x and 70 N m about x."""
    weight = MASSES["mass"] * GRAVITY
    spun = {"FX": "100", "MX": "70", "FY": f"-sin(phi)*{weight!r}", "FZ": f"-cos(phi)*{weight!r}"}
    own = database(spun, {})
    point = dict(zip(("cg_x", "cg_y", "cg_z"), REFERENCE.moment_reference, strict=True))
    time = np.arange(0.0, 4.001, 0.01)
    run = simulate(flight_model(own), time, {"altitude": 300.0}, {**MASSES, **point})
    np.testing.assert_allclose(run.channels["V"][:, 0], 0.2 * time, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(run.channels["p"][:, 0], 0.1 * time, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(run.channels["altitude"][:, 0], 300.0, rtol=1e-12)
    # Coefficients without dynamic pressure give no load, though hats and angles are over V.
    still = database({**spun, "FX": "0"}, BY_AIRSPEED)
    hung = simulate(flight_model(still), time, {"altitude": 300.0}, {**MASSES, **point})
    np.testing.assert_allclose(hung.channels["p"][:, 0], 0.1 * time, rtol=1e-9, atol=1e-12)
    assert all(np.isfinite(values).all() for values in hung.channels.values())


def test_a_flight_passes_through_rest() -> None:
    """Thrown upward at 4 m/s, tail first: V is 0 on a sample of its way, and nothing is NaN."""
    model = flight_model(database({"FX": "0.0*V"}, BY_AIRSPEED))
    rise = 4.0 / GRAVITY
    time = np.linspace(0.0, 2.0 * rise, 201)
    start = {"V": 4.0, "altitude": 300.0, "theta": np.pi / 2}
    run = simulate(model, time, start, {**MASSES, "cg_x": -2.0, "cg_y": 0.1, "cg_z": 0.2})
    top = 300.0 + 0.5 * GRAVITY * rise**2
    np.testing.assert_allclose(run.channels["altitude"][100, 0], top, rtol=1e-7)
    np.testing.assert_allclose(run.channels["V"][100, 0], 0.0, atol=1e-9)
    assert all(np.isfinite(values).all() for values in run.channels.values())


def test_a_database_without_loads_has_no_flight_at_rest() -> None:
    with pytest.raises(InputError, match="no airspeed"):
        simulate(flight_model(database({}, COEFFICIENTS)), np.zeros(1), {"V": 0.0}, MASSES)


def test_a_thrust_line_and_its_load_fly_alike() -> None:
    """Thrust 30 deg up through a point beside the moment reference, by either way."""
    point, up = np.array([-1.0, 0.4, -0.3]), np.deg2rad(30.0)
    direction = (np.cos(up), 0.0, -np.sin(up))
    arm = point - np.array(REFERENCE.moment_reference)
    force = np.array(direction)
    moment = np.cross(arm, force)
    thrust = "800*throttle"
    loads = {
        axis: f"({value!r})*{thrust}"
        for axis, value in zip(
            ("FX", "FY", "FZ", "MX", "MY", "MZ"), (*force.tolist(), *moment.tolist()), strict=True
        )
    }
    line = Propulsion(parse(thrust), tuple(point.tolist()), direction)
    models = (
        flight_model(database({}, COEFFICIENTS), engines=[line]),
        flight_model(database(loads, COEFFICIENTS)),
    )
    time = np.arange(0.0, 5.001, 0.01)
    series = {**MASSES, "throttle": 0.7 + 0.2 * np.sin(time), "cg_x": -2.1}
    start = {"V": 45.0, "altitude": 500.0, "alpha": 0.05}
    one, other = (simulate(model, time, start, series) for model in models)
    for name in ("V", "alpha", "q", "phi", "ax", "az"):
        np.testing.assert_allclose(one.channels[name], other.channels[name], rtol=1e-9, atol=1e-12)


def test_an_engine_holds_the_airspeed_of_a_trim() -> None:
    model = flight_model(database(LOADS, {**COEFFICIENTS, "Cm": "-0.6*alpha - 0.8*delta_elevator"}))
    about = {**MASSES, **dict(zip(("cg_x", "cg_y", "cg_z"), (-2.0, 0.1, 0.2), strict=True))}
    found = trim(model, Condition(45.0, 500.0), about, thrust="throttle")
    assert 0.0 < found.series["throttle"] < 1.0
    assert np.abs(found.problem.accelerations(np.asarray(found.point)[:, None])).max() < 1e-7


def test_points_without_a_stated_pressure_have_the_air_of_their_airspeed() -> None:
    own = database(LOADS, COEFFICIENTS)
    assert neutral_point(own)["qbar"] == pytest.approx(0.5 * 1.225, rel=1e-5)
    at = unstated_inputs(own, {"V": 40.0, "qbar": 800.0})
    assert at["rho"] == 1.0
    point = {name: np.array([value]) for name, value in {**at, "V": 40.0, "qbar": 800.0}.items()}
    evaluation = evaluate_database(own, point)
    assert evaluation.value["CX"][0] == pytest.approx(-0.03 - 0.2 * 40 / (800 * 12))
    plain = replace(build_up(), terms=(*build_up().terms, Term("more", "CX", parse("qbar*rho"))))
    assert (neutral_point(plain)["qbar"], neutral_point(plain)["rho"]) == (0.0, 0.0)


def test_slopes_by_dynamic_pressure_hold_the_loads() -> None:
    own = database({"FX": "600"}, {"CX": "-0.03"})
    slopes = slopes_by(own, "qbar", {"qbar": np.array([800.0])})
    assert slopes["CX"] == pytest.approx(-600 / (12 * 800.0**2), rel=1e-4)


def test_a_table_of_a_load_takes_no_increment() -> None:
    """Its share of the coefficient is over qbar: what is folded in would not be the increment."""
    text = """\
name = "tabled"
[reference]
area = 12.0
chord = 1.3
span = 9.0
moment_reference = [0, 0, 0]
[tables.T]
arguments = ["alpha"]
breakpoints = [[-0.2, 0.0, 0.2]]
values = [1.0, 2.0, 4.0]
[[terms]]
name = "pull"
axis = "FX"
expression = "T(alpha)"
"""
    more = Increment("CX", (parse("alpha"),), np.array([0.1]), np.eye(1))
    whole = replace(read_native(text), increments=(more,))
    assert not consolidate(whole).increments[0].folded[0]


def test_other_simulators_fly_the_same_loads() -> None:
    own = database(LOADS, COEFFICIENTS)
    cases = jsbsim_check_cases(own, 20)
    file = export_jsbsim(own, name="loaded", cases=cases)
    agreement = check_in_jsbsim(own, loaded_in_jsbsim(file), cases, input_properties(own))
    assert agreement.passed, agreement.errors
    rng = np.random.default_rng(5)
    for again in (import_jsbsim(file, name="again"), import_daveml(export_daveml(own), name="d")):
        x = {name: rng.uniform(0.2, 0.6, 6) for name in {*own.inputs, *again.inputs}}
        one, other = (each.predict(x).coefficients for each in (own, again))
        for axis in AXES:
            np.testing.assert_allclose(one[axis], other[axis], rtol=1e-9, atol=1e-12)


def test_a_document_gives_loads_back() -> None:
    own = database(LOADS, COEFFICIENTS)
    assert from_document(to_document(own)).terms == own.terms


def test_without_loads_nothing_changes() -> None:
    plain = build_up()
    assert plain.coefficient_terms is plain.terms
    assert not plain.has_loads
    assert "qbar" not in plain.inputs


def test_an_unknown_load_axis_is_refused_with_the_nearest() -> None:
    with pytest.raises(InputError, match=r"(?s)unknown axis 'FXX'.*'FX'"):
        database({"FXX": "1"}, {})
    more = Increment("FX", (parse("1"),), np.array([1.0]), np.eye(1))
    with pytest.raises(InputError, match="increments are on coefficients: CX"):
        replace(database(LOADS, {}), increments=(more,))
