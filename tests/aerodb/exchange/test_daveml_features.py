"""DAVE-ML features that HL-20 does not use, each with a small file, and files that are refused."""

import numpy as np
import pytest
from scipy.interpolate import LinearNDInterpolator

from aerodb.errors import InputError
from aerodb.exchange.daveml.check_cases import read_check_cases, verify_cases
from aerodb.exchange.daveml.export import export_daveml
from aerodb.exchange.daveml.reader import import_daveml
from aerodb.exchange.daveml.root_element import is_daveml
from aerodb.exchange.native import from_document, to_document
from aerodb.tables.database import AeroDatabase
from aerodb.tables.uncertainty import Uncertainty
from aerodb.tasks.steps.importing import read_database
from tests.support.daveml_samples import FRAME, pitch, small, variable

DEGREES = np.pi / 180
ALPHA, MACH = (
    np.array([-20.0, -5.0, 0.0, 2.5, 5.0, 12.0, 40.0]),
    np.array([0.1, 0.3, 0.3, 0.5, 0.8, 0.9, 2.0]),
)


def cm(
    database: AeroDatabase, alpha_deg: np.ndarray = ALPHA, mach: np.ndarray = MACH
) -> np.ndarray:
    """Cm at points."""
    return database.predict({"alpha": alpha_deg * DEGREES, "mach": mach}).coefficients["Cm"]


def read(body: str, output: str = "") -> AeroDatabase:
    """The database of a small file, which also survives export, import and storing."""
    database = import_daveml(small(body, output), name="small")
    again = import_daveml(export_daveml(database, check_cases=4), name="again")
    assert np.array_equal(cm(again), cm(database), equal_nan=True)
    stored = from_document(to_document(database))
    assert np.array_equal(cm(stored), cm(database), equal_nan=True)
    return database


def apply(operator: str, *operands: str) -> str:
    return f"<apply><{operator}/>{''.join(operands)}</apply>"


A, M = "<ci>ALP</ci>", "<ci> MACH </ci>"

MATH = [
    (apply("plus", A, M, "<cn>1</cn>"), lambda a, m: a + m + 1),
    (apply("minus", A), lambda a, m: -a),
    (apply("quotient", A, "<cn>2</cn>"), lambda a, m: a / 2),
    (apply("power", M, "<cn>2.5</cn>"), lambda a, m: m**2.5),
    (apply("root", "<degree><cn>3</cn></degree>", A), lambda a, m: np.cbrt(a)),
    (apply("root", M), lambda a, m: np.sqrt(m)),
    (apply("log", M), lambda a, m: np.log10(m)),
    (apply("log", "<logbase><cn>2</cn></logbase>", M), lambda a, m: np.log2(m)),
    (apply("ln", M), lambda a, m: np.log(m)),
    (apply("rem", A, "<cn>3</cn>"), lambda a, m: np.fmod(a, 3)),
    (apply("floor", apply("plus", A, "<cn>0.25</cn>")), lambda a, m: np.floor(a + 0.25)),
    (apply("ceiling", apply("plus", A, "<cn>0.25</cn>")), lambda a, m: np.ceil(a + 0.25)),
    (apply("max", A, M, "<cn>-1</cn>"), lambda a, m: np.maximum(np.maximum(a, m), -1)),
    (apply("sec", M), lambda a, m: 1 / np.cos(m)),
    (apply("coth", M), lambda a, m: 1 / np.tanh(m)),
    (apply("arccot", M), lambda a, m: np.arctan(1 / m)),
    (apply("arcsinh", A), lambda a, m: np.arcsinh(a)),
    ("<apply><csymbol>atan2</csymbol>" + A + M + "</apply>", lambda a, m: np.arctan2(a, m)),
    (apply("times", "<pi/>", "<cn type='rational'>1<sep/>4</cn>", M), lambda a, m: np.pi / 4 * m),
    (apply("plus", "<cn type='e-notation'>2<sep/>-3</cn>", M), lambda a, m: 0.002 + m),
    (apply("and", apply("lt", A, "<cn>5</cn>"), apply("geq", M, "<cn>0.3</cn>")), lambda a, m: (a < 5) & (m >= 0.3)),
    (apply("xor", apply("leq", A, "<cn>5</cn>"), apply("neq", M, "<cn>0.3</cn>")), lambda a, m: (a <= 5) ^ (m != 0.3)),
    (apply("lt", "<cn>0</cn>", M, A), lambda a, m: (m > 0) & (m < a)),
    (apply("not", apply("or", apply("gt", A, M), apply("eq", M, "<cn>0.5</cn>"))), lambda a, m: ~((a > m) | (m == 0.5))),
]  # fmt: skip


