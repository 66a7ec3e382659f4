"""Checks of a flight against its vehicle: closed-form flights, each fault planted, and nothing to
say where there is nothing."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from aerodb.flight import Flight
from aerodb.physics import standard_atmosphere
from aerodb.signals import low_passed
from aerodb.suspicions import against_vehicle, air_suspicions, limits_flight
from aerodb.suspicions.controls import control_suspicions
from aerodb.suspicions.drag import drag_suspicions
from aerodb.suspicions.equation_error import equation_errors
from aerodb.suspicions.lift import helmbold, lift_suspicions
from aerodb.suspicions.masses import mass_suspicions
from aerodb.suspicions.surfaces import by_role, size_suspicions
from aerodb.vehicle import Vehicle, parse_vehicle
from tests.support import effect_flights

RHO, V, MASS, AREA, CHORD, SPAN = 1.112, 40.0, 600.0, 12.0, 1.25, 9.6
QBAR, STEP = 0.5 * RHO * V**2, 0.02
VEHICLE = f"""
name = "light"
[reference]
area = {AREA}
chord = {CHORD}
span = {SPAN}
[points]
moment_reference = [-2.0, 0.0, 0.0]
[mass]
mass = {MASS}
cg = [-2.1, 0.0, 0.0]
Ixx = 900.0
Iyy = 1100.0
Izz = 1850.0
Ixz = 0.0
[surfaces.elevator]
limits = ["-25 deg", "25 deg"]
[surfaces.aileron]
limits = ["-25 deg", "25 deg"]
[surfaces.rudder]
limits = ["-25 deg", "25 deg"]
"""
#: Moments and forces of the aircraft that is flown: per rad and per hat rate.
CM, CL_, CN = (
    (-0.8, -14.0, -1.3),
    (-0.08, -0.5, 0.12, -0.2, 0.015),
    (0.08, -0.04, -0.12, -0.01, -0.09),
)


def vehicle() -> Vehicle:
    return parse_vehicle(VEHICLE)


def steps(times: tuple[float, ...], size: float) -> Callable[[float], float]:
    """A 3-2-1-1 and doublets: the sign changes at each time."""
    return lambda t: (
        0.0 if t < times[0] or t > times[-1] else size * (-1.0) ** np.searchsorted(times, t)
    )


ELEVATOR = steps((1.0, 2.5, 3.5, 4.0, 4.5), 0.04)
AILERON = steps((6.0, 6.8, 7.6, 8.4, 9.2), 0.05)
RUDDER = steps((11.0, 12.0, 13.0, 14.0), 0.06)


def flown(
    noise: float = 1.0, rudder: Callable[[float], float] = RUDDER, sideslip: float = 0.0
) -> Flight:
    """A flight that obeys its equations: alpha, beta and the rates by linear moments and forces,
    with sensor noise; from a sideslip [rad]."""
    slope, side = helmbold(SPAN**2 / AREA), -0.5
    force = QBAR * AREA

    def rates(t: float, x: np.ndarray) -> list[float]:
        alpha, q, beta, p, r = x
        half_span, half_chord = SPAN / (2 * V), CHORD / (2 * V)
        da, dr = AILERON(t), rudder(t)
        cm = CM[0] * alpha + CM[1] * q * half_chord + CM[2] * ELEVATOR(t)
        lateral = np.array([beta, p * half_span, r * half_span, da, dr])
        return [
            q - force * slope * alpha / (MASS * V),
            (force * CHORD * cm - (900.0 - 1850.0) * p * r) / 1100.0,
            force * side * beta / (MASS * V) - r,
            (force * SPAN * float(np.dot(CL_, lateral)) - (1850.0 - 1100.0) * q * r) / 900.0,
            (force * SPAN * float(np.dot(CN, lateral)) - (1100.0 - 900.0) * p * q) / 1850.0,
        ]

    time = np.arange(0.0, 18.0, STEP)
    start = np.array([0.0, 0.0, sideslip, 0.0, 0.0])
    motion = solve_ivp(rates, (0.0, 18.0), start, t_eval=time, max_step=STEP, rtol=1e-8)
    alpha, q, beta, p, r = motion.y
    level = MASS * 9.80665 / force
    air = standard_atmosphere(np.asarray(1000.0))
    rng = np.random.default_rng(3)

    def sensed(values: Any, sigma: float) -> np.ndarray:
        return np.asarray(values + noise * sigma * rng.standard_normal(len(time)))

    return Flight(
        "light-1",
        "light",
        time,
        {
            "V": sensed(V, 0.1),
            "qbar": sensed(QBAR, 2.0),
            "rho": np.full_like(time, RHO),
            "altitude": np.full_like(time, 1000.0),
            "static_pressure": np.full_like(time, float(air.pressure)),
            "temperature": np.full_like(time, float(air.temperature)),
            "alpha": sensed(alpha + level / slope, 1e-3),
            "beta": sensed(beta, 1e-3),
            "p": sensed(p, 1e-3),
            "q": sensed(q, 1e-3),
            "r": sensed(r, 1e-3),
            "ax": sensed(-0.5, 0.03),
            "ay": sensed(force * side * beta / MASS, 0.03),
            "az": sensed(-force * (level + slope * alpha) / MASS, 0.03),
            "delta_elevator": np.array([ELEVATOR(t) for t in time]),
            "delta_aileron": np.array([AILERON(t) for t in time]),
            "delta_rudder": np.array([rudder(t) for t in time]),
        },
    )


@pytest.fixture(scope="module")
def flight() -> Flight:
    return flown()


def changed(flight: Flight, **channels: Any) -> Flight:
    return flight.with_channels({n: np.asarray(v) for n, v in channels.items()})


def wrong(**parts: dict[str, Any]) -> Vehicle:
    data = vehicle().model_dump()
    for part, values in parts.items():
        data[part] |= values
    return Vehicle.model_validate(data)


def test_a_right_flight_raises_nothing(flight: Flight) -> None:
    assert against_vehicle(flight, vehicle()) == ()
    assert against_vehicle(flown(noise=0.0), vehicle()) == ()


def test_the_lift_slope_of_a_wing() -> None:
    """Helmbold's limits: pi A / 2 of a slender wing, 2 pi of a section; 4.46 at aspect ratio 6.83
    (published lifting-line values: 2 pi / (1 + 2 / A) = 4.86 less 4 to 9 %)."""
    assert helmbold(0.02) == pytest.approx(np.pi * 0.01, rel=1e-2)
    assert helmbold(1e5) == pytest.approx(2 * np.pi, rel=1e-4)
    assert helmbold(6.0) == pytest.approx(2 * np.pi * 6 / (2 + np.sqrt(40)))


@pytest.mark.parametrize("surface", ["elevator", "aileron", "rudder"])
def test_a_reversed_surface_is_named(flight: Flight, surface: str) -> None:
    name = f"delta_{surface}"
    (found,) = against_vehicle(changed(flight, **{name: -flight[name]}), vehicle())
    assert (found.channel, found.kind) == (name, "sign")
    assert "its sign is flipped" in found.sentence
    assert limits_flight(found)


def test_the_effect_is_the_planted_one(flight: Flight) -> None:
    (found,) = control_suspicions(
        changed(flight, delta_elevator=-flight["delta_elevator"]), vehicle()
    )
    error = max(3.0 * found.evidence["standard_error"], 0.05 * abs(CM[2]))
    assert found.evidence["effect"] == pytest.approx(-CM[2], abs=error)


def test_damping_is_told_by_the_speed_of_each_moment() -> None:
    """Of an aircraft that doubles its speed, which moves the aileron as the equation of roll asks,
    damping and effect are those of the equation."""
    time = np.arange(0.0, 40.0, STEP)
    speed = 30.0 + 0.75 * time
    p = 0.2 * np.sin(2.4 * time) + 0.1 * np.sin(4.1 * time + 1.0)
    acceleration = 0.48 * np.cos(2.4 * time) + 0.41 * np.cos(4.1 * time + 1.0)
    qbar = 0.5 * RHO * speed**2
    cl = 900.0 * acceleration / (qbar * AREA * SPAN)
    channels = dict.fromkeys(("q", "delta_elevator", "delta_rudder"), np.zeros_like(time))
    channels |= {"V": speed, "qbar": qbar, "alpha": np.full_like(time, 0.05), "p": p}
    channels |= {"beta": 0.01 * np.sin(1.7 * time), "r": 0.02 * np.sin(3.1 * time)}
    channels["delta_aileron"] = (cl - CL_[1] * p * SPAN / (2.0 * speed)) / CL_[3]
    made = Flight("light-2", "light", time, channels)
    fit = equation_errors(made, vehicle(), by_role(made, vehicle(), ()))["roll"].fit()
    assert fit is not None
    found = dict(zip(fit.names, fit.estimates.tolist(), strict=True))
    assert found["p"] == pytest.approx(CL_[1], rel=0.02)
    assert found["delta_aileron"] == pytest.approx(CL_[3], rel=0.02)


@pytest.mark.parametrize("seconds", [0.3, -0.3])
@pytest.mark.parametrize("surface", ["elevator", "aileron"])
def test_a_late_or_early_surface_is_named(flight: Flight, surface: str, seconds: float) -> None:
    name, shift = f"delta_{surface}", round(seconds / STEP)
    (found,) = control_suspicions(
        changed(flight, **{name: np.roll(flight[name], shift)}), vehicle()
    )
    assert (found.channel, found.kind) == (name, "delay")
    assert found.evidence["delay"] == pytest.approx(seconds, abs=0.05)
    assert ("too late" if seconds > 0 else "too early") in found.sentence


def test_swapped_aileron_and_rudder(flight: Flight) -> None:
    made = changed(
        flight, delta_aileron=flight["delta_rudder"], delta_rudder=flight["delta_aileron"]
    )
    (found,) = control_suspicions(made, vehicle())
    assert found.kind == "swapped"


def test_a_surface_that_was_not_recorded(flight: Flight) -> None:
    (found,) = control_suspicions(
        changed(flight, delta_elevator=np.zeros_like(flight.time)), vehicle()
    )
    assert (found.channel, found.kind) == ("delta_elevator", "stuck")
    assert limits_flight(found)


def test_a_surface_that_the_motion_does_not_need_is_said_and_no_fault() -> None:
    """Released from a sideslip with the rudder held still, the aircraft yaws by its motion and the
    aileron: the flight cannot tell this rudder from one that was not recorded."""
    (found,) = against_vehicle(flown(rudder=lambda t: 0.0, sideslip=0.1), vehicle())
    assert (found.channel, found.kind) == ("delta_rudder", "unmoved")
    assert not limits_flight(found)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda d: 100.0 * d / 0.44, "in percent or degrees"),
        (lambda d: 1500.0 + 500.0 * d / 0.44, "in microseconds"),
        (lambda d: np.rad2deg(d) * 10.0, "in percent or degrees"),
    ],
)
def test_the_size_of_a_deflection(flight: Flight, change: Any, words: str) -> None:
    (found,) = size_suspicions(
        changed(flight, delta_elevator=change(flight["delta_elevator"])), vehicle()
    )
    assert found.kind == "unit"
    assert words in found.sentence


def test_a_deflection_converted_twice(flight: Flight) -> None:
    (found,) = control_suspicions(
        changed(flight, delta_elevator=np.deg2rad(flight["delta_elevator"])), vehicle()
    )
    assert (found.channel, found.kind) == ("delta_elevator", "unit")


def test_signs_of_surfaces_that_nobody_declared_are_not_judged(flight: Flight) -> None:
    """A canard is no elevator, and a convention of one's own has its own sign."""
    text = VEHICLE.replace("[surfaces.aileron]", 'convention = "leading edge"\n[surfaces.aileron]')
    assert (
        control_suspicions(
            changed(flight, delta_elevator=-flight["delta_elevator"]), parse_vehicle(text)
        )
        == ()
    )
    channels = {n: v for n, v in flight.channels.items() if n != "delta_elevator"}
    canard = replace(flight, channels={**channels, "delta_canard": -flight["delta_elevator"]})
    assert control_suspicions(canard, vehicle()) == ()


