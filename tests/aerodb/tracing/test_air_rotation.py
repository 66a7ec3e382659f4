"""The rotation of the air in turbulence: JSBSim's own, which reaches its aerodynamics and no gyro."""

from dataclasses import replace
from functools import lru_cache
from itertools import pairwise

import numpy as np
import pytest
from scipy.signal import welch

from aerodb.coefficients.comparison import Comparison, compare
from aerodb.coefficients.total import total_coefficients
from aerodb.consistency.smoother.state_error_spectrum import StateNoise
from aerodb.effects.flight_view import FlightView, view_of
from aerodb.effects.measurement.air_rotation import air_rotation_columns
from aerodb.flight import Flight
from aerodb.support import Array
from aerodb.tables.database import AeroDatabase
from aerodb.tracing.estimates.campaigns import campaign
from aerodb.tracing.evidence.evidence import NUISANCE
from aerodb.tracing.evidence.low_pass import band_limited
from aerodb.tracing.evidence.normal_equations import normal_equations_of
from aerodb.tracing.evidence.state_errors import roll_rates, rolling_air, rotating_air
from aerodb.vehicle import Vehicle
from tests.support.jsbsim_campaign import STEP, Plan, flown, imported, vehicle_of
from tests.support.jsbsim_cases import B737, lowering
from tests.support.jsbsim_flights import FOOT
from tests.support.tracing_small import LIBRARY, SETTINGS, evidence

MODERATE = {
    "atmosphere/turb-type": 4.0,  # Milspec, discretised after Tustin
    "atmosphere/turbulence/milspec/windspeed_at_20ft_AGL-fps": 50.0,
    "atmosphere/turbulence/milspec/severity": 3.0,
}
BANDWIDTH = 0.8  # Hz, of tracing a 737
OF_THE_AIR = {
    **{f"{rate}_aero": (f"velocities/{rate}-aero-rad_sec", 1.0) for rate in "pqr"},
    "gust_down": ("atmosphere/total-wind-down-fps", FOOT),
    "gust_east": ("atmosphere/total-wind-east-fps", FOOT),
    "gust_north": ("atmosphere/total-wind-north-fps", FOOT),
}


@lru_cache(maxsize=4)
def _flight(turbulent: bool, number: int = 0) -> dict[str, Array]:
    """A flight without sensor errors, with the rates that JSBSim's aerodynamics use."""
    plan: Plan = lowering(number)
    if turbulent:
        steps = {
            name: (lambda time, value=value: value if time > -4.9 else 0.0)
            for name, value in MODERATE.items()
        }
        plan = replace(plan, other={**plan.other, **steps})
    return flown(replace(B737, channels={**B737.channels, **OF_THE_AIR}), plan)


@lru_cache(maxsize=1)
def _aircraft() -> tuple[AeroDatabase, Vehicle]:
    database = imported(B737)
    return database, vehicle_of(B737, database)


def _compared(channels: dict[str, Array]) -> tuple[Comparison, FlightView]:
    database, vehicle = _aircraft()
    time = STEP * np.arange(len(channels["V"]))
    logged = {name: values for name, values in channels.items() if name not in OF_THE_AIR}
    flight = Flight("in-moving-air", vehicle.name, time, logged)
    comparison = compare(flight, total_coefficients(flight, vehicle), database, vehicle.reference)
    return comparison, view_of(flight, comparison, database, vehicle)


def _in_band(values: list[Array], usable: Array) -> Array:
    limited = band_limited(values, usable, STEP, BANDWIDTH)
    return np.asarray(limited - limited.mean(axis=0))


def _left(axis: str, channels: dict[str, Array]) -> float:
    """Part of the residual's power that the columns of the air's rotation leave."""
    comparison, view = _compared(channels)
    columns = [
        by_axis[axis]
        for by_axis in air_rotation_columns(view, comparison.measured).values()
        if axis in by_axis and by_axis[axis].any()
    ]
    residual = np.nan_to_num(comparison.residual(axis))
    moved = _in_band([residual, *columns], comparison.usable[axis])
    left = moved[:, 0] - moved[:, 1:] @ np.linalg.lstsq(moved[:, 1:], moved[:, 0], rcond=None)[0]
    return float(left.var() / moved[:, 0].var())


