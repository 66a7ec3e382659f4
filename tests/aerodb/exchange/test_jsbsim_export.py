"""Exports to JSBSim: equal coefficients inside JSBSim, and again after an import."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from lxml import etree

from aerodb.errors import InputError
from aerodb.exchange.daveml.reader import import_daveml
from aerodb.exchange.increment_terms import with_increments_as_terms
from aerodb.exchange.jsbsim.check_cases import (
    JsbsimAgreement,
    check_in_jsbsim,
    fly_cases,
    jsbsim_check_cases,
)
from aerodb.exchange.jsbsim.export import export_jsbsim, input_properties
from aerodb.exchange.jsbsim.reader import import_jsbsim
from aerodb.nomenclature import AXES
from aerodb.storage.writers.jsbsim_executive import loaded_in_jsbsim
from aerodb.tables.analysis.check_cases import CheckCase
from aerodb.tables.database import AeroDatabase, Term, Variable
from aerodb.tables.expression import parse
from aerodb.tables.increment import Increment, Interval
from aerodb.tables.reference import ReferenceGeometry
from aerodb.tables.scattered import ScatteredTable
from aerodb.tables.table import Table
from tests.support.jsbsim_flights import INCH, aircraft_file, random_condition, simulator

REFERENCE = ReferenceGeometry(12.5, 1.4, 9.1, (-2.31, 0.04, 0.37))
ARGUMENTS = (
    "alpha",
    "beta",
    "mach",
    "delta_elevator",
    "delta_body_flap",
    "camber",
    "2*alpha + 0.1",
    "abs(beta)",
    "q_hat",
)
FACTORS = (
    "1",
    "camber",
    "q*c_ref/V",
    "p_hat",
    "delta_landing_gear*abs(beta)",
    "sign(beta)*sqrt(abs(beta))",
    "clip(alpha, -0.1, 0.2)^2",
    "piecewise(alpha, alpha > 0.1 , 0.1)",
    "piecewise(1, mach < 0.4, mach, mach < 0.6 , 2*mach)",
    "(alpha >= 0)*(beta != 0) + not(and(alpha < 0.1, or(beta > 0, beta <= -0.1)))",
    "tanh(3*alpha) + asinh(beta) + sinh(alpha) - cosh(beta)",
    "min(alpha, beta, 0.05)*max(alpha, -beta)",
    "-rem(10*alpha, 0.3) + floor(5*alpha) - ceil(7*beta)",
    "root(alpha, 3) + atan2(alpha, 0.3) - exp(-alpha)*log(1.5 + alpha)",
    "step(-alpha)/(1 + qbar/10000) + S_ref/b_ref",
)
WIND, BODY = ("C_drag", "C_side", "C_lift"), ("CX", "CY", "CZ")


def random_table(name: str, rng: np.random.Generator, dimensions: int) -> Table:
    """Axes of one to four breakpoints, some not linear, some extrapolated."""
    axes = [np.cumsum(rng.uniform(0.05, 0.3, rng.integers(1, 5))) - 0.4 for _ in range(dimensions)]
    ways = [
        str(rng.choice(["linear", "linear", "linear", "discrete", "floor", "ceiling"]))
        for _ in axes
    ]
    beyond = [
        str(rng.choice(["neither", "min", "max", "both"]))
        if way == "linear" and k < 3
        else "neither"
        for k, way in enumerate(ways)
    ]
    values = rng.normal(0, 0.1, [axis.size for axis in axes])
    labels = tuple(f"argument {k}" for k in range(dimensions))
    beyond = [word if axis.size > 1 else "neither" for word, axis in zip(beyond, axes, strict=True)]
    return Table(name, labels, tuple(axes), values, tuple(ways), tuple(beyond))


def random_database(seed: int) -> AeroDatabase:
    """Terms of tables of up to five dimensions times factors, on body, wind or mixed axes, with
    variables and free inputs."""
    rng = np.random.default_rng(seed)
    axes = (BODY, WIND, BODY + WIND)[seed % 3] + ("Cl", "Cm", "Cn")
    tables = {f"T{k}": random_table(f"T{k}", rng, int(rng.integers(1, 6))) for k in range(5)}
    variables = {
        "twist": Variable(parse(str(rng.choice(FACTORS))), "1", "used by <others> & more"),
        "curve": Variable(
            parse(
                "twist*0.5 + T0("
                + ", ".join(rng.choice(ARGUMENTS, len(tables["T0"].arguments)))
                + ")"
            )
        ),
    }
    terms = []
    for k, axis in enumerate(axes):
        table = tables[f"T{rng.integers(5)}"]
        arguments = ", ".join(rng.choice([*ARGUMENTS, "curve"], len(table.arguments)))
        text = f"-0.3*{table.name}({arguments})*({rng.choice(FACTORS)}) + twist - curve/4"
        terms.append(Term(f"{axis} of part {k}", axis, parse(text)))
    terms.append(Term("constant", axes[0], parse("0.02")))
    arguments = ", ".join(["camber"] * len(tables["T1"].arguments))
    terms.append(
        Term("camber", axes[1], parse(f"T1({arguments})*twist"))
    )  # its table must not take the input's name
    free = {"camber": "as the source has it, 0 to 1"}
    return AeroDatabase(
        f"generated {seed}", REFERENCE, variables, tables, tuple(terms), free_inputs=free
    )


def agreement(database: AeroDatabase, cases: list[CheckCase]) -> JsbsimAgreement:
    xml = export_jsbsim(database, name="exported", cases=cases)
    return check_in_jsbsim(database, loaded_in_jsbsim(xml), cases, input_properties(database))


def imported_again(database: AeroDatabase, n: int, seed: int) -> float:
    """Largest difference after export and import, at random points, over max(|C|, 1e-3)."""
    again = import_jsbsim(export_jsbsim(database, name="exported"), name="again")
    cases = jsbsim_check_cases(database, n, seed)
    channels = {name: np.array([case.inputs[name] for case in cases]) for name in database.inputs}
    channels |= {"alpha": np.zeros(n), "beta": np.zeros(n)} if not channels else {}
    before, after = (each.predict(channels).coefficients for each in (database, again))
    return max(
        float(np.max(np.abs(after[axis] - before[axis]) / np.maximum(np.abs(before[axis]), 1e-3)))
        for axis in AXES
    )


@pytest.mark.parametrize("seed", range(24))
def test_generated_databases_inside_jsbsim_and_imported_again(seed: int) -> None:
    database = random_database(seed)
    found = agreement(database, jsbsim_check_cases(database, 12, seed))
    assert found.passed, found
    assert set(found.followed) <= {"alphadot"}
    assert imported_again(database, 200, seed) <= 1e-12


@pytest.mark.parametrize("aircraft", ["DHC6", "f16", "c172p", "737", "Concorde"])
def test_aircraft_of_jsbsim_come_back_the_same(aircraft: str) -> None:
    database = import_jsbsim(aircraft_file(aircraft), name=aircraft)
    assert agreement(database, jsbsim_check_cases(database, 30, 1)).passed
    assert imported_again(database, 500, 2) <= 1e-12


def test_an_export_flies_as_the_original_does() -> None:
    """Without this product in between: f16.xml and its export side by side inside JSBSim, at the
    same conditions."""
    database = import_jsbsim(aircraft_file("f16"), name="f16")
    original, export = simulator("f16"), loaded_in_jsbsim(export_jsbsim(database, name="f16"))
    rng = np.random.default_rng(51)
    conditions = [
        "h-sl-ft",
        "vt-fps",
        "alpha-deg",
        "beta-deg",
        "p-rad_sec",
        "q-rad_sec",
        "r-rad_sec",
    ]
    for _ in range(30):
        random_condition(original, rng)
        original.run_ic()
        for name in conditions:
            export[f"ic/{name}"] = original[f"ic/{name}"]
        for path, _scale in input_properties(database).values():
            if path.startswith(("fcs/", "gear/")):
                export[path] = original[path]
        export.run_ic()
        for axis in "xyz":
            assert export[f"forces/fb{axis}-aero-lbs"] == pytest.approx(
                original[f"forces/fb{axis}-aero-lbs"], rel=1e-9, abs=1e-6
            )
        assert moments_about_reference(export) == pytest.approx(
            moments_about_reference(original), rel=1e-9, abs=1e-5
        )


def moments_about_reference(executive: object) -> np.ndarray:
    """From JSBSim's centre of gravity to its aerodynamic reference point, in pounds and feet."""
    get = executive.__getitem__  # type: ignore[attr-defined]
    force, moment = (
        [get(path.format(axis)) for axis in axes]
        for path, axes in (("forces/fb{}-aero-lbs", "xyz"), ("moments/{}-aero-lbsft", "lmn"))
    )
    structural = [
        (get(f"inertia/cg-{axis}-in") - get(f"metrics/aero-rp-{axis}-in")) / 12 for axis in "xyz"
    ]
    arm = np.array(structural) * [-1, 1, -1]
    return np.asarray(moment) + np.cross(arm, force)


