"""VSPAERO, XFLR5 and Datcom: what is imported of their layouts is the lattice that filled them, on body axes."""

import numpy as np
import pytest

from aerodb.errors import InputError, OpenQuestionsError
from aerodb.exchange import KnownVehicle, code_of, import_code
from aerodb.tables import AeroDatabase, ReferenceGeometry, lacking_effects
from tests.aerodb.exchange.test_avl import predicted
from tests.support import code_files
from tests.support import vortex_lattice as lattice

OWN = KnownVehicle(
    ReferenceGeometry(lattice.AREA, lattice.CHORD, lattice.SPAN, (-0.08, 0.0, -0.02)), True, {}
)
ALPHAS = (-2.0, 0.0, 3.0, 6.0)


def imported(*texts: str, **bindings: str) -> AeroDatabase:
    files = [(f"file{k}", text.encode()) for k, text in enumerate(texts)]
    return import_code(files, "plane", bindings=bindings, vehicle=OWN)


#: How much of a motion or a control is tried -> what of it is printed: rudders of the lattice go right.
MOVES = {
    "beta": ({"beta": 0.5}, {"beta": 0.5}),
    "p": ({"rates": np.array([0.004, 0, 0])}, {"rates": (0.004, 0, 0)}),
    "q": ({"rates": np.array([0, 0.0004, 0])}, {"rates": (0, 0.0004, 0)}),
    "r": ({"rates": np.array([0, 0, 0.004])}, {"rates": (0, 0, 0.004)}),
    "aileron": ({"aileron": 0.5}, {"aileron": 0.5}),
    "elevator": ({"elevator": 0.5}, {"elevator": 0.5}),
    "rudder": ({"rudder": 0.5}, {"rudder": -0.5}),
}


@pytest.mark.parametrize("move", MOVES)
@pytest.mark.parametrize("runs", [1, 4])
def test_stability_runs_of_vspaero(runs: int, move: str) -> None:
    """Controls are per rad here, and named by their groups."""
    bound = {"ailerons": "delta_aileron"}
    database = imported(*map(code_files.stab, ALPHAS if runs > 1 else (3.0,)), **bound)
    given, own = MOVES[move]
    wanted, got = lattice.at(3.0, **given), predicted(database, 3.0, **own)
    assert predicted(database, 3.0) == pytest.approx(lattice.at(3.0), abs=2e-7)
    assert got == pytest.approx(wanted, abs=1e-4)
    still = lattice.at(3.0)
    largest = max(wanted, key=lambda axis: abs(wanted[axis] - still[axis]))
    moved = got[largest] - predicted(database, 3.0)[largest]
    assert moved == pytest.approx(wanted[largest] - still[largest], rel=0.02)
    assert database.reference.moment_reference == pytest.approx((-0.08, 0.0, -0.02))


def test_runs_of_vspaero_over_sideslip_are_tables_of_it() -> None:
    """A sweep over both angles appends its runs to one file, as ``AoA`` and ``Beta`` of a case."""
    betas = (-4.0, 0.0, 4.0)
    sweep = "".join(code_files.stab(alpha, beta) for beta in betas for alpha in ALPHAS)
    database = imported(sweep, ailerons="delta_aileron")
    for alpha in ALPHAS:
        for beta in betas:
            got = predicted(database, alpha, beta)
            assert got == pytest.approx(lattice.at(alpha, beta), abs=1e-6)
            rolled = predicted(database, alpha, beta, rates=(0.004, 0, 0))
            wanted = lattice.at(alpha, beta, rates=np.array([0.004, 0, 0]))
            assert rolled == pytest.approx(wanted, abs=1e-4)
    with pytest.raises(InputError, match="4 angles of attack by 3 sideslips"):
        imported(*(code_files.stab(a, b) for b in betas for a in ALPHAS if (a, b) != (3.0, 4.0)))