def test_a_damper_with_its_servo_raises_nothing() -> None:
    """A pitch damper in gusts of unknown size: the surface follows the rate by .05 s."""
    rng = np.random.default_rng(5)
    time = np.arange(0.0, 60.0, STEP)
    gust = np.zeros_like(time)
    alpha, q, delta = np.zeros_like(time), np.zeros_like(time), np.zeros_like(time)
    for k in range(1, len(time)):
        gust[k] = gust[k - 1] * (1 - STEP / 0.5) + 0.004 * rng.standard_normal()
        delta[k] = delta[k - 1] + STEP / 0.05 * (0.4 * q[k - 1] - delta[k - 1])
        felt = alpha[k - 1] + gust[k - 1]
        cm = CM[0] * felt + CM[1] * q[k - 1] * CHORD / (2 * V) + CM[2] * delta[k - 1]
        q[k] = q[k - 1] + STEP * QBAR * AREA * CHORD * cm / 1100.0
        alpha[k] = alpha[k - 1] + STEP * (q[k - 1] - QBAR * AREA * 4.8 * felt / (MASS * V))
    still = np.zeros_like(time)
    made = Flight(
        "gusts",
        "light",
        time,
        {
            "V": np.full_like(time, V),
            "qbar": np.full_like(time, QBAR),
            "alpha": alpha,  # without the gust: a vane that does not see it
            "beta": still,
            "p": still,
            "q": q + 1e-3 * rng.standard_normal(len(time)),
            "r": still,
            "delta_elevator": delta,
        },
    )
    assert control_suspicions(made, vehicle()) == ()


