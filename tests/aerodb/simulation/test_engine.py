"""The engine against closed solutions, independent integration and the product's own equations."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ellipj, ellipkinc

from aerodb.consistency import motion
from aerodb.errors import InputError
from aerodb.physics import EARTH_RATE, GRAVITY, Earth, normal_gravity, standard_atmosphere
from aerodb.simulation import Actuator, Propulsion, flight_model, simulate
from aerodb.support import Array
from aerodb.tables import AeroDatabase, ReferenceGeometry, Term, parse

BRICK = {"mass": 2.267962, "Ixx": 0.002568, "Iyy": 0.008421, "Izz": 0.009755}
HEAVY = {"mass": 800.0, "Ixx": 1e3, "Iyy": 1.5e4, "Izz": 1.6e4}
#: Semi-major axis [m], flattening and gravitational constant [m3/s2] of WGS 84 (TR8350.2, table
#: 3.1 and 3.3), for a field that is computed here without the product.
_A, _F, _GM = 6378137.0, 1.0 / 298.257223563, 3.986004418e14


def database(**terms: str) -> AeroDatabase:
    return AeroDatabase(
        name="body",
        reference=ReferenceGeometry(1.0, 1.0, 1.0, (0.0, 0.0, 0.0)),
        terms=tuple(Term(f"{axis}_all", axis, parse(text)) for axis, text in terms.items()),
    )


def jacobi_rates(inertia: Array, start: Array, time: Array) -> Array:
    """Rates (3, n) of a free body with Ixx < Iyy < Izz (Landau & Lifshitz, Mechanics, section
    37)."""
    twice_energy, square = inertia @ start**2, inertia**2 @ start**2
    order = [0, 1, 2] if square > twice_energy * inertia[1] else [2, 1, 0]
    a, b, c = inertia[order]
    first = np.sqrt((twice_energy * c - square) / (a * (c - a)))
    second = np.sqrt((twice_energy * c - square) / (b * (c - b)))
    third = np.sqrt((square - twice_energy * a) / (c * (c - a)))
    rate = np.sqrt((c - b) * (square - twice_energy * a) / (a * b * c))
    modulus = (b - a) * (twice_energy * c - square) / ((c - b) * (square - twice_energy * a))
    w = start[order]
    phase = ellipkinc(np.arctan2(w[1] / second, w[0] / first), modulus)
    sn, cn, dn, _ = ellipj(phase + rate * time, modulus)
    rates = np.empty((3, len(time)))
    rates[order] = np.array([first * cn, second * sn, third * dn])
    return rates


def test_a_free_brick_tumbles_as_the_jacobi_functions_say() -> None:
    """NASA's check case 2: rates of 10, 20 and 30 deg/s, no moments, 30 s."""
    time = np.arange(0.0, 30.0001, 0.01)
    start = np.deg2rad([10.0, 20.0, 30.0])
    flown = simulate(
        flight_model(database()),
        time,
        {"V": 1.0, "altitude": 9144.0, **dict(zip("pqr", start, strict=True))},
        BRICK,
    )
    inertia = np.array([BRICK[name] for name in ("Ixx", "Iyy", "Izz")])
    rates = np.array([flown.channels[name][:, 0] for name in "pqr"])
    np.testing.assert_allclose(rates, jacobi_rates(inertia, start, time), rtol=0, atol=1e-8)
    # Momentum in earth axes stays: the attitude belongs to the rates.
    phi, theta, psi = (flown.channels[name][:, 0] for name in ("phi", "theta", "psi"))
    matrices = _body_to_earth(phi, theta, psi)
    momentum = np.einsum("nij,jn->ni", matrices, inertia[:, None] * rates)
    assert np.abs(momentum / np.linalg.norm(momentum[0]) - momentum[0] / np.linalg.norm(
        momentum[0])).max() < 1e-8  # fmt: skip