@pytest.mark.parametrize(("math", "formula"), MATH)
def test_mathml_functions(math: str, formula: object) -> None:
    found = cm(read("", math))
    assert found == pytest.approx(
        np.asarray(formula(ALPHA, MACH), dtype=float), rel=1e-12, abs=1e-13
    )  # type: ignore[operator]


def test_nested_piecewise_with_and_without_otherwise() -> None:
    """A piece's value is a piecewise of its own; a lone <piecewise> stands inside an <apply>, as
    HL-20 writes it."""
    inner = f"<piecewise><piece><cn>1</cn>{apply('lt', M, '<cn>0.5</cn>')}</piece><otherwise>{M}</otherwise></piecewise>"
    outer = f"<apply><piecewise><piece><cn>-2</cn>{apply('lt', A, '<cn>-2</cn>')}</piece>"
    outer += f"<piece>{inner}{apply('leq', A, '<cn>5</cn>')}</piece></piecewise></apply>"
    expected = np.where(ALPHA < -2, -2, np.where(ALPHA <= 5, np.where(MACH < 0.5, 1, MACH), np.nan))
    assert np.allclose(cm(read("", outer)), expected, equal_nan=True)


def test_variables_saturate_at_min_and_max() -> None:
    """Of an input, a calculation and a constant: a limiter downstream of each (AIAA S-119,
    variableDef)."""
    frame = FRAME.replace(
        'units="deg" sign="ANU"', 'units="deg" sign="ANU" minValue="-4" maxValue="10"'
    )
    body = variable(
        "X", f"<calculation><math>{apply('times', A, M)}</math></calculation>", maxValue="3"
    )
    body += variable("K", initialValue="7", maxValue="5")
    body += pitch(
        f"<calculation><math>{apply('plus', '<ci>X</ci>', '<ci>K</ci>')}</math></calculation>"
    )
    database = import_daveml(frame.format(body=body).encode(), name="limits")
    expected = np.minimum(np.clip(ALPHA, -4, 10) * MACH, 3) + 5
    assert cm(database) == pytest.approx(expected, rel=1e-13)
    assert cm(import_daveml(export_daveml(database), name="again")) == pytest.approx(
        expected, rel=1e-13
    )


def table(interpolate: str = "", values: str = "1, 3, 2", limits: str = "") -> str:
    words = f' interpolate="{interpolate}"' if interpolate else ""
    return (
        pitch()
        + f"""<breakpointDef name="a" bpID="A1" units="deg"><bpVals>0 5 10</bpVals></breakpointDef>
      <function name="f"><independentVarRef varID="ALP"{words} {limits}/><dependentVarRef varID="CM"/><functionDefn>
      <griddedTable name="t"><breakpointRefs><bpRef bpID="A1"/></breakpointRefs><dataTable>{values}</dataTable></griddedTable>
      </functionDefn></function>"""
    )


@pytest.mark.parametrize(
    ("body", "expected"),
    [
        (table(), [1, 1, 1, 2, 3, 2, 2]),
        (table(limits='extrapolate="min"'), [-7, -1, 1, 2, 3, 2, 2]),
        (table(limits='extrapolate="max"'), [1, 1, 1, 2, 3, 1.6, -4]),
        (table(limits='extrapolate="both" max="12"'), [-7, -1, 1, 2, 3, 1.6, 1.6]),
        (table(limits='min="2.5" max="7.5"'), [2, 2, 2, 2, 3, 2.5, 2.5]),
        (table("discrete"), [1, 1, 1, 3, 3, 2, 2]),
        (table("floor"), [1, 1, 1, 1, 3, 2, 2]),
        (table("ceiling"), [1, 1, 1, 3, 3, 2, 2]),
        (table(values="1,,3 <!-- 9, 9 --> ,\n 2.D0"), [1, 1, 1, 2, 3, 2, 2]),
    ],
)
def test_gridded_tables(body: str, expected: list[float]) -> None:
    """Interpolation, extrapolation and limits of an argument; numbers separated by anything
    (independentVarRef)."""
    assert cm(read(body)) == pytest.approx(expected, rel=1e-12)


