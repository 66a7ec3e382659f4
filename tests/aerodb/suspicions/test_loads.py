"""Mass, CG and thrust of a vehicle file, and controls exchanged, beside the vehicle's database: what
each leaves in closed form, what aerodynamics may lack, and nothing to say where there is nothing."""

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from aerodb.coefficients.comparison import compare
from aerodb.coefficients.total import total_coefficients
from aerodb.conditioning import Suspicion
from aerodb.flight import Flight
from aerodb.physics import GRAVITY
from aerodb.signals import low_passed
from aerodb.suspicions import limits_flight
from aerodb.suspicions.derivatives import Share
from aerodb.suspicions.exchanged import exchanged_suspicions
from aerodb.suspicions.lift import helmbold
from aerodb.suspicions.loads import POSSIBLE, cg_beside, mass_beside, thrust_beside
from aerodb.tables.database import AeroDatabase
from aerodb.vehicle import Vehicle
from tests.aerodb.suspicions.test_against_vehicle import (
    AREA,
    CHORD,
    CM,
    CN,
    MASS,
    SPAN,
    changed,
    with_errors,
    wrong,
)
from tests.aerodb.suspicions.test_database import about_cg, database, flight, said
from tests.support import effect_flights

REFERENCE = (-2.1, 0.0, 0.0)


def with_mass(factor: float) -> Vehicle:
    return wrong(points={"moment_reference": REFERENCE}, mass={"mass": factor * MASS})


@pytest.mark.parametrize("factor", [0.7, 0.85, 1.2])
def test_a_wrong_mass_is_the_factor_of_all_forces(factor: float) -> None:
    (found,) = said(flight(), with_mass(factor), database())
    assert (found.channel, found.kind) == ("mass", POSSIBLE)
    assert found.evidence["factor"] == pytest.approx(factor, rel=0.03)
    assert not limits_flight(found)
    percent = 100 * abs(found.evidence["factor"] - 1.0)
    small = "small" if factor < 1.0 else "large"
    assert f"a mass {percent:.0f} % too {small} would look like this" in found.sentence


@pytest.mark.parametrize(("factor", "told"), [(1.0, False), (0.7, True)])
def test_errors_of_beta_hide_no_mass_and_make_none(factor: float, told: bool) -> None:
    """They make the side force, and each moment by sideslip, a sixth smaller."""
    of, flown = with_mass(factor), with_errors(flight(), "beta", times=6)
    full = compare(flown, total_coefficients(flown, of), database(), of.reference)
    rates = [Share("Cm", name, 1.0, 0.01, 0.5, 1.0) for name in ("q", "p", "r", "delta_rudder")]
    slips = [Share(axis, "beta", 0.7, 0.01, 0.5, 1.0) for axis in ("Cl", "Cn") for _ in range(3)]
    found = mass_beside(full.measured, full.predicted, full.usable, flown.step, [*rates, *slips])
    assert [(each.channel, each.kind) for each in found] == [("mass", POSSIBLE)] * told
    for each in found:
        assert each.evidence["side"] == pytest.approx(factor / 1.2, rel=0.05)
        assert each.evidence["factor"] == pytest.approx(factor, rel=0.03)


def test_a_side_force_that_says_nothing_makes_no_mass_wrong() -> None:
    """Normal force and its change by .8, as a wrong lift of the database has them, and a side force
    of .98 with a large error."""
    rng, n = np.random.default_rng(2), 4000
    swings = (low_passed(rng.standard_normal(n), 0.02, band) for band in (1.0, 1.0, 0.2))
    one, other, slow = (each / np.std(each) for each in swings)
    predicted = {"CZ": -0.5 + 0.1 * one, "CY": 0.05 * other}
    measured = {"CZ": 0.8 * predicted["CZ"], "CY": 0.98 * predicted["CY"] + 0.012 * slow}
    usable = dict.fromkeys(measured, np.ones(n, dtype=bool))
    rates = [Share("Cm", name, 1.0, 0.01, 0.5, 1.0) for name in ("q", "p", "r", "delta_rudder")]
    assert mass_beside(measured, predicted, usable, 0.02, rates) == []
    measured["CY"] *= 0.8
    (found,) = mass_beside(measured, predicted, usable, 0.02, rates)
    assert found.evidence["factor"] == pytest.approx(0.8, rel=0.05)


@pytest.mark.parametrize("scale", [1.21, 1.69, 1.0 / 1.21])
def test_an_upwash_that_is_inverted_is_the_scale_of_alpha(scale: float) -> None:
    made = changed(flight(), alpha=scale * flight()["alpha"])
    (found,) = said(made, about_cg(), database())
    assert (found.channel, found.kind) == ("alpha", POSSIBLE)
    assert found.evidence["factor"] == pytest.approx(scale, rel=0.03)
    assert "[air_data] upwash" in found.sentence
    assert not limits_flight(found)