def _body_to_earth(phi: Array, theta: Array, psi: Array) -> Array:
    s, c = np.sin, np.cos
    zero, one = np.zeros_like(phi), np.ones_like(phi)
    turn = lambda rows: np.moveaxis(np.array(rows), 2, 0)  # noqa: E731
    yaw = turn([[c(psi), -s(psi), zero], [s(psi), c(psi), zero], [zero, zero, one]])
    pitch = turn([[c(theta), zero, s(theta)], [zero, one, zero], [-s(theta), zero, c(theta)]])
    roll = turn([[one, zero, zero], [zero, c(phi), -s(phi)], [zero, s(phi), c(phi)]])
    return np.asarray(yaw @ pitch @ roll)


def _ned(latitude: float, longitude: float) -> Array:
    """North, east and down [rows] in earth-centred axes."""
    s, c, sl, cl = np.sin(latitude), np.cos(latitude), np.sin(longitude), np.cos(longitude)
    return np.array([[-s * cl, -s * sl, c], [-sl, cl, 0.0], [-c * cl, -c * sl, -s]])


def _geodetic(r: Array) -> tuple[float, float, float]:
    """Latitude, longitude and height by iteration (Hofmann-Wellenhof & Moritz, eq. 5-31)."""
    square = _F * (2.0 - _F)
    radius, height, latitude = np.hypot(r[0], r[1]), 0.0, np.arctan2(r[2], np.hypot(r[0], r[1]))
    for _ in range(12):
        normal = _A / np.sqrt(1.0 - square * np.sin(latitude) ** 2)
        height = radius * np.cos(latitude) + r[2] * np.sin(latitude) - _A * np.sqrt(
            1.0 - square * np.sin(latitude) ** 2
        )  # fmt: skip
        latitude = np.arctan2(r[2], radius * (1.0 - square * normal / (normal + height)))
    return float(latitude), float(np.arctan2(r[1], r[0])), float(height)


def _place(latitude: float, longitude: float, height: float) -> Array:
    square = _F * (2.0 - _F)
    normal = _A / np.sqrt(1.0 - square * np.sin(latitude) ** 2)
    across = (normal + height) * np.cos(latitude)
    return np.array(
        [
            across * np.cos(longitude),
            across * np.sin(longitude),
            (normal * (1.0 - square) + height) * np.sin(latitude),
        ]
    )


def _field_of_the_level_ellipsoid(r: Array) -> Array:
    """Gravity with the centrifugal part, earth-centred axes: the exact closed potential of the
    level ellipsoid (Hofmann-Wellenhof & Moritz, Physical Geodesy (2006), eq. 2-126), by central
    differences over complex steps of its attraction."""
    small = np.sqrt(_F * (2.0 - _F)) * _A
    minor = _A * (1.0 - _F)

    def potential(x: complex, y: complex, z: complex) -> complex:
        square = x * x + y * y + z * z - small * small
        u2 = square * (0.5 + 0.5 * np.sqrt(1.0 + 4.0 * small**2 * z * z / square**2))
        u = np.sqrt(u2)
        sine = z / u
        q = 0.5 * ((1.0 + 3.0 * u2 / small**2) * np.arctan(small / u) - 3.0 * u / small)
        q0 = 0.5 * (
            (1.0 + 3.0 * minor**2 / small**2) * np.arctan(small / minor) - 3.0 * minor / small
        )
        rate2 = EARTH_RATE**2
        return (
            _GM / small * np.arctan(small / u)
            + 0.5 * rate2 * _A**2 * q / q0 * (sine * sine - 1.0 / 3.0)
            + 0.5 * rate2 * (x * x + y * y)
        )

    step = 1e-6
    return np.array(
        [potential(*(r + 1j * step * axis)).imag / step for axis in np.eye(3)]  # type: ignore[arg-type]
    )


