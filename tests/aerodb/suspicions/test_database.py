"""Checks of a flight against its vehicle's database: closed-form flights, each fault planted, what a
wind tunnel may have wrong, and nothing to say where there is nothing."""

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
import pytest

from aerodb.coefficients.comparison import compare
from aerodb.coefficients.total import total_coefficients
from aerodb.conditioning import Suspicion
from aerodb.exchange.native import read_native
from aerodb.flight import Flight
from aerodb.suspicions import against_database, limits_flight
from aerodb.suspicions.derivatives import axis_shares
from aerodb.suspicions.lift import helmbold
from aerodb.suspicions.loads import force_ratio
from aerodb.tables.database import AeroDatabase
from aerodb.vehicle import Vehicle
from tests.aerodb.suspicions.test_against_vehicle import (
    AREA,
    CHORD,
    CL_,
    CM,
    CN,
    MASS,
    QBAR,
    SPAN,
    STEP,
    changed,
    flown,
    vehicle,
    with_errors,
    wrong,
)
from tests.support import parts

SIDE = -0.5
LATERAL = ("beta", "p_hat", "r_hat", "delta_aileron", "delta_rudder")


def database_text(**factors: float) -> str:
    """What flies in `flown`, about its CG; factors : derivative -> what the tunnel has wrong."""
    level = MASS * 9.80665 / (QBAR * AREA)
    slope = helmbold(SPAN**2 / AREA)
    own = {
        "CX": {"1": -0.5 * MASS / (QBAR * AREA)},
        "CY": {"beta": SIDE},
        "CZ": {"1": 0.0, "alpha": -slope},
        "Cl": dict(zip(LATERAL, CL_, strict=True)),
        "Cm": dict(
            zip(("1", "alpha", "q_hat", "delta_elevator"), (-CM[0] * level / slope, *CM), strict=True)
        ),
        "Cn": dict(zip(LATERAL, CN, strict=True)),
    }  # fmt: skip
    text = f'name = "light"\n[reference]\narea = {AREA}\nchord = {CHORD}\nspan = {SPAN}\n'
    text += "moment_reference = [-2.1, 0.0, 0.0]\n"
    for axis, derivatives in own.items():
        text += f"[derivatives.{axis}]\n"
        for name, value in derivatives.items():
            text += f'"{name}" = {value * factors.get(f"{axis}_{name}", 1.0)}\n'
    return text


def database(**factors: float) -> AeroDatabase:
    return read_native(database_text(**factors))


def said(flight: Flight, of: Vehicle, beside: AeroDatabase) -> tuple[Suspicion, ...]:
    compared = compare(flight, total_coefficients(flight, of), beside, of.reference)
    return against_database(
        flight,
        beside,
        compared.measured,
        compared.predicted,
        compared.usable,
        compared.bandwidth,
        of,
    )


@lru_cache(maxsize=1)
def flight() -> Flight:
    return flown()


def about_cg() -> Vehicle:
    return wrong(points={"moment_reference": (-2.1, 0.0, 0.0)})


def test_a_right_flight_shows_the_derivatives_of_its_database() -> None:
    of, beside = about_cg(), database()
    compared = compare(flight(), total_coefficients(flight(), of), beside, of.reference)
    axes = axis_shares(
        flight(), beside, compared.measured, compared.predicted, compared.usable, compared.bandwidth
    )
    for axis, names in (("Cm", ("alpha", "q", "delta_elevator")), ("Cl", ("p", "delta_aileron"))):
        fit = axes[axis].fit()
        assert fit is not None
        assert axes[axis].agreement() > 0.98
        for name in names:
            share = axes[axis].share(fit, name)
            assert share.ratio == pytest.approx(1.0, abs=max(4.0 * share.error, 0.12))
    assert said(flight(), of, beside) == ()


