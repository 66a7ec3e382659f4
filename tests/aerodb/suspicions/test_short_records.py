"""Records of seconds, in which little moves by itself."""

import numpy as np
import pytest

from aerodb.estimation import least_squares
from aerodb.flight import Flight
from aerodb.suspicions.lift import lift_suspicions
from aerodb.vehicle import parse_vehicle

VEHICLE = """
name = "wing"
[reference]
area = 20.0
chord = 2.0
span = 10.0
[points]
moment_reference = "cg"
[mass]
mass = 2000.0
cg = [0.0, 0.0, 0.0]
Ixx = 2000.0
Iyy = 3000.0
Izz = 4500.0
Ixz = 0.0
"""


def test_two_records_of_one_surface_are_not_told_apart_by_rounding() -> None:
    """Their shares of the inflation were those of what rounding leaves, below one."""
    rng = np.random.default_rng(1)
    one, other = rng.normal(size=(2, 700))
    for apart in (1e-10, 1e-11, 1e-12):
        twin = one + apart * rng.normal(size=700)
        columns = np.column_stack([one, twin, other])
        fit = least_squares(columns, other + 0.1 * rng.normal(size=700), ("one", "twin", "other"))
        assert min(fit.vif[:2]) > 1e12
        assert fit.vif[2] == pytest.approx(1.0, abs=0.05)


def test_alpha_that_goes_back_as_flaps_lift_is_no_lift_slope() -> None:
    """The flaps go out over 4 of 12 s, and lift stays what carries the weight."""
    time = np.arange(0.0, 12.0, 0.02)
    rng = np.random.default_rng(2)
    flap = 0.3 * np.clip((time - 4.0) / 4.0, 0.0, 1.0)
    swing = 0.005 * np.sin(2.0 * np.pi * 0.3 * time)
    lift = 0.4 + 5.0 * swing - 0.06 * flap / 0.3  # a descent begins with them
    flight = Flight(
        "flaps",
        "wing",
        time,
        {
            "V": np.full_like(time, 70.0),
            "qbar": np.full_like(time, 3000.0),
            "alpha": 0.06 + swing - 0.2 * flap + 1e-4 * rng.normal(size=len(time)),
            "az": -lift * 3000.0 * 20.0 / 2000.0 + 0.01 * rng.normal(size=len(time)),
            "delta_flap": flap,
        },
    )
    assert not lift_suspicions(flight, parse_vehicle(VEHICLE))
