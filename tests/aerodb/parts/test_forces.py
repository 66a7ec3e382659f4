"""Parts against closed forms of strip and momentum theory, and against a few lines of numpy."""

import numpy as np
import pytest
from scipy.interpolate import interpn

from aerodb.exchange.native import read_native
from aerodb.nomenclature import AXES
from aerodb.parts import flap_effectiveness
from aerodb.tables import AeroDatabase, with_parameters
from tests.support.parts import aircraft

AREA, CHORD, SPAN = 12.0, 1.2, 10.0
HEAD = f"""\
name = "wing"
[reference]
area = {AREA}
chord = {CHORD}
span = {SPAN}
moment_reference = [0.0, 0.0, 0.0]
"""


def database(text: str) -> AeroDatabase:
    return read_native(HEAD + text)


def rectangle(strips: int, *, sweep: float = 0.0, dihedral: float = 0.0) -> AeroDatabase:
    """A wing of constant chord with the section slope 5; `sweep` and `dihedral` in rad."""
    half = SPAN / 2
    tip = [float(-half * np.tan(sweep)), half, float(-half * np.tan(dihedral))]
    return database(
        f"""
[parts.wing]
kind = "surface"
mirror = true
root = [0.0, 0.0, 0.0]
tip = {tip}
root_chord = {CHORD}
strips = {strips}
lift = "5*alpha"
"""
    )


def slopes(own: AeroDatabase, name: str, step: float, **at: float) -> dict[str, float]:
    """Slopes of the coefficients by central differences, at 50 m/s and sea level."""
    point = dict.fromkeys(own.inputs, 0.0) | {"V": 50.0, "rho": 1.2, "qbar": 1500.0} | at
    ends = [
        own.predict({**point, name: point.get(name, 0.0) + d}).coefficients for d in (step, -step)
    ]
    return {axis: float((ends[0][axis] - ends[1][axis])[0]) / (2 * step) for axis in AXES}


@pytest.mark.parametrize("strips", [3, 14])
def test_roll_damping_of_a_rectangular_wing(strips: int) -> None:
    """Strip theory: dC_l = -(2/(S b)) a (p y/V) c y dy over half the span gives C_lp = -a/6 per
    p b/(2 V); n strips at their middles give (1 - 1/(4 n^2)) of it."""
    found = slopes(rectangle(strips), "p", 1e-3)["Cl"] * 2 * 50.0 / SPAN
    assert found == pytest.approx(-5.0 / 6.0 * (1 - 1 / (4 * strips**2)), rel=1e-6)


def test_dihedral_and_sweep() -> None:
    """C_lbeta = -a sin(Gamma)/4 of dihedral, with area and arm along the slope. Simple sweep theory: C_L = a cos(Lambda) alpha and
    C_lbeta = -C_L tan(Lambda)/4, both for constant chord."""
    up = np.deg2rad(4.0)
    found = slopes(rectangle(10, dihedral=up), "beta", 1e-4)["Cl"]
    assert found == pytest.approx(-5.0 * np.sin(up) / (4 * np.cos(up) ** 2), rel=3e-3)
    back = np.deg2rad(30.0)
    swept = rectangle(10, sweep=back)
    assert slopes(swept, "alpha", 1e-4)["CZ"] == pytest.approx(-5.0 * np.cos(back), rel=1e-6)
    lift = 5.0 * np.cos(back) * 0.05
    found = slopes(swept, "beta", 1e-3, alpha=0.05)["Cl"]
    assert found == pytest.approx(-lift * np.tan(back) / 4, rel=5e-3)


