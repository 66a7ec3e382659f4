"""Legs: the published equations as vectors, JSBSim's gear, standstill, and a turn by steering."""

import numpy as np
import pytest

from aerodb.errors import InputError
from aerodb.exchange.native import read_native
from aerodb.parts.frame import turned
from aerodb.simulation import Condition, Simulation, flight_model, simulate, standstill, trim
from aerodb.tables import AeroDatabase, curves, lacking_effects, unusual_content
from tests.support.parts import TEXT
from tests.support.three_wheels import (
    DAMPING,
    MAIN,
    MASSES,
    NOSE,
    ROLLING,
    SPRING,
    THREE_WHEELS,
    WITH_AIR,
    stopped_in_jsbsim,
)

STATE = (
    "phi", "theta", "psi", "p", "q", "r", "velocity_north", "velocity_east", "velocity_down",
    "height_above_ground",
)  # fmt: skip
LEVEL = 1.2 - MASSES["mass"] * 9.80665 / (3.0 * SPRING)  # m, height at which the springs carry
DATUM = (0.0, 0.0, 0.0)  # m, where the centre of gravity is


def by_hand(at: dict[str, float]) -> np.ndarray:
    """Forces [N] and moments [N m] of the three wheels in body axes, by vectors."""
    attitude = turned(at["phi"], at["theta"], at["psi"])  # columns: body axes over the earth
    velocity = np.array([at["velocity_north"], at["velocity_east"], at["velocity_down"]])
    total = np.zeros(6)
    for place, angle, brake in (
        (NOSE, at["steering"], 0.0),
        (MAIN, 0.0, at["brake"]),
        ((MAIN[0], -MAIN[1], MAIN[2]), 0.0, at["brake"]),
    ):
        from_cg = np.array(place) - [at.get(f"cg_{axis}", 0.0) for axis in "xyz"]
        arm = attitude @ np.array(place)
        depth = (attitude @ from_cg)[2] - at["height_above_ground"]
        if depth <= 0.0:
            continue
        moving = velocity + attitude @ np.cross([at["p"], at["q"], at["r"]], from_cg)
        load = max(SPRING * depth + DAMPING * moving[2], 0.0)
        heading = at["psi"] + angle
        ahead = np.array([np.cos(heading), np.sin(heading), 0.0])
        across = np.array([-np.sin(heading), np.cos(heading), 0.0])
        u, v = moving @ ahead, moving @ across
        rolling = (brake * 0.22 * (0.74712 - 0.00144 * u) + ROLLING) * np.sign(u)
        largest = 0.6 if place == NOSE else 0.6 - 0.2 * brake
        phi = np.clip(4.2972 * np.arctan(v / abs(u)) / largest, -1.5, 1.5)
        force = load * np.array([0.0, 0.0, -1.0])
        force -= load * (rolling * ahead + largest * (phi - 4.0 / 27.0 * phi**3) * across)
        contact = arm - [0.0, 0.0, depth]
        total += [*(attitude.T @ force), *(attitude.T @ np.cross(contact, force))]
    return total


def loads(own: AeroDatabase, at: dict[str, float]) -> np.ndarray:
    values = own.predict({**at, "V": 1.0, "alpha": 0.0, "beta": 0.0}).coefficients
    found = np.array([values[axis][0] for axis in ("CX", "CY", "CZ", "Cl", "Cm", "Cn")])
    return found * 100.0 * 10.3 * np.array([1.0, 1.0, 1.0, 3.8, 3.0, 3.8])


def test_the_loads_are_those_of_the_equations() -> None:
    own, rng, carried = read_native(THREE_WHEELS), np.random.default_rng(38), 0
    for _ in range(200):
        at = {
            "height_above_ground": rng.uniform(1.0, 1.3),
            "phi": rng.uniform(-0.1, 0.1),
            "theta": rng.uniform(-0.1, 0.1),
            "psi": rng.uniform(-3.0, 3.0),
            "p": rng.uniform(-0.2, 0.2),
            "q": rng.uniform(-0.2, 0.2),
            "r": rng.uniform(-0.2, 0.2),
            "velocity_down": rng.uniform(-1.0, 1.0),
            "brake": rng.uniform(0.0, 1.0),
            "steering": rng.uniform(-0.1, 0.1),
            "cg_x": rng.uniform(-0.4, 0.4),
            "cg_y": rng.uniform(-0.05, 0.05),
            "cg_z": rng.uniform(-0.1, 0.1),
        }
        ahead, aside = rng.uniform(5.0, 60.0) * rng.choice([-1, 1]), rng.uniform(-3.0, 3.0)
        at["velocity_north"] = ahead * np.cos(at["psi"]) - aside * np.sin(at["psi"])
        at["velocity_east"] = ahead * np.sin(at["psi"]) + aside * np.cos(at["psi"])
        expected = by_hand(at)
        carried += bool(expected.any())
        np.testing.assert_allclose(loads(own, at), expected, rtol=1e-9, atol=1e-8)
    assert 50 < carried < 200