@pytest.mark.parametrize(
    "factors",
    [
        {"CZ_alpha": 0.8},
        {"CZ_alpha": 1.25},
        {"Cm_delta_elevator": 0.5},
        {"Cm_delta_elevator": 2.0},
        {"Cl_delta_aileron": 0.5, "Cl_p_hat": 1.5},
        {"Cn_delta_rudder": 0.5, "Cn_beta": 0.5},
        {"Cm_alpha": 0.5, "Cm_q_hat": 2.0},
        {"Cl_r_hat": 0.0, "Cn_p_hat": 0.0, "Cl_delta_rudder": 0.0},
        {"Cl_beta": -1.0},
        {"Cm_1": 1.3, "CX_1": 2.0},
    ],
)
def test_what_a_wind_tunnel_may_have_wrong_is_no_contradiction(factors: dict[str, float]) -> None:
    assert not any(limits_flight(each) for each in said(flight(), about_cg(), database(**factors)))


@pytest.mark.parametrize("factor", [0.5, 2.0])
@pytest.mark.parametrize(("axis", "surface"), [("Cm", "elevator"), ("Cl", "aileron")])
def test_a_control_of_half_or_twice_the_effect_is_suspected(
    axis: str, surface: str, factor: float
) -> None:
    """A scale of its channel and an error of the tunnel look alike: both are named."""
    name = f"delta_{surface}"
    (found,) = said(flight(), about_cg(), database(**{f"{axis}_{name}": factor}))
    assert (found.channel, found.kind) == (name, "possible")
    assert found.evidence["ratio"] == pytest.approx(1.0 / factor, rel=0.1)
    assert "the scale of its channel is another, or the database's" in found.sentence
    scaled = changed(flight(), **{name: flight()[name] / factor})
    (same,) = said(scaled, about_cg(), database())
    assert (same.channel, same.kind) == (found.channel, found.kind)
    assert not limits_flight(found)


@pytest.mark.parametrize("deficit", [{}, {"Cm_delta_elevator": 0.5, "Cl_delta_aileron": 2.0}])
@pytest.mark.parametrize("surface", ["elevator", "aileron", "rudder"])
@pytest.mark.parametrize(
    ("change", "kind", "words"),
    [
        (lambda d: -d, "sign", "its sign is flipped"),
        (np.deg2rad, "unit", "its unit is another"),
        (np.rad2deg, "unit", "its unit is another"),
    ],
)
def test_a_control_of_another_sign_or_unit(
    surface: str,
    change: Callable[[np.ndarray], np.ndarray],
    kind: str,
    words: str,
    deficit: dict[str, float],
) -> None:
    name = f"delta_{surface}"
    made = changed(flight(), **{name: change(flight()[name])})
    (found,) = said(made, about_cg(), database(**deficit))
    assert (found.channel, found.kind) == (name, kind)
    assert words in found.sentence
    assert limits_flight(found)


def test_more_than_a_unit_makes_is_another_channels() -> None:
    """A control that hardly moves is not taken for one in another unit."""
    made = changed(flight(), delta_elevator=flight()["delta_elevator"] / 5e3)
    (found,) = [e for e in said(made, about_cg(), database()) if e.channel == "delta_elevator"]
    assert found.kind == "size"
    assert "more than any unit makes it" in found.sentence
    assert limits_flight(found)


@pytest.mark.parametrize("seconds", [0.3, -0.3])
@pytest.mark.parametrize("surface", ["elevator", "aileron", "rudder"])
def test_a_late_or_early_control(surface: str, seconds: float) -> None:
    name = f"delta_{surface}"
    made = changed(flight(), **{name: np.roll(flight()[name], round(seconds / STEP))})
    (found,) = said(made, about_cg(), database())
    assert (found.channel, found.kind) == (name, "delay")
    assert found.evidence["delay"] == pytest.approx(seconds, abs=0.05)
    assert ("too late" if seconds > 0 else "too early") in found.sentence


@pytest.mark.parametrize("surface", ["elevator", "aileron"])
def test_a_control_that_was_not_recorded(surface: str) -> None:
    name = f"delta_{surface}"
    found = said(changed(flight(), **{name: np.zeros_like(flight().time)}), about_cg(), database())
    assert (name, "stuck") in {(each.channel, each.kind) for each in found}