def test_damping_of_a_tail_and_a_fin() -> None:
    """C_mq = -2 a_t V_H l_t/c per q c/(2 V) with V_H = S_t l_t/(S c); C_nr = -2 a_f S_f l_f^2/(S b^2)."""
    own = database(
        """
[parts.tail]
kind = "section"
position = [-5.0, 0.0, 0.0]
area = 2.0
lift = "4*alpha"
[parts.fin]
kind = "section"
position = [-5.5, 0.0, 0.0]
area = 1.5
dihedral = "90 deg"
lift = "3*alpha"
"""
    )
    volume = 2.0 * 5.0 / (AREA * CHORD)
    pitch = slopes(own, "q", 1e-3)["Cm"] * 2 * 50.0 / CHORD
    assert pitch == pytest.approx(-2 * 4.0 * volume * 5.0 / CHORD, rel=1e-4)
    turn = slopes(own, "r", 1e-3)["Cn"] * 2 * 50.0 / SPAN
    assert turn == pytest.approx(-2 * 3.0 * 1.5 * 5.5**2 / (AREA * SPAN**2), rel=1e-4)
    side = slopes(own, "beta", 1e-4)
    assert side["CY"] == pytest.approx(-3.0 * 1.5 / AREA, rel=1e-6)
    assert side["Cn"] == pytest.approx(3.0 * 1.5 * 5.5 / (AREA * SPAN), rel=1e-6)


def test_all_forces_of_an_aircraft_by_an_independent_integration() -> None:
    """Wing, tail, fin, fuselage and propeller of the light aircraft, by vectors and loops."""
    own, rng = aircraft(), np.random.default_rng(4)
    for _ in range(5):
        x = {name: rng.uniform(-0.2, 0.2) for name in own.inputs}
        x |= {"V": rng.uniform(35.0, 70.0), "rho": 1.05, "throttle": rng.uniform(0.2, 0.9)}
        x["qbar"] = 0.5 * x["rho"] * x["V"] ** 2
        found = own.predict(x).coefficients
        force, moment = integrated(own, x)
        scale = x["qbar"] * 16.0
        hand = np.concatenate([force / scale, moment / (scale * np.array([11.0, 1.5, 11.0]))])
        np.testing.assert_allclose([found[axis][0] for axis in AXES], hand, rtol=1e-9, atol=1e-12)


