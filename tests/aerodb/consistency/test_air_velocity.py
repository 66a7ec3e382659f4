"""The velocity of the air along a flight: from a motion written down here, and what it needs."""

import numpy as np
import pytest

from aerodb.consistency import air_velocity
from aerodb.errors import InputError
from aerodb.flight import Flight

TIME = 0.02 * np.arange(200)


def _channels() -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Banked and climbing flight at a heading, in air that moves as sines; rotation matrices."""
    phi, theta, psi = 0.3 * np.sin(TIME), 0.1 + 0.05 * np.cos(TIME), 0.8 + 0.2 * TIME
    air = np.stack([4.0 + np.sin(3 * TIME), -2.0 + np.cos(5 * TIME), 3.0 * np.sin(7 * TIME)])
    alpha, beta, speed = 0.05 + 0.02 * np.sin(2 * TIME), 0.03 * np.cos(TIME), 50.0 + np.sin(TIME)
    body = speed * np.stack(
        [np.cos(alpha) * np.cos(beta), np.sin(beta), np.sin(alpha) * np.cos(beta)]
    )
    over = np.zeros_like(body)
    for k in range(len(TIME)):
        c, s = np.cos, np.sin
        roll = np.array([[1, 0, 0], [0, c(phi[k]), -s(phi[k])], [0, s(phi[k]), c(phi[k])]])
        pitch = np.array([[c(theta[k]), 0, s(theta[k])], [0, 1, 0], [-s(theta[k]), 0, c(theta[k])]])
        yaw = np.array([[c(psi[k]), -s(psi[k]), 0], [s(psi[k]), c(psi[k]), 0], [0, 0, 1]])
        over[:, k] = yaw @ pitch @ roll @ body[:, k] + air[:, k]
    names = ("velocity_north", "velocity_east", "velocity_down")
    channels = {"V": speed, "alpha": alpha, "beta": beta, "phi": phi, "theta": theta, "psi": psi}
    return channels | dict(zip(names, over, strict=True)), air


def test_it_is_what_moves_over_the_earth_less_what_moves_through_the_air() -> None:
    channels, air = _channels()
    found = air_velocity(Flight("f", "v", TIME, channels))
    np.testing.assert_allclose(found, air, atol=1e-9)


def test_a_vane_alone_is_refused_with_what_is_lacking() -> None:
    channels, _ = _channels()
    alone = {name: channels[name] for name in ("V", "alpha", "phi", "theta")}
    with pytest.raises(InputError, match="lacks psi, velocity_north, velocity_east, velocity_down"):
        air_velocity(Flight("f", "v", TIME, alone))


def test_samples_that_are_not_usable_are_not_known() -> None:
    channels, _ = _channels()
    channels["alpha"] = channels["alpha"].copy()
    channels["alpha"][5] = np.nan
    found = air_velocity(Flight("f", "v", TIME, channels))
    assert np.isnan(found[:, 5]).all()
    assert np.isfinite(np.delete(found, 5, axis=1)).all()