@pytest.mark.parametrize(
    ("field", "tolerance"), [("product", 1e-8), ("exact", 2e-7)], ids=("same field", "exact field")
)
def test_a_sphere_drops_over_the_rotating_earth(field: str, tolerance: float) -> None:
    """NASA's check case 6: a sphere with drag, released at rest over the equator's earth at 9144 m;
    here at 35 degrees, where the Coriolis and the transport terms all act. The reference integrates
    in earth-centred rotating axes, without radii of curvature, quaternion or transport rate.

    With the product's field (its second-order expansion in height) the paths must agree; with the
    exact field of the ellipsoid the difference is that of the expansion."""
    latitude, height, drag, mass = np.deg2rad(35.0), 9144.0, 0.0182, 14.5939
    spin = np.array([0.0, 0.0, EARTH_RATE])

    def gravity(r: Array) -> Array:
        if field == "exact":
            return _field_of_the_level_ellipsoid(r)
        here = _geodetic(r)
        local = normal_gravity(here[0], here[2])
        return np.array([local.north_by_height * here[2], 0.0, local.gravity]) @ _ned(*here[:2])

    def rates(_: float, y: Array) -> Array:
        r, v = y[:3], y[3:]
        air = standard_atmosphere(_geodetic(r)[2])
        resistance = 0.5 * float(air.density) * np.linalg.norm(v) * v * drag / mass
        return np.concatenate([v, gravity(r) - 2.0 * np.cross(spin, v) - resistance])

    time = np.arange(0.0, 30.0001, 0.02)
    first = np.concatenate([_place(latitude, 0.0, height), [0, 0, 0]])
    first[3:] = 1e-3 * _ned(latitude, 0.0)[2]
    path = solve_ivp(rates, (0, 30), first, "DOP853", time, rtol=1e-12, atol=1e-7).y
    truth = np.array([_geodetic(r) for r in path[:3].T]).T
    model = flight_model(
        database(
            CX="-0.0182 * cos(alpha) * cos(beta)",
            CY="-0.0182 * sin(beta)",
            CZ="-0.0182 * sin(alpha) * cos(beta)",
        ),
        earth=Earth(float(latitude)),
    )
    flown = simulate(
        model, time,
        {"V": 1e-3, "alpha": np.pi / 2, "altitude": height, "r": -EARTH_RATE * np.sin(latitude),
         "p": EARTH_RATE * np.cos(latitude)},
        {"mass": mass, "Ixx": 4.88, "Iyy": 4.88, "Izz": 4.88},
    )  # fmt: skip
    fallen = height - truth[2, -1]
    to_north, to_east = Earth(float(latitude)).metres_per_radian
    assert fallen > 3000.0
    for name, expected in (
        ("altitude", truth[2]),
        ("north", (truth[0] - latitude) * to_north),
        ("east", truth[1] * to_east),
    ):
        error = np.abs(flown.channels[name][:, 0] - expected).max() / fallen
        assert error < tolerance, (name, error)
    assert truth[1, -1] * to_east > 0.5  # it falls to the east


@pytest.mark.parametrize("earth", [None, Earth(float(np.deg2rad(48.0)), 0.2, 45.0)])
def test_reconstruction_and_simulation_have_one_kinematics(earth: Earth | None) -> None:
    """The derivative of a run's state equals that of flight-path reconstruction under the run's
    specific force and rates."""
    model = flight_model(
        database(CX="-.05", CZ="-.4 - 3 * alpha", Cm="-.5 * alpha", Cl="-.1 * beta"), earth=earth
    )
    flown = simulate(
        model, np.arange(0.0, 5.0, 0.01),
        {"V": 90.0, "alpha": 0.05, "beta": 0.02, "p": 0.2, "r": 0.1, "phi": 0.4, "altitude": 2e3},
        {"mass": 20.0, "Ixx": 9.0, "Iyy": 20.0, "Izz": 25.0, "wind_north": 5.0, "wind_east": -3.0},
    )  # fmt: skip
    x = flown.state[:, 0]
    state = np.array([*x[:3], *x[6:12], -x[12]])
    force = np.array([flown.channels[name][-1, 0] for name in ("ax", "ay", "az")])
    slope, jacobian = np.zeros(10), np.zeros((10, 16))
    if earth is None:
        motion._slope(state, np.array([*force, *x[3:6]]), GRAVITY, slope, jacobian)
    else:
        place = np.array([earth.latitude, earth.height, *earth.metres_per_radian])
        motion._slope_rotating(state, np.array([*force, *x[3:6]]), place, slope, jacobian)
    rates = flown.rates[:, 0]
    expected = np.array([*rates[:3], *rates[6:12], -rates[12]])
    np.testing.assert_allclose(expected, slope, rtol=1e-12, atol=1e-13)