def integrated(own: AeroDatabase, x: dict[str, float]) -> tuple[np.ndarray, np.ndarray]:
    """Force and moment about (-2, 0, 0) of the aircraft of `tests.support.parts`, by hand."""
    k, rho = own.parameters, x["rho"]
    ca, sa, cb, sb = np.cos(x["alpha"]), np.sin(x["alpha"]), np.cos(x["beta"]), np.sin(x["beta"])
    motion, omega = x["V"] * np.array([ca * cb, sb, sa * cb]), np.array([x["p"], x["q"], x["r"]])
    reference = np.array([-2.0, 0.0, 0.0])
    force, moment = np.zeros(3), np.zeros(3)

    def add(at: np.ndarray, f: np.ndarray, m: np.ndarray | None = None) -> None:
        force[:] += f
        moment[:] += np.cross(at - reference, f) + (0.0 if m is None else m)

    def air(at: np.ndarray) -> np.ndarray:
        return motion + np.cross(omega, at - reference)

    disc = np.array([0.0, 0.0, 0.1])
    table = own.tables["THRUST"]
    at = [[x["V"], x["throttle"]]]
    thrust = float(interpn(table.breakpoints, table.values, at)[0])
    add(disc, np.array([thrust, 0.0, 0.0]))
    u = air(disc)[0]
    induced = 0.5 * (np.sqrt(u**2 + 2 * thrust / (rho * np.pi * 0.95**2)) - u)
    # part, root, tip, chords, incidence and twist, strips
    for side in (1.0, -1.0):
        rows = [
            ("wing", (-1.95, 0.3, -0.7), (-1.95, 5.5, -0.85), (1.55, 1.35), (1.0, -2.0), 14),
            ("tail", (-6.6, 0.0, -0.4), (-6.7, 1.7, -0.4), (1.0, 0.8), (-1.0, 0.0), 4),
        ]
        if side > 0:
            rows += [("fin", (-6.5, 0.0, -0.5), (-6.9, 0.0, -2.0), (1.3, 0.8), (0.0, 0.0), 4)]
        for part, root, tip, chords, angles, n in rows:
            root, tip = np.array(root), np.array(tip)
            root[1] *= side
            tip[1] *= side
            line = tip - root
            width = np.hypot(line[1], line[2])
            lean = np.array([0.0, line[1], line[2]]) / width  # from the root to the tip
            span = lean if part == "fin" else side * lean  # to the right; up for the fin
            across = np.cross([1.0, 0.0, 0.0], span)  # down for a wing
            sweep = np.arctan2(-line[0], width)
            forward = np.cos(sweep) * np.array([1.0, 0.0, 0.0]) + np.sin(sweep) * lean
            about = np.cross(across, forward)
            for j in range(n):
                at = (j + 0.5) / n
                place, chord = root + at * line, chords[0] + at * (chords[1] - chords[0])
                area = chord * width / n
                flow = air(place)
                if part == "tail":
                    behind = 0.0 - place[0]
                    grown = 1 + behind / np.hypot(behind, 0.95)
                    flow = flow + np.array([induced * grown, 0.0, 0.0])
                along, normal = flow @ forward, flow @ across
                if part == "tail":
                    down = 0.02 + k["tail_downwash"] * x["alpha"]
                    along, normal = (
                        along * np.cos(down) + normal * np.sin(down),
                        normal * np.cos(down) - along * np.sin(down),
                    )
                size = np.hypot(along, normal)
                alpha = np.arctan2(normal, along) + np.deg2rad(angles[0] + at * angles[1])
                if part == "wing":
                    inside = np.clip(min((j + 1) / n, 0.95) - max(j / n, 0.6), 0, 1) * n
                    tau = flap_effectiveness(0.22) * k["aileron_part"] * inside
                    alpha += side * tau * x["delta_aileron"]
                    lift = k["wing_slope"] * alpha + k["wing_zero"]
                    drag, twist = k["wing_drag"] + 0.045 * lift**2, -0.04
                elif part == "tail":
                    tau = flap_effectiveness(0.35) * k["elevator_part"]
                    lift = k["tail_slope"] * (alpha + tau * x["delta_elevator"])
                    drag, twist = 0.01 + 0.08 * lift**2, 0.0
                else:
                    tau = flap_effectiveness(0.3) * k["rudder_part"]
                    lift = k["fin_slope"] * (alpha - tau * x["delta_rudder"])
                    drag, twist = 0.01 + 0.1 * lift**2, 0.0
                q = 0.5 * rho * size**2 * area
                cos, sin = along / size, normal / size
                f = q * ((lift * sin - drag * cos) * forward - (lift * cos + drag * sin) * across)
                add(place, f, q * chord * twist * about)
    middle = np.array([-2.4, 0.0, 0.1])
    flow = air(middle)
    size = np.linalg.norm(flow)
    slip = np.arcsin(flow[1] / size)
    f = -0.5 * rho * size * 1.5 * k["body_drag"] * flow
    f[1] += 0.5 * rho * size**2 * 1.5 * -0.35 * slip
    pressure = rho * 0.85 * 4.5
    add(middle, f, pressure * flow[0] * np.array([0.0, flow[2], -flow[1]]))
    return force, moment


def test_the_slipstream_holds_the_momentum_that_the_thrust_gives() -> None:
    """T = rho A (u + v) 2 v at the disc, also standing; 2 v far behind, v/2 less ahead."""
    own = database(
        """
[free_inputs]
pull = "N"
[parts.propeller]
kind = "engine"
position = [0.0, 0.0, 0.0]
thrust = "pull"
diameter = 2.0
[parts.probe]
kind = "section"
position = [-1000.0, 0.0, 0.0]
area = 1.0
lift = "0"
drag = "1"
slipstream = "propeller"
"""
    )
    for speed in (5.0, 40.0):
        x = dict.fromkeys(own.inputs, 0.0) | {"V": speed, "rho": 1.2, "qbar": 0.6 * speed**2}
        pulls = np.array([200.0, 1500.0])
        force = own.predict({**x, "pull": pulls}).coefficients["CX"] * x["qbar"] * AREA - pulls
        far = np.sqrt(-force / (0.5 * 1.2 * 1.0))  # the drag of the probe tells the speed
        induced = 0.5 * (far - speed)
        np.testing.assert_allclose(1.2 * np.pi * (speed + induced) * 2 * induced, pulls, rtol=2e-6)


