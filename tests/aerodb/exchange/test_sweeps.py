"""Sweeps as CSV, text, MAT and Excel: one round of questions, and the lattice that filled them comes back."""

import io
import zipfile

import numpy as np
import pytest
from scipy.io import savemat

from aerodb.errors import InputError, OpenQuestionsError
from aerodb.exchange import KnownVehicle, import_code
from aerodb.tables import AeroDatabase, ReferenceGeometry, curves, lacking_effects
from tests.aerodb.exchange.test_avl import predicted
from tests.support import vortex_lattice as lattice
from tests.support.code_files import wind

OWN = KnownVehicle(
    ReferenceGeometry(lattice.AREA, lattice.CHORD, lattice.SPAN, (-0.08, 0.0, -0.02)), True, {}
)
ALPHAS, BETAS = (-2.0, 2.0, 6.0), (-4.0, 0.0, 4.0)
POINTS = [(a, b) for a in ALPHAS for b in BETAS]


def imported(name: str, data: bytes, **bindings: str) -> AeroDatabase:
    return import_code([(name, data)], "plane", bindings=bindings, vehicle=OWN)


def asked(name: str, data: bytes, **bindings: str) -> dict[str, tuple]:
    with pytest.raises(OpenQuestionsError) as caught:
        imported(name, data, **bindings)
    return {question.name: question.proposals for question in caught.value.questions}


def rows(kind: str) -> tuple[list[str], list[list[float]]]:
    """Columns of the lattice as a CFD code (x aft, y right, z up), a tunnel or a body-axis table gives them."""
    found = []
    for a, b in POINTS:
        c = lattice.at(a, b)
        w, r = wind(c, a, b), np.deg2rad(a)
        ca, sa = np.cos(r), np.sin(r)
        if kind == "cfd":
            found.append([a, b, w["CL"], w["CD"], w["CS"], -c["Cl"], c["Cm"], -c["Cn"]])
        elif kind == "stability":
            drag, lift = -c["CX"] * ca - c["CZ"] * sa, c["CX"] * sa - c["CZ"] * ca
            roll, yaw = c["Cl"] * ca + c["Cn"] * sa, c["Cn"] * ca - c["Cl"] * sa
            found.append([a, b, lift, drag, c["CY"], roll, c["Cm"], yaw])
        else:
            found.append([r, np.deg2rad(b), *(c[n] for n in lattice.AXES)])
    names = {
        "cfd": ["AoA", "Beta", "CL", "CD", "CSF", "CMx", "CMy", "CMz"],
        "stability": ["alpha [deg]", "beta [deg]", "CL", "CD", "CY", "Cll", "Cm", "Cn"],
        "body": ["alpha [rad]", "beta [rad]", "CX", "CY", "CZ", "Cll", "Cm", "Cn"],
    }
    return names[kind], found


def text(kind: str, separator: str = ",", above: str = "") -> bytes:
    names, values = rows(kind)
    lines = [separator.join(names), *(separator.join(f"{x:.10g}" for x in row) for row in values)]
    return (above + "\n".join(lines) + "\n").encode()


def same(database: AeroDatabase) -> None:
    for alpha, beta in POINTS:
        assert predicted(database, alpha, beta) == pytest.approx(lattice.at(alpha, beta), abs=1e-8)


CFD = {
    "csf": "C_side",
    "cmx": "-Cl",
    "cmy": "Cm",
    "cmz": "-Cn",
    "force_axes": "wind",
    "moment_axes": "body",
}


def test_all_is_asked_in_one_round_and_answers_give_the_lattice() -> None:
    data = text("cfd")
    open_ = asked("cfd.csv", data)
    assert set(open_) == {*CFD, "reference"}
    assert [answer for answer, _ in open_["cmz"]] == ["-Cn", "Cn", "skip"]
    assert imported("cfd.csv", data, **CFD, reference="vehicle").free_inputs == {}
    same(imported("cfd.csv", data, **CFD, reference="vehicle"))


@pytest.mark.parametrize(
    ("separator", "above"),
    [(";", ""), ("\t", "# tunnel, run 12\n"), ("  ", "% solver 7\n# "), (", ", "")],
)
def test_text_of_any_separator_and_titles(separator: str, above: str) -> None:
    same(imported("cfd.txt", text("cfd", separator, above), **CFD, reference="vehicle"))