@pytest.mark.parametrize(
    ("channels", "channel", "words"),
    [
        ({"rho": RHO / 515.379}, "rho", "slug/ft^3"),
        ({"rho": 0.0}, "rho", "was not recorded"),
        ({"temperature": 8.5}, "temperature", "it is in degC"),
        ({"static_pressure": 898.7}, "rho", "ratio"),
        ({"V": V / 0.514444}, "qbar", "one of the three"),
        ({"qbar": QBAR / 47.88}, "qbar", "ratio"),
    ],
)
def test_contradictions_of_the_air_data(
    flight: Flight, channels: dict[str, float], channel: str, words: str
) -> None:
    made = changed(flight, **{n: np.full_like(flight.time, v) for n, v in channels.items()})
    assert any(s.channel == channel and words in s.sentence for s in air_suspicions(made))


def test_air_data_of_a_fast_aircraft_are_no_contradiction(flight: Flight) -> None:
    """A pitot-static pressure at Mach .8 exceeds rho V^2 / 2 by 17 %."""
    keep = {n: flight[n] for n in ("rho", "temperature", "static_pressure", "altitude")}
    speed, mach = 269.0, 0.8
    impact = float(flight["static_pressure"][0]) * ((1 + 0.2 * mach**2) ** 3.5 - 1)
    made = replace(
        flight,
        channels={
            **keep,
            "V": np.full_like(flight.time, speed),
            "mach": np.full_like(flight.time, mach),
            "qbar": np.full_like(flight.time, impact),
        },
    )
    assert air_suspicions(made) == ()