def test_the_last_breakpoint_varies_fastest_up_to_six_dimensions() -> None:
    rng = np.random.default_rng(6)
    values = rng.normal(size=(2, 3, 2, 2, 2, 3))
    bps = "".join(
        "<breakpointDef"
        f' bpID="B{n}"><bpVals>{" ".join(map(str, range(n)))}</bpVals></breakpointDef>'
        for n in (2, 3)
    )
    names = [f"I{k}" for k in range(6)]
    body = bps + pitch() + "".join(variable(name, "<isInput/>") for name in names)
    body += '<function name="f">' + "".join(
        f'<independentVarRef varID="{name}"/>' for name in names
    )
    body += '<dependentVarRef varID="CM"/><functionDefn><griddedTable><breakpointRefs>'
    body += "".join(f'<bpRef bpID="B{n}"/>' for n in values.shape)
    body += f"</breakpointRefs><dataTable>{' '.join(map(repr, values.ravel().tolist()))}</dataTable></griddedTable></functionDefn>"
    database = import_daveml(small(body + "</function>"), name="six")
    nodes = np.indices(values.shape).reshape(6, -1).astype(float)
    found = database.predict(dict(zip(names, nodes, strict=True))).coefficients["Cm"]
    assert np.array_equal(found, values.ravel())


def test_legacy_point_lists() -> None:
    body = (
        pitch()
        + """<function name="old"><independentVarPts varID="ALP" name="a" units="deg">0, 5, 10</independentVarPts>
      <independentVarPts varID="MACH">0.2 0.6</independentVarPts>
      <dependentVarPts varID="CM">1, 2, 3, 4, 5, 6</dependentVarPts></function>"""
    )
    assert cm(read(body)) == pytest.approx([1, 1.25, 1.25, 2.75, 4, 6, 6], rel=1e-12)


def test_ungridded_tables_are_delaunay_and_held_at_the_hull() -> None:
    """Inside: scipy's linear interpolation of the scaled points. Outside: the value where the line
    to the middle leaves."""
    rng = np.random.default_rng(4)
    points = np.column_stack([rng.uniform(-10, 30, 12), rng.uniform(0.1, 1.5, 12)])
    values = rng.normal(size=12)
    rows = "".join(
        f"<dataPoint>{a!r}, {m!r} {v!r}</dataPoint>"
        for (a, m), v in zip(points.tolist(), values.tolist(), strict=True)
    )
    body = (
        pitch()
        + f'<ungriddedTableDef name="u" utID="U 1">{rows}</ungriddedTableDef><function name="f">'
    )
    body += (
        '<independentVarRef varID="ALP"/><independentVarRef varID="MACH"/><dependentVarRef'
        ' varID="CM"/>'
    )
    body += '<functionDefn><ungriddedTableRef utID="U 1"/></functionDefn></function>'
    database = read(body)
    a, m = rng.uniform(-15, 35, 500), rng.uniform(0.0, 1.6, 500)
    expected = LinearNDInterpolator(points, values, rescale=True)(a, m)
    found = database.predict({"alpha": a * DEGREES, "mach": m})
    inside = np.isfinite(expected)
    assert found.coefficients["Cm"][inside] == pytest.approx(expected[inside], rel=1e-9, abs=1e-9)
    assert np.array_equal(found.outside, ~inside)
    assert np.isfinite(found.coefficients["Cm"]).all()
    assert cm(database, points[:, 0], points[:, 1]) == pytest.approx(values, abs=1e-9)


def test_ungridded_tables_of_one_argument_are_sorted() -> None:
    rows = "".join(f"<dataPoint>{row}</dataPoint>" for row in ("10 2", "0 1", "5 3"))
    body = (
        pitch()
        + f"""<function name="f"><independentVarRef varID="ALP"/><dependentVarRef varID="CM"/><functionDefn>
      <ungriddedTable name="u">{rows}</ungriddedTable></functionDefn></function>"""
    )
    assert cm(read(body)) == pytest.approx([1, 1, 1, 2, 3, 2, 2], rel=1e-12)


