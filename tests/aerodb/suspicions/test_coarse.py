"""Flow angles and deflections in steps that are coarser than they must be known."""

import numpy as np
import pytest

from aerodb.suspicions.coarse import coarse_suspicions
from aerodb.suspicions.every import against_vehicle, limits_flight
from tests.support import effect_flights

VEHICLE = effect_flights.vehicle()
FLIGHT = effect_flights.flown(2, effect_flights.database())


def stepped(name: str, step: float) -> np.ndarray:
    size = np.deg2rad(step)
    return np.asarray(size * np.round(FLIGHT[name] / size))


@pytest.mark.parametrize("name", ["alpha", "delta_rudder"])
def test_steps_of_two_degrees_are_said_and_limit_the_flight(name: str) -> None:
    made = FLIGHT.with_channels({name: stepped(name, 2.0)})
    said = next(s for s in against_vehicle(made, VEHICLE) if s.channel == name)
    assert said.kind == "steps"
    assert said.evidence["step"] == pytest.approx(np.deg2rad(2.0))
    assert limits_flight(said)


def test_finer_steps_and_a_wider_limit_are_not_said() -> None:
    assert coarse_suspicions(FLIGHT, VEHICLE) == ()
    fine = {name: stepped(name, 0.25) for name in ("alpha", "beta", "delta_elevator")}
    assert coarse_suspicions(FLIGHT.with_channels(fine), VEHICLE) == ()
    wide = VEHICLE.model_copy(
        update={"accuracy": VEHICLE.accuracy.model_copy(update={"flow_angle": np.deg2rad(2.0)})}
    )
    assert coarse_suspicions(FLIGHT.with_channels({"alpha": stepped("alpha", 2.0)}), wide) == ()


def test_a_control_that_is_moved_between_a_few_values_has_no_step() -> None:
    """A 3-2-1-1 of two sizes, as a simulator flies it."""
    few = np.deg2rad(3.0) * np.clip(np.round(FLIGHT["delta_elevator"] / np.deg2rad(3.0)), -2, 2)
    assert len(np.unique(few)) < 6
    assert coarse_suspicions(FLIGHT.with_channels({"delta_elevator": few}), VEHICLE) == ()
