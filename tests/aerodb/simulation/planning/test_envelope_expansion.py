"""The next permitted point; campaigns flown with it are in `tests/campaigns/expansion.py`."""

from dataclasses import replace

import pytest

from aerodb.errors import InputError
from aerodb.simulation import Condition, Growth, Margins, expand_envelope, trim
from tests.support.flying_increments import ALTITUDE, BODY, light_aircraft

LIMITS = dict.fromkeys(("delta_elevator", "delta_aileron", "delta_rudder"), (-0.35, 0.35))
MARGINS = Margins(sigmas=2.0, control=0.1, growth_rate=0.3)
RANGE = ("V", 48.0, 36.0, 6.0)


def _expansion(margins=MARGINS, growth=(), limits=LIMITS):
    condition = Condition(48.0, ALTITUDE)
    return expand_envelope(
        light_aircraft().database, condition, BODY, *RANGE, margins, growth, limits=limits
    )


def test_without_uncertainty_the_step_is_the_full_one() -> None:
    found = _expansion()
    assert found.value == pytest.approx(42.0)
    assert not found.reached
    assert found.stopped_by == ()


def test_the_step_ends_where_the_trimmed_elevator_reaches_its_margin() -> None:
    """Elevator limits that the exact trim at 45 m/s just needs: the last point before it."""
    needed = trim(light_aircraft(), Condition(45.0, ALTITUDE), BODY).deflections["delta_elevator"]
    limits = {**LIMITS, "delta_elevator": (needed - 1e-6, 0.35)}
    found = _expansion(replace(MARGINS, control=0.0), limits=limits)
    assert found.value == pytest.approx(45.0)
    assert "delta_elevator" in found.stopped_by[0]


def test_the_step_shrinks_as_the_uncertainty_grows() -> None:
    values = [
        _expansion(growth=[Growth("Cm", "alpha", size)]).value for size in (1e-3, 20.0, 3000.0)
    ]
    assert values[0] == pytest.approx(42.0)
    assert values[0] < values[1] <= values[2] == 48.0


def test_margins_that_fail_at_the_edge_are_an_error() -> None:
    with pytest.raises(InputError, match=r"V 48 m/s: alpha 2\.61 deg is outside 0 deg to"):
        _expansion(Margins(channels={"alpha": (0.0, 0.01)}))


def test_growth_is_stated_for_channels_of_a_trim() -> None:
    with pytest.raises(InputError, match="no channel"):
        _expansion(growth=[Growth("Cm", "alpha", 4.0, across="nothing")])