def test_groups_of_vspaero_are_asked_by_their_names() -> None:
    with pytest.raises(OpenQuestionsError) as caught:
        imported(code_files.stab(3.0).replace("Rudder", "Fin"))
    asked = {question.name: question.proposals for question in caught.value.questions}
    assert asked.keys() == {"fin"}
    named = imported(code_files.stab(3.0).replace("Ailerons", "ConGrp_1"), congrp_1="delta_aileron")
    assert "aileron" not in lacking_effects(named)


@pytest.mark.parametrize("betas", [(0.0,), (-4.0, 0.0, 4.0)])
def test_a_polar_of_vspaero_holds_its_points(betas: tuple[float, ...]) -> None:
    database = imported(code_files.polar(ALPHAS, betas), reference="vehicle")
    for alpha in ALPHAS:
        for beta in betas:
            assert predicted(database, alpha, beta) == pytest.approx(
                lattice.at(alpha, beta), abs=1e-8
            )
    lacks = lacking_effects(database)
    assert "pitch damping" in lacks
    assert ("yawing moment over sideslip" in lacks) == (len(betas) == 1)


@pytest.mark.parametrize("comma", [False, True])
def test_a_polar_of_xflr5_holds_its_points(comma: bool) -> None:
    text = code_files.xflr5(ALPHAS, (-4.0, 0.0, 4.0), comma)
    with pytest.raises(OpenQuestionsError) as caught:
        imported(text)
    assert [q.name for q in caught.value.questions] == ["Cl_sign", "Cn_sign", "reference"]
    bound = {"reference": "vehicle", "Cl_sign": "alike", "Cn_sign": "opposite"}
    database = imported(text, **bound)
    for alpha in ALPHAS:
        for beta in (-4.0, 4.0):
            assert predicted(database, alpha, beta) == pytest.approx(
                lattice.at(alpha, beta), abs=2e-6
            )


def test_polars_of_xflr5_are_read_together_and_gaps_are_refused() -> None:
    texts = [code_files.xflr5(ALPHAS, (beta,)) for beta in (0.0, 4.0)]
    bound = {"reference": "vehicle", "Cl_sign": "alike", "Cn_sign": "opposite"}
    assert imported(*texts, **bound).tables["Cm_table"].values.shape == (4, 2)
    with pytest.raises(InputError, match="7 points for a grid"):
        imported(texts[0], code_files.xflr5(ALPHAS[:3], (4.0,)), **bound)


def test_a_stability_log_of_xflr5_is_turned_to_body_axes() -> None:
    text = code_files.xflr5_stability(3.0)
    with pytest.raises(OpenQuestionsError) as caught:
        imported(text)
    names = [question.name for question in caught.value.questions]
    assert names == ["alpha_trim", "C_lift", "C_drag", "elevator", "reference"]
    still = lattice.at(3.0)
    trim = code_files.wind(still, 3.0, 0.0)
    bound = {"alpha_trim": "3 deg", "C_lift": str(trim["CL"]), "C_drag": str(trim["CD"])}
    bound |= {"elevator": "57.29577951308232*delta_elevator", "reference": "vehicle"}
    database = imported(text, **bound)
    for move in ("beta", "p", "q", "r", "elevator"):
        given, own = MOVES[move]
        got, before = predicted(database, 3.0, **own), predicted(database, 3.0)
        other = lattice.at(3.0, **{n: -x for n, x in given.items()})
        for axis, value in lattice.at(3.0, **given).items():
            change = 0.5 * (value - other[axis])
            assert got[axis] - before[axis] == pytest.approx(
                change, abs=0.01 * abs(change) + 2e-5
            ), (move, axis)
    got = predicted(database, 3.2)
    assert got["CZ"] == pytest.approx(lattice.at(3.2)["CZ"], abs=2e-4)
    assert got["CX"] == pytest.approx(lattice.at(3.2)["CX"], abs=2e-4)
    with pytest.raises(InputError, match="no cyb"):
        imported("\n".join(x for x in text.splitlines() if "CYb" not in x) + "\nCYb =\nXw = 1")
    with pytest.raises(InputError, match="stands twice"):
        imported(text + text)


