"""AVL's output as a database: a known geometry, computed by a lattice of the tests, in AVL's layout.

What is imported is compared with the lattice itself, on body axes: conventions of AVL cannot hide in both.
"""

import numpy as np
import pytest

from aerodb.errors import InputError, OpenQuestionsError
from aerodb.exchange import KnownVehicle, code_of, import_code
from aerodb.tables import AeroDatabase, ReferenceGeometry, lacking_effects
from tests.support import vortex_lattice as lattice

OWN = KnownVehicle(
    ReferenceGeometry(lattice.AREA, lattice.CHORD, lattice.SPAN, (0.0, 0.0, 0.0)), True, {}
)


def imported(*texts: str, **bindings: str) -> AeroDatabase:
    files = [(f"run{k}.st", text.encode()) for k, text in enumerate(texts)]
    return import_code(files, "plane", bindings=bindings, vehicle=OWN)


def predicted(
    database: AeroDatabase,
    alpha: float,
    beta: float = 0.0,
    rates: tuple[float, float, float] = (0, 0, 0),
    **deflections: float,
) -> dict[str, float]:
    """Coefficients at angles and deflections in degrees and rates without dimension."""
    lengths = (lattice.SPAN, lattice.CHORD, lattice.SPAN)
    point = {n: 2 * x / length for n, x, length in zip("pqr", rates, lengths, strict=True)}
    point |= {"alpha": np.deg2rad(alpha), "beta": np.deg2rad(beta), "V": 1.0, "alphadot": 0.0}
    point |= {
        f"delta_{n}": np.deg2rad(deflections.get(n, 0.0)) for n in ("aileron", "elevator", "rudder")
    }
    values = database.predict({n: np.array([x]) for n, x in point.items()}).coefficients
    return {axis: float(x[0]) for axis, x in values.items()}


#: What is changed about the run -> the largest difference of a coefficient that the second order leaves.
CHANGES = {
    "nothing": ({}, 1e-7),
    "alpha": ({"alpha": 3.5}, 4e-4),
    "beta": ({"beta": 0.5}, 1e-4),
    "roll rate": ({"rates": (0.005, 0, 0)}, 1e-4),
    "pitch rate": ({"rates": (0, 0.0005, 0)}, 1e-4),
    "yaw rate": ({"rates": (0, 0, 0.005)}, 1e-4),
    "aileron": ({"aileron": 1.0}, 1e-4),
    "elevator": ({"elevator": 1.0}, 1e-4),
    "rudder": ({"rudder": 1.0}, 1e-4),
}


@pytest.mark.parametrize("kind", ["st", "sb"])
@pytest.mark.parametrize("change", CHANGES)
def test_a_run_gives_what_the_lattice_gives(kind: str, change: str) -> None:
    """The rudder of the lattice goes to the right for positive angles, against the channel here."""
    given, tolerance = CHANGES[change]
    database = imported(lattice.avl_text(3.0, kind=kind))
    wanted = lattice.at(
        given.get("alpha", 3.0),
        given.get("beta", 0.0),
        np.array(given.get("rates", (0, 0, 0)), dtype=float),
        **{n: x for n, x in given.items() if n in lattice.CONTROLS},
    )
    signs = {"rudder": -1.0}
    own = {n: signs.get(n, 1.0) * x if n in lattice.CONTROLS else x for n, x in given.items()}
    got = predicted(database, **{"alpha": 3.0, **own})
    assert got == pytest.approx(wanted, abs=tolerance)
    if change not in ("nothing", "alpha"):
        # The change itself, too: a lost derivative is no small difference.
        still = lattice.at(3.0)
        largest = max(wanted, key=lambda axis: abs(wanted[axis] - still[axis]))
        moved = got[largest] - predicted(database, 3.0)[largest]
        assert moved == pytest.approx(wanted[largest] - still[largest], rel=0.02)


def test_derivatives_are_those_of_the_file() -> None:
    database = imported(lattice.avl_text(0.0))
    terms = {term.name: str(term.expression) for term in database.terms}
    text = lattice.avl_text(0.0)
    for name, own in (
        ("CLa", "C_lift_alpha"),
        ("Cmq", "Cm_q_hat"),
        ("Clp", "Cl_p_hat"),
        ("Cmd2", "Cm_elevator"),
    ):
        stated = float(text.split(f"{name} =")[1].split()[0])
        assert float(terms[own].split("*")[0]) == pytest.approx(stated, abs=1e-12)


def test_runs_at_a_rate_and_an_elevator_are_taken_to_zero() -> None:
    database = imported(lattice.avl_text(3.0, elevator=-2.0, pitch_rate=0.002))
    wanted = lattice.at(3.0)
    got = predicted(database, 3.0)
    assert got["CZ"] == pytest.approx(wanted["CZ"], abs=2e-4)
    assert got["Cm"] == pytest.approx(wanted["Cm"], abs=2e-4)