def test_errors_of_alpha_are_no_scale_of_it() -> None:
    """They make all that alpha does a sixth smaller."""
    for times in (1, 6):
        found = said(with_errors(flight(), "alpha", times), about_cg(), database())
        assert "alpha" not in {each.channel for each in found}


@pytest.mark.parametrize(
    "lacking",
    [
        {"CZ_alpha": 1.0 / 1.2},
        {"CZ_alpha": 0.8},
        {"CY_beta": 0.7},
        {"CZ_alpha": 0.85, "CY_beta": 1.2},
        {"Cm_alpha": 0.6},
        {"Cn_beta": 0.6},
        {"Cm_alpha": 0.7, "Cn_beta": 1.5},
    ],
)
def test_what_a_tunnel_lacks_on_one_axis_is_no_wrong_file(lacking: Mapping[str, float]) -> None:
    assert said(flight(), about_cg(), database(**lacking)) == ()


@pytest.mark.parametrize("shift", [0.3, -0.3])
def test_a_cg_elsewhere_adds_moments_about_two_axes(shift: float) -> None:
    place = (REFERENCE[0] + shift, 0.0, 0.0)
    of = wrong(points={"moment_reference": REFERENCE}, mass={"cg": place})
    (found,) = said(flight(), of, database())
    assert (found.channel, found.kind) == ("cg_x", POSSIBLE)
    assert not limits_flight(found)
    assert found.evidence["shift"] == pytest.approx(shift, rel=0.1)
    assert f"{abs(found.evidence['shift']) / CHORD:.2g} chords" in found.sentence
    assert ("too far forward" if shift > 0 else "too far aft") in found.sentence


def test_both_stabilities_that_truly_differ_like_a_shifted_cg_limit_nothing() -> None:
    """Derivatives that are those about a CG elsewhere: no flight can tell, so it is only named."""
    shift, slope = 0.15, helmbold(SPAN**2 / AREA)
    factors = {
        "Cm_alpha": 1.0 + shift / CHORD * slope / -CM[0],
        "Cn_beta": 1.0 + shift / SPAN * 0.5 / CN[0],
    }
    (found,) = said(flight(), about_cg(), database(**factors))
    assert (found.channel, found.kind) == ("cg_x", POSSIBLE)
    assert not limits_flight(found)
    assert abs(found.evidence["shift"]) == pytest.approx(shift, rel=0.15)


def test_aileron_and_rudder_exchanged() -> None:
    """As in the campaign, also where the database has the effects of both wrong."""
    aileron, rudder = flight()["delta_aileron"], flight()["delta_rudder"]
    made = changed(flight(), delta_aileron=rudder, delta_rudder=aileron)
    for lacking in ({}, {"Cl_delta_aileron": 0.6, "Cn_delta_rudder": 1.5}):
        (found,) = said(made, about_cg(), database(**lacking))
        assert (found.channel, found.kind) == ("delta_aileron", "swapped")
        assert limits_flight(found)


def test_controls_that_hardly_move_are_not_called_exchanged() -> None:
    still = np.zeros_like(flight().time)
    rng = np.random.default_rng(2)
    noise = 1e-5 * rng.standard_normal((2, len(still)))
    made = changed(flight(), delta_aileron=noise[0], delta_rudder=noise[1])
    assert "swapped" not in {each.kind for each in said(made, about_cg(), database())}


@lru_cache(maxsize=1)
def pushed() -> tuple[Flight, Vehicle, AeroDatabase]:
    beside = effect_flights.database()
    return effect_flights.flown(3, beside), effect_flights.vehicle(), beside


def thrust_said(drag: float, expected: float, thrust: float, lift: float = 0.5) -> list[Suspicion]:
    """What is said of constant coefficients: of drag, of the database, and of the logged thrust."""
    made, of, _ = pushed()
    n, area = len(made.time), effect_flights.AREA
    full = {"C_drag": np.full(n, drag), "C_lift": np.full(n, lift)}
    beside = {"C_drag": np.full(n, expected), "C_lift": np.full(n, lift)}
    usable = dict.fromkeys(full, np.ones(n, dtype=bool))
    logged = changed(made, thrust=thrust * made["qbar"] * area)
    return thrust_beside(logged, of, area, full, beside, usable)


@pytest.mark.parametrize(
    ("factor", "words"),
    [
        (0.0, "no thrust was recorded"),
        (0.005, "no thrust was recorded"),
        (1.0 / 4.4482, "4.45 times what is logged (lbf taken for N)"),
        (-1.0, "the sign of the thrust is flipped"),
        (0.1, "10 times what is logged"),
    ],
)
def test_a_wrong_thrust_leaves_too_little_drag(factor: float, words: str) -> None:
    """In level flight the thrust is the drag: what is left of it is (1 - factor) of the thrust."""
    level = 0.08
    (found,) = thrust_said(factor * level, level, factor * level)
    assert (found.channel, found.kind) == ("thrust", "size")
    assert limits_flight(found)
    assert words in found.sentence