def increments() -> tuple[Increment, ...]:
    regressors = tuple(
        parse(text)
        for text in ("1", "alpha", "q_hat", "alpha*delta_elevator", "max(alpha - 0.1, 0)")
    )
    rng = np.random.default_rng(52)
    envelope = {
        "alpha": Interval(-0.05, 0.15, 0.04),
        "mach": Interval(0.3, 0.5, 0.0),
        "q_hat": Interval(-0.002, 0.003, 0.001),
    }
    wide = {"alpha": Interval(0.0, 0.2, 0.05), "delta_elevator": Interval(-0.1, 0.1, 0.1)}
    first = Increment(
        "CZ",
        regressors,
        rng.normal(0, 0.1, 5),
        np.eye(5) * 1e-4,
        envelope,
        ("f1", "f2"),
        "lift slope",
    )
    second = Increment("C_lift", regressors[1:4], rng.normal(0, 0.1, 3), np.eye(3) * 1e-4, wide)
    going_on = replace(first, axis="Cn", margins={"alpha": 0.1, "q_hat": 0.0})
    return first, second, replace(second, axis="Cm", envelope={}), going_on


def test_increments_keep_their_envelope_rule_inside_jsbsim() -> None:
    """On body and wind axes; alpha from far below to far above, so that every corner of the rule is
    met."""
    database = replace(random_database(3), increments=increments())
    assert agreement(database, jsbsim_check_cases(database, 60, 3)).passed
    assert imported_again(database, 400, 4) <= 1e-12
    cases = jsbsim_check_cases(database, 400, 5)
    channels = {name: np.array([case.inputs[name] for case in cases]) for name in database.inputs}
    plain, layered = (
        with_increments_as_terms(database).predict(channels),
        database.predict(channels),
    )
    for axis in AXES:
        assert plain.coefficients[axis] == pytest.approx(
            layered.coefficients[axis], rel=1e-13, abs=1e-15
        )
    bare = replace(database, increments=()).predict(channels).coefficients
    changed = np.abs(layered.coefficients["CZ"] - bare["CZ"])
    assert np.mean(changed > 1e-3) > 0.2
    assert np.mean(changed == 0.0) > 0.1