def test_several_runs_are_tables_over_alpha_trimmed_or_not() -> None:
    runs = [
        lattice.avl_text(a, elevator=e)
        for a, e in ((-4, 2.0), (0, 0.0), (4, -2.0), (8, -3.0), (2, 0.0))
    ]
    database = imported(*runs)
    assert database.tables["C_lift_0"].breakpoints[0] == pytest.approx(np.deg2rad([-4, 0, 2, 4, 8]))
    for alpha in (-4.0, 2.0, 8.0):
        got, wanted = predicted(database, alpha), lattice.at(alpha)
        # A deflection of 3 deg turns the normals: what is not linear in it stays.
        assert got == pytest.approx(wanted, abs=2e-3)
    assert predicted(database, 2.0)["CZ"] == pytest.approx(lattice.at(2.0)["CZ"], abs=1e-7)
    between = predicted(database, 2.0, 1.0, (0.01, 0, 0), aileron=1.0)
    wanted = lattice.at(2.0, 1.0, np.array([0.01, 0, 0]), aileron=1.0)
    assert between == pytest.approx(wanted, abs=3e-4)


def test_an_appended_file_is_as_several() -> None:
    texts = [lattice.avl_text(a) for a in (0.0, 2.0, 4.0)]
    assert imported("\n".join(texts)).tables.keys() == imported(*texts).tables.keys()


def test_lift_from_flight_changes_the_induced_drag() -> None:
    database = imported(lattice.avl_text(3.0))
    assert database.depends_on_lift_increments


def test_what_is_missing_is_said() -> None:
    database = imported(lattice.avl_text(3.0))
    assert lacking_effects(database) == ()
    assert "profile drag" in database.description
    bare = lattice.avl_text(3.0)
    for name in ("aileron", "elevator", "rudder"):
        bare = "\n".join(line for line in bare.splitlines() if not line.startswith(f"   {name} "))
    bare = "\n".join(x for x in bare.splitlines() if "d1 " not in x and "d1=" not in x)
    assert lacking_effects(imported(bare)) == ("elevator", "aileron", "rudder")


def test_lengths_and_controls_of_strangers_are_asked_in_one_round() -> None:
    text = lattice.avl_text(3.0).replace("elevator", "moving  ")
    with pytest.raises(OpenQuestionsError) as caught:
        import_code([("a.st", text.encode())], "a")
    assert [question.name for question in caught.value.questions] == ["length_unit", "moving"]
    (lifts, _), *_ = caught.value.questions[1].proposals
    assert lifts.startswith("57.29")
    database = import_code(
        [("a.st", text.encode())],
        "a",
        bindings={"length_unit": "ft", "moving": "-57.29577951308232*delta_canard"},
    )
    assert database.reference.span == pytest.approx(3.0 * 0.3048)
    assert database.reference.moment_reference == pytest.approx((-0.08 * 0.3048, 0, -0.02 * 0.3048))
    assert "delta_canard" in database.inputs


def test_the_unit_of_length_is_that_of_the_vehicle() -> None:
    own = ReferenceGeometry(0.6 * 0.0254**2, 0.2 * 0.0254, 3 * 0.0254, (0.0, 0.0, 0.0))
    text = lattice.avl_text(3.0).encode()
    database = import_code([("a.st", text)], "a", vehicle=KnownVehicle(own, True, {}))
    assert database.reference.area == pytest.approx(own.area)


GOOD = lattice.avl_text(3.0)
DAMAGED = {
    "wide": (GOOD.replace("CLtot =   0.3", "CLtot = ********   0.3"), "too wide", 24),
    "text": (GOOD.replace("Cmtot =  -0.0", "Cmtot = -0.x"), "no number", 21),
    "cut": (GOOD[: GOOD.index("  CLtot")], "cut off", 2),
    "geometric axes": (
        GOOD.replace(
            "Standard axis orientation,  X fwd, Z down", "Geometric axis orientation, X aft, Z up"
        ),
        "geometric axes",
        12,
    ),
    "no area": (GOOD.replace("Sref = 0.6", "Sref = 0.0"), "positive", 2),
    "totals alone": (GOOD[: GOOD.index(" Stability-axis")], "derivatives", 2),
}


@pytest.mark.parametrize("damage", DAMAGED)
def test_damage_is_refused_with_its_line(damage: str) -> None:
    text, what, line = DAMAGED[damage]
    assert text != GOOD
    with pytest.raises(InputError) as caught:
        imported(text)
    assert what in str(caught.value)
    assert f"run0.st, line {line}" in caught.value.where


def test_runs_of_other_aircraft_or_twice_are_refused() -> None:
    with pytest.raises(InputError, match="one reference"):
        imported(GOOD, lattice.avl_text(4.0).replace("Sref = 0.6", "Sref = 0.7"))
    with pytest.raises(InputError, match="the same angle of attack"):
        imported(GOOD, GOOD)
    with pytest.raises(InputError, match="which the file does not have"):
        imported(GOOD, flap="delta_flap")


def test_other_files_are_not_avl() -> None:
    assert code_of(GOOD.encode()) == "AVL"
    assert code_of(b"\x89HDF") == ""
    assert code_of(b"time,alpha\n0,1\n") == ""
