"""Rotors: closed forms of the printed equations, JSBSim's propeller, and a hover."""

import json
import subprocess
import sys

import numpy as np
import pytest

from aerodb.errors import InputError
from aerodb.exchange.daveml.export import export_daveml
from aerodb.exchange.daveml.reader import import_daveml
from aerodb.exchange.native import read_native
from aerodb.parts import beyond_tilt, command_ranges
from aerodb.simulation import Condition, NoTrimError, flight_model, linear_model, simulate, trim
from aerodb.tables import AeroDatabase, curves, evaluate, lacking_effects
from tests.support.quadrotor import MASSES, QUADROTOR, thrust_at

HEAD = """\
name = "rotor"
[reference]
area = 1.0
chord = 1.0
span = 1.0
moment_reference = [0.1, 0.0, 0.02]
[free_inputs]
n = "rev/s"
tilt = "rad"
"""
FLOW = {"V": 11.0, "alpha": 0.4, "beta": -0.2, "p": 0.6, "q": -0.4, "r": 0.9, "rho": 1.1}
AXES = ("FX", "FY", "FZ", "MX", "MY", "MZ")


def rotor(*keys: str, name: str = "one") -> AeroDatabase:
    text = [f"[parts.{name}]", 'kind = "rotor"', "position = [0.3, -0.4, -0.1]", "diameter = 0.5"]
    return read_native(HEAD + "\n".join([*text, *keys]))


def loads(own: AeroDatabase, **at: float) -> np.ndarray:
    """Forces [N] and moments [N m] of a database about its moment reference."""
    values = {**FLOW, "qbar": 1.0, "n": 0.0, "tilt": 0.0, **at}
    found = own.predict(values).coefficients  # lengths, area and qbar are 1
    return np.array([found[a][0] for a in ("CX", "CY", "CZ", "Cl", "Cm", "Cn")])


def by_hand(axis: np.ndarray, n: float, turns: int, at: dict[str, float]) -> np.ndarray:
    """Equations 4.2 to 4.10 as vectors, with c_T = .1 - .12 J, c_Q = .02 - .01 J, c_D = .003 and
    c_R = .0007."""
    arm = np.array([0.3, -0.4, -0.1]) - np.array([0.1, 0.0, 0.02])
    a, b = at["alpha"], at["beta"]
    air = at["V"] * np.array([np.cos(a) * np.cos(b), np.sin(b), np.sin(a) * np.cos(b)])
    local = air + np.cross([at["p"], at["q"], at["r"]], arm)
    along = local @ axis
    over = local - along * axis
    ratio = along / (n * 0.5)
    force = at["rho"] * n * abs(n) * 0.5**4 * (0.1 - 0.12 * ratio) * axis - 0.003 * abs(n) * over
    torque = -turns * at["rho"] * n * abs(n) * 0.5**5 * (0.02 - 0.01 * ratio) * axis
    moment = torque - turns * 0.0007 * abs(n) * over + np.cross(arm, force)
    return np.array([*force, *moment])


KEYS = ('thrust = ["0.1", "0.12"]', "torque = [0.02, 0.01]", "drag = 0.003", "roll = 0.0007")


@pytest.mark.parametrize("turns", [1, -1])
def test_a_standard_rotor_is_that_of_the_equations(turns: int) -> None:
    own = rotor('speed = "n"', f"turns = {turns}", "axis = [0.2, 0.1, -0.9]", *KEYS)
    axis = np.array([0.2, 0.1, -0.9]) / np.linalg.norm([0.2, 0.1, -0.9])
    for n in (20.0, 95.0):
        np.testing.assert_allclose(loads(own, n=n), by_hand(axis, n, turns, FLOW), rtol=1e-12)
    assert np.abs(loads(own, n=-30.0)).max() == 0.0  # it does not turn backwards
    assert np.abs(loads(own, n=0.0)).max() == 0.0


def test_a_bidirectional_rotor_turns_its_thrust_round() -> None:
    own = rotor('speed = "n"', "bidirectional = true", *KEYS)
    axis = np.array([0.0, 0.0, -1.0])
    for n in (-60.0, 40.0):
        np.testing.assert_allclose(loads(own, n=n), by_hand(axis, n, 1, FLOW), rtol=1e-12)