def test_the_file_says_what_it_holds() -> None:
    """Units and axes by independent numbers: 12.5 m2 are 134.549 ft2; the reference lies aft, right
    and down of the datum."""
    database = replace(random_database(1), increments=increments())
    cases = jsbsim_check_cases(database, 3, 0)
    root = etree.fromstring(export_jsbsim(database, name="glider & <co>", cases=cases))
    assert root.get("name") == "glider & <co>"
    assert float(root.findtext("metrics/wingarea")) == pytest.approx(134.5488802, rel=1e-9)
    assert float(root.findtext("metrics/chord")) == pytest.approx(4.593175853, rel=1e-9)
    point = [float(root.findtext(f"metrics/location/{axis}")) for axis in "xyz"]
    assert point == pytest.approx([2.31 / INCH, 0.04 / INCH, -0.37 / INCH], rel=1e-12)
    said = " ".join(element.text for element in root.iter("documentation"))
    for words in (
        "AERORP",
        "x aft",
        "trailing edge down",
        "aerodb/channel/delta_body_flap",
        "as the source has it",
        "f1, f2",
    ):
        assert words in said
    written = root.findall("check_cases/case")
    assert [float(each.text) for each in written[2].findall("output")] == [
        cases[2].coefficients[axis] for axis in AXES
    ]
    assert {each.get("name"): float(each.text) for each in written[1].findall("input")} == cases[
        1
    ].inputs