@pytest.mark.parametrize(
    ("parts", "channel"),
    [
        ({"mass": {"mass": 600e3}}, "mass"),
        ({"mass": {"mass": float("inf")}}, "mass"),
        ({"mass": {"Ixx": 9000.0}}, "Ixx"),
        ({"mass": {"Iyy": 11000.0}}, "Iyy"),
        ({"mass": {"Izz": 185.0}}, "Izz"),
        ({"mass": {"Ixz": 2000.0}}, "Ixz"),
        ({"mass": {"Ixx": 21e3, "Iyy": 26e3, "Izz": 44e3}}, "Ixx"),
        ({"mass": {"cg": (2.1, 0.0, 0.0)}}, "cg_x"),
        ({"mass": {"cg": (-2.1, 1.5, 0.0)}}, "cg_y"),
        ({"reference": {"area": 129.0}}, "area"),
        ({"reference": {"span": SPAN / 2}}, "area"),
    ],
)
def test_bodies_and_wings_that_do_not_exist(
    flight: Flight, parts: dict[str, Any], channel: str
) -> None:
    found = mass_suspicions(flight, wrong(**parts))
    assert channel in {s.channel for s in found}
    assert all(limits_flight(s) for s in found)


def test_weight_and_slope_of_the_lift(flight: Flight) -> None:
    """A mass in lb has a lift slope that no wing has; a glider of 3.6 kg cannot fly this log."""
    (found,) = lift_suspicions(flight, wrong(mass={"mass": MASS / 0.45359237}))
    assert found.evidence["slope"] == pytest.approx(2.2046 * found.evidence["expected"], rel=0.03)
    small = wrong(
        mass={"mass": 3.6, "Ixx": 0.5, "Iyy": 0.3, "Izz": 0.75},
        reference={"area": 0.62, "chord": 0.2, "span": 3.2},
    )
    assert "another aircraft's" in lift_suspicions(flight, small)[0].sentence


