"""DAVE-ML: NASA's HL-20 against its own check cases, and round trips.

The round trips are those of HL-20, of increments and of generated databases.
"""

from collections.abc import Callable
from pathlib import Path

import jsbsim
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lxml import etree

from aerodb.examples.phoenix.preflight import preflight_text
from aerodb.exchange.daveml.check_cases import read_check_cases, verify_cases
from aerodb.exchange.daveml.export import export_daveml
from aerodb.exchange.daveml.reader import import_daveml
from aerodb.exchange.jsbsim.reader import import_jsbsim
from aerodb.exchange.native import database_content_sha256, from_document, read_native, to_document
from aerodb.nomenclature import AXES
from aerodb.tables.database import AeroDatabase, Term, Variable
from aerodb.tables.expression import parse
from aerodb.tables.increment import Increment, Interval
from aerodb.tables.reference import ReferenceGeometry
from aerodb.tables.scattered import ScatteredTable
from aerodb.tables.table import Table
from aerodb.tables.uncertainty import Uncertainty

Measured = Callable[[str], Path]
BODY_FLAPS = ("upper_left", "upper_right", "lower_left", "lower_right")
BINDINGS = {"DLG": "90*delta_landing_gear"}
REFERENCE = ReferenceGeometry(area=10.3, chord=6.0, span=3.48, moment_reference=(-1.0, 0.0, 0.5))


def difference(one: AeroDatabase, other: AeroDatabase, points: dict[str, np.ndarray]) -> float:
    """Largest difference of a coefficient over max(|C|, 1): both must know the same inputs."""
    a, b = one.predict(points).coefficients, other.predict(points).coefficients
    return max(
        float(np.max(np.abs(a[axis] - b[axis]) / np.maximum(np.abs(a[axis]), 1.0))) for axis in AXES
    )


@pytest.fixture(scope="module")
def hl20_xml(measured: Measured) -> bytes:
    return measured("daveml/HL20_aero.dml").read_bytes()


@pytest.fixture(scope="module")
def hl20(hl20_xml: bytes) -> AeroDatabase:
    return import_daveml(hl20_xml, name="HL-20", bindings=BINDINGS)


def hl20_points(n: int) -> dict[str, np.ndarray]:
    """Random points inside the tables and around them."""
    rng = np.random.default_rng(20)
    ranges = {
        "V": (30, 300), "alpha": (-0.1, 0.6), "beta": (-0.3, 0.3), "mach": (0.1, 4.2), "height_above_ground": (0, 15),
        "delta_landing_gear": (0, 1), "p": (-2, 2), "q": (-2, 2), "r": (-2, 2),
        **dict.fromkeys((f"delta_{each}_body_flap" for each in BODY_FLAPS), (-1.1, 1.1)),
        **dict.fromkeys(("delta_left_wing_flap", "delta_right_wing_flap", "delta_rudder"), (-0.6, 0.6)),
    }  # fmt: skip
    return {name: rng.uniform(low, high, n) for name, (low, high) in ranges.items()}


def test_hl20_meets_all_its_static_shots_and_internal_signals(
    hl20: AeroDatabase, hl20_xml: bytes
) -> None:
    """25 shots with 8,616 internal signals: the outputs at the file's tolerances, the signals,
    which have none, at 1e-12."""
    cases = read_check_cases(hl20_xml)
    results = verify_cases(hl20, cases, relative=1e-12)
    assert [result.failures for result in results] == [()] * 25
    assert sum(result.internals for result in results) == 8616
    assert sum(result.outputs for result in results) == 250


def test_a_wrong_value_is_reported(hl20: AeroDatabase, hl20_xml: bytes) -> None:
    """The verification itself can fail: one node changed by a per cent is seen in signals and
    outputs."""
    table = (
        hl20.tables["CMB0_table"]
        if "CMB0_table" in hl20.tables
        else hl20.tables[sorted(hl20.tables)[40]]
    )
    values = table.values * 1.01 + 1e-4
    changed = Table(table.name, table.arguments, table.breakpoints, values)
    other = AeroDatabase(
        hl20.name,
        hl20.reference,
        hl20.variables,
        {**hl20.tables, table.name: changed},
        hl20.terms,
        free_inputs=hl20.free_inputs,
    )
    assert any(not result.passed for result in verify_cases(other, read_check_cases(hl20_xml)))


def test_hl20_coefficients_on_body_axes(hl20: AeroDatabase, hl20_xml: bytes) -> None:
    """The first shot through channels in SI: lift and drag are along the stability axes (NASA
    TM-107580), CY is a body axis."""
    shot = read_check_cases(hl20_xml)[0]
    outputs = {signal.identity: signal.value for signal in shot.outputs}
    alpha = np.radians(12.34)
    channels = dict.fromkeys(hl20.inputs, 0.0) | {
        "alpha": alpha, "mach": 0.8, "V": 300 * 0.3048, "height_above_ground": 20000 * 0.3048,
    }  # fmt: skip
    found = hl20.predict(channels).coefficients
    assert found["CX"][0] == pytest.approx(
        outputs["CL"] * np.sin(alpha) - outputs["CD"] * np.cos(alpha), rel=1e-6
    )
    assert found["CZ"][0] == pytest.approx(
        -outputs["CL"] * np.cos(alpha) - outputs["CD"] * np.sin(alpha), rel=1e-6
    )
    assert found["Cm"][0] == pytest.approx(outputs["CM"], abs=1e-6)
    assert hl20.reference.area == pytest.approx(286.45 * 0.3048**2)
    assert hl20.reference.moment_reference == pytest.approx((-0.54 * 28.24 * 0.3048, 0.0, 0.0))