def test_the_engine_reads_the_product_s_standard_atmosphere() -> None:
    altitude = np.array([0.0, 5e3, 11e3, 15e3, 25e3, 40e3])
    air = standard_atmosphere(altitude)
    flown = simulate(
        flight_model(database()),
        np.array([0.0, 0.01]),
        {"V": 100.0, "altitude": altitude},
        BRICK,
    )
    np.testing.assert_allclose(flown.channels["rho"][0], air.density, rtol=1e-12)
    np.testing.assert_allclose(flown.channels["temperature"][0], air.temperature, rtol=1e-12)


def test_alphadot_is_solved_and_not_delayed() -> None:
    """CZ and Cm with alphadot terms: the accelerations satisfy the equations with the alphadot
    that they themselves make."""
    text = {"CZ": "-.3 - 4 * alpha - 2 * alphadot * 1 / (2 * V)", "CX": "-.03"}
    model = flight_model(database(**text, Cm="-.4 * alpha - 6 * alphadot * 1 / (2 * V)"))
    flown = simulate(
        model,
        np.arange(0.0, 2.0, 0.01),
        {"V": 40.0, "alpha": 0.1, "altitude": 500.0},
        {"mass": 20.0, "Ixx": 5.0, "Iyy": 8.0, "Izz": 9.0},
    )
    c = {name: values[:, 0] for name, values in flown.channels.items()}
    slope = (c["alpha"][2:] - c["alpha"][:-2]) / 0.02
    np.testing.assert_allclose(slope, c["alphadot"][1:-1], atol=2e-3 * np.ptp(c["alphadot"]))
    predicted = model.database.predict(
        {"alpha": c["alpha"], "alphadot": c["alphadot"], "V": c["V"]}
    )
    np.testing.assert_allclose(c["CZ"], predicted.coefficients["CZ"], rtol=1e-9)
    np.testing.assert_allclose(c["Cm"], predicted.coefficients["Cm"], rtol=1e-9, atol=1e-12)
    assert flown.unresolved == 0


def test_actuators_limit_the_rate_and_the_deflection() -> None:
    model = flight_model(
        database(Cm="-.1 * delta_e"),
        actuators={"delta_e": Actuator(limits=(-0.2, 0.2), rate=0.5, lag=0.05)},
    )
    time = np.arange(0.0, 3.0, 0.01)
    command = np.where(time > 0.995, 1.0, 0.0)
    flown = simulate(model, time, {"V": 30.0, "altitude": 100.0}, BRICK | {"delta_e": command})
    moved = flown.channels["delta_e"][:, 0]
    assert np.diff(moved).max() <= 0.5 * 0.01 + 1e-12
    assert np.diff(moved).max() > 0.0049
    assert moved.max() <= 0.2
    assert moved[-1] == pytest.approx(0.2, abs=1e-9)