def with_errors(flight: Flight, name: str, times: int = 1) -> Flight:
    """So many times the flight, with errors of one channel that are .45 of its variation (rms)."""
    channels = {each: np.tile(values, times) for each, values in flight.channels.items()}
    time = STEP * np.arange(times * len(flight.time))
    errors = low_passed(np.random.default_rng(5).standard_normal(len(time)), STEP, 2.0)
    errors *= 0.45 * np.std(flight[name]) / np.std(errors)
    return Flight("long", "light", time, {**channels, name: channels[name] + errors})


@pytest.mark.parametrize(("share", "told"), [(0.56, False), (0.37, True)])
def test_errors_of_alpha_make_a_slope_small(flight: Flight, share: float, told: bool) -> None:
    """A slope of .56 of the wing's that a vane's errors lower is no fault; one of .37 is with the
    same errors."""
    long = with_errors(flight, "alpha", times=6)
    found = lift_suspicions(long, wrong(mass={"mass": share * MASS}))
    assert [each.channel for each in found] == ["mass"] * told


@pytest.mark.parametrize("engines", [False, True])
def test_an_air_that_pushes(flight: Flight, engines: bool) -> None:
    """In level flight at constant speed thrust is drag: reversed, it leaves the drag reversed."""
    alpha = np.deg2rad(3.0)
    forward, down = 9.80665 * np.sin(alpha), -9.80665 * np.cos(alpha)
    level = changed(
        flight,
        alpha=np.full_like(flight.time, alpha),
        ax=np.full_like(flight.time, forward),
        az=np.full_like(flight.time, down),
    )
    drag = 0.9  # [N/kg]; the thrust along the x axis carries a little of the weight
    total = np.full_like(flight.time, MASS * drag / np.cos(alpha))
    lines: dict[str, Any] = {"left": {}, "right": {}} if engines else {}
    driven = wrong(thrust={"source": "channel", "engines": lines})
    shares = (
        {"thrust_left": total / 3.0, "thrust_right": total / 1.5} if engines else {"thrust": total}
    )
    assert drag_suspicions(changed(level, **shares), driven) == ()
    reversed_ = changed(level, **{name: -values for name, values in shares.items()})
    (found,) = drag_suspicions(reversed_, driven)
    assert found.evidence["drag"] == pytest.approx(-drag, rel=1e-6)
    assert limits_flight(found)
    backwards = {"direction": (-1.0, 0.0, 0.0)}
    lines = dict.fromkeys(lines, backwards)
    assert drag_suspicions(
        changed(level, **shares),
        wrong(thrust={"source": "channel", "engines": lines, **({} if engines else backwards)}),
    )