def test_a_wrong_number_in_the_file_fails_the_check() -> None:
    database = import_jsbsim(aircraft_file("DHC6"), name="DHC6")
    cases = jsbsim_check_cases(database, 20, 0)
    xml = export_jsbsim(database, name="exported", cases=cases)
    before, after = (
        b'<location name="AERORP" unit="IN">\n      <x>211.8</x>',
        b'<location name="AERORP" unit="IN">\n      <x>200.0</x>',
    )
    assert before in xml
    found = check_in_jsbsim(
        database, loaded_in_jsbsim(xml.replace(before, after)), cases, input_properties(database)
    )
    assert not found.passed
    assert found.errors["Cm"] > 1e-3 > 1e-9 > found.errors["CZ"]


def test_an_aircraft_at_rest_has_no_force_and_no_nan() -> None:
    executive = loaded_in_jsbsim(export_jsbsim(random_database(2), name="exported"))
    executive.run_ic()
    assert [executive[f"forces/fb{axis}-aero-lbs"] for axis in "xyz"] == [0, 0, 0]
    assert np.isfinite(executive["aero/alphadot-rad_sec"])


def test_a_case_does_not_depend_on_the_one_before_it() -> None:
    """JSBSim turns angles one after another from where they stand: steep ones on top of steep ones
    leave its range."""
    rng = np.random.default_rng(5)
    database = AeroDatabase(
        "steep", REFERENCE, terms=(Term("t", "CZ", parse("-4*alpha + beta + 0.1*q_hat")),)
    )
    steep = {"alpha": 1.4, "beta": 1.4, "phi": 0.5, "theta": 0.5}
    conditions = [
        {
            "V": 100.0,
            "rho": 1.0,
            "mach": 0.3,
            "q": 0.1,
            **{name: float(rng.uniform(-most, most)) for name, most in steep.items()},
        }
        for _ in range(200)
    ]
    executive = loaded_in_jsbsim(export_jsbsim(database, name="exported"))
    flown = fly_cases(executive, conditions, input_properties(database), REFERENCE)
    for name in ("alpha", "beta"):
        np.testing.assert_allclose(
            flown.inputs[name], [condition[name] for condition in conditions], atol=1e-9
        )
    assert np.isfinite(flown.coefficients["CZ"]).all()


def test_what_jsbsim_cannot_carry_is_refused_by_name() -> None:
    points = np.array([[0.0, 0.0], [0.1, 0.0], [0.0, 0.1], [0.1, 0.1]])
    scattered = {"cloud": ScatteredTable("cloud", ("alpha", "beta"), points, np.arange(4.0))}
    database = AeroDatabase(
        "d", REFERENCE, terms=(Term("t", "CX", parse("cloud(alpha, beta)")),), scattered=scattered
    )
    with pytest.raises(
        InputError, match="table 'cloud' on scattered points has no equivalent in JSBSim"
    ):
        export_jsbsim(database, name="d")
    with pytest.raises(InputError, match="no check cases"):
        check_in_jsbsim(database, None, [], {})
    with pytest.raises(InputError, match="JSBSim cannot load the file"):
        loaded_in_jsbsim(b"<fdm_config name='x'/>")


def test_a_database_of_constants_alone() -> None:
    database = AeroDatabase(
        "constants",
        REFERENCE,
        terms=(Term("1 odd/name", "CX", parse("-0.03")), Term("m", "Cm", parse("0.01"))),
    )
    assert agreement(database, jsbsim_check_cases(database, 2, 0)).passed
    flown = fly_cases(loaded_in_jsbsim(export_jsbsim(database, name="c")), [{}], {}, REFERENCE)
    assert flown.coefficients["Cm"] == pytest.approx([0.01], rel=1e-12)