def test_turbulence_turns_jsbsims_air_as_fast_as_the_aircraft_turns() -> None:
    """The mechanism: what the gyro shows is not what the aerodynamics feel."""
    channels = _flight(turbulent=True)
    good = np.ones(len(channels["q"]), dtype=np.bool_)
    for rate, least in (("p", 0.3), ("q", 1.0), ("r", 0.3)):
        air, own = _in_band([channels[f"{rate}_aero"] - channels[rate], channels[rate]], good).T
        assert air.std() > least * own.std()
    still = _flight(turbulent=False)
    assert np.abs(still["q_aero"] - still["q"]).max() < 1e-9


@pytest.mark.parametrize("number", [0, 3])
@pytest.mark.parametrize(("axis", "most"), [("Cm", 0.06), ("Cn", 0.12)])
def test_the_columns_explain_what_rotating_air_leaves_on_a_correct_database(
    axis: str, most: float, number: int
) -> None:
    """On Cm 85 to 97 % of it is the pitching of the air alone, whatever the heading flown."""
    assert _left(axis, _flight(turbulent=True, number=number)) < most


def test_without_turbulence_they_are_as_good_as_nothing() -> None:
    """Beside the damping that the aircraft itself shows."""
    comparison, view = _compared(_flight(turbulent=False))
    still = air_rotation_columns(view, comparison.measured)["air_rotation:q"]["Cm"]
    own = view.slope("q")["Cm"] * view["q"]
    moved = _in_band([still, own], comparison.usable["Cm"])
    assert moved[:, 0].std() < 0.03 * moved[:, 1].std()


def test_a_flight_without_attitude_has_no_such_columns() -> None:
    comparison, view = _compared(_flight(turbulent=False))
    channels = {name: values for name, values in view.channels.items() if name != "theta"}
    assert air_rotation_columns(replace(view, channels=channels), comparison.measured) == {}
    forces = {axis: values for axis, values in comparison.measured.items() if axis != "CZ"}
    assert air_rotation_columns(view, forces) == {}


def test_a_model_without_damping_feels_no_rotation() -> None:
    comparison, view = _compared(_flight(turbulent=False))
    blind = replace(view.database, terms=())
    assert (
        air_rotation_columns(replace(view, database=blind, _slopes={}), comparison.measured) == {}
    )


def test_the_gusts_that_alpha_shows_say_how_fast_the_air_rolls() -> None:
    """Against the roll rate of JSBSim's air, which it draws by itself, within a factor of 1.5."""
    channels = _flight(turbulent=True)
    comparison, view = _compared(channels)
    gusts = channels["gust_down"] / channels["V"]
    frequency, power = welch(gusts, 1.0 / STEP, nperseg=800)
    edges = np.geomspace(0.1, 12.5, 12)
    density = [
        float(power[(frequency >= low) & (frequency < high)].mean())
        for low, high in pairwise(edges)
    ]
    none = tuple(np.zeros(len(density)).tolist())
    noise = StateNoise(
        "sensor", tuple(edges.tolist()), {"alpha": 0.0}, {"alpha": none}, 0.0,
        {"alpha": tuple(density)},
    )  # fmt: skip
    flight = Flight(comparison.flight, "737", view.time, dict(view.channels))
    rolling = rolling_air(noise, flight, view.reference.span)
    assert rolling is not None
    frequency, power = welch(channels["p_aero"] - channels["p"], 1.0 / STEP, nperseg=800)
    inside = (frequency >= 0.2) & (frequency < 1.0)
    shown = np.sqrt(power[inside].sum() * (frequency[1] - frequency[0]))
    assert shown / 1.5 < rolling.rms("p", 0.2, 1.0) < 1.5 * shown
    calm = replace(noise, unsteady={"alpha": none})
    assert rolling_air(calm, flight, view.reference.span) is None
    air, own = roll_rates(noise, flight, view.reference.span, 1.0)
    assert air == pytest.approx(rolling.rms("p", 0.1, 1.0))
    assert own == pytest.approx(np.sqrt(welch(channels["p"], 1.0 / STEP, nperseg=800)[1][:17].sum()
                                        * 0.03125), rel=0.3)  # fmt: skip
    assert roll_rates(calm, flight, view.reference.span, 1.0) == (0.0, own)
    blind = Flight("blind", "737", view.time, {"V": channels["V"]})
    assert roll_rates(noise, blind, view.reference.span, 1.0) == (0.0, 0.0)