def test_a_control_that_truly_stands_still_is_no_contradiction() -> None:
    """A database with a rudder, and a flight without: its channel is zero as the rudder is."""
    beside = database()
    still = np.zeros_like(flight().time)
    truth = replace(flight(), channels={**flight().channels, "delta_rudder": still})
    rudderless = {"Cl_delta_rudder": 0.0, "Cn_delta_rudder": 0.0}
    compared = compare(truth, total_coefficients(flight(), about_cg()), beside, vehicle().reference)
    flies = compare(
        flight(),
        total_coefficients(flight(), about_cg()),
        database(**rudderless),
        vehicle().reference,
    )
    effect = compare(
        flight(), total_coefficients(flight(), about_cg()), beside, vehicle().reference
    )
    measured = {
        axis: values - (effect.predicted[axis] - flies.predicted[axis])
        for axis, values in compared.measured.items()
    }
    assert (
        against_database(
            truth,
            beside,
            measured,
            compared.predicted,
            compared.usable,
            compared.bandwidth,
            about_cg(),
        )
        == ()
    )


@pytest.mark.parametrize(
    ("factor", "words"),
    [(1.0 / 1.3558, "slug ft^2 taken for kg m^2"), (1.3558, "kg m^2 taken for slug ft^2")],
)
def test_an_inertia_in_another_unit(factor: float, words: str) -> None:
    inertia = {name: factor * value for name, value in
               (("Ixx", 900.0), ("Iyy", 1100.0), ("Izz", 1850.0))}  # fmt: skip
    of = wrong(points={"moment_reference": (-2.1, 0.0, 0.0)}, mass=inertia)
    for beside in (database(), database(Cm_delta_elevator=0.5, CZ_alpha=0.8)):
        (found,) = said(flight(), of, beside)
        assert (found.channel, found.kind) == ("Ixx", "size")
        assert found.evidence["factor"] == pytest.approx(factor, rel=0.06)
        assert words in found.sentence


def test_derivatives_of_a_database_that_are_off_accuse_no_inertia() -> None:
    """The elevator's channel is one and a half times too large, and a tunnel has half of what it
    says of roll and yaw wrong by one factor; the rest agrees exactly."""
    wrong_ones = ("Cl_beta", "Cl_r_hat", "Cn_beta", "Cn_delta_rudder", "Cn_r_hat")
    beside = database(**dict.fromkeys(wrong_ones, 1.5))
    made = flight().with_channels({"delta_elevator": 1.5 * flight()["delta_elevator"]})
    assert "Ixx" not in {each.channel for each in said(flight(), about_cg(), beside)}
    assert "Ixx" not in {each.channel for each in said(made, about_cg(), beside)}


@pytest.mark.parametrize(
    ("factor", "slope"),
    [(1.0 / 0.45359237, 0.8), (0.45359237, 1.0), (1.0 / 14.5939, 0.8), (1000.0, 0.8)],
)
def test_a_mass_in_another_unit(factor: float, slope: float) -> None:
    of = wrong(points={"moment_reference": (-2.1, 0.0, 0.0)}, mass={"mass": factor * MASS})
    found = said(flight(), of, database(CZ_alpha=slope))
    assert found[0].channel == "mass"
    assert "another aircraft's" in found[0].sentence


@pytest.mark.parametrize(("share", "told"), [(1.0, False), (0.58, False), (0.37, True)])
def test_errors_of_alpha_make_the_change_of_the_lift_small(share: float, told: bool) -> None:
    """A change of .58 of the database's that a vane's errors lower below .55 is no fault; one of
    .37 is with the same errors."""
    of = wrong(points={"moment_reference": (-2.1, 0.0, 0.0)}, mass={"mass": share * MASS})
    long = with_errors(flight(), "alpha", times=6)
    compared = compare(long, total_coefficients(long, of), database(), of.reference)
    good = compared.usable["CZ"] & np.isfinite(compared.measured["CZ"])
    seen = force_ratio(compared.measured["CZ"], compared.predicted["CZ"], good, long.step)
    assert seen is not None
    assert seen.value == pytest.approx(share / 1.2, rel=0.05)  # 1 + .45^2
    found = [each for each in said(long, of, database()) if "lift changes" in each.sentence]
    assert [each.channel for each in found] == ["mass"] * told