def test_uncertainty_is_carried_and_written_again() -> None:
    """Normal with correlations, uniform with two bounds, bounds that a table or a variable
    gives."""
    body = table().replace(
        "<dataTable>",
        """<uncertainty effect="multiplicative"><normalPDF numSigmas="3"><bounds><dataTable>.1, .2 .3</dataTable></bounds>
        </normalPDF></uncertainty><dataTable>""",
    )
    body += variable("WIDTH", initialValue="0.1")
    body += variable(
        "K", """<uncertainty effect="additive"><normalPDF numSigmas="2"><bounds>0.5</bounds><correlatesWith varID="WIDTH"/>
        <correlation varID="L" corrCoef="-0.25"/></normalPDF></uncertainty>""", initialValue="1",
    )  # fmt: skip
    body += variable(
        "L", """<uncertainty effect="percentage"><uniformPDF symmetric="no"><bounds>5</bounds><bounds>
        <variableRef varID="WIDTH"/></bounds></uniformPDF></uncertainty>""", initialValue="1",
    )  # fmt: skip
    first = read(body)
    for database in (
        first,
        import_daveml(export_daveml(first), name="again"),
        from_document(to_document(first)),
    ):
        assert database.tables["t"].uncertainty == Uncertainty(
            "multiplicative", "normal", ((0.1, 0.2, 0.3),), 3.0
        )
        assert database.variables["K"].uncertainty == Uncertainty(
            "additive", "normal", (0.5,), 2.0, ("WIDTH",), (("L", -0.25),)
        )
        assert database.variables["L"].uncertainty == Uncertainty(
            "percentage", "uniform", (5.0, "WIDTH")
        )


def test_names_may_repeat_with_other_units_and_units_be_spelled_otherwise() -> None:
    """angleOfAttack in deg is the input, in rad an output beside it; the check case says which by
    its unit."""
    body = variable("ALP RAD", f"<calculation><math>{apply('times', A, '<cn>0.5</cn>')}</math></calculation><isOutput/>",
                    name="angleOfAttack", units="rad")  # fmt: skip
    body += pitch(
        f"<calculation><math>{apply('times', '<ci> ALP RAD </ci>', M)}</math></calculation>"
    )
    body += """<checkData><staticShot name="one"><checkInputs>
      <signal><signalName>angleOfAttack</signalName><signalUnits>deg</signalUnits><signalValue>4</signalValue></signal>
      <signal><signalName>mach</signalName><signalUnits>ND</signalUnits><signalValue>0.5</signalValue></signal></checkInputs>
      <internalValues><signal><varID>ALP RAD</varID><signalValue>2</signalValue></signal></internalValues><checkOutputs>
      <signal><signalName>angleOfAttack</signalName><signalUnits>rad</signalUnits><signalValue>2</signalValue><tol>1e-9</tol>
      </signal><signal><signalName>aeroBodyMomentCoefficient_Pitch</signalName><signalUnits></signalUnits>
      <signalValue>1.0</signalValue><tol>1e-9</tol></signal></checkOutputs></staticShot></checkData>"""
    file = small(body)
    (result,) = verify_cases(import_daveml(file, name="names"), read_check_cases(file))
    assert result.passed, result.failures
    assert (result.internals, result.outputs) == (1, 2)
    (wrong,) = verify_cases(
        import_daveml(file, name="names"), read_check_cases(file.replace(b">1.0<", b">1.1<"))
    )
    assert "CM is 1.0, expected 1.1" in wrong.failures[0]


def test_inputs_and_outputs_with_any_name_are_bound() -> None:
    body = variable("gear", "<isInput/>", units="deg", name="gearAngle")
    body += variable(
        "foo",
        f"<calculation><math>{apply('times', A, '<ci>gear</ci>')}</math></calculation><isOutput/>",
    )
    with pytest.raises(InputError, match="no output is a known coefficient"):
        import_daveml(small(body), name="f")
    database = import_daveml(
        small(body), name="f", bindings={"CZ": "-foo", "gearAngle": "90*delta_landing_gear"}
    )
    assert database.inputs == ("alpha", "delta_landing_gear")
    found = database.predict({"alpha": 2 * DEGREES, "delta_landing_gear": 0.5}).coefficients["CZ"]
    assert found == pytest.approx([-90.0], rel=1e-12)
    free = import_daveml(small(body), name="f", bindings={"CZ": "-foo"})
    assert free.inputs == ("alpha", "gearAngle")
    assert "[deg]" in free.free_inputs["gearAngle"]
    with pytest.raises(InputError, match="binding of 'geer'"):
        import_daveml(small(body), name="f", bindings={"CZ": "foo", "geer": "1"})


