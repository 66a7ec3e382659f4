"""Constants that flights share: said with what would leave them, where the database is off."""

from dataclasses import asdict, replace

import numpy as np
import pytest

from aerodb.coefficients import total_coefficients
from aerodb.increments.model_file import parse_model_file
from aerodb.loop import freeze_library, unexplained_levels
from aerodb.report.levels import followed, to_declare
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


def test_levels_that_follow_a_condition_are_said_with_it(source: FlightsInMemory) -> None:
    """Four flights at Mach numbers .14 to .22; the database lacks a moment that follows it. The
    same levels in another order follow nothing, and stay a spread."""
    ids, slope = tuple(source.flown), 0.6
    faster = {}
    for factor, (id, (flight, made)) in zip(
        (0.8, 0.95, 1.1, 1.25), source.flown.items(), strict=True
    ):
        mach = factor * flight.channels["mach"]
        faster[id] = (replace(flight, channels={**flight.channels, "mach": mach}), made)
    flown = FlightsInMemory(source.vehicle, faster)
    off = Term("off", "Cm", parse(f"{-slope}*(mach - 0.15)"))
    wrong = replace(database(1.0), terms=(*database(1.0).terms, off))
    library = freeze_library(flown, ids, wrong)
    (level,) = unexplained_levels(flown, ids, wrong, library)
    (condition,) = level.conditions
    assert (level.axis, condition.condition, level.rivals) == ("Cm", "mach", ())
    assert condition.slope == pytest.approx(slope, abs=3.0 * condition.standard_error)
    assert condition.standard_error < 0.2 * slope
    assert condition.effects == ("mach_effect@Cm",)
    assert [at for at, _ in condition.levels] == sorted(at for at, _ in condition.levels)
    entry = asdict(level)
    assert followed(entry).startswith("the level of Cm follows Mach number: ")
    assert parse_model_file(to_declare([entry])).increment[0].axis == "Cm"

    places = (2, 0, 3, 1)
    mixed = {
        id: (replace(flight, channels={**flight.channels, "mach": other[0].channels["mach"]}), made)
        for (id, (flight, made)), other in zip(
            faster.items(), [[*faster.values()][k] for k in places], strict=True
        )
    }
    shifted = {
        id: (flight, replace(made, values={**made.values, "Cm": made.values["Cm"] + shift}))
        for shift, (id, (flight, made)) in zip((-0.02, 0.0, 0.01, 0.02), mixed.items(), strict=True)
    }
    without = FlightsInMemory(source.vehicle, shifted)
    levels = unexplained_levels(
        without, ids, off_by(OFF), freeze_library(without, ids, off_by(OFF))
    )
    assert [level.conditions for level in levels if level.axis == "Cm"] in ([], [()])


def test_nothing_is_said_of_the_right_database(source: FlightsInMemory) -> None:
    ids = tuple(source.flown)
    library = freeze_library(source, ids, database(1.0))
    assert unexplained_levels(source, ids, database(1.0), library) == ()
