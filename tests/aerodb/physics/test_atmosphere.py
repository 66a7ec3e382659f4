"""Standard atmosphere, air-data relations and attitudes against published tables and independent
packages."""

import numpy as np
import pytest
from ambiance import Atmosphere
from scipy.spatial.transform import Rotation

from aerodb.flight import Flight
from aerodb.logs.air_data import complete_air_data
from aerodb.physics.atmosphere import mach_from_calibrated, speed_of_sound, standard_atmosphere
from aerodb.physics.frames import euler_321_from_enu_quaternion, euler_321_from_quaternion


@pytest.mark.parametrize(
    ("altitude", "temperature", "pressure", "density"),
    [  # ICAO Doc 7488/3, table of the standard atmosphere by geopotential altitude
        (0.0, 288.15, 101325.0, 1.225),
        (5000.0, 255.65, 54019.9, 0.736116),
        (11000.0, 216.65, 22632.0, 0.363918),
        (20000.0, 216.65, 5474.87, 0.0880345),
        (32000.0, 228.65, 868.014, 0.0132249),
    ],
)
def test_published_standard_atmosphere(
    altitude: float, temperature: float, pressure: float, density: float
) -> None:
    air = standard_atmosphere(altitude)
    assert air.temperature == pytest.approx(temperature, abs=0.005)
    assert air.pressure == pytest.approx(pressure, rel=2e-5)
    assert air.density == pytest.approx(density, rel=2e-5)


def test_standard_atmosphere_against_an_independent_package() -> None:
    altitude = np.linspace(-2000.0, 70000.0, 400)
    other = Atmosphere(Atmosphere.geop2geom_height(altitude))
    air = standard_atmosphere(altitude)
    np.testing.assert_allclose(air.temperature, other.temperature, rtol=1e-12)
    np.testing.assert_allclose(air.pressure, other.pressure, rtol=2e-5)
    np.testing.assert_allclose(air.density, other.density, rtol=2e-5)


def test_standard_atmosphere_ends() -> None:
    assert np.isnan(standard_atmosphere(np.array([-6000.0, 71001.0, np.nan])).density).all()


def test_calibrated_airspeed_is_true_airspeed_at_sea_level_and_less_aloft() -> None:
    sea_level = mach_from_calibrated(np.array([100.0]), np.array([101325.0])) * speed_of_sound(
        np.array([288.15])
    )
    assert sea_level == pytest.approx(100.0, rel=1e-9)
    # The other way round: the impact pressure at Mach 0.8 and 30000 ft, read at sea level.
    pressure = standard_atmosphere(9144.0).pressure
    impact = pressure * ((1.0 + 0.2 * 0.8**2) ** 3.5 - 1.0)
    calibrated = speed_of_sound(np.asarray(288.15)) * np.sqrt(
        5.0 * ((impact / 101325.0 + 1.0) ** (2.0 / 7.0) - 1.0)
    )
    assert mach_from_calibrated(calibrated, pressure) == pytest.approx(0.8, rel=1e-12)


def _flight(**channels: float) -> Flight:
    return Flight(
        "f", "v", np.arange(3.0), {name: np.full(3, value) for name, value in channels.items()}
    )


def test_air_data_are_completed_in_any_direction() -> None:
    rho, v = 0.9, 80.0
    whole = {"rho": rho, "V": v, "qbar": 0.5 * rho * v * v}
    for absent, value in whole.items():
        flight = complete_air_data(
            _flight(**{name: x for name, x in whole.items() if name != absent})
        )
        np.testing.assert_allclose(flight[absent], value, rtol=1e-12)
        assert any(note.startswith(absent) for note in flight.notes)


def test_air_data_from_static_quantities() -> None:
    air = standard_atmosphere(3000.0)
    flight = complete_air_data(
        _flight(static_pressure=float(air.pressure), temperature=float(air.temperature), mach=0.3)
    )
    v = 0.3 * float(speed_of_sound(air.temperature))
    np.testing.assert_allclose(flight["V"], v, rtol=1e-12)
    np.testing.assert_allclose(flight["qbar"], 0.5 * float(air.density) * v * v, rtol=1e-12)
    np.testing.assert_allclose(flight["qbar"], 0.7 * float(air.pressure) * 0.09, rtol=1e-12)


def test_air_data_keep_flags_and_invent_nothing() -> None:
    flight = _flight(rho=1.0, V=50.0).with_flag("V", "gap", np.array([False, True, False]))
    assert complete_air_data(flight).usable(["qbar"]).tolist() == [True, False, True]
    assert "qbar" not in complete_air_data(_flight(V=50.0))
    at_rest = complete_air_data(_flight(qbar=0.0, V=0.0))
    assert "rho" not in at_rest


def _random_rotations() -> Rotation:
    return Rotation.random(200, random_state=np.random.default_rng(5))


def test_euler_angles_of_a_quaternion() -> None:
    rotation = _random_rotations()
    x, y, z, w = rotation.as_quat().T
    expected = rotation.as_euler("ZYX")[:, ::-1].T
    np.testing.assert_allclose(euler_321_from_quaternion(w, x, y, z), expected, atol=1e-7)


def test_euler_angles_of_a_ros_quaternion() -> None:
    rotation = _random_rotations()
    earth = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]])
    body = np.diag([1.0, -1.0, -1.0])
    expected = Rotation.from_matrix(earth @ rotation.as_matrix() @ body).as_euler("ZYX")[:, ::-1].T
    x, y, z, w = rotation.as_quat().T
    np.testing.assert_allclose(euler_321_from_enu_quaternion(w, x, y, z), expected, atol=1e-7)


def test_ros_quaternion_of_an_aircraft_that_flies_level_to_the_east() -> None:
    one, zero = np.ones(1), np.zeros(1)
    phi, theta, psi = euler_321_from_enu_quaternion(one, zero, zero, zero)
    np.testing.assert_allclose(np.ravel([phi, theta, psi]), [0.0, 0.0, np.pi / 2], atol=1e-12)
