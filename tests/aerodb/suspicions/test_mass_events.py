"""A dropped load: JSBSim's C130 by its own mass, its flights without a drop, and slow changes."""

from collections.abc import Callable

import numpy as np
import pytest

from aerodb.flight import Flight
from aerodb.suspicions.mass_events import mass_event_suspicions
from aerodb.vehicle import mass_channels, parse_vehicle
from tests.support.load_drop import (
    DROP,
    FIRST,
    LOAD,
    RAMP,
    STEP,
    flown,
    logged,
    pilot,
    vehicle_text,
)

#: Flights with and without a drop, in the suite and in full.
REDUCED, FULL = 1, 200


def flight_of(channels: dict[str, np.ndarray]) -> Flight:
    held = {name: values for name, values in channels.items() if name != "time"}
    return Flight("c130-drop", "c130", channels["time"], held)


@pytest.mark.heavy
@pytest.mark.parametrize("gusts", [0.0, 3.0])
def test_a_dropped_load_has_its_time_and_its_mass(
    gusts: float, trials: Callable[[int, int], int]
) -> None:
    """Time within one sample, mass within four standard errors and 6 %, 3 % in the mean."""
    errors = []
    for seed in range(trials(REDUCED, 10)):
        true = flown(60.0, DROP, seed, gusts, pilot)
        (found,) = mass_event_suspicions(
            flight_of(logged(true, seed)), parse_vehicle(vehicle_text(true))
        )
        assert (found.channel, found.kind) == ("mass", "jump")
        assert "az, delta_elevator or alpha" in found.sentence
        said = found.evidence
        assert said["from"] == pytest.approx(FIRST, abs=1.01 * STEP)
        assert said["earliest"] <= FIRST <= said["latest"]
        errors.append(said["mass"] / -LOAD - 1.0)
        print(f"gusts {gusts:g}, seed {seed}: {said}")
        assert abs(errors[-1]) < 0.06
        assert abs(said["mass"] + LOAD) < 4.0 * said["mass_error"]
    assert abs(np.mean(errors)) < 0.03


@pytest.mark.heavy
def test_no_drop_is_found_where_there_is_none(trials: Callable[[int, int], int]) -> None:
    for seed in range(trials(REDUCED, FULL)):
        true = flown(60.0, None, seed, 3.0 * (seed % 2), pilot)
        assert not mass_event_suspicions(
            flight_of(logged(true, seed)), parse_vehicle(vehicle_text(true))
        ), seed


def test_a_stated_drop_is_no_suspicion_and_the_masses_are_those_of_jsbsim() -> None:
    true = flown(60.0, DROP, 0, 0.0, pilot)
    event = (
        f'[[mass.event]]\nflight = "c130-d"\ntime = {FIRST}\nmass = {-LOAD}\n'
        f"position = {list(RAMP)}\n"
    )
    vehicle, flight = parse_vehicle(vehicle_text(true, event)), flight_of(logged(true))
    assert not mass_event_suspicions(flight, vehicle)
    known = mass_channels(flight, vehicle)
    for name in ("mass", "Ixx", "Iyy", "Izz", "cg_x", "cg_z"):
        np.testing.assert_allclose(known[name], true[name], rtol=2e-3, atol=2e-3, err_msg=name)


def test_what_flaps_and_a_gust_change_is_no_mass() -> None:
    """A lift that grows over two seconds and stays, and one that jumps and returns."""
    true = flown(60.0, None, 0, 0.0, pilot)
    for share in (
        0.1 * np.clip((true["time"] - 30.0) / 2.0, 0.0, 1.0),
        0.1 * ((true["time"] > 30.0) & (true["time"] < 32.0)),
    ):
        shown = logged(true)
        shown["az_imu"] = shown["az_imu"] * (1.0 + share)
        assert not mass_event_suspicions(flight_of(shown), parse_vehicle(vehicle_text(true)))


def test_what_jumps_while_flaps_are_on_their_way_is_no_mass() -> None:
    """A load that drops as the flaps go out over four seconds looks like a lift out of proportion."""
    true = flown(60.0, DROP, 0, 0.0, pilot)
    vehicle, shown = parse_vehicle(vehicle_text(true)), logged(true)
    for begin, told in ((FIRST - 20.0, True), (FIRST - 2.0, False)):
        flap = 0.3 * np.clip((true["time"] - begin) / 4.0, 0.0, 1.0)
        found = mass_event_suspicions(flight_of({**shown, "delta_flap": flap}), vehicle)
        assert bool(found) == told