def test_stability_axes_are_turned() -> None:
    data = text("stability")
    open_ = asked("t.csv", data)
    assert set(open_) == {"cy", "cll", "cn", "force_axes", "moment_axes", "reference"}
    bound = {
        "cy": "CY",
        "cll": "Cl",
        "cn": "Cn",
        "moment_axes": "stability",
        "reference": "vehicle",
    }
    same(imported("t.csv", data, **bound))
    wrong = imported("t.csv", data, **{**bound, "moment_axes": "body"})
    assert predicted(wrong, 6.0, 4.0)["Cn"] != pytest.approx(lattice.at(6.0, 4.0)["Cn"], abs=1e-5)


def test_body_axes_in_radians() -> None:
    bound = {"cx": "CX", "cy": "CY", "cz": "CZ", "cll": "Cl", "cn": "Cn", "moment_axes": "body"}
    same(imported("b.csv", text("body"), **bound, reference="vehicle"))


def test_small_angles_without_a_unit_are_asked() -> None:
    data = text("body").replace(b" [rad]", b"")
    assert "angle_unit" in asked("b.csv", data)
    bound = {"cx": "CX", "cy": "CY", "cz": "CZ", "cll": "Cl", "cn": "Cn", "moment_axes": "body"}
    same(imported("b.csv", data, **bound, reference="vehicle", angle_unit="rad"))


def test_a_deflection_is_an_axis_in_its_own_unit() -> None:
    lines = ["alpha,elevator,CL,CD,Cm"]
    for a in ALPHAS:
        for e in (-5.0, 0.0, 5.0):
            c = lattice.at(a, elevator=e)
            w = wind(c, a, 0.0)
            lines.append(f"{a},{-e},{w['CL']:.10g},{w['CD']:.10g},{c['Cm']:.10g}")
    data = "\n".join(lines).encode()
    open_ = asked("e.csv", data)
    assert [answer for answer, _ in open_["elevator"]][-1] == "skip"
    bound = {"elevator": "-57.29577951308232*delta_elevator", "reference": "vehicle"}
    database = imported("e.csv", data, **bound)
    for e in (-5.0, 5.0):
        wanted = lattice.at(2.0, elevator=e)
        got = predicted(database, 2.0, elevator=e)
        assert [got[n] for n in ("CX", "CZ", "Cm")] == pytest.approx(
            [wanted[n] for n in ("CX", "CZ", "Cm")], abs=1e-8
        )
    assert "elevator" not in lacking_effects(database)


def mat(**variables: object) -> bytes:
    file = io.BytesIO()
    savemat(file, variables)
    return file.getvalue()


def test_breakpoints_and_tables_of_a_mat_file() -> None:
    lift = np.array([[wind(lattice.at(a, b), a, b)["CL"] for b in (-4.0, 4.0)] for a in ALPHAS])
    drag = np.array([[wind(lattice.at(a, b), a, b)["CD"] for b in (-4.0, 4.0)] for a in ALPHAS])
    pitch = np.array([[lattice.at(a, b)["Cm"] for b in (-4.0, 4.0)] for a in ALPHAS])
    data = mat(
        alpha_bp=np.array(ALPHAS), beta_bp=np.array([-4.0, 4.0]), CL_table=lift, CD_table=drag, Cm_table=pitch,
        Sref=0.6, cbar=0.2, b=3.0,
    )  # fmt: skip
    bound = {"force_axes": "wind", "x_ref": "-0.08", "y_ref": "0", "z_ref": "-0.02"}
    database = imported("m.mat", data, **bound)
    assert database.reference == OWN.reference
    for k, a in enumerate(ALPHAS):
        got = predicted(database, a, 4.0)
        assert got["Cm"] == pytest.approx(pitch[k, 1], abs=1e-12)
        assert wind(got, a, 4.0)["CL"] == pytest.approx(lift[k, 1], abs=1e-12)


def test_columns_of_a_mat_file() -> None:
    names, values = rows("cfd")
    same(
        imported(
            "m.mat",
            mat(**dict(zip(names, np.array(values).T, strict=True))),
            **CFD,
            reference="vehicle",
        )
    )


def workbook(shared: bool) -> bytes:
    """A workbook with a title row, names, numbers and a remark below, as spreadsheets write them."""
    names, values = rows("cfd")
    strings = ["Tunnel, run 12", *names, "end"]
    ns = 'xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main"'

    def cell(k: int, row: int, value: object) -> str:
        at = f"{chr(65 + k)}{row}"
        if isinstance(value, str):
            if shared:
                return f'<c r="{at}" t="s"><v>{strings.index(value)}</v></c>'
            return f'<c r="{at}" t="inlineStr"><is><t>{value}</t></is></c>'
        return f'<c r="{at}"><v>{float(value)!r}</v></c>'

    table = [["Tunnel, run 12"], names, *values, [], ["end"]]
    body = "".join(
        f'<row r="{r}">' + "".join(cell(k, r, v) for k, v in enumerate(row)) + "</row>"
        for r, row in enumerate(table, 1)
    )
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as book:
        book.writestr("xl/workbook.xml", f"<workbook {ns}/>")
        book.writestr(
            "xl/worksheets/sheet1.xml", f"<worksheet {ns}><sheetData>{body}</sheetData></worksheet>"
        )
        if shared:
            items = "".join(f"<si><t>{each}</t></si>" for each in strings)
            book.writestr("xl/sharedStrings.xml", f"<sst {ns}>{items}</sst>")
    return file.getvalue()