def test_a_castering_wheel_is_dragged_along_its_motion() -> None:
    text = THREE_WHEELS.replace('cornering = "mu_side"\nside_limit = 0.6\n', "castering = true\n")
    text = text.replace('steering = "steering"\n', "")
    own = read_native(text.replace(f"position = {list(MAIN)}", "position = [-0.4, 0.9, 0.5]"))
    still = dict.fromkeys(("phi", "theta", "psi", "p", "q", "r", "velocity_down", "brake"), 0.0)
    still |= {"cg_x": 0.0, "cg_y": 0.0, "cg_z": 0.0}
    at = {**still, "height_above_ground": 1.1, "velocity_north": 3.0, "velocity_east": 4.0}
    load = SPRING * (NOSE[2] - 1.1)
    expected = [-0.6 * ROLLING * load, -0.8 * ROLLING * load, -load]
    np.testing.assert_allclose(loads(own, {**at, "steering": 0.0})[:3], expected)


def rolled(speed: float, seconds: float, **series: float) -> Simulation:
    model = flight_model(read_native(THREE_WHEELS))
    parameters = {name: series.pop(name) for name in ("mu_brake",) if name in series}
    acting = {**MASSES, "Ixz": 0.0, "brake": 0.0, "steering": 0.0, **series}
    time = np.arange(0.0, seconds, 0.01)
    return simulate(model, time, {"V": speed, "altitude": LEVEL}, acting, parameters=parameters)


@pytest.mark.parametrize(("mu", "published"), [(0.22, 1090.2), (0.1917, 1200.7)])
def test_a_ground_roll_is_that_of_jsbsim(mu: float, published: float) -> None:
    """The published distance is of another geometry, which is not printed."""
    pytest.importorskip("jsbsim")
    run = rolled(59.15, 45.0, brake=1.0, mu_brake=mu)
    stands = standstill(run, read_native(THREE_WHEELS), DATUM)
    assert stands is not None
    time, distance = stopped_in_jsbsim(mu, 59.15, LEVEL)
    assert stands.time == pytest.approx(time, rel=1e-3)
    assert stands.distance == pytest.approx(distance, rel=1e-3)
    assert distance == pytest.approx(published, rel=5e-3)
    assert run.ended[0] == len(run.time)


def test_at_rest_nothing_moves() -> None:
    run = rolled(0.0, 30.0)
    assert run.ended[0] == len(run.time)
    assert abs(run.channels["north"][-1, 0]) < 0.1  # it settles on its springs
    assert np.abs(run.channels["velocity_north"][-1, 0]) < 1e-9
    assert run.channels["height_above_ground"][-1, 0] < 1.2


def test_still_air_has_no_loads_whatever_divides_by_its_speed() -> None:
    """As files of JSBSim do, ``b/(2 V)``; a start at rest on the legs is one that rests."""
    damped = WITH_AIR + '"b_ref*r/(2*V)" = -0.3\n'
    model = flight_model(read_native(damped))
    acting = {**MASSES, "Ixz": 0.0, "brake": 0.0, "steering": 0.0}
    start = trim(model, Condition(0.0, 100.0, ground=True), acting)
    run = simulate(model, np.arange(0.0, 2.0, 0.01), start.start, start.series)
    assert run.ended[0] == len(run.time)
    still = start.start["altitude"] - 100.0
    assert run.channels["height_above_ground"][:, 0] == pytest.approx(still, abs=1e-6)


def test_the_nose_wheel_steers_a_turn() -> None:
    """At a walking pace, the yaw rate of rolling without slip: speed over wheelbase, times steering."""
    run = rolled(3.0, 3.0, steering=0.1)
    at = 150
    speed = np.hypot(*(run.channels[f"velocity_{way}"][at, 0] for way in ("north", "east")))
    expected = speed * np.tan(0.1) / (NOSE[0] - MAIN[0])
    assert run.channels["r"][at, 0] == pytest.approx(expected, rel=0.03)
    assert run.channels["east"][-1, 0] > 0.0