def test_drag_that_a_database_may_have_wrong_is_no_wrong_thrust() -> None:
    """Half too much, three times too little, and less than sensors may err by."""
    assert thrust_said(0.08, 0.08, 0.08) == []
    assert thrust_said(0.055, 0.08, 0.08) == []
    assert thrust_said(0.24, 0.08, 0.08) == []
    margin = 0.5 * (0.035 + 0.2 / GRAVITY)
    assert thrust_said(0.0, 0.99 * margin, 0.0) == []
    assert len(thrust_said(0.0, 1.01 * margin, 0.0)) == 1


def changing(factor: float, brakes: float = 0.0, steps: int = 7) -> list[Suspicion]:
    """What is said where the thrust is `factor` times what is logged, of a database that lacks the
    drag of brakes, for which the logged thrust makes up by a share."""
    made, of, _ = pushed()
    time, out = made.time, 0.1 * made["delta_speed_brake"]
    swing = np.sin(2.0 * np.pi * steps * time / time[-1]) if steps else np.zeros_like(time)
    logged = 0.06 + 0.015 * swing + brakes * out
    lift = 0.5 + 0.1 * np.sin(2.0 * np.pi * 4.0 * time / time[-1])
    noise = 1e-3 * np.random.default_rng(6).standard_normal(len(time))
    left = (1.0 - factor) * logged + noise + 0.01 * lift + (out if brakes else 0.0)
    expected = np.ones_like(time)  # so much that its level says nothing
    full = {"C_drag": expected + left, "C_lift": lift}
    beside = {"C_drag": expected, "C_lift": lift}
    usable = dict.fromkeys(full, np.ones(len(time), dtype=bool))
    area = effect_flights.AREA
    flown = changed(made, thrust=logged * made["qbar"] * area)
    return thrust_beside(flown, of, area, full, beside, usable)


@pytest.mark.parametrize(
    ("factor", "words"),
    [(4.4482, "lbf taken for N"), (2.0 * 4.4482, "8.89 times"), (-1.0, "sign of the thrust")],
)
def test_a_wrong_thrust_shows_where_it_changes(factor: float, words: str) -> None:
    (found,) = changing(factor)
    assert (found.channel, found.kind) == ("thrust", "size")
    assert limits_flight(found)
    assert words in found.sentence
    assert found.evidence["factor"] == pytest.approx(factor, rel=0.02)


@pytest.mark.parametrize("factor", [1.0, 0.4, 0.0, 2.5])
def test_a_thrust_of_another_model_is_no_wrong_one(factor: float) -> None:
    """Ram drag, slipstream and losses of installation; brakes out as the thrust goes up or down;
    a thrust that does not change."""
    assert changing(factor) == []
    assert changing(factor, brakes=-0.2) == []
    assert changing(factor, brakes=1.0) == []
    assert changing(4.4482, steps=0) == []


def test_a_whole_flight_with_its_thrust_in_pounds() -> None:
    made, of, beside = pushed()
    found = said(changed(made, thrust=made["thrust"] / 4.4482), of, beside)
    assert ["lbf taken for N" in each.sentence for each in found if each.channel == "thrust"] == [
        True
    ]


def test_a_whole_flight_with_its_thrust_lost() -> None:
    made, of, beside = pushed()
    assert said(made, of, beside) == ()
    found = said(changed(made, thrust=np.zeros_like(made.time)), of, beside)
    assert "thrust" in {each.channel for each in found}


def test_nothing_is_said_where_there_is_nothing() -> None:
    made, of, beside = pushed()
    assert mass_beside({}, {}, {}, 0.02, []) == []
    assert cg_beside({}, beside.reference) == []
    assert exchanged_suspicions({}, made) == []
    assert thrust_beside(made, of, 1.0, {}, {}, {}) == []
    unlogged = replace(made, channels={n: v for n, v in made.channels.items() if n != "thrust"})
    flat = {"C_drag": np.zeros(len(made.time)), "C_lift": np.ones(len(made.time))}
    full = {"C_drag": np.ones(len(made.time)), "C_lift": np.ones(len(made.time))}
    usable = {"C_drag": np.ones(len(made.time), dtype=bool)}
    assert len(thrust_beside(made, of, 1.0, flat, full, usable)) == 1
    assert thrust_beside(unlogged, of, 1.0, flat, full, usable) == []
    assert thrust_beside(made, of, 1.0, flat, full, {"C_drag": ~usable["C_drag"]}) == []
