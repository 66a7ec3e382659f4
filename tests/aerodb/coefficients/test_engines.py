"""Engines that are logged one by one: each acts on a line of its own."""

from dataclasses import replace

import numpy as np
import pytest

from aerodb.coefficients import total_coefficients
from aerodb.coefficients.thrust import thrust_share
from aerodb.errors import InputError
from aerodb.flight import Flight
from aerodb.vehicle import Vehicle, parse_vehicle, vehicle_template
from tests.support import effect_flights

ARM, HEIGHT = 2.5, -0.4
ENGINES = {
    "left": {"point": [-1.0, -ARM, HEIGHT]},
    "right": {"point": [-1.0, ARM, HEIGHT]},
}


def vehicle(thrust: dict[str, object]) -> Vehicle:
    return Vehicle.model_validate({**effect_flights.vehicle().model_dump(), "thrust": thrust})


@pytest.fixture(scope="module")
def flight() -> Flight:
    """A flight whose engines give thrusts that differ, and change."""
    model = effect_flights.database(wind=False)
    (flown,) = effect_flights.flown_together([31], model, effect_flights.vehicle())
    t = flown.time - flown.time[0]
    left, right = 700.0 + 90.0 * np.sin(0.7 * t), 500.0 + 60.0 * np.cos(1.1 * t)
    made = {"thrust_left": left, "thrust_right": right, "thrust": left + right}
    return flown.with_channels(made)


def test_unequal_engines_give_the_moments_of_their_arms(flight: Flight) -> None:
    """``N = -sum T_i y_i`` and ``M = sum T_i z_i`` about the moment reference, which is in the plane
    of symmetry and on the datum's height: what is taken out of the total coefficients."""
    none = total_coefficients(flight, vehicle({"source": "none"}), angular_acceleration="logged")
    both = total_coefficients(
        flight, vehicle({"source": "channel", "engines": ENGINES}), angular_acceleration="logged"
    )
    reference, qbar = effect_flights.vehicle().reference, flight["qbar"]
    left, right = flight["thrust_left"], flight["thrust_right"]
    yaw = ARM * (left - right)
    pitch = HEIGHT * (left + right)
    for axis, load, length in (
        ("CX", left + right, 1.0),
        ("Cm", pitch, reference.chord),
        ("Cn", yaw, reference.span),
    ):
        expected = none.values[axis] - load / (qbar * reference.area * length)
        np.testing.assert_allclose(both.values[axis], expected, atol=1e-12)


def test_equal_engines_are_one_on_the_line_between(flight: Flight) -> None:
    half = 0.5 * flight["thrust"]
    even = flight.with_channels({"thrust_left": half, "thrust_right": half})
    one = {"source": "channel", "point": [-1.0, 0.0, HEIGHT]}
    pair = {"source": "channel", "engines": ENGINES}
    first, second = (
        total_coefficients(even, vehicle(thrust), angular_acceleration="logged").values
        for thrust in (one, pair)
    )
    for axis in first:
        np.testing.assert_allclose(second[axis], first[axis], atol=1e-12)


def test_an_engine_that_is_not_logged_leaves_its_axes_open(flight: Flight) -> None:
    """Also Cn, although the moments of two equal engines would cancel; not Cm, where the elevator
    moves far more than an arm of .4 m could."""
    lacking = replace(
        flight, channels={k: v for k, v in flight.channels.items() if k != "thrust_right"}
    )
    aircraft = vehicle({"source": "channel", "engines": ENGINES})
    made = total_coefficients(lacking, aircraft, angular_acceleration="logged")
    assert {"CX", "Cn"} <= set(made.left_out)
    assert "Cm" not in made.left_out
    assert any("thrust_<engine>" in note for note in made.notes)
    share = thrust_share(lacking, aircraft, np.zeros((len(flight.time), 3)))
    assert share is not None
    assert not share.known.any()


@pytest.mark.parametrize(
    ("thrust", "says"),
    [
        ({"source": "none", "engines": ENGINES}, 'source = "channel"'),
        ({"source": "channel", "point": [0, 0, 0], "engines": ENGINES}, "each engine its own"),
        ({"source": "channel", "engines": {"lefft": {}}}, "thrust_left"),
    ],
)
def test_a_wrong_statement_is_refused(thrust: dict[str, object], says: str) -> None:
    with pytest.raises(ValueError, match=says):
        vehicle(thrust)


def test_the_template_shows_engines() -> None:
    text = vehicle_template("my-twin").replace('source = "unknown" ', 'source = "channel" ')
    for line in ("[thrust.engines.left]", "point = [-1.2, -2.0, -0.3]", "direction = [1.0"):
        assert f"# {line}" in text
        text = text.replace(f"# {line}", line)
    assert set(parse_vehicle(text).thrust.lines) == {"thrust_left"}
    with pytest.raises(InputError, match="engines"):
        parse_vehicle(text.replace("engines.left", "engins.left"))