def test_thrust_that_is_not_logged_or_says_nothing(flight: Flight) -> None:
    none = np.full_like(flight.time, np.nan)
    driven = wrong(thrust={"source": "channel"})
    assert drag_suspicions(flight, driven) == ()  # not logged
    assert drag_suspicions(changed(flight, thrust=none), driven) == ()
    idle = changed(flight, thrust=np.zeros_like(flight.time))
    assert drag_suspicions(idle, driven) == ()
    push = changed(flight, thrust=np.full_like(flight.time, -5e3))
    assert drag_suspicions(push, vehicle()) == ()  # a glider's file
    assert drag_suspicions(push, driven)


def test_logged_masses_of_another_aircraft(flight: Flight) -> None:
    made = changed(flight, mass=np.full_like(flight.time, 4600.0))
    assert "in the log" in mass_suspicions(made, vehicle())[0].sentence


def test_nothing_more_is_concluded_from_a_motion_that_is_suspected(flight: Flight) -> None:
    made = changed(flight, delta_elevator=-flight["delta_elevator"])
    assert against_vehicle(made, vehicle(), {"q"}) == ()


def test_records_that_cannot_tell_anything() -> None:
    time = STEP * np.arange(400)
    assert against_vehicle(Flight("e", "light", time, {}), vehicle()) == ()
    ground = {n: np.zeros(400) for n in ("V", "qbar", "p", "q", "r", "alpha", "az")}
    assert control_suspicions(Flight("g", "light", time, ground), vehicle()) == ()
    assert lift_suspicions(Flight("g", "light", time, ground), vehicle()) == ()
    nothing = {"V": np.full(400, np.nan), "delta_elevator": np.full(400, np.nan)}
    assert against_vehicle(Flight("n", "light", time, nothing), vehicle()) == ()


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 0.0, 1e300, -1.0])
def test_channels_full_of_rubbish_end_no_check(flight: Flight, value: float) -> None:
    """Whatever a log holds, it is judged: an error here would refuse the log."""
    for name in flight.channels:
        for part in (slice(None), slice(100, 200)):
            values = flight[name].copy()
            values[part] = value
            with np.errstate(all="ignore"):
                found = against_vehicle(changed(flight, **{name: values}), vehicle())
            assert all(s.sentence for s in found)
    driven = wrong(thrust={"source": "channel"})
    for name in ("thrust", "ax", "az", "alpha"):
        full = {"thrust": np.ones_like(flight.time), name: np.full_like(flight.time, value)}
        with np.errstate(all="ignore"):
            assert all(s.sentence for s in drag_suspicions(changed(flight, **full), driven))
    for name in ("mass", "Ixx", "Iyy", "Izz", "Ixz"):
        with np.errstate(all="ignore"):
            against_vehicle(changed(flight, **{name: np.full_like(flight.time, value)}), vehicle())


@pytest.mark.parametrize("number", [9, 16, 34, 66, 71])
def test_a_surface_is_not_late_where_downwash_lags(number: int) -> None:
    """Flow angles and surfaces that move apart for 16 s, and a pitching moment of alphadot."""
    of = effect_flights.vehicle()
    right = effect_flights.flown(number, effect_flights.database())
    assert not against_vehicle(right, of)