@pytest.mark.parametrize(
    ("old", "new", "place"),
    [
        ("spring = 60000.0", "spring = -1.0", "spring"),
        ("damping = 6000.0", "damping = -1.0", "damping"),
        ("side_limit = 0.6\n", "", "side_limit"),
        ('along = "mu_roll"', 'along = "mu_rol"', "along"),
        ("brake*mu_brake", "braking*mu_brake", "along"),
        ('steering = "steering"', 'steering = "steering"\ncastering = true', "castering"),
        (f"position = {list(NOSE)}\n", "", "position"),
    ],
)
def test_a_mistake_is_said_with_its_place(old: str, new: str, place: str) -> None:
    assert old in THREE_WHEELS
    with pytest.raises(InputError) as raised:
        read_native(THREE_WHEELS.replace(old, new, 1))
    said = f"{raised.value}"
    assert place in said
    assert "parts.nose" in said or "parts.main" in said


@pytest.mark.parametrize("brake", [0.0, 1.0])
def test_a_start_on_the_ground_stays_on_its_springs(brake: float) -> None:
    """At the legs' loads by statics: the brakes' moment about the centre of gravity is theirs."""
    model = flight_model(read_native(THREE_WHEELS))
    found = trim(model, Condition(30.0, 300.0, ground=True), {**MASSES, "brake": brake})
    run = simulate(model, np.arange(0.0, 1.0, 0.01), found.start, found.series)
    still = run.channels["height_above_ground"][:, 0]
    assert np.ptp(still) < 1e-4
    at = {name: float(run.channels[name][0, 0]) for name in STATE} | {"steering": 0.0}
    force = by_hand({**at, "brake": brake})
    attitude = turned(at["phi"], at["theta"], at["psi"])
    assert (attitude @ force[:3])[2] == pytest.approx(-MASSES["mass"] * 9.80665, rel=1e-6)
    assert np.abs(force[[3, 4]]).max() < 1e-3


def test_a_roll_ends_at_its_standstill() -> None:
    """Of a constant deceleration: rolling friction alone, from 4 m/s."""
    model = flight_model(read_native(THREE_WHEELS))
    found = trim(model, Condition(4.0, 0.0, ground=True), MASSES)
    run = simulate(model, np.arange(0.0, 15.0, 0.01), found.start, found.series)
    stands = standstill(run, model.database, DATUM)
    assert stands is not None
    slows = ROLLING * 9.80665
    assert stands.time == pytest.approx(4.0 / slows, rel=2e-3)
    assert stands.distance == pytest.approx(4.0**2 / (2.0 * slows), rel=2e-3)


def test_what_rests_or_rolls_on_has_no_standstill() -> None:
    own = read_native(THREE_WHEELS)
    assert standstill(rolled(0.0, 5.0), own, DATUM) is None
    assert standstill(rolled(59.15, 5.0, brake=1.0), own, DATUM) is None


def test_a_start_on_the_ground_needs_legs() -> None:
    bare = THREE_WHEELS[: THREE_WHEELS.index("[parts.nose]")] + "[derivatives.CX]\n1 = -0.1\n"
    model = flight_model(read_native(bare.replace("pressure = 100.0\n", "")))
    with pytest.raises(InputError) as raised:
        trim(model, Condition(30.0, 0.0, ground=True), MASSES)
    assert "legs" in raised.value.what
    with pytest.raises(InputError):
        Condition(30.0, 0.0, ground=True, bank=0.1)
    wheels = flight_model(read_native(THREE_WHEELS))
    with pytest.raises(InputError) as raised:
        trim(wheels, Condition(30.0, 0.0, ground=True), {**MASSES, "ground_altitude": 5.0})
    assert "ground_altitude" in raised.value.remedy


def test_legs_are_no_aerodynamics_of_an_import() -> None:
    bare = read_native(TEXT)
    text = (
        TEXT + THREE_WHEELS[THREE_WHEELS.index("[parts.main]") :].split('cornering = "mu_side')[0]
    )
    text = text.replace(
        "[parameters]\n",
        "[parameters]\nmu_brake = { value = 0.2 }\nmu_roll = { value = 0.04 }\n",
        1,
    )
    own = read_native(text.replace("[parameters]", '[free_inputs]\nbrake = "1"\n[parameters]', 1))
    assert own.parts.keys() - bare.parts.keys() == {"main"}
    alpha = np.deg2rad([-2.0, 4.0])
    for axis, values in curves(bare, alpha).items():
        np.testing.assert_allclose(curves(own, alpha)[axis], values, atol=1e-12)
    assert unusual_content(own) == unusual_content(bare)
    assert lacking_effects(own) == lacking_effects(bare)