def test_hl20_there_and_back(hl20: AeroDatabase) -> None:
    """Exported, imported again: equal at 10,000 points; the file's own check cases pass; a second
    trip adds nothing."""
    file = export_daveml(hl20)
    again = import_daveml(file, name="again")
    assert difference(hl20, again, hl20_points(10_000)) <= 1e-12
    results = verify_cases(again, read_check_cases(file))
    assert len(results) == 25
    assert all(result.passed and result.internals > 300 for result in results)
    twice = import_daveml(export_daveml(again), name="twice")
    assert set(twice.variables) == set(again.variables)
    assert to_document(from_document(to_document(again))) == to_document(again)


def test_increments_keep_their_envelope_in_the_file(hl20: AeroDatabase) -> None:
    """Inside the envelope, one cell beyond, while they fade and far outside: the same numbers."""
    increment = Increment(
        "Cm", (parse("1"), parse("alpha"), parse("max(alpha - 0.1, 0)*delta_rudder")), np.array([0.01, -0.2, 0.5]),
        np.eye(3) * 1e-4, {"alpha": Interval(0.0, 0.2, 0.05), "mach": Interval(0.5, 1.5, 0.3)}, ("f1",),
    )  # fmt: skip
    database = AeroDatabase(
        "updated",
        hl20.reference,
        hl20.variables,
        hl20.tables,
        hl20.terms,
        (increment,),
        hl20.free_inputs,
    )
    again = import_daveml(export_daveml(database), name="again")
    points = hl20_points(10_000)
    assert difference(database, hl20, points) > 1e-3
    assert difference(database, again, points) <= 1e-12


def test_phoenix_there_and_back() -> None:
    database = read_native(preflight_text())
    again = import_daveml(export_daveml(database, created="2026-01-01"), name="again")
    rng = np.random.default_rng(3)
    points = {name: rng.uniform(-0.3, 0.3, 2000) for name in database.inputs} | {
        "V": rng.uniform(40, 120, 2000)
    }
    points |= {
        name: rng.uniform(0.1, 20.0, 2000)
        for name in ("height_above_ground", "mach")
        if name in points
    }
    assert difference(database, again, points) <= 1e-12
    assert again.inputs == database.inputs


@pytest.mark.parametrize("aircraft", ["f16", "c172p", "737"])
def test_jsbsim_aircraft_become_daveml(aircraft: str) -> None:
    """Wind axes, free inputs and stacked tables of aircraft that were made for another program."""
    file = Path(jsbsim.get_default_root_dir()) / "aircraft" / aircraft / f"{aircraft}.xml"
    database = import_jsbsim(file.read_bytes(), name=aircraft)
    again = import_daveml(export_daveml(database), name=aircraft)
    rng = np.random.default_rng(5)
    points = {name: rng.uniform(-0.3, 0.5, 2000) for name in again.inputs}
    points |= {
        name: rng.uniform(0.2, 0.9, 2000) for name in ("mach", "rho", "qbar") if name in points
    }
    points["V"] = rng.uniform(40, 150, 2000)
    assert set(again.inputs) >= set(database.inputs)
    assert difference(database, again, points) <= 1e-12


FUNCTIONS = (
    "abs(alpha - 0.1)", "min(alpha, beta, mach)", "sqrt(mach)", "exp(alpha)", "log(mach)", "log10(mach)",
    "sin(beta)", "tan(alpha)",
    "asin(alpha)", "atan2(alpha, mach)", "sign(beta)", "step(alpha - 0.1)", "clip(alpha, -0.1, 0.1)", "tanh(alpha)",
    "acosh(1 + mach)",
    "floor(10*alpha)", "ceil(10*beta)", "rem(10*alpha, 3)", "root(beta, 3)", "mach^1.5", "-alpha^2",
    "piecewise(alpha, alpha < beta, beta)", "piecewise(1, and(alpha > 0, beta > 0), 2, or(mach >= 0.5, not(beta <= 0)), 3)",
    "(alpha != beta)*2 - (mach == 0.5)", "q_hat*alpha", "S_ref/b_ref^2",
)  # fmt: skip


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 2**32 - 1))
def test_any_database_comes_back_equal(seed: int) -> None:
    """Generated databases: body or wind axes, all functions, tables of every kind, free inputs,
    uncertainty, increments."""
    rng = np.random.default_rng(seed)
    database = generated(rng)
    file = export_daveml(database, check_cases=3)
    again = import_daveml(file, name="again")
    points = {name: rng.uniform(-0.4, 0.4, 300) for name in database.inputs}
    points |= {
        "V": rng.uniform(20, 80, 300),
        "mach": rng.uniform(0.1, 0.9, 300),
        "alpha": rng.uniform(-0.5, 0.5, 300),
    }
    points |= {name: points.get(name, np.zeros(300)) for name in again.inputs}
    assert difference(database, again, points) <= 1e-12
    assert all(result.passed for result in verify_cases(again, read_check_cases(file)))
    assert {name: table.uncertainty for name, table in again.tables.items()} == {
        name: table.uncertainty for name, table in database.tables.items()
    }
    stored = from_document(to_document(again))
    assert to_document(stored) == to_document(again)
    assert database_content_sha256(stored) == database_content_sha256(again)


