"""Constants that flights share: said with what would leave them, where the database is off."""

from dataclasses import replace

import numpy as np
import pytest

from aerodb.coefficients import total_coefficients
from aerodb.loop import freeze_library, unexplained_levels
from aerodb.tables.database import AeroDatabase, Term
from aerodb.tables.expression import parse
from tests.aerodb.loop.test_axis_models import database, flights
from tests.support.flights_in_memory import FlightsInMemory

OFF = 0.02


@pytest.fixture(scope="module")
def source() -> FlightsInMemory:
    return flights(range(60, 64))


def off_by(size: float) -> AeroDatabase:
    """The whole database, with a zero term of Cm that is wrong."""
    whole = database(1.0)
    return replace(whole, terms=(*whole.terms, Term("off", "Cm", parse(repr(size)))))


def test_a_wrong_zero_term_is_said_with_what_else_would_leave_it(source: FlightsInMemory) -> None:
    ids = tuple(source.flown)
    library = freeze_library(source, ids, off_by(OFF))
    (level,) = unexplained_levels(source, ids, off_by(OFF), library)
    assert level.axis == "Cm"
    assert level.constant == pytest.approx(-OFF, rel=0.05)
    assert level.share > 0.9
    needed = {rival.hypothesis: rival for rival in level.rivals}
    elevator = needed["surface_bias@all:elevator"]
    # minus the constant over dCm/ddelta: the surface deflects by that much more than logged
    channels = source.flight(ids[0]).channels
    step = {**channels, "delta_elevator": channels["delta_elevator"] + 0.01}
    moved, still = (off_by(OFF).predict(c).coefficients["Cm"] for c in (step, channels))
    slope = float(np.mean(moved - still)) / 0.01
    assert elevator.value == pytest.approx(OFF / slope, rel=0.05)


@pytest.mark.parametrize("share", [0.05, -0.05])
def test_a_wrong_mass_is_said_with_what_varies_within_the_flights(
    source: FlightsInMemory, share: float
) -> None:
    """Every flight's intercept holds most of what it leaves on CZ. A bias of the vane would leave that
    as well, but not the rest."""
    mass = source.vehicle.mass
    heavy = mass.model_copy(update={"mass": (1.0 + share) * np.asarray(mass.mass, dtype=float)})
    assumed = source.vehicle.model_copy(update={"mass": heavy})
    wrong = {}
    for id, (flight, made) in source.flown.items():
        as_assumed, right = (
            total_coefficients(flight, vehicle, angular_acceleration="logged").values
            for vehicle in (assumed, source.vehicle)
        )
        shifted = {axis: made.values[axis] + as_assumed[axis] - right[axis] for axis in made.values}
        wrong[id] = (flight, replace(made, values=shifted))
    ids, heavier = tuple(wrong), FlightsInMemory(assumed, wrong)
    levels = unexplained_levels(
        heavier, ids, database(1.0), freeze_library(heavier, ids, database(1.0))
    )
    (lift,) = (level for level in levels if level.axis == "CZ")
    said = {rival.hypothesis: rival for rival in lift.rivals}
    assert said["mass_error@all"].varies
    assert said["mass_error@all"].value == pytest.approx(share, rel=0.1)
    assert "alpha_bias@all" not in said


def test_nothing_is_said_of_the_right_database(source: FlightsInMemory) -> None:
    ids = tuple(source.flown)
    library = freeze_library(source, ids, database(1.0))
    assert unexplained_levels(source, ids, database(1.0), library) == ()
