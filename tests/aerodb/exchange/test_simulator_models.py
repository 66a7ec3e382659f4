"""Models of simulators as databases, and back: ArduPilot SITL and Gazebo AdvancedLiftDrag.

The formulas are written here a second time, in the simulator's own variables.
"""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from lxml import etree

from aerodb.errors import InputError, OpenQuestionsError
from aerodb.exchange import (
    KnownVehicle,
    code_of,
    differences,
    export_gazebo,
    export_sitl,
    from_document,
    import_code,
    project_gazebo,
    project_sitl,
    to_document,
)
from aerodb.tables import (
    AeroDatabase,
    Increment,
    ReferenceGeometry,
    failed_check_cases,
    make_check_cases,
    parse,
)
from tests.support import vortex_lattice

TRAVELS = {"aileron": 0.4, "elevator": 0.35, "rudder": 0.5}
OWN = KnownVehicle(ReferenceGeometry(0.5, 0.25, 2.0, (-0.3, 0.0, 0.02)), True, TRAVELS)
PLANE = {
    "s": 0.5, "b": 2.0, "c": 0.25, "c_lift_0": 0.31, "c_lift_a": 5.2, "c_lift_q": 6.5, "c_lift_deltae": 0.21,
    "mcoeff": 40.0, "alpha_stall": 0.3, "c_drag_p": 0.03, "oswald": 0.8, "c_drag_q": 0.1, "c_drag_deltae": 0.02,
    "c_y_0": 0.001, "c_y_b": -0.5, "c_y_p": -0.05, "c_y_r": 0.2, "c_y_deltaa": 0.01, "c_y_deltar": -0.15,
    "c_l_0": 0.0005, "c_l_b": -0.09, "c_l_p": -0.6, "c_l_r": 0.12, "c_l_deltaa": 0.2, "c_l_deltar": -0.02,
    "c_m_0": 0.02, "c_m_a": -0.9, "c_m_q": -14.0, "c_m_deltae": 0.8,
    "c_n_0": -0.0003, "c_n_b": 0.07, "c_n_p": -0.03, "c_n_r": -0.09, "c_n_deltaa": 0.005, "c_n_deltar": 0.08,
    "CGOffset": [-0.02, 0.0, -0.01],
}  # fmt: skip
BOUND = {f"{n}": f"-delta_{n}/{x}" for n, x in TRAVELS.items()}
POINT = {"x_ref": "-0.32", "y_ref": "0", "z_ref": "0.01"}
#: u, v, w [m/s], p, q, r [rad/s], and deflections [rad].
STATES = [
    (20.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    (18.0, 2.5, 2.0, 0.3, -0.2, 0.4, 0.1, -0.1, 0.2),
    (12.0, -3.0, 5.5, -1.0, 0.5, -0.3, -0.2, 0.15, -0.1),
    (6.0, 1.0, -9.0, 0.2, 0.1, 0.1, 0.05, 0.2, 0.1),
    (15.0, 0.0, 9.0, 0.0, 0.3, 0.0, 0.0, -0.2, 0.0),
]


def sitl_file(numbers: dict = PLANE) -> bytes:
    return b"# own numbers\n" + json.dumps(numbers, indent=1).encode()


def read(data: bytes, name: str = "plane.json", **bindings: str) -> AeroDatabase:
    return import_code([(name, data)], "plane", bindings=bindings, vehicle=OWN)


def by_database(database: AeroDatabase, state: tuple[float, ...], density: float = 1.2) -> tuple:
    """Force [N] and moment [N m] about the database's point, on body axes."""
    u, v, w, p, q, r, aileron, elevator, rudder = state
    speed = math.sqrt(u * u + v * v + w * w)
    given = {
        "V": speed,
        "alpha": math.atan2(w, u),
        "beta": math.asin(v / speed),
        "p": p,
        "q": q,
        "r": r,
    }
    given |= {"delta_aileron": aileron, "delta_elevator": elevator, "delta_rudder": rudder}
    values = database.predict({n: np.array([x]) for n, x in given.items()}).coefficients
    own = database.reference
    force = 0.5 * density * speed**2 * own.area
    f = np.array([values[n][0] for n in ("CX", "CY", "CZ")]) * force
    lengths = np.array([own.span, own.chord, own.span])
    return f, np.array([values[n][0] for n in ("Cl", "Cm", "Cn")]) * force * lengths


def by_sitl(k: dict, state: tuple[float, ...], density: float = 1.2) -> tuple:
    """The same as the plane model of SITL computes it."""
    u, v, w, p, q, r, aileron, elevator, rudder = state
    ail, ele, rud = (
        -x / TRAVELS[n] for n, x in zip(TRAVELS, (aileron, elevator, rudder), strict=True)
    )
    alpha, beta, speed = math.atan2(w, u), math.atan2(v, u), math.sqrt(u * u + v * v + w * w)
    a = min(max(alpha, k["alpha_stall"] - 0.8), k["alpha_stall"] + 0.8)
    m, stall = k["mcoeff"], k["alpha_stall"]
    e1, e2 = math.exp(-m * (a - stall)), math.exp(m * (a + stall))
    sigma = (1 + e1 + e2) / (1 + e1) / (1 + e2)
    lift = (1 - sigma) * (k["c_lift_0"] + k["c_lift_a"] * a)
    lift += sigma * 2 * math.copysign(1, a) * math.sin(a) ** 2 * math.cos(a)
    aspect = k["b"] ** 2 / k["s"]
    drag = k["c_drag_p"] + (k["c_lift_0"] + k["c_lift_a"] * alpha) ** 2 / (
        math.pi * k["oswald"] * aspect
    )
    ph, qh, rh = p * k["b"] / 2 / speed, q * k["c"] / 2 / speed, r * k["b"] / 2 / speed
    lift += k["c_lift_q"] * qh + k["c_lift_deltae"] * ele
    drag += k["c_drag_q"] * qh + k["c_drag_deltae"] * abs(ele)
    ca, sa = math.cos(alpha), math.sin(alpha)

    def side(x: str) -> float:
        return (
            k[f"c_{x}_0"] + k[f"c_{x}_b"] * beta + k[f"c_{x}_p"] * ph + k[f"c_{x}_r"] * rh
            + k[f"c_{x}_deltaa"] * ail + k[f"c_{x}_deltar"] * rud
        )  # fmt: skip

    pressure = 0.5 * density * speed**2 * k["s"]
    force = pressure * np.array([-drag * ca + lift * sa, side("y"), -drag * sa - lift * ca])
    pitch = k["c_m_0"] + k["c_m_a"] * alpha + k["c_m_q"] * qh + k["c_m_deltae"] * ele
    return force, pressure * np.array([k["b"] * side("l"), k["c"] * pitch, k["b"] * side("n")])


@pytest.mark.parametrize("state", STATES)
def test_a_plane_model_gives_what_sitl_computes(state: tuple[float, ...]) -> None:
    force, moment = by_database(read(sitl_file(), **BOUND, **POINT), state)
    wanted = by_sitl(PLANE, state)
    assert force == pytest.approx(wanted[0], rel=1e-12, abs=1e-12)
    assert moment == pytest.approx(wanted[1], rel=1e-12, abs=1e-12)


def test_a_plane_model_is_written_and_read_back() -> None:
    database = read(sitl_file(), **BOUND, **POINT)
    written = export_sitl(project_sitl(database, {}))
    entries = json.loads(b"\n".join(x for x in written.split(b"\n") if not x.startswith(b"#")))
    assert entries == PLANE
    again = import_code([("plane.json", written)], "plane")
    assert failed_check_cases(again, make_check_cases(database)) == ()
    assert again.reference == database.reference
    assert export_sitl(again) == written


def test_what_the_file_leaves_out_is_asked_in_one_round() -> None:
    few = {n: x for n, x in PLANE.items() if n not in ("c_n_p", "c_l_deltar", "CGOffset", "oswald")}
    with pytest.raises(OpenQuestionsError) as caught:
        read(sitl_file(few))
    names = [question.name for question in caught.value.questions]
    assert names == ["oswald", "left_out", "reference", "aileron", "elevator", "rudder"]
    assert "c_n_p" in caught.value.questions[1].text
    assert caught.value.questions[4].proposals[0][0] == "-delta_elevator/0.35"
    answers = {"oswald": "0.7", "left_out": "zero", "c_n_p": "0.01", **BOUND, **POINT}
    variables = read(sitl_file(few), **answers).variables
    assert float(str(variables["c_n_p"].expression)) == 0.01
    assert float(str(variables["c_l_deltar"].expression)) == 0.0


def test_the_travel_that_the_file_states_is_proposed() -> None:
    with pytest.raises(OpenQuestionsError) as caught:
        read(sitl_file({**PLANE, "deltae_max": 0.3491, "deltar_max": 0}), **POINT)
    proposals = {question.name: question.proposals for question in caught.value.questions}
    assert proposals["elevator"][0] == ("-delta_elevator/0.3491", "deltae_max of the file")
    assert [text for text, _ in proposals["rudder"]] == ["-delta_rudder/0.5"]
    assert [text for text, _ in proposals["elevator"]][1:] == ["-delta_elevator/0.35"]


def test_the_point_proposed_is_the_vehicles_and_the_files_offset() -> None:
    database = read(sitl_file(), **BOUND, reference="vehicle")
    assert database.reference.moment_reference == pytest.approx((-0.32, 0.0, 0.01))
    asked = read(sitl_file(), **BOUND, reference="vehicle", x_ref="-0.5")
    assert asked.reference.moment_reference == pytest.approx((-0.5, 0.0, 0.01))
    with pytest.raises(OpenQuestionsError) as caught:
        import_code([("p.json", sitl_file())], "p", bindings=BOUND)
    assert [question.name for question in caught.value.questions] == list(POINT)


@pytest.mark.parametrize(
    ("data", "what"),
    [
        (sitl_file().replace(b'"c_lift_a": 5.2', b'"c_lift_a": "5.2"'), "c_lift_a is 5.2"),
        (sitl_file().replace(b'"c_lift_a": 5.2', b'"c_lift_a": NaN'), "c_lift_a is"),
        (sitl_file().replace(b'"c_lift_a": 5.2', b'"c_lift_a": 1e999'), "c_lift_a is"),
        (sitl_file()[:-20], "line"),
        (sitl_file().replace(b'"s": 0.5', b'"s": 0'), "S_ref is 0"),
        (sitl_file().replace(b'"oswald": 0.8', b'"oswald": 0'), "oswald is 0"),
    ],
)
def test_a_damaged_plane_model_is_refused(data: bytes, what: str) -> None:
    with pytest.raises(InputError, match=what):
        read(data, **BOUND, **POINT)


SURFACES = {"left_elevon": (-1.0, 0.001), "right_elevon": (1.0, -0.0012), "fin": (1.0, 0.0)}
LINEAR = {
    "CYa": 0.002, "Cella": 0.001, "Cema": -1.1, "Cena": 0.0005, "CLb": 0.01, "CYb": -0.4, "Cellb": -0.1,
    "Cemb": 0.02, "Cenb": 0.08, "CDp": 0.01, "CYp": -0.06, "CLp": 0.02, "Cellp": -0.55, "Cemp": 0.03, "Cenp": -0.04,
    "CDq": 0.12, "CYq": 0.01, "CLq": 7.1, "Cellq": 0.02, "Cemq": -12.0, "Cenq": 0.01, "CDr": 0.02, "CYr": 0.21,
    "CLr": 0.03, "Cellr": 0.15, "Cemr": 0.01, "Cenr": -0.07, "Cem0": 0.015, "Cema_stall": -0.3,
}  # fmt: skip
GAZEBO = {
    **LINEAR,
    "CL0": 0.2,
    "CLa": 4.9,
    "CD0": 0.025,
    "alpha_stall": 0.28,
    "AR": 8.0,
    "eff": 0.85,
    "area": 0.5,
    "mac": 0.26,
}


def gazebo_file(numbers: dict = GAZEBO) -> bytes:
    inner = "".join(f"<{n}>{x!r}</{n}>" for n, x in numbers.items())
    for k, (name, (direction, cell)) in enumerate(SURFACES.items()):
        ends = {
            "CD": 0.0001 * k,
            "CY": 0.002,
            "CL": 0.006 + 0.001 * k,
            "Cell": cell,
            "Cem": -0.01,
            "Cen": -0.0003,
        }
        inner += f"<control_surface><name>{name}</name><index>{k}</index><direction>{direction}</direction>"
        inner += (
            "".join(f"<{n}_ctrl>{x!r}</{n}_ctrl>" for n, x in ends.items()) + "</control_surface>"
        )
    return (
        '<sdf version="1.9"><model name="m"><plugin filename="gz-sim-advanced-lift-drag-system" name="x">'
        f"{inner}<ref_pt>-0.05 0.01 0.02</ref_pt></plugin></model></sdf>"
    ).encode()


JOINTS = {
    "left_elevon": "57.29577951308232*delta_aileron",
    "right_elevon": "57.29577951308232*delta_elevator",
    "fin": "-57.29577951308232*delta_rudder",
}


def by_gazebo(k: dict, state: tuple[float, ...], density: float = 1.2) -> tuple:
    """Force and moment as the plugin computes them, with the pitching moment that its parameters mean."""
    u, v, w, p, q, r, *deflections = state
    plane, speed = math.hypot(u, w), math.sqrt(u * u + v * v + w * w)
    alpha, beta = math.atan2(w, u), math.atan2(v, u)
    span = math.sqrt(k["area"] * k["AR"])
    pressure, half = 0.5 * density * plane**2, 0.5 * density * plane
    angles = np.rad2deg(np.array(deflections) * np.array([1, 1, -1]))
    joint = dict.fromkeys(("CD", "CY", "CL", "Cell", "Cem", "Cen"), 0.0)
    for i, (angle, (direction, cell)) in enumerate(zip(angles, SURFACES.values(), strict=True)):
        ends = {
            "CD": 0.0001 * i,
            "CY": 0.002,
            "CL": 0.006 + 0.001 * i,
            "Cell": cell,
            "Cem": -0.01,
            "Cen": -0.0003,
        }
        for n, x in ends.items():
            joint[n] += angle * direction * x
    stall, sharp = k["alpha_stall"], 15.0
    e1, e2 = math.exp(-sharp * (alpha - stall)), math.exp(sharp * (alpha + stall))
    sigma = (1 + e1 + e2) / ((1 + e1) * (1 + e2))
    lift = (1 - sigma) * (k["CL0"] + k["CLa"] * alpha)
    lift += sigma * 2 * math.copysign(1, alpha) * math.sin(alpha) ** 2 * math.cos(alpha)
    lift += k["CLb"] * beta + joint["CL"]
    flat = 2 / (1 + math.exp(-0.224 - 0.115 * max(k["AR"], 1 / k["AR"])))
    drag = (1 - sigma) * (k["CD0"] + lift**2 / (math.pi * k["AR"] * k["eff"]))
    drag += sigma * abs(flat * (0.5 - 0.5 * math.cos(2 * alpha))) + joint["CD"]
    pitch = k["Cem0"] + k["Cemb"] * beta + joint["Cem"]
    pitch += k["Cema"] * max(min(alpha, stall), -stall)
    pitch += k["Cema_stall"] * (max(alpha - stall, 0) + min(alpha + stall, 0))
    static = {"CL": lift, "CD": drag, "Cem": pitch}
    for n in ("CY", "Cell", "Cen"):
        static[n] = k[f"{n}a"] * alpha + k[f"{n}b"] * beta + joint[n]

    def total(n: str) -> float:
        turn = k[f"{n}p"] * p * span / 2 + k[f"{n}q"] * q * k["mac"] / 2 + k[f"{n}r"] * r * span / 2
        return (static[n] * pressure + turn * half) * k["area"]

    ca, sa = math.cos(alpha), math.sin(alpha)
    force = np.array(
        [-total("CD") * ca + total("CL") * sa, total("CY"), -total("CD") * sa - total("CL") * ca]
    )
    assert speed >= plane
    return force, np.array([total("Cell") * span, total("Cem") * k["mac"], total("Cen") * span])


@pytest.mark.parametrize("state", STATES)
def test_a_plugin_gives_what_gazebo_computes(state: tuple[float, ...]) -> None:
    database = read(gazebo_file(), "model.sdf", **JOINTS)
    force, moment = by_database(database, state)
    wanted = by_gazebo(GAZEBO, state)
    assert force == pytest.approx(wanted[0], rel=1e-11, abs=1e-12)
    assert moment == pytest.approx(wanted[1], rel=1e-11, abs=1e-12)
    assert database.reference.moment_reference == pytest.approx((-0.05, -0.01, -0.02))


def test_a_plugin_is_written_and_read_back() -> None:
    database = read(gazebo_file(), "model.sdf", **JOINTS)
    written = export_gazebo(project_gazebo(database))
    plugin = etree.fromstring(written)
    for name, value in GAZEBO.items():
        assert float(plugin.findtext(name)) == pytest.approx(value, rel=1e-9, abs=1e-12)
    again = import_code([("model.sdf", written)], "plane")
    assert failed_check_cases(again, make_check_cases(database)) == ()
    assert export_gazebo(project_gazebo(again)) == written


def test_joints_are_asked_for_with_the_sign_that_their_lift_tells() -> None:
    with pytest.raises(OpenQuestionsError) as caught:
        read(gazebo_file(), "model.sdf")
    asked = {q.name: q.proposals for q in caught.value.questions}
    assert set(asked) == set(SURFACES)
    assert [text for text, _ in asked["left_elevon"]] == ["-57.29577951308232*delta_left_elevon"]


@pytest.mark.parametrize(
    ("data", "what"),
    [
        (gazebo_file().replace(b"<CLa>4.9<", b"<CLa>x<"), "<CLa> is 'x'"),
        (gazebo_file().replace(b"<AR>8.0<", b"<AR>0<"), "<AR> is 0"),
        (gazebo_file().replace(b"<name>fin<", b"<name>left_elevon<"), "two control surfaces"),
        (gazebo_file().replace(b"<CY_ctrl>0.002</CY_ctrl>", b"", 1), "without <CY_ctrl>"),
        (gazebo_file()[:-30], "not valid XML"),
        (gazebo_file().replace(b"0.01 0.02<", b"0.01<"), "three numbers"),
    ],
)
def test_a_damaged_plugin_is_refused(data: bytes, what: str) -> None:
    with pytest.raises(InputError, match=what):
        read(data, "model.sdf", **JOINTS)


def lattice_database() -> AeroDatabase:
    own = KnownVehicle(ReferenceGeometry(0.6, 0.2, 3.0, (0.0, 0.0, 0.0)), True, {})
    text = vortex_lattice.avl_text(3.0).encode()
    return import_code([("plane.st", text)], "plane", vehicle=own)


@pytest.mark.parametrize("form", ["sitl", "gazebo"])
def test_a_database_of_a_lattice_becomes_a_model_with_its_derivatives(form: str) -> None:
    database = lattice_database()
    model = project_sitl(database, TRAVELS) if form == "sitl" else project_gazebo(database)
    held = differences(database, model)
    assert held["Cm"] < 1e-3
    assert held["Cl"] < 1e-3
    assert held["C_lift"] < 5e-3
    assert held["CY"] < 5e-3
    written = export_sitl(model) if form == "sitl" else export_gazebo(model)
    again = import_code([("f", written)], "plane")
    assert failed_check_cases(again, make_check_cases(model)) == ()
    given = {"alpha": 0.06, "beta": 0.01, "V": 1.0, "p": 0.002, "q": 0.001, "r": -0.002}
    given |= {"delta_aileron": 0.02, "delta_elevator": -0.02, "delta_rudder": 0.03}
    at = {n: np.array([x]) for n, x in given.items()}
    before, after = (each.predict(at).coefficients for each in (database, again))
    for axis in before:
        assert after[axis][0] == pytest.approx(before[axis][0], abs=2e-3), axis


@pytest.mark.parametrize("form", ["sitl", "gazebo"])
def test_what_flight_added_to_a_model_is_added_to_its_numbers(form: str) -> None:
    if form == "sitl":
        database = read(sitl_file(), **BOUND, **POINT)
        project, start, slope = (lambda x: project_sitl(x, {})), "c_m_a", "c_l_b"
    else:
        database = read(gazebo_file(), "model.sdf", **JOINTS)
        project, start, slope = project_gazebo, "Cema", "Cellb"
    stored = from_document(to_document(database))
    flown = replace(
        stored,
        increments=(
            Increment("Cm", (parse("alpha"),), np.array([0.2]), np.array([[1e-4]])),
            Increment("Cl", (parse("beta"),), np.array([-0.03]), np.array([[1e-4]])),
        ),
    )
    numbers = project(flown).variables
    before = database.variables
    got = {
        n: float(str(numbers[n].expression)) - float(str(before[n].expression))
        for n in (start, slope)
    }
    assert got[start] == pytest.approx(0.2, rel=1e-3)
    assert got[slope] == pytest.approx(-0.03, rel=1e-2)
    untouched = "alpha_stall"
    assert numbers[untouched].expression == before[untouched].expression


def test_a_surface_without_limits_has_no_share_of_travel() -> None:
    with pytest.raises(InputError, match="full travel of aileron"):
        project_sitl(lattice_database(), {})


def test_files_are_told_by_their_content() -> None:
    assert code_of(sitl_file()) == "ArduPilot SITL"
    assert code_of(gazebo_file()) == "Gazebo AdvancedLiftDrag"
    assert code_of(b'{"a": 1}') == ""