#: Names in NASA's file -> ours; its units are degrees, feet, and radians per second.
SHOT_INPUTS = {
    "angleOfAttack": "alpha",
    "angleOfSideslip": "beta",
    "mach": "mach",
    "trueAirspeed": "V",
    "heightOfCgWrtRwy": "height_above_ground",
    "bodyAngularRate_Roll": "p",
    "bodyAngularRate_Pitch": "q",
    "bodyAngularRate_Yaw": "r",
    **{
        f"{a}{b.title()}BodyFlapDeflection": f"delta_{a}_{b}_body_flap"
        for a in ("upper", "lower")
        for b in ("left", "right")
    },
    **{f"{side}WingFlapDeflection": f"delta_{side}_wing_flap" for side in ("left", "right")},
    "rudderDeflection": "delta_rudder",
    "landingGearExtension": "landingGearExtension",
}
MOMENTS = {"Roll": "Cl", "Pitch": "Cm", "Yaw": "Cn"}


def shots(xml: bytes) -> list[tuple[dict[str, float], dict[str, float]]]:
    """Inputs in SI and outputs of the file's static shots, read here by plain means."""
    found = []
    for shot in etree.fromstring(xml, etree.XMLParser(load_dtd=False, resolve_entities=False)).iter(
        "{*}staticShot"
    ):
        parts = []
        for tag in ("checkInputs", "checkOutputs"):
            rows = [
                [each.text.strip() for each in signal]
                for signal in shot.iterfind(f"{{*}}{tag}/{{*}}signal")
            ]
            parts.append({row[0]: (row[1], float(row[2])) for row in rows})
        units = {"deg": np.pi / 180, "f": 0.3048, "f_s": 0.3048, "nd": 1.0, "rad_s": 1.0}
        inputs = {
            SHOT_INPUTS[name]: value * units[unit] for name, (unit, value) in parts[0].items()
        }
        inputs["landingGearExtension"] = parts[0]["landingGearExtension"][1]
        found.append((inputs, {name: value for name, (_, value) in parts[1].items()}))
    return found


def test_hl20_from_daveml_passes_its_25_shots_inside_jsbsim(
    measured: Callable[[str], Path],
) -> None:
    """NASA's HL-20 in DAVE-ML, converted: JSBSim is brought to each static shot and gives its
    outputs, within the file's tolerance of 1e-6; lift and drag are along the stability axes."""
    xml = measured("daveml/HL20_aero.dml").read_bytes()
    database = import_daveml(xml, name="HL-20")
    executive = loaded_in_jsbsim(export_jsbsim(database, name="HL-20"))
    wanted = shots(xml)
    assert len(wanted) == 25
    flown = fly_cases(
        executive, [inputs for inputs, _ in wanted], input_properties(database), database.reference
    )
    for name in set(database.inputs) - {"V", "mach"}:
        assert flown.inputs[name] == pytest.approx(
            [inputs[name] for inputs, _ in wanted], rel=1e-9, abs=1e-9
        )
    c = flown.coefficients
    sine, cosine = np.sin(flown.inputs["alpha"]), np.cos(flown.inputs["alpha"])
    given = {
        "totalCoefficientOfLift": c["CX"] * sine - c["CZ"] * cosine,
        "totalCoefficientOfDrag": -c["CX"] * cosine - c["CZ"] * sine,
    }
    given |= {
        "aeroBodyForceCoefficient_Y": c["CY"],
        **{f"aeroBodyMomentCoefficient_{n}": c[axis] for n, axis in MOMENTS.items()},
    }
    for name, values in given.items():
        assert values == pytest.approx([outputs[name] for _, outputs in wanted], rel=0, abs=1e-6), (
            name
        )


def test_hl20_imported_again_and_at_random_points(measured: Callable[[str], Path]) -> None:
    database = import_daveml(measured("daveml/HL20_aero.dml").read_bytes(), name="HL-20")
    assert agreement(database, jsbsim_check_cases(database, 60, 0)).passed
    assert imported_again(database, 2000, 1) <= 1e-12