def test_a_slender_body_has_munks_moment() -> None:
    own = database(
        """
[parts.body]
kind = "fuselage"
position = [0.0, 0.0, 0.0]
area = 1.0
drag = "0"
volume = 3.0
inertia_factor = 0.9
"""
    )
    x = {"V": 40.0, "rho": 1.1, "alpha": 0.1, "beta": 0.0, "p": 0.0, "q": 0.0, "r": 0.0}
    x["qbar"] = 0.5 * 1.1 * 1600
    found = own.predict(x).coefficients["Cm"][0] * AREA * CHORD
    assert found == pytest.approx(0.9 * 3.0 * np.sin(0.2), rel=1e-12)


def test_a_surface_is_its_strips_written_one_by_one() -> None:
    """The tail's strips, in the slipstream and downwash, as parts of kind section."""
    engine = """
[free_inputs]
pull = "N"
[parts.propeller]
kind = "engine"
position = [1.0, 0.0, 0.2]
direction = [1.0, 0.0, -0.1]
thrust = "pull"
diameter = 2.0
"""
    shared = 'lift = "4*alpha"\ndrag = "0.01 + 0.1*lift^2"\nmoment = "-0.05"\ndownwash = "0.3*alpha"\nslipstream = "propeller"\n'
    whole = database(
        engine
        + '[parts.t]\nkind = "surface"\nroot = [-5, 0.2, 0]\ntip = [-5.4, 2.0, -0.3]\n'
        + "root_chord = 1.0\ntip_chord = 0.6\nstrips = 3\nincidence = 0.02\ntwist = -0.05\n"
        + shared
    )
    pieces = ""
    line = np.array([-0.4, 1.8, -0.3])
    width = float(np.hypot(1.8, 0.3))
    for k in range(3):
        at = (k + 0.5) / 3
        chord = 1.0 - 0.4 * at
        pieces += (
            f'[parts.t_{k}]\nkind = "section"\nposition = {(np.array([-5, 0.2, 0]) + at * line).tolist()}\n'
            f"area = {chord * width / 3}\nchord = {chord}\nincidence = {0.02 - 0.05 * at}\n"
            f"dihedral = {float(np.arctan2(0.3, 1.8))}\nsweep = {float(np.arctan2(0.4, width))}\n"
        ) + shared
    apart, rng = database(engine + pieces), np.random.default_rng(7)
    x = {name: rng.uniform(-0.3, 0.3, 20) for name in whole.inputs}
    x |= {"V": rng.uniform(20, 60, 20), "rho": rng.uniform(0.9, 1.2, 20), "pull": 900.0}
    x["qbar"] = 0.5 * x["rho"] * x["V"] ** 2
    one, other = (each.predict(x).coefficients for each in (whole, apart))
    for axis in AXES:
        np.testing.assert_allclose(one[axis], other[axis], rtol=1e-10, atol=1e-13)


def test_symmetric_flight_has_no_lateral_load() -> None:
    x = dict.fromkeys(aircraft().inputs, 0.0)
    x |= {"V": 50.0, "rho": 1.2, "qbar": 1500.0, "alpha": 0.08, "q": 0.1, "throttle": 0.6}
    found = aircraft().predict(x).coefficients
    for axis in ("CY", "Cl", "Cn"):
        assert abs(found[axis][0]) < 1e-14, axis


def test_a_load_of_a_turned_part() -> None:
    """A drag area on a boom to the left, turned by 90 deg: its x axis is to the right."""
    own = database(
        """
[parts.boom]
kind = "body"
position = [1.0, -2.0, 0.0]
axes = [0.0, 0.0, "90 deg"]
[[parts.boom.load]]
axis = "FX"
expression = "-0.5*rho*0.3*u*abs(u)"
[[parts.boom.load]]
axis = "MY"
expression = "7"
"""
    )
    x = {
        "V": 30.0,
        "rho": 1.0,
        "alpha": 0.0,
        "beta": 0.2,
        "p": 0.0,
        "q": 0.0,
        "r": 0.5,
        "qbar": 450.0,
    }
    found = own.predict(x).coefficients
    sideways = 30 * np.sin(0.2) + 0.5 * 1.0
    force = -0.15 * sideways**2
    scale = 450.0 * AREA
    assert found["CY"][0] == pytest.approx(force / scale)
    assert found["Cn"][0] == pytest.approx(force * 1.0 / (scale * SPAN))
    assert found["Cl"][0] == pytest.approx(-7 / (scale * SPAN))  # its y axis points aft