def test_nothing_is_said_where_a_flight_cannot_decide() -> None:
    """A quiet flight, a short one, one without its flow angles."""
    beside = database()
    rng = np.random.default_rng(1)
    quiet = {
        name: np.full_like(values, np.median(values)) + 1e-4 * rng.standard_normal(len(values))
        for name, values in flight().channels.items()
        if name not in ("V", "qbar", "az", "ax", "ay")
    }
    kept = {name: flight()[name] for name in ("V", "qbar", "az", "ax", "ay")}
    assert said(replace(flight(), channels={**kept, **quiet}), about_cg(), beside) == ()
    short = replace(
        flight(),
        time=flight().time[:120],
        channels={n: v[:120] for n, v in flight().channels.items()},
    )
    assert said(short, about_cg(), beside) == ()
    made = changed(
        flight(), beta=np.zeros_like(flight().time), delta_rudder=-flight()["delta_rudder"]
    )
    assert said(made, about_cg(), beside) == ()


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 0.0, 1e300, -1.0])
def test_channels_full_of_rubbish_end_no_check(value: float) -> None:
    of, beside = about_cg(), database()
    compared: Any = compare(flight(), total_coefficients(flight(), of), beside, of.reference)
    arrays = (compared.measured, compared.predicted, compared.usable)
    for name in flight().channels:
        for part in (slice(None), slice(100, 200)):
            values = flight()[name].copy()
            values[part] = value
            with np.errstate(all="ignore"):
                found = against_database(
                    changed(flight(), **{name: values}), beside, *arrays, compared.bandwidth, of
                )
            assert all(each.sentence for each in found)
    for axis in compared.measured:
        values = compared.measured[axis].copy()
        values[100:200] = value
        with np.errstate(all="ignore"):
            against_database(
                flight(), beside, {**compared.measured, axis: values}, *arrays[1:], None, of
            )


def test_a_database_without_lift_contradicts_no_lift() -> None:
    """Empty, or of the lateral axes alone; half the lift is a contradiction, as it was."""
    right, of = database(), about_cg()
    for axes in ((), ("CY", "Cl", "Cn")):
        partial = replace(right, terms=tuple(t for t in right.terms if t.axis in axes))
        assert said(flight(), of, partial) == ()
    assert any(each.kind == "size" for each in said(flight(), of, database(CZ_alpha=0.3)))


@pytest.mark.parametrize(
    ("wrong_parts", "factor", "named"),
    [
        ({}, 1.0, False),
        ({}, 1.3558, True),
        (
            {"tail_slope": 6.5, "fin_slope": 5.5, "elevator_part": 1.1, "wing_slope": 6.8},
            1.0,
            False,
        ),
    ],
)
def test_a_wrong_build_up_is_no_wrong_inertia(
    wrong_parts: dict[str, float], factor: float, named: bool
) -> None:
    """Slopes that are all too steep lower all moments of the flight, each by a factor of its own."""
    source = parts.flights(range(40, 41), parts.aircraft())
    (id,) = source.flown
    beside = source.comparison(id, parts.aircraft(wrong_parts))
    measured = {
        axis: values * (factor if axis in ("Cl", "Cm", "Cn") else 1.0)
        for axis, values in beside.measured.items()
    }
    found = against_database(
        source.flight(id), parts.aircraft(wrong_parts), measured, beside.predicted, beside.usable,
        beside.bandwidth, source.vehicle,
    )  # fmt: skip
    assert any(each.channel == "Ixx" for each in found) == named, found