def generated(rng: np.random.Generator) -> AeroDatabase:
    """A database with a random structure."""
    axes = [np.cumsum(rng.uniform(0.05, 0.3, rng.integers(2, 5))) - 0.5 for _ in range(3)]
    words = [tuple(rng.choice(["linear", "discrete", "floor", "ceiling"], 2)) for _ in range(2)]
    doubt = Uncertainty(
        "additive",
        "normal",
        (tuple(rng.uniform(0, 1, axes[0].size).tolist()),),
        2.0,
        (),
        (("x", 0.5),),
    )
    tables = {
        "T1": Table(
            "T1",
            ("alpha",),
            axes[:1],
            rng.normal(size=axes[0].size),
            extrapolation=("both",),
            uncertainty=doubt,
        ),
        "T2": Table(
            "T2", ("alpha", "beta"), axes[:2], rng.normal(size=[a.size for a in axes[:2]]), words[0]
        ),
        "T3": Table(
            "T3",
            ("a", "b", "m"),
            axes,
            rng.normal(size=[a.size for a in axes]),
            extrapolation=("min", "neither", "max"),
        ),
    }
    scattered = {
        "P": ScatteredTable(
            "P", ("alpha", "beta"), rng.uniform(-0.4, 0.4, (9, 2)), rng.normal(size=9)
        )
    }
    calls = [
        "T1(alpha)",
        "T2(alpha, beta)",
        "T3(alpha, 2*beta, mach - 0.5)",
        "P(alpha, beta)",
        "P(x, fuel_state)",
        "T1(y)",
    ]
    first, second = (str(text) for text in rng.permutation([*FUNCTIONS, *calls[:4]])[:2])
    chosen = [str(text) for text in rng.permutation([*FUNCTIONS, *calls])[:12]]
    variables = {
        "x": Variable(
            parse(first), uncertainty=Uncertainty("percentage", "uniform", (5.0, "bound"))
        ),
        "y": Variable(
            parse(f"max({second}, -0.2)"), "deg", "limited", {"id": "why so", "sign": "up"}
        ),
        "bound": Variable(parse("-2.5")),
    }
    pool = AXES if rng.random() < 0.5 else ("C_drag", "C_lift", "C_side", "CY", "Cm")
    terms = [
        Term(f"t{k}", str(rng.choice(pool)), parse(f"{text}*{rng.normal():.3f}"))
        for k, text in enumerate(chosen)
    ]
    envelope = {"alpha": Interval(-0.1, 0.2, 0.1), "beta": Interval(0.0, 0.1, 0.0)}
    increment = Increment(
        "CZ", (parse("alpha"), parse("q_hat")), rng.normal(size=2), np.eye(2), envelope
    )
    terms += [Term("last", "Cm", parse("x + y - fuel_state"))]
    free = {"fuel_state": "share of fuel left [nd]"}
    return AeroDatabase(
        "g", REFERENCE, variables, tables, tuple(terms), (increment,), free, scattered=scattered
    )


def test_the_file_states_what_it_means() -> None:
    """Axes, units, signs and moment reference stand in the file; its receiver needs no manual of
    ours."""
    database = AeroDatabase(
        "s", REFERENCE, terms=(Term("a", "Cm", parse("-0.3*alpha + 0.1*delta_rudder")),)
    )
    root = etree.fromstring(export_daveml(database))
    known = {element.get("varID"): element for element in root.iter("{*}variableDef")}
    assert (
        known["alpha"].get("name"),
        known["alpha"].get("units"),
        known["alpha"].get("sign"),
    ) == (
        "angleOfAttack",
        "rad",
        "anu",
    )
    assert known["delta_rudder"].get("sign") == "tel"
    assert known["Cm"].get("name") == "aeroBodyMomentCoefficient_Pitch"
    assert float(known["moment_reference_x"].get("initialValue")) == -1.0
    text = root.findtext("{*}fileHeader/{*}description")
    assert "Moments about (-1, 0, 0.5) m" in text
    assert len(root.findall("{*}checkData/{*}staticShot")) == 25


def test_a_database_that_is_finite_nowhere_has_no_check_cases() -> None:
    database = AeroDatabase("s", REFERENCE, terms=(Term("a", "Cm", parse("sqrt(-1 - alpha^2)")),))
    assert read_check_cases(export_daveml(database)) == ()
