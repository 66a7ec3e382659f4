"""Tables over height: humps and early ends are found, what fades as theory says is not."""

import numpy as np
import pytest

from aerodb.exchange.native import read_native
from aerodb.tables import uneven_height_tables
from tests.support.jsbsim_cases import C172P, C182, imported

HEIGHTS = (0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.7, 1.0, 1.5)  # spans


def database(values: np.ndarray, more: str = "") -> str:
    """A lift over the height above ground in spans."""
    return f"""\
name = "wing"
[reference]
area = 10.0
chord = 1.0
span = 10.0
moment_reference = [0.0, 0.0, 0.0]
[tables.lift_near_ground]
arguments = ["height"]
breakpoints = [{list(HEIGHTS)}]
values = {values.tolist()}
{more}
[variables]
height = {{ expression = "height_above_ground/b_ref" }}
[[terms]]
name = "lift"
axis = "C_lift"
expression = "0.4*lift_near_ground(height)"
"""


def image_vortex() -> np.ndarray:
    """Share of the induced drag by McCormick's image vortices: it rises to one."""
    squared = (16.0 * np.array(HEIGHTS)) ** 2
    return squared / (1.0 + squared)


def judged(values: np.ndarray, more: str = "") -> str:
    return uneven_height_tables(read_native(database(values, more))).get("lift_near_ground", "")


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_what_fades_as_theory_says_is_even(sign: float) -> None:
    assert judged(sign * image_vortex()) == ""
    assert judged(sign * np.exp(-3.0 * np.array(HEIGHTS))) == ""
    assert judged(np.full(len(HEIGHTS), sign)) == ""
    assert judged(np.round(sign * image_vortex(), 2)) == ""


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_hump_is_found_with_its_numbers(sign: float) -> None:
    values = 1.0 + 0.2 * np.exp(-4.0 * np.array(HEIGHTS))
    values[4] = values[3] + 0.02
    said = judged(sign * np.round(values, 3))
    assert "turns by" in said
    assert "at height 0.3, 0.4, 0.5" in said
    assert "ends" not in said


def test_an_end_before_it_has_faded_is_found_unless_it_goes_on() -> None:
    straight = 1.2 - 0.1 * np.array(HEIGHTS)
    assert "up to where it ends, at 1.5" in judged(straight)
    early = np.where(np.array(HEIGHTS) < 0.6, straight, straight[5])
    assert "up to where it ends, at 0.5" in judged(early)
    assert judged(straight, 'extrapolation = ["max"]') == ""


def test_the_known_hump_of_a_light_aircraft_is_found() -> None:
    for aircraft in (C172P, C182):
        (said,) = uneven_height_tables(imported(aircraft)).values()
        assert "1.046, 1.055, 1.019 at" in said
        assert said.endswith("0.3, 0.4, 0.5")