@pytest.mark.parametrize("angle", [0.0, 0.7, 1.57])
def test_a_tilting_rotor_has_its_axis_turned(angle: float) -> None:
    """By Rodrigues' formula about an oblique tilt axis."""
    hinge = np.array([0.1, 1.0, 0.0]) / np.hypot(0.1, 1.0)
    own = rotor('speed = "n"', 'tilt = "tilt"', "tilt_axis = [0.1, 1.0, 0.0]", *KEYS)
    up = np.array([0.0, 0.0, -1.0])
    axis = np.cos(angle) * up + np.sin(angle) * np.cross(hinge, up)
    found = loads(own, n=70.0, tilt=angle)
    np.testing.assert_allclose(found, by_hand(axis, 70.0, 1, FLOW), rtol=1e-11, atol=1e-13)


def test_the_moments_have_the_signs_of_a_rotor() -> None:
    """Seen from above it turns anticlockwise: the frame is turned clockwise, nose right; forward
    flight lifts the right side, whose blade advances."""
    still = dict.fromkeys(("alpha", "beta", "p", "q", "r"), 0.0)
    own = read_native(
        HEAD + '[parts.one]\nkind = "rotor"\nposition = [0.1, 0.0, 0.02]\ndiameter = 0.5\n'
        'speed = "n"\nturns = 1\n' + "\n".join(KEYS)
    )
    assert loads(own, n=50.0, **{**still, "V": 0.0})[5] > 0.0
    assert loads(own, n=50.0, **{**still, "V": 9.0})[3] < 0.0


def test_a_mirrored_rotor_turns_the_other_way() -> None:
    text = HEAD + (
        '[parts.one]\nkind = "rotor"\nmirror = true\nposition = [0.3, 0.4, -0.1]\ndiameter = 0.5\n'
        'speed = "n"\ntilt = "tilt"\n' + "\n".join(KEYS)
    )
    flow = {**FLOW, "beta": 0.0, "p": 0.0, "r": 0.0}
    found = loads(read_native(text), n=60.0, tilt=0.4, **flow)
    np.testing.assert_allclose(found[[1, 3, 5]], 0.0, atol=1e-13)
    assert found[2] < -1.0


#: JSBSim's propeller, whose table C_THRUST is linear over the advance ratio, in a process of its
#: own: thrust [lbf], induced velocity [ft/s], its conditions.
PROPELLER = """
import json, sys
from tests.support.jsbsim_propeller import flown
print(json.dumps(flown()))
"""