def test_parameters_are_shared_by_name() -> None:
    more = with_parameters(aircraft(), {"wing_slope": 5.5})
    x = dict.fromkeys(more.inputs, 0.0) | {"V": 50.0, "rho": 1.2, "qbar": 1500.0, "alpha": 0.1}
    gain = more.predict(x).coefficients["CZ"] - aircraft().predict(x).coefficients["CZ"]
    area = 2 * 5.2 * 1.45
    # Every strip of both sides has the new slope: at the mean incidence of 0 deg.
    assert gain[0] == pytest.approx(-0.5 * 0.1 * area / 16.0, rel=0.03)


def test_a_section_is_a_flat_plate_beyond_its_stall() -> None:
    """Both regions and the blend, written as the source has them: with exponentials."""
    own = database(
        '[parts.strip]\nkind = "section"\nposition = [0.0, 0.0, 0.0]\n'
        'area = 2.0\nlift = "0.2 + 5*alpha"\ndrag = "0.02 + 0.3*alpha^2"\n'
        "[parts.strip.separated]\nangle = 0.3\nsharpness = 30.0\nlift = 0.9\ndrag = [0.05, 1.8]\n"
    )
    for alpha in (-1.4, -0.33, -0.1, 0.0, 0.28, 0.31, 0.8, 1.5):
        upper, lower = (np.exp(30.0 * (alpha + sign * 0.3)) for sign in (1.0, -1.0))
        share = 1.0 - upper / ((1.0 + upper) * (1.0 + lower))
        lift = (1 - share) * (0.2 + 5 * alpha) + share * 0.9 * np.sin(2 * alpha)
        drag = (1 - share) * (0.02 + 0.3 * alpha**2) + share * (0.05 + 1.75 * np.sin(alpha) ** 2)
        at = {"V": 20.0, "alpha": alpha, "beta": 0.0, "p": 0.0, "q": 0.0, "r": 0.0}
        found = own.predict({**at, "rho": 1.2, "qbar": 240.0}).coefficients
        area = 2.0 / own.reference.area
        normal = area * (lift * np.cos(alpha) + drag * np.sin(alpha))
        along = area * (lift * np.sin(alpha) - drag * np.cos(alpha))
        assert found["CZ"][0] == pytest.approx(-normal, rel=1e-9, abs=1e-12)
        assert found["CX"][0] == pytest.approx(along, rel=1e-9, abs=1e-12)


def test_a_wing_tilts_with_its_rotor_and_stands_in_its_slipstream() -> None:
    """Equations 4.31 to 4.36 as vectors: 1 rad up from forward, in slow flight."""
    own = read_native(
        HEAD
        + """
[free_inputs]
up = "rad"
[parts.fan]
kind = "rotor"
position = [0.3, 1.0, -0.1]
axis = [1, 0, 0]
tilt = "up"
speed = "70"
diameter = 0.6
thrust = [0.1, 0.12]
[parts.wing]
kind = "section"
position = [0.0, 1.0, -0.1]
area = 0.4
lift = "0.1 + 4.5*alpha"
drag = "0.02 + 0.2*alpha^2"
tilt = "up"
slipstream = "fan"
"""
    )
    angle, air = 1.0, np.array([7.0, 0.0, 0.9])
    axis = np.array([np.cos(angle), 0.0, -np.sin(angle)])
    u, area = float(air @ axis), np.pi * 0.3**2
    thrust = 1.2 * 70.0**2 * 0.6**4 * (0.1 - 0.12 * u / (70.0 * 0.6))
    induced = 0.5 * (-u + np.sqrt(u**2 + 2 * thrust / (1.2 * area)))
    grown = 1.0 + 0.3 / np.hypot(0.3, 0.3)
    flow = air + grown * induced * axis
    alpha = np.arctan2(flow[2], flow[0]) + angle
    speed = np.hypot(flow[0], flow[2])
    along = np.array([flow[0], 0.0, flow[2]]) / speed
    upward = np.array([along[2], 0.0, -along[0]])
    wing = (
        0.5
        * 1.2
        * 0.4
        * speed**2
        * ((0.1 + 4.5 * alpha) * upward - (0.02 + 0.2 * alpha**2) * along)
    )
    expected = wing + thrust * axis
    V = float(np.linalg.norm(air))
    at = {"V": V, "alpha": float(np.arctan2(air[2], air[0])), "beta": 0.0, "up": angle}
    found = own.predict({**at, "p": 0.0, "q": 0.0, "r": 0.0, "rho": 1.2, "qbar": 1.0}).coefficients
    force = AREA * np.array([found[name][0] for name in ("CX", "CY", "CZ")])
    np.testing.assert_allclose(force, expected, rtol=1e-12, atol=1e-12)