@pytest.mark.parametrize("shared", [False, True])
def test_a_workbook(shared: bool) -> None:
    same(imported("t.xlsx", workbook(shared), **CFD, reference="vehicle"))


CASES = {
    "one angle": (
        b"Time Cd Cs Cl Cd(f) Cd(r)\n1 2 3 4 5 6\n2 2 3 4 5 6\n",
        "no column is the angle",
    ),
    "hole": (text("cfd").replace(text("cfd").splitlines()[3] + b"\n", b""), "8 points for a grid"),
    "twice": (text("cfd") + text("cfd").splitlines()[3] + b"\n", "stand twice"),
    "text": (text("cfd").replace(b"\n2,0,", b"\n2,x,"), "Beta is 'x'"),
    "names twice": (text("cfd").replace(b"CD", b"CL"), "two columns are called 'CL'"),
    "ragged": (text("cfd").replace(b"\n2,0,", b"\n2,"), "7 columns below a header of 8"),
    "empty": (b"alpha,CL\n", "no columns of numbers"),
    "two meanings": (text("cfd").replace(b"Beta", b"alpha"), "what is it"),
}


@pytest.mark.parametrize("case", CASES)
def test_what_is_no_sweep_is_refused(case: str) -> None:
    data, what = CASES[case]
    with pytest.raises(InputError, match=what):
        imported(
            "s.csv",
            data,
            **(
                {}
                if case in ("one angle", "empty", "two meanings")
                else {**CFD, "reference": "vehicle"}
            ),
        )


def test_an_answer_that_is_none_says_so() -> None:
    with pytest.raises(InputError, match="is neither of"):
        imported("s.csv", text("cfd"), **{**CFD, "csf": "3"}, reference="vehicle")
    with pytest.raises(InputError, match="two columns are Cm"):
        imported("s.csv", text("cfd"), **{**CFD, "cmx": "Cm"}, reference="vehicle")
    with pytest.raises(InputError, match="is none of wind, stability"):
        imported("s.csv", text("cfd"), **{**CFD, "force_axes": "body"}, reference="vehicle")


DRAG = [0.02 + 1e-3 * a * a for a in range(-4, 13, 2)]


@pytest.mark.parametrize(("unit", "size"), [("counts", 1e4), ("%", 100.0), ("total", 1.0)])
def test_drag_in_counts_is_a_share(unit: str, size: float) -> None:
    """A count of drag is 1e-4; other words in brackets are no unit."""
    lines = [
        f"{a},{0.1 * a + 0.3},{d * size:.9g}" for a, d in zip(range(-4, 13, 2), DRAG, strict=True)
    ]
    data = f"alpha [deg],CL,CD ({unit})\n" + "\n".join(lines)
    database = imported("a.csv", data.encode(), reference="vehicle")
    found = curves(database, np.deg2rad(np.arange(-4.0, 13.0, 2.0)))["C_drag"]
    np.testing.assert_allclose(found, DRAG, rtol=1e-9)


def test_forces_are_no_coefficients() -> None:
    data = b"alpha [deg],CL [N],CD\n0,30,0.02\n4,50,0.03\n8,60,0.04\n"
    with pytest.raises(InputError, match="CL is in n, a force or a moment"):
        imported("a.csv", data, reference="vehicle")


@pytest.mark.parametrize("separator", [";", "\t", " "])
def test_decimal_commas_of_a_sweep(separator: str) -> None:
    plain = (
        text("stability", separator)
        .replace(b"alpha [deg]", b"alpha")
        .replace(b"beta [deg]", b"beta")
    )
    answers = {
        "reference": "vehicle", "force_axes": "stability", "moment_axes": "body", "cy": "CY",
        "cll": "Cl", "cn": "Cn", "angle_unit": "deg",
    }  # fmt: skip
    with_commas = imported("a.csv", plain.replace(b".", b","), **answers)
    with_points = imported("a.csv", plain, **answers)
    assert with_commas.tables.keys() == with_points.tables.keys()
    for name, table in with_points.tables.items():
        np.testing.assert_array_equal(with_commas.tables[name].values, table.values)