def test_thrust_and_induced_velocity_are_those_of_jsbsim() -> None:
    pytest.importorskip("jsbsim")
    done = subprocess.run([sys.executable, "-c", PROPELLER], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    points = json.loads(done.stdout.splitlines()[-1])
    assert len(points) > 3
    for at in points:
        own = read_native(
            HEAD + '[parts.one]\nkind = "rotor"\nposition = [0.1, 0.0, 0.02]\naxis = [1, 0, 0]\n'
            f'speed = "n"\ndiameter = {at["diameter"]!r}\nthrust = [0.1, 0.12]'
        )
        values = {
            "V": at["u"], "alpha": 0.0, "beta": 0.0, "p": 0.0, "q": 0.0, "r": 0.0,
            "rho": at["rho"], "qbar": 1.0, "n": at["n"],
        }  # fmt: skip
        thrust = own.predict(values).coefficients["CX"][0]
        assert thrust == pytest.approx(at["thrust"], rel=2e-6)
        # The induced velocity over thrust, as momentum theory has it.
        expression = own.variables["one_induced"].expression
        induced = float(evaluate(expression, {**values, "one_thrust": thrust, "one_u": at["u"]}))
        assert induced == pytest.approx(at["induced"], rel=2e-6)


def test_a_hover_carries_the_weight_with_equal_rotors() -> None:
    own = read_native(QUADROTOR)
    assert command_ranges(own) == dict.fromkeys(
        ("command_1", "command_2", "command_3", "command_4"), (0.0, 1.0)
    )
    found = trim(
        flight_model(own), Condition(0.0, 100.0, hover=True), MASSES, limits=command_ranges(own)
    )
    assert set(found.problem.controls) == {"collective", "roll", "pitch", "yaw"}
    commands = [found.deflections[f"command_{k}"] for k in range(1, 5)]
    np.testing.assert_allclose(commands, commands[0], rtol=1e-9)
    density = found.channels["rho"]
    assert 4 * thrust_at(commands[0], density) == pytest.approx(MASSES["mass"] * 9.80665, rel=1e-9)
    assert abs(found.channels["phi"]) < 1e-9
    assert found.channels["V"] == 0.0
    assert all(np.isfinite(value) for value in found.channels.values())


def test_forward_flight_leans_into_the_drag() -> None:
    """With rotor drag alone: tan(theta) = -(drag along the level)/weight, by the force balance."""
    own = read_native(QUADROTOR)
    model, limits = flight_model(own), command_ranges(own)
    found = trim(model, Condition(8.0, 100.0, hover=True), MASSES, limits=limits)
    theta = found.channels["theta"]
    assert -0.5 < theta < -0.02
    at = found.problem.accelerations(np.asarray(found.point)[:, None])
    assert np.abs(at).max() < 1e-6
    climbing = trim(
        model, Condition(3.0, 100.0, climb=np.pi / 2, hover=True), MASSES, limits=limits
    )
    assert climbing.channels["climb"] == pytest.approx(np.pi / 2, abs=1e-6)
    still = trim(model, Condition(0.0, 100.0, hover=True), MASSES, limits=limits)
    # A climb takes inflow: c_T0 n^2 D^4 - c_T1 n D^3 w carries the same weight.
    n, w = 120.0 * climbing.deflections["command_1"], 3.0
    carried = 0.11 * n**2 * 0.254**4 - 0.1 * n * 0.254**3 * w
    assert carried == pytest.approx(0.11 * (120.0 * still.deflections["command_1"]) ** 2 * 0.254**4)


def test_the_linear_model_of_a_hover_is_that_of_its_rotors() -> None:
    """Heave damping by hand: dT/dw of four rotors over the mass."""
    own = read_native(QUADROTOR)
    found = trim(
        flight_model(own), Condition(0.0, 100.0, hover=True), MASSES, limits=command_ranges(own)
    )
    linear = linear_model(found)
    w = linear.states.index("w")
    n = float(
        evaluate(
            own.variables["front_right_n"].expression, {"command_1": found.deflections["command_1"]}
        )
    )
    heave = -4.0 * found.channels["rho"] * n * 0.254**3 * 0.1 / MASSES["mass"]
    assert linear.A[w, w] == pytest.approx(heave, rel=1e-6)
    assert np.isfinite(linear.A).all()


def test_a_hover_flies_on_from_rest() -> None:
    own = read_native(QUADROTOR)
    model = flight_model(own)
    found = trim(model, Condition(0.0, 100.0, hover=True), MASSES, limits=command_ranges(own))
    time = np.arange(0.0, 2.001, 0.01)
    run = simulate(model, time, found.start, found.series)
    assert np.abs(run.channels["altitude"] - 100.0).max() < 1e-6
    assert all(np.isfinite(values).all() for values in run.channels.values())


def spun_up() -> AeroDatabase:
    """The quadrotor whose rotors follow their commands with a lag of 50 ms."""
    text = QUADROTOR
    for k in range(1, 5):
        text = text.replace(f'speed = "120*command_{k}"', f'speed = "n_{k}"')
        text += f'\n[states.n_{k}]\nunit = "Hz"\nrate = "(120*command_{k} - n_{k})/0.05"\n'
    return read_native(text)


def test_rotors_that_follow_their_commands_with_a_lag() -> None:
    own, plain = spun_up(), read_native(QUADROTOR)
    assert command_ranges(own) == command_ranges(plain)
    one, other = (
        trim(flight_model(each), Condition(4.0, 100.0, hover=True), MASSES) for each in (own, plain)
    )
    for k in range(1, 5):
        command = other.deflections[f"command_{k}"]
        assert one.deflections[f"command_{k}"] == pytest.approx(command, rel=1e-8)
        assert one.start[f"n_{k}"] == pytest.approx(120 * command, rel=1e-8)
    linear = linear_model(one)
    row = linear.states.index("n_1")
    assert linear.A[row, row] == pytest.approx(-20.0, rel=1e-6)
    assert linear.B[linear.states.index("q"), linear.inputs.index("command_1")] == 0.0
    again = import_daveml(export_daveml(own), name="quad")
    assert {f"command_{k}" for k in range(1, 5)} <= set(again.inputs)
    assert not {"elevator", "aileron", "rudder"} & set(lacking_effects(own))


def test_commands_of_rotors_are_controls() -> None:
    """A build-up of loads is asked in the air of sea level, where its curves are finite."""
    own = read_native(QUADROTOR)
    assert not {"elevator", "aileron", "rudder"} & set(lacking_effects(own))
    assert all(np.isfinite(values).all() for values in curves(own, np.array([-0.1, 0.2])).values())


def test_what_has_no_hover_says_why() -> None:
    own = read_native(QUADROTOR)
    model, limits = flight_model(own), command_ranges(own)
    with pytest.raises(NoTrimError, match="its range is 0 to 1"):
        trim(model, Condition(0.0, 100.0, hover=True), {**MASSES, "mass": 40.0}, limits=limits)
    held = {**MASSES, "command_1": 0.5, "command_2": 0.5, "command_3": 0.5, "command_4": 0.5}
    with pytest.raises(InputError, match="no free input lifts it"):
        trim(model, Condition(0.0, 100.0, hover=True), held)
    with pytest.raises(InputError, match="a hover with bank"):
        Condition(0.0, 100.0, bank=0.1, hover=True)
    with pytest.raises(InputError, match="no airspeed"):
        Condition(0.0, 100.0)
    hovering = Condition(0.0, 100.0, hover=True)
    with pytest.raises(InputError, match="controls are stated"):
        trim(model, hovering, MASSES, controls={"roll": "command_1"}, limits=limits)


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        (('thrust = ["0.1", "0.1"]',), "parts.one"),
        (('speed = "u9"', "thrust = 0.1"), r"\[parts.one\] speed"),
        (('speed = "n"', "thrust = 0.1", "axis = [0, 0, 0]"), "axis has no length"),
        (
            ('speed = "n"', "thrust = 0.1", 'tilt = "tilt"', "tilt_axis = [0, 0, 1]"),
            "not across the axis",
        ),
        (('speed = "n"', "thrust = 0.1", "command = [1, 0]"), "command without range"),
    ],
)
def test_a_wrong_rotor_is_refused_with_its_place(keys: tuple[str, ...], says: str) -> None:
    with pytest.raises(InputError, match=says):
        rotor(*keys)


