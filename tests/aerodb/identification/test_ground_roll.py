"""Rolls on the ground: JSBSim's as an independent second, planted friction, and what cannot be said."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from aerodb.errors import InputError
from aerodb.estimation import Fit, output_error
from aerodb.exchange.native import read_native
from aerodb.flight import Flight
from aerodb.identification import (
    RolledFlight,
    Rolls,
    ground_fit,
    ground_parameters,
    ground_rolls,
    recorded_rolls,
    roll_errors,
)
from aerodb.identification.ground_records import roll_model
from aerodb.identification.ground_roll import fitted_roll
from aerodb.identification.likelihood_bounds import with_bounds
from aerodb.simulation import Condition, flight_model, simulate, trim
from aerodb.vehicle import parse_vehicle
from tests.support.three_wheels import (
    MASSES,
    ROLLING,
    SIDE,
    SPRING,
    VEHICLE,
    WITH_AIR,
    measured,
    rolled_in_jsbsim,
)

OWN, WHEELS = read_native(WITH_AIR), parse_vehicle(VEHICLE)
LEVEL = 1.2 - MASSES["mass"] * 9.80665 / (3.0 * SPRING)
NAMES = ("mu_brake", "mu_side")


def flight(channels: dict[str, np.ndarray]) -> Flight:
    held = {name: values for name, values in channels.items() if name != "time"}
    return Flight("roll", "wheels", channels["time"] - channels["time"][0], held)


def in_jsbsim(mu: float, wind: tuple[float, float], seed: int) -> Flight:
    pytest.importorskip("jsbsim")
    return flight(measured(rolled_in_jsbsim(mu, wind, LEVEL), seed))


def by_position(
    each: Flight, names: tuple[str, ...] = NAMES, wind: tuple[float, float] | None = None
) -> Fit:
    """By positions with 3 m of noise, and heading, without what the pitot tube says of the wind."""
    rolls = recorded_rolls([RolledFlight(each, WHEELS, "roll")], OWN)
    model, records = roll_model(rolls, names, OWN, wind), rolls.records
    model = replace(model, outputs=("north", "east", "psi"))
    return with_bounds(
        output_error, model, records, fitted_roll(output_error, model, records), names
    )


def by_all(each: Flight, names: tuple[str, ...] = NAMES) -> Fit:
    return ground_fit(
        output_error, recorded_rolls([RolledFlight(each, WHEELS, "roll")], OWN), names, OWN
    )


@pytest.mark.parametrize(("mu", "seed"), [(0.22, 0), (0.1917, 1)])
def test_brakes_of_jsbsims_vehicle_in_a_known_calm(mu: float, seed: int) -> None:
    found = by_position(in_jsbsim(mu, (0.0, 0.0), seed), ("mu_brake",), (0.0, 0.0))["mu_brake"]
    assert found.value == pytest.approx(mu, rel=5e-3)
    assert found.standard_error < 3e-3 * mu


@pytest.mark.parametrize(("mu", "seed"), [(0.22, 0), (0.1917, 1)])
def test_brakes_and_tyres_in_an_unknown_crosswind(mu: float, seed: int) -> None:
    found = by_position(in_jsbsim(mu, (0.0, 5.0), seed))
    assert found["mu_brake"].value == pytest.approx(mu, rel=0.02)
    assert found["mu_side"].value == pytest.approx(SIDE, rel=0.05)
    assert found["wind_east[roll#1]"].value == pytest.approx(5.0, abs=0.3)


def test_in_an_unknown_calm_tyres_have_bounds_and_no_value() -> None:
    found = by_position(in_jsbsim(0.22, (0.0, 0.0), 0))
    assert found["mu_brake"].value == pytest.approx(0.22, rel=0.02)
    side = found["mu_side"]
    assert (side.standing, np.isnan(side.value)) == ("not excited", True)
    low, high = (float(part.split()[0]) for part in side.reason.split(" is ")[1].replace(
        "above ", "").replace("below ", "").split(" and "))  # fmt: skip
    assert low < SIDE < high


def rolled(slope: float = 0.0, mu_brake: float = 0.22, seed: int = 0) -> Flight:
    """A roll of our own engine up a runway, with brakes from 8 s on, in a wind of 2 m/s from
    ahead."""
    model = flight_model(OWN)
    start = trim(model, Condition(50.0, 0.0, ground=True), {**MASSES})
    time = np.arange(0.0, 60.0, 0.02)
    series = {name: np.full(len(time), value) for name, value in start.series.items()}
    series |= {"brake": np.clip(time - 8.0, 0.0, 1.0), "steering": np.zeros(len(time))}
    series["wind_north"] = np.full(len(time), -2.0)
    series["force_x"] = np.full(len(time), -9.80665 * slope * MASSES["mass"])
    run = simulate(model, time, start.start, series, parameters={"mu_brake": mu_brake})
    stands = int(np.argmax(run.channels["velocity_north"][:, 0] < 0.1)) or len(time)
    names = ("V", "alpha", "beta", "p", "q", "r", "phi", "theta", "psi", "north", "east", "ax",
             "height_above_ground", "steering")  # fmt: skip
    channels = {name: run.channels[name][:stands, 0] for name in names}
    channels["time"] = time[:stands]
    noise = np.random.default_rng(seed + 100).normal(0.0, 0.1, (2, stands))
    velocity = [run.channels[f"velocity_{way}"][:stands, 0] for way in ("north", "east")]
    climb = channels["north"] * slope
    found = measured(channels, seed)
    found |= dict(zip(("velocity_north", "velocity_east"), velocity + noise, strict=True))
    return flight(found | {"brake": series["brake"][:stands], "altitude": climb})


def test_a_planted_friction_is_found_uphill() -> None:
    """The slope decelerates by 0.04 m/s2, a tenth of rolling friction: seen in the altitudes."""
    names = ("mu_brake", "mu_roll")
    rolls = recorded_rolls([RolledFlight(rolled(0.004, 0.2), WHEELS, "roll")], OWN)
    found = fitted_roll(output_error, roll_model(rolls, names, OWN, (-2.0, 0.0)), rolls.records)
    for name, value in (("mu_brake", 0.2), ("mu_roll", ROLLING)):
        assert abs(found[name].value - value) < 3.0 * found[name].standard_error
        assert found[name].standard_error < 0.03 * value
    assert any("climbs by 0.4" in note for note in rolls.assumed)


def test_a_slope_that_only_the_altimeter_has_is_told_with_what_it_does_to_rolling_friction() -> (
    None
):
    """A static pressure that errs with the dynamic one climbs as a slope does: friction is less by
    as much as the note says, of what the wing leaves on the wheels before the brakes."""
    names, level = ("mu_brake", "mu_roll"), rolled()
    errs = level.with_channels({"altitude": -0.004 * (level["V"] / 20.0) ** 2 * 100.0})
    rolls = recorded_rolls([RolledFlight(errs, WHEELS, "roll")], OWN)
    found = fitted_roll(output_error, roll_model(rolls, names, OWN, (-2.0, 0.0)), rolls.records)
    (note,) = (note for note in rolls.assumed if "static pressure" in note.lower())
    more = float(note.split("would be about ")[1].split()[0])
    weight, fast = MASSES["mass"] * 9.80665, level["V"][level.time < 8.0]
    carried = weight - 0.2 * 0.5 * 1.225 * 10.3 * float(np.mean(fast**2))
    own = found["mu_roll"]
    assert abs(own.value - ROLLING) > 4.0 * own.standard_error
    assert ROLLING - own.value == pytest.approx(more * weight / carried, rel=0.1)


def test_a_slope_that_altitudes_do_not_tell_is_said() -> None:
    """None without altitudes; with a drift of metres, what rolling friction may be off by."""
    whole = rolled()
    gone = {n: v for n, v in whole.channels.items() if n != "altitude"}
    drift = np.cumsum(np.random.default_rng(5).normal(0.0, 0.05, len(whole.time)))
    drifting = whole.with_channels({"altitude": drift})
    for each, said in (
        (replace(whole, channels=gone), "slope is not known"),
        (drifting, "the runway is level to +- "),
        (whole, ""),
    ):
        notes = recorded_rolls([RolledFlight(each, WHEELS, "roll")], OWN).assumed
        told = [note for note in notes if "slope" in note or "runway" in note]
        assert len(told) == bool(said)
        assert all(said in note for note in told)


@pytest.mark.parametrize("believed", [0.12, 0.26, 0.35])
def test_a_database_with_another_friction_is_corrected(believed: float) -> None:
    """With too much of it the run stands still long before the roll does."""
    text = WITH_AIR.replace("mu_brake = { value = 0.22", f"mu_brake = {{ value = {believed}")
    own = read_native(text)
    assert own.parameters["mu_brake"] == believed
    rolls = recorded_rolls([RolledFlight(rolled(mu_brake=0.2), WHEELS, "roll")], own)
    found = ground_fit(output_error, rolls, ("mu_brake",), own)["mu_brake"]
    assert found.value == pytest.approx(0.2, rel=5e-3)
    assert abs(found.value - 0.2) < 4.0 * found.standard_error


def test_a_slope_without_height_above_ground_costs_a_part_of_the_roll_and_says_so() -> None:
    def rolls(*gone: str) -> Rolls:
        whole = rolled(0.012)
        left = {name: values for name, values in whole.channels.items() if name not in gone}
        each = replace(whole, channels=left)
        return recorded_rolls([RolledFlight(each, WHEELS, "roll")], OWN)

    known, unknown = rolls(), rolls("height_above_ground")
    assert len(unknown.records[0].time) < 0.8 * len(known.records[0].time)
    said = [any("left out as flight" in note for note in each.assumed) for each in (known, unknown)]
    assert said == [False, True]


def test_a_right_friction_stays() -> None:
    found = by_all(rolled(), ("mu_brake",))
    assert abs(found["mu_brake"].value - 0.22) < 3.0 * found["mu_brake"].standard_error


def test_errors_from_a_start_that_is_known_take_fewer_fits_and_are_the_same() -> None:
    """Wind and start of an earlier fit are not searched again among crosswinds."""
    rolls = recorded_rolls([RolledFlight(rolled(), WHEELS, "roll")], OWN)
    fits = list[Fit]()

    def counted(*given: Any) -> Fit:
        fits.append(output_error(*given))
        return fits[-1]

    values = {"mu_brake": 0.22}
    (cold,) = roll_errors(counted, rolls, values, OWN)
    (warm,) = roll_errors(counted, rolls, values, OWN, None, {**cold.found, "mu_brake": 0.3})
    first, again = fits
    assert again.iterations < first.iterations / 2
    for name in cold.measured:
        np.testing.assert_allclose(warm.residual(name), cold.residual(name), atol=0.02)


@pytest.mark.parametrize(
    ("gone", "said"),
    [
        (("brake",), "lacks brake"),
        (("latitude", "longitude", "velocity_north"), "no velocity and no position"),
    ],
)
def test_what_a_roll_lacks_is_said(gone: tuple[str, ...], said: str) -> None:
    whole = rolled()
    left = {name: values for name, values in whole.channels.items() if name not in gone}
    with pytest.raises(InputError) as raised:
        by_all(replace(whole, channels=left))
    assert said in raised.value.what


def test_brakes_in_per_cent_are_said() -> None:
    whole = rolled()
    per_cent = whole.with_channels({"brake": 100.0 * whole["brake"]})
    with pytest.raises(InputError) as raised:
        by_all(per_cent)
    assert "brake reaches 100, but is a share from 0 to 1" in raised.value.what


@pytest.mark.parametrize("gone", [("theta", "phi"), ("height_above_ground", "altitude")])
def test_what_can_still_be_said_is_said(gone: tuple[str, ...]) -> None:
    """Without attitude all of the roll, without height the part that is too slow to fly."""
    whole = rolled()
    left = {name: values for name, values in whole.channels.items() if name not in gone}
    found = by_all(replace(whole, channels=left), ("mu_brake",))
    estimate = found["mu_brake"]
    assert abs(estimate.value - 0.22) < 3.0 * estimate.standard_error
    assert estimate.standard_error < 0.05 * 0.22
    named = {"phi": "theta", "altitude": "altitude"}[gone[-1]]
    assert any(f"{named} is not known" in note for note in found.notes)


def test_a_bounce_is_left_out() -> None:
    whole = rolled()
    theta = whole["theta"] + np.where(whole.time < 3.0, np.deg2rad(5.0), 0.0)
    bounced = whole.with_channels({"theta": theta})
    (roll,) = ground_rolls(bounced)
    rolls = recorded_rolls([RolledFlight(bounced, WHEELS, "roll")], OWN)
    (record,), notes = rolls.records, rolls.assumed
    assert record.time[0] == pytest.approx(3.0, abs=0.3)
    assert roll.start == 0
    assert any("nose wheel in the air" in note for note in notes)


def test_what_acts_on_the_ground_alone() -> None:
    assert ground_parameters(("mu_brake", "mu_side"), OWN)
    text = WITH_AIR.replace("[parameters]\n", "[parameters]\ndrag = { value = 0.06 }\n")
    text += '[[terms]]\nname = "drag"\naxis = "CX"\nexpression = "-drag"\n'
    own = read_native(text)
    assert not ground_parameters(("drag",), own)
    with pytest.raises(InputError, match="ground only"):
        ground_parameters(("drag", "mu_brake"), own)


def test_a_bounce_of_all_wheels_is_left_out_and_said() -> None:
    """The attitude stays, the height above ground shows it: a hop of 1.2 m from 3 to 4.6 s. Noise of
    .1 m and a runway's slope show none."""
    whole = rolled(0.004)
    hop = np.clip(1.0 - ((whole.time - 3.8) / 0.8) ** 2, 0.0, None) * 1.2
    bounced = whole.with_channels({"height_above_ground": whole["height_above_ground"] + hop})
    for flown, begins, said in ((whole, 0.0, False), (bounced, 4.6, True)):
        rolls = recorded_rolls([RolledFlight(flown, WHEELS, "roll")], OWN)
        assert rolls.records[0].time[0] == pytest.approx(begins, abs=0.3)
        assert any("leaves the ground for 1." in note for note in rolls.assumed) == said
