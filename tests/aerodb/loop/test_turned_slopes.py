"""A slope over alpha that is added: about which point it turns the curve."""

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

import numpy as np
import pytest

from aerodb.effects import zero_lift_alpha
from aerodb.loop import freeze_library
from aerodb.loop.turned_slopes import about_flown_mean, about_zero_lift
from aerodb.tables import AeroDatabase, Increment, Interval, parse
from tests.aerodb.loop.test_axis_models import database, flights
from tests.support.flights_in_memory import FlightsInMemory

MORE = -0.4  # 1/rad


@pytest.fixture(scope="module")
def source() -> FlightsInMemory:
    return flights(range(60, 63))


def with_slope(regressor: str, axis: str = "CZ") -> AeroDatabase:
    whole = database(1.0)
    slope = Increment(
        axis,
        (parse(regressor),),
        np.array([MORE]),
        np.array([[1e-4]]),
        {"alpha": Interval(-0.5, 0.5, 0.1)},
        ("one",),
    )
    return replace(whole, increments=(*whole.increments, slope))


def lacking(source: FlightsInMemory, regressor: str, axis: str = "CZ") -> FlightsInMemory:
    """The flights of an aircraft that has this slope beside its database."""
    flown = {}
    for id, (flight, made) in source.flown.items():
        has, lacks = (
            each.predict(flight.channels).coefficients[axis]
            for each in (with_slope(regressor, axis), database(1.0))
        )
        flown[id] = (
            flight,
            replace(made, values={**made.values, axis: made.values[axis] + has - lacks}),
        )
    return FlightsInMemory(source.vehicle, flown)


def about(
    source: FlightsInMemory,
    before: AeroDatabase,
    candidate: AeroDatabase,
    sensors: Mapping[str, float] = MappingProxyType({}),
) -> AeroDatabase:
    ids = tuple(source.flown)
    library = freeze_library(source, ids, before)
    return about_zero_lift(source, ids, before, candidate, library, sensors)


def added(source: FlightsInMemory) -> Increment:
    return about(source, database(1.0), with_slope("alpha")).increments[-1]


def test_a_lift_curve_that_is_wrong_by_a_share_turns_about_zero_lift(
    source: FlightsInMemory,
) -> None:
    at = zero_lift_alpha(database(1.0))
    assert abs(at) > 0.005
    turned = f"alpha + {-at!r}" if at < 0 else f"alpha - {at!r}"
    flown = lacking(source, turned)
    slope = added(flown)
    assert slope.regressors == (parse(turned),)
    assert slope.estimates == pytest.approx([MORE])


def test_a_slope_about_no_angle_of_attack_stays(source: FlightsInMemory) -> None:
    flown = lacking(source, "alpha")
    assert added(flown).regressors == (parse("alpha"),)


def test_a_centre_of_gravity_that_is_off_does_not_choose_the_point(
    source: FlightsInMemory,
) -> None:
    """It brings a constant that looks like a turn about zero lift, until it is found itself."""
    plain, turned = with_slope("alpha", "Cm"), database(1.0)
    flown = lacking(source, "alpha", "Cm")
    library = freeze_library(flown, tuple(flown.flown), turned)
    (cg,) = (each for each in library.hypotheses if each.id == "cg_offset@all:x")
    columns = {id: cg.columns(flown.view(id, plain))["Cm"] for id in flown.flown}
    level = MORE * zero_lift_alpha(turned)  # that of a turn about zero lift
    off = -1.2 * level / float(np.mean([column.mean() for column in columns.values()]))
    seen = {}
    for id, (flight, made) in flown.flown.items():
        moment = made.values["Cm"] + off * columns[id]
        seen[id] = (flight, replace(made, values={**made.values, "Cm": moment}))
    flown = FlightsInMemory(flown.vehicle, seen)
    hidden = about(flown, turned, plain)
    assert hidden.increments[-1].regressors != (parse("alpha"),)
    assert about(flown, turned, plain, {cg.id: off}) is plain
    again = about(flown, turned, hidden, {cg.id: off})  # what was turned before, too
    assert again.increments[-1].regressors == (parse("alpha"),)


def test_what_the_database_had_before_is_not_turned(source: FlightsInMemory) -> None:
    at = zero_lift_alpha(database(1.0))
    flown = lacking(source, f"alpha + {-at!r}" if at < 0 else f"alpha - {at!r}")
    older = with_slope("alpha")
    assert about(flown, older, older) is older


def test_about_the_flown_mean_a_slope_leaves_the_level(source: FlightsInMemory) -> None:
    """Something else put the level off by as much as the slope brings: about the mean nothing moves."""
    ids, before = tuple(source.flown), database(1.0)
    turned = about_flown_mean(source, ids, before, with_slope("alpha"), {"CZ"})
    mean = np.mean([source.flight(id)["alpha"].mean() for id in ids])

    def level(model: AeroDatabase) -> float:
        return float(np.mean([source.comparison(id, model).residual("CZ").mean() for id in ids]))

    assert level(turned) == pytest.approx(level(before), abs=2e-4)
    assert level(with_slope("alpha")) - level(before) == pytest.approx(-MORE * mean, rel=0.02)
    assert "flown mean" in turned.increments[-1].note
    other = about_flown_mean(source, ids, before, with_slope("alpha"), {"Cm"})
    assert other.increments[-1].regressors == (parse("alpha"),)