@pytest.mark.parametrize(("rate", "angle"), [("p", "alpha"), ("q", "alpha"), ("r", "beta")])
def test_the_gusts_that_vanes_show_say_how_fast_the_air_turns(rate: str, angle: str) -> None:
    """Against the rates of JSBSim's air, which it filters by itself, within a factor of 1.5."""
    channels = _flight(turbulent=True)
    comparison, view = _compared(channels)
    heading = channels["psi"]
    across = channels["gust_east"] * np.cos(heading) - channels["gust_north"] * np.sin(heading)
    gusts = {"alpha": channels["gust_down"], "beta": across}[angle] / channels["V"]
    frequency, power = welch(gusts, 1.0 / STEP, nperseg=800)
    edges = np.geomspace(0.1, 12.5, 12)
    density = tuple(
        float(power[(frequency >= low) & (frequency < high)].mean())
        for low, high in pairwise(edges)
    )
    none = (0.0,) * len(density)
    noise = StateNoise(
        "sensor", tuple(edges.tolist()), {angle: 0.0}, {angle: none}, 0.0, {angle: density}
    )
    flight = Flight(comparison.flight, "737", view.time, dict(view.channels))
    air = rotating_air(noise, flight, view.reference.span)
    assert air is not None
    frequency, power = welch(channels[f"{rate}_aero"] - channels[rate], 1.0 / STEP, nperseg=800)
    inside = (frequency >= 0.2) & (frequency < 1.0)
    shown = np.sqrt(power[inside].sum() * (frequency[1] - frequency[0]))
    assert shown / 1.5 < air.rms(rate, 0.2, 1.0) < 1.5 * shown
    assert rotating_air(replace(noise, unsteady={angle: none}), flight, view.reference.span) is None


def test_a_nuisance_column_is_eliminated_with_a_prior_of_one() -> None:
    """As in ridge regression with the nuisance beside the hypotheses: an independent solution."""
    flight = evidence(13)
    rng = np.random.default_rng(4)
    extra = {axis: rng.standard_normal(flight.samples) for axis in flight.residual}
    named = replace(flight, columns={**flight.columns, f"{NUISANCE}q": extra})
    whole = normal_equations_of(
        replace(flight, columns={**flight.columns, "kept": extra}), SETTINGS
    )
    found = normal_equations_of(named, SETTINGS)
    assert found.hypotheses == tuple(flight.columns)
    at = len(whole.axes) + whole.hypotheses.index("kept")
    ridged = whole.matrix + np.diag(np.arange(len(whole.matrix)) == at)
    expected = np.linalg.inv(np.delete(np.delete(np.linalg.inv(ridged), at, 0), at, 1))
    rest = np.delete(np.delete(whole.matrix, at, 0), at, 1)
    assert np.allclose(found.matrix, expected, rtol=1e-6, atol=1e-6 * np.abs(rest).max())


def test_what_rotating_air_leaves_is_not_claimed() -> None:
    """A residual that is nothing but the nuisance gives an estimate near zero, and a wide one."""
    flight = evidence(13)
    first = LIBRARY[0].id
    (axis,) = flight.columns[first]
    rng = np.random.default_rng(5)
    gusts = flight.columns[first][axis] + 0.3 * rng.standard_normal(flight.samples)
    residual = {name: np.array(values) for name, values in flight.residual.items()}
    residual[axis] = residual[axis] + 2.0 * gusts
    moved = replace(flight, residual=residual)
    ignorant = campaign([normal_equations_of(moved, SETTINGS)], LIBRARY).flight_estimates((0,), ())
    columns = {**flight.columns, f"{NUISANCE}q": {axis: 2.0 * gusts}}
    knowing = campaign(
        [normal_equations_of(replace(moved, columns=columns), SETTINGS)], LIBRARY
    ).flight_estimates((0,), ())
    assert ignorant.estimate[0, 0] > 1.0
    spread = knowing.information[0, 0] ** -0.5
    assert abs(knowing.estimate[0, 0]) < max(3.0 * spread, 0.2 * ignorant.estimate[0, 0])
    assert spread > 2.0 * ignorant.information[0, 0] ** -0.5