def test_thrust_acts_along_its_line_through_its_point() -> None:
    """Two engines, one failed: the yawing moment is thrust times arm, the CG counted."""
    engines = [
        Propulsion(parse("T_left"), (0.0, -2.0, 0.5)),
        Propulsion(parse("T_right"), (0.0, 2.0, 0.5)),
    ]
    model = flight_model(database(), engines=engines)
    flown = simulate(
        model, np.array([0.0]), {"V": 50.0, "altitude": 1e3},
        BRICK | {"mass": 100.0, "Izz": 50.0, "T_left": 0.0, "T_right": 300.0, "cg_y": 0.1,
                 "cg_z": 0.2},
    )  # fmt: skip
    assert flown.channels["ax"][0, 0] == pytest.approx(3.0)
    assert flown.rates[5, 0] == pytest.approx(-300.0 * 1.9 / 50.0)
    assert flown.rates[4, 0] == pytest.approx(300.0 * 0.3 / BRICK["Iyy"])


def test_runs_side_by_side_equal_single_runs() -> None:
    model = flight_model(database(CZ="-.4 - 3 * alpha", Cm="-.5 * alpha - .6 * delta_e"))
    time = np.arange(0.0, 2.0, 0.01)
    speeds, pulse = np.linspace(30.0, 60.0, 37), np.where((time > 0.5) & (time < 0.8), 0.1, 0.0)
    vehicle = {"mass": 20.0, "Ixx": 5.0, "Iyy": 8.0, "Izz": 9.0, "delta_e": pulse}
    together = simulate(model, time, {"V": speeds, "altitude": 100.0}, vehicle)
    for j in (0, 15, 16, 36):
        alone = simulate(model, time, {"V": speeds[j], "altitude": 100.0}, vehicle)
        for name in ("alpha", "q", "theta", "V"):
            np.testing.assert_array_equal(together.channels[name][:, j], alone.channels[name][:, 0])


def test_a_diverging_run_keeps_what_came_before() -> None:
    model = flight_model(database(CX="2"))
    time = np.arange(0.0, 20.0, 0.01)
    flown = simulate(model, time, {"V": 50.0, "alpha": 0.01, "altitude": 1e3}, HEAVY)
    last = int(flown.ended[0])
    assert 500 < last < len(time)  # V grows as 1 / (16 s - t)
    assert np.isfinite(flown.channels["alpha"][:last, 0]).all()
    assert np.isnan(flown.channels["alpha"][last:, 0]).all()
    assert any("ended at" in note for note in flown.notes())


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"mass": None}, "inputs missing: mass"),
        ({"delta_e": np.full(10, np.nan)}, "not finite: delta_e"),
        ({"delta_el": 0.0}, "no input 'delta_el'"),
    ],
)
def test_bad_input_is_named(change: dict[str, Array | None], said: str) -> None:
    model = flight_model(database(Cm="-.1 * delta_e"))
    given = {**BRICK, "delta_e": 0.0, **change}
    series = {name: value for name, value in given.items() if value is not None}
    with pytest.raises(InputError, match=said):
        simulate(model, np.arange(10) * 0.01, {"V": 30.0, "altitude": 100.0}, series)
    with pytest.raises(InputError, match="no airspeed"):
        simulate(model, np.arange(10) * 0.01, {"altitude": 100.0}, {**BRICK, "delta_e": 0.0})


def test_air_that_rotates_turns_a_damped_body_with_it_and_no_gyro_shows_it() -> None:
    """With ``Cl = -c p``, p goes exponentially to the rotation of the air."""
    damped = flight_model(database(Cl="-0.2*p"))
    time = np.arange(0.0, 4.0001, 0.01)
    start = {"V": 30.0, "altitude": 0.0}
    flown = simulate(damped, time, start, HEAVY | {"gust_p": 0.1, "temperature_offset": 0.0})
    qbar = flown.channels["qbar"][0, 0]
    rate = 0.2 * qbar / HEAVY["Ixx"]
    assert flown.channels["p"][0, 0] == 0.0
    np.testing.assert_allclose(
        flown.channels["p"][:50, 0], 0.1 * (1 - np.exp(-rate * time[:50])), rtol=0.02, atol=1e-6
    )