#: DATCOM's effectiveness of single slotted flaps of the chord ratio .25 (Roskam VI, figure 8.17): deflection
#: [deg] -> change of the angle of attack by it.
SLOTTED = {10.0: 0.510, 20.0: 0.491, 30.0: 0.456, 40.0: 0.399, 50.0: 0.303}
#: The share of a plain flap's effectiveness of the same chord ratio that is left (figure 8.13).
PLAIN = {10.0: 1.0, 20.0: 0.851, 30.0: 0.642, 40.0: 0.570, 50.0: 0.519}


def turned(flap: str, angle: float) -> float:
    """By how much a deflection [rad] changes the angle of attack of a section."""
    own = database(
        '[parts.strip]\nkind = "section"\nposition = [0.0, 0.0, 0.0]\narea = 2.0\nlift = "5*alpha"\n'
        f"control = {{ delta_flap = {{ chord_ratio = 0.25, {flap} }} }}\n"
    )
    at = {"V": 20.0, "alpha": 0.0, "beta": 0.0, "p": 0.0, "q": 0.0, "r": 0.0, "delta_flap": angle}
    found = own.predict({**at, "rho": 1.2, "qbar": 240.0}).coefficients["CZ"][0]
    return float(-found * own.reference.area / (2.0 * 5.0))


def test_a_slotted_flap_has_the_measured_effectiveness() -> None:
    for degrees, published in SLOTTED.items():
        angle = np.deg2rad(degrees)
        assert turned('type = "slotted"', angle) / angle == pytest.approx(published, rel=0.06)
        assert turned('type = "slotted"', -angle) == -turned('type = "slotted"', angle)
    half = turned('type = "slotted", efficiency = 0.41', 0.3)
    assert half == pytest.approx(0.5 * turned('type = "slotted"', 0.3), rel=1e-12)


def test_a_plain_flap_loses_its_effectiveness_earlier() -> None:
    linear = flap_effectiveness(0.25) * 0.8
    for degrees, published in PLAIN.items():
        angle = np.deg2rad(degrees)
        assert turned('type = "plain"', angle) / angle == pytest.approx(
            linear * published, abs=0.04
        )
    assert turned("efficiency = 0.8", 0.5) == pytest.approx(linear * 0.5, rel=1e-12)


def test_a_flap_over_half_a_strip_has_half_its_measured_effectiveness() -> None:
    """With the measured efficiency and with one that is given."""
    wing = """
[parts.wing]
kind = "surface"
root = [0.0, 0.0, 0.0]
tip = [0.0, 4.0, 0.0]
root_chord = 1.0
strips = 1
lift = "5*alpha"
control = {{ delta_flap = {{ chord_ratio = 0.25, {} }} }}
"""
    at = {"V": 20.0, "alpha": 0.0, "beta": 0.0, "p": 0.0, "q": 0.0, "r": 0.0, "delta_flap": 0.5}
    at |= {"rho": 1.2, "qbar": 240.0}

    def lift(flap: str) -> float:
        return float(database(wing.format(flap)).predict(at).coefficients["CZ"][0])

    whole = lift('type = "slotted"')
    assert lift('type = "slotted", span = [0.0, 0.5]') == pytest.approx(0.5 * whole, rel=1e-12)
    given = lift('type = "slotted", efficiency = 0.41, span = [0.5, 1.0]')
    assert given == pytest.approx(0.25 * whole, rel=1e-12)