@pytest.mark.parametrize("per", ["DEGREE", "RADIAN"])
@pytest.mark.parametrize("unit", ["M", "FT"])
def test_datcom_gives_the_whole_aircraft_about_body_axes(per: str, unit: str) -> None:
    text = code_files.datcom(ALPHAS, per, unit)
    database = imported(text, lateral_axes="stability")
    assert database.reference.area == pytest.approx(lattice.AREA, rel=1e-4)
    assert database.reference.moment_reference == pytest.approx((-0.08, 0, -0.02), abs=1e-5)
    for alpha in ALPHAS:
        assert predicted(database, alpha) == pytest.approx(lattice.at(alpha), abs=1e-4)
    # CYB, CNB, CLQ and CMQ are printed at the first angle alone: compared there.
    for move in ("beta", "p", "q", "r"):
        given, own = MOVES[move]
        # Half the difference of both senses: what is even in the motion has no derivative.
        wanted = lattice.at(ALPHAS[0], **given)
        still = lattice.at(ALPHAS[0], **{n: -x for n, x in given.items()})
        got, before = predicted(database, ALPHAS[0], **own), predicted(database, ALPHAS[0])
        for axis in ("Cl", "Cm", "Cn") if move == "r" else ("CY", "Cl", "Cm", "Cn"):  # no CYR
            change = 0.5 * (wanted[axis] - still[axis])
            assert got[axis] - before[axis] == pytest.approx(
                change, abs=0.03 * abs(change) + 2e-5
            ), (move, axis)
    assert lacking_effects(database) == ("elevator", "aileron", "rudder")
    assert "alphadot" in database.inputs


def test_datcom_asks_for_the_axes_and_says_what_it_has_no_method_for() -> None:
    text = code_files.datcom(ALPHAS)
    with pytest.raises(OpenQuestionsError) as caught:
        imported(text)
    assert [question.name for question in caught.value.questions] == ["lateral_axes"]
    lines = text.splitlines()
    at = next(k for k, line in enumerate(lines) if "CLAD" in line) + 2
    lines[at + 1] = lines[at + 1][:76] + "NDM".rjust(13) + lines[at + 1][89:]
    database = imported("\n".join(lines), lateral_axes="body")
    assert "CYP" in database.description
    assert "CY_p_hat" not in {term.name.removesuffix("_term") for term in database.terms}


DAMAGED = {
    "stab, no row": (code_files.stab(3.0).replace("CMy ", "#My "), "has no CMy"),
    "stab, text": (
        code_files.stab(3.0).replace("Sref_                   0.6", "Sref_                   x.6"),
        "no number",
    ),
    "stab, cut": (code_files.stab(3.0)[:900], "has no"),
    "polar, cut": (code_files.polar(ALPHAS, (0.0,))[:-40], "columns below a header"),
    "polar, nan": (code_files.polar(ALPHAS, (0.0,)).replace("0.900000000", "nan", 1), "no number"),
    "xflr5, cut": (code_files.xflr5(ALPHAS)[:-30], "columns below a header"),
    "datcom, cut": (code_files.datcom(ALPHAS)[:900], "no table of ALPHA"),
    "datcom, wide": (
        code_files.datcom(ALPHAS).replace("   9.000    9.000", "   *****    9.000"),
        "too wide",
    ),
}


@pytest.mark.parametrize("damage", DAMAGED)
def test_damage_is_refused_with_its_place(damage: str) -> None:
    text, what = DAMAGED[damage]
    with pytest.raises(InputError, match=what) as caught:
        imported(text, reference="vehicle") if "polar" in damage or "xflr5" in damage else imported(
            text
        )
    assert "file0" in caught.value.where


def test_codes_are_told_apart() -> None:
    texts = {
        "VSPAERO stability": code_files.stab(3.0),
        "VSPAERO polar": code_files.polar(ALPHAS, (0.0,)),
        "XFLR5": code_files.xflr5(ALPHAS),
        "XFLR5 stability": code_files.xflr5_stability(3.0),
        "Datcom": code_files.datcom(ALPHAS),
        "AVL": lattice.avl_text(3.0),
    }
    assert {name: code_of(text.encode()) for name, text in texts.items()} == {n: n for n in texts}