LIMITED = ("speed = 80.0", "thrust = 0.1", 'tilt = "tilt"', 'tilt_limits = ["-5 deg", "95 deg"]')


def test_a_tilt_stops_at_its_limits_and_what_is_beyond_is_said() -> None:
    own = rotor(*LIMITED)
    for told, stops in ((0.3, 0.3), (2.5, np.deg2rad(95.0)), (-0.2, np.deg2rad(-5.0))):
        assert loads(own, tilt=told) == pytest.approx(
            loads(rotor("speed = 80.0", "thrust = 0.1", 'tilt = "tilt"'), tilt=stops)
        )
    channels = {name: np.full(3, value) for name, value in FLOW.items()}
    within = beyond_tilt(own, {**channels, "tilt": np.array([0.0, 1.6, -0.05])})
    beyond = beyond_tilt(own, {**channels, "tilt": np.deg2rad([0.0, 104.0, np.nan])})
    assert within == {}
    assert "told to be 104 deg, beyond its limit of 95 deg" in beyond["one"]


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        (("thrust = 0.1",), "a rotor without speed"),
        ((*LIMITED[:2], LIMITED[3]), "tilt_limits without tilt"),
        ((*LIMITED[:3], 'tilt_limits = ["95 deg", "0 deg"]'), "tilt_limits without range"),
    ],
)
def test_what_a_rotor_lacks_is_said_with_its_place(keys: tuple[str, ...], said: str) -> None:
    with pytest.raises(InputError, match=said) as error:
        rotor(*keys)
    assert error.value.where == "database file: [parts.one]"
    assert error.value.remedy