def test_signs_against_ours_are_turned() -> None:
    body = variable("DE", "<isInput/>", name="elevatorDeflection", units="deg", sign="TEU")
    body += variable("CN", "<calculation><math><ci>DE</ci></math></calculation><isOutput/>",
                     name="aeroBodyForceCoefficient_Z", sign="UP")  # fmt: skip
    database = import_daveml(small(body), name="signs")
    assert database.predict({"delta_elevator": 3 * DEGREES}).coefficients["CZ"] == pytest.approx(
        [3.0]
    )


BOMB = '<!DOCTYPE DAVEfunc [<!ENTITY a "aaaaaaaaaa">' + "".join(
    f'<!ENTITY {chr(98 + k)} "{f"&{chr(97 + k)};" * 10}">' for k in range(9)
) + "]>"  # fmt: skip
TABLE_REF = (
    '<function name="f"><independentVarRef varID="ALP"/><dependentVarRef'
    ' varID="CM"/><functionDefn>{}</functionDefn></function>'
)


TOO_MANY = TABLE_REF.format("<ungriddedTable><dataPoint>1 2 3</dataPoint></ungriddedTable>")


@pytest.mark.parametrize(
    ("file", "message"),
    [
        (small("").replace(b"<DAVEfunc", BOMB.encode() + b"<DAVEfunc", 1), "declarations of its own|not valid XML"),
        (
            small("").replace(b"<DAVEfunc", b'<!DOCTYPE x [<!ENTITY e SYSTEM "file:///etc/passwd">]><DAVEfunc', 1)
            .replace(b"a small model", b"&e;"),
            "declarations of its own|entity",
        ),
        (small("<description " + f'a="{"x" * 20_000}"' + "/>"), "20000 characters in attribute 'a'"),
        (small("<description>" * 400 + "</description>" * 400), "not valid XML|nested elements"),
        (b"<html/>", "root element <html>"),
        (b"\xff\xfe\x00", "not valid XML"),
        (small("<dynamics/>"), "unsupported element <dynamics>"),
        (small(variable("X", "<calculation><math><apply><factorial/><ci>ALP</ci></apply></math></calculation>")), "<factorial>"),
        (small(variable("X", "<calculation><script/></calculation>")), "<calculation> without one <math>"),
        (small("", "<ci>NOBODY</ci>"), "no variableDef 'NOBODY'"),
        (small("", "<apply><csymbol>evil</csymbol><ci>ALP</ci></apply>"), "<csymbol> 'evil'"),
        (small("", "<cn>__import__('os')</cn>"), "is not a number"),
        (small("", "<cn>1e999</cn>"), "too large"),
        (small("", "<apply>" * 120 + "<ci>ALP</ci>" + "</apply>" * 120), "levels of nesting"),
        (small("", "<ci>CM</ci>"), "defined by each other"),
        (small(table("cubicSpline")), "interpolate='cubicSpline'"),
        (small(table("discrete", limits='extrapolate="both"')), "extrapolation of an axis that is discrete"),
        (small(table(values="1 2")), "2 numbers in <dataTable>, the breakpoints need 3"),
        (small(table().replace("0 5 10", "0 10 5")), "do not increase"),
        (small(pitch() + TABLE_REF.format('<griddedTableRef gtID="none"/>')), "no table 'none'"),
        (small(pitch() + TOO_MANY), "1 independent variable"),
        (small(variable("ALP")), "duplicate variableDef 'ALP'"),
        (small(pitch()).replace(b'units="deg" sign="ANU"', b'units="deg" sign="sideways"'), "cannot be alpha"),
        (small(pitch()).replace(b"referenceWingArea", b"someArea"), "no variable named referenceWingArea"),
    ],
)  # fmt: skip
def test_what_cannot_be_understood_is_refused_by_name(file: bytes, message: str) -> None:
    with pytest.raises(InputError, match=message):
        import_daveml(file, name="bad")


def test_the_kind_of_a_file_is_seen_in_its_first_element() -> None:
    assert is_daveml(b"<!-- <fdm_config> --><?x?><!DOCTYPE DAVEfunc><d:DAVEfunc xmlns:d='x'/>")
    assert not is_daveml(b"<fdm_config><DAVEfunc/></fdm_config>")
    database = read_database(small(table()), "small.xml", {})
    assert cm(database) == pytest.approx([1, 1, 1, 2, 3, 2, 2], rel=1e-12)
