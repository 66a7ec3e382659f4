"""Which swing of the airspeed is a phugoid."""

import pytest

from aerodb.simulation import Oscillation
from aerodb.tasks.steps.fly import _is_phugoid


@pytest.mark.parametrize(
    ("period", "speed", "expected"),
    [(35.0, 77.2, True), (25.0, 77.2, True), (0.4, 77.2, False), (9.0, 20.0, True)],
)
def test_a_fast_swing_of_the_airspeed_is_none(period: float, speed: float, expected: bool) -> None:
    """Lanchester: sqrt(2) pi V / g, 35 s at 150 kt and 9 s at 39 kt."""
    assert _is_phugoid(Oscillation(1.0, 0.05, period, 10.0, 0.0, 0.0), speed) is expected
