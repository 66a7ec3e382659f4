"""Sensor columns against the real chain: perturb one instrument of a log, process it again,
difference the residual."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from aerodb.coefficients.comparison import band_limited, compare
from aerodb.coefficients.total import total_coefficients
from aerodb.effects.flight_view import FlightView, view_of
from aerodb.effects.hypothesis import Hypothesis
from aerodb.effects.library import SENSORS, hypotheses_for
from aerodb.flight import Flight
from aerodb.nomenclature import AXES, MOMENT_AXES
from aerodb.signals import played
from aerodb.signals.error_measures import rms
from aerodb.support.arrays import Array
from aerodb.tables.analysis.sensitivity import slopes_by
from aerodb.tables.database import Term
from aerodb.tables.expression import parse
from aerodb.tables.reference import ReferenceGeometry
from aerodb.vehicle import Vehicle, add_combinations
from aerodb.vehicle.probe import air_data_at_cg
from tests.support.effect_flights import database, flown, logged, vehicle

#: Size of the perturbation; the tangent must meet the difference within TOLERANCE of its rms on
#: every axis that it moves.
TOLERANCE = 0.03
#: What an axis may differ where it is hardly moved at all, as a share of the most that any axis is
#: moved.
NEGLIGIBLE = 0.002

Perturbed = Callable[[Flight, Vehicle, float], tuple[Flight, Vehicle]]


def _channel(name: str, change: Callable[[Array, float], Array]) -> Perturbed:
    return lambda flight, of, h: (flight.with_channels({name: change(flight[name], h)}), of)


def _late(name: str) -> Perturbed:
    def perturbed(flight: Flight, of: Vehicle, h: float) -> tuple[Flight, Vehicle]:
        return flight.with_channels(
            {name: CubicSpline(flight.time, flight[name])(flight.time - h)}
        ), of

    return perturbed


def _scaled(*names: str) -> Perturbed:
    return lambda flight, of, h: (
        flight.with_channels({name: flight[name] * (1 + h) for name in names}),
        of,
    )


def _shifted(**by: float) -> Perturbed:
    return lambda flight, of, h: (
        flight.with_channels({name: flight[name] + share * h for name, share in by.items()}),
        of,
    )


def _ahead(shape: Callable[[Array, Array, float], Array], **by: float) -> Perturbed:
    """The log shows what a surface that follows it badly has yet to do: each channel differs by its
    share of ``shape(time, deflection, h)``; the deflection is the sum of the shares."""

    def perturbed(flight: Flight, of: Vehicle, h: float) -> tuple[Flight, Vehicle]:
        own = sum(flight[name] * share for name, share in by.items()) / sum(map(abs, by.values()))
        more = shape(flight.time, np.asarray(own), h)
        return flight.with_channels(
            {name: flight[name] + np.sign(share) * more for name, share in by.items()}
        ), of

    return perturbed


def _early(time: Array, own: Array, h: float) -> Array:
    return np.asarray(CubicSpline(time, own)(time + h) - own)


def _play(share: float) -> Callable[[Array, Array, float], Array]:
    """The log leads the surface to the flank of the play on which it is."""

    def ahead(time: Array, own: Array, h: float) -> Array:
        width = share * own.std()
        return h * (own - played(own, width)) / width

    return ahead


def _dead(time: Array, own: Array, h: float) -> Array:
    return h * np.clip(own / (own.std() / 3.0), -1.0, 1.0)


#: Surface -> the channels of its deflection, with their shares in it.
MOVING = {
    "elevator": {"delta_elevator": 1.0},
    "rudder": {"delta_rudder": 1.0},
    "aileron": {"delta_aileron_right": 1.0, "delta_aileron_left": -1.0},
    "flaperon": {"delta_aileron_right": 1.0, "delta_aileron_left": 1.0},
}


def _mass(**changes: Callable[[Vehicle, float], object]) -> Perturbed:
    def perturbed(flight: Flight, of: Vehicle, h: float) -> tuple[Flight, Vehicle]:
        mass = of.mass.model_copy(update={name: change(of, h) for name, change in changes.items()})
        return flight, of.model_copy(update={"mass": mass})

    return perturbed


def _moved(k: int) -> Callable[[Vehicle, float], object]:
    return lambda of, h: tuple(x + h * (j == k) for j, x in enumerate(of.mass.cg))


def _probe(k: int) -> Perturbed:
    def perturbed(flight: Flight, of: Vehicle, h: float) -> tuple[Flight, Vehicle]:
        assumed = tuple(x - h * (j == k) for j, x in enumerate(of.points.air_data))
        return flight, of.model_copy(
            update={"points": of.points.model_copy(update={"air_data": assumed})}
        )

    return perturbed


def _line(k: int) -> Perturbed:
    def perturbed(flight: Flight, of: Vehicle, h: float) -> tuple[Flight, Vehicle]:
        point = tuple(x + h * (j == k) for j, x in enumerate(of.thrust.point))
        thrust = of.thrust.model_copy(update={"point": point})
        return flight, of.model_copy(update={"thrust": thrust})

    return perturbed


def _plus(x: Array, h: float) -> Array:
    return x + h


#: Parameter -> size of the perturbation and what it does to the log or to the vehicle file.
PERTURBATIONS: dict[str, tuple[float, Perturbed]] = {
    "qbar_scale": (0.01, _scaled("qbar")),
    "qbar_offset": (10.0, _channel("qbar", _plus)),
    "alpha_bias": (0.0044, _channel("alpha", _plus)),
    "alpha_scale": (0.02, _scaled("alpha")),
    "alpha_delay": (0.01, _late("alpha")),
    "beta_bias": (0.0044, _channel("beta", _plus)),
    "beta_scale": (0.02, _scaled("beta")),
    "beta_delay": (0.01, _late("beta")),
    "air_data_x": (0.1, _probe(0)),
    "air_data_z": (0.1, _probe(2)),
    **{f"a{x}_bias": (0.05, _channel(f"a{x}_imu", _plus)) for x in "xyz"},
    **{f"{x}_bias": (0.002, _channel(x, _plus)) for x in "pqr"},
    **{f"{x}_scale": (0.01, _scaled(x)) for x in "pqr"},
    "mass_share": (0.01, _mass(mass=lambda of, h: of.mass.mass * (1 + h))),
    **{f"cg_{x}_offset": (0.01, _mass(cg=_moved(k))) for k, x in enumerate("xyz")},
    "Ixx_share": (0.01, _mass(Ixx=lambda of, h: of.mass.Ixx * (1 + h))),
    "Iyy_share": (0.01, _mass(Iyy=lambda of, h: of.mass.Iyy * (1 + h))),
    "Izz_share": (0.01, _mass(Izz=lambda of, h: of.mass.Izz * (1 + h))),
    "Ixz_share": (
        0.01,
        _mass(Ixz=lambda of, h: of.mass.Ixz + h * np.sqrt(of.mass.Ixx * of.mass.Izz)),
    ),
    "thrust_scale": (0.02, _scaled("thrust")),
    "thrust_line_y": (0.05, _line(1)),
    "thrust_line_z": (0.05, _line(2)),
    "delta_elevator_scale": (0.02, _scaled("delta_elevator")),
    "delta_rudder_scale": (0.02, _scaled("delta_rudder")),
    "delta_flap_scale": (0.02, _scaled("delta_flap")),
    "delta_speed_brake_scale": (0.02, _scaled("delta_speed_brake")),
    "delta_body_flap_scale": (0.02, _scaled("delta_body_flap")),
    "delta_strake_scale": (0.02, _scaled("delta_strake")),
    "delta_aileron_scale": (0.02, _scaled("delta_aileron_right", "delta_aileron_left")),
    **{
        f"delta_{name}_bias": (0.005, _channel(f"delta_{name}", _plus))
        for name in ("elevator", "rudder", "flap", "speed_brake", "body_flap", "strake")
    },
    "delta_aileron_bias": (0.005, _shifted(delta_aileron_right=1, delta_aileron_left=-1)),
    "delta_flaperon_bias": (0.005, _shifted(delta_aileron_right=1, delta_aileron_left=1)),
    **{f"delta_{name}_delay": (0.01, _ahead(_early, **by)) for name, by in MOVING.items()},
    **{f"delta_{name}_backlash": (0.001, _ahead(_play(0.2), **by)) for name, by in MOVING.items()},
    **{
        f"delta_{name}_wide_backlash": (0.001, _ahead(_play(2.0 / 3.0), **by))
        for name, by in MOVING.items()
    },
    **{f"delta_{name}_dead_zone": (0.001, _ahead(_dead, **by)) for name, by in MOVING.items()},
    "delta_aileron_right_lost": (0.02, _scaled("delta_aileron_right")),
    "delta_aileron_left_lost": (0.02, _scaled("delta_aileron_left")),
}


def _processed(flight: Flight, of: Vehicle, wind: bool) -> tuple[Flight, dict[str, Array]]:
    flight = add_combinations(air_data_at_cg(flight, of), of)
    geometry = ReferenceGeometry(
        of.reference.area, of.reference.chord, of.reference.span, (0.0, 0.0, 0.0)
    )
    compared = compare(flight, total_coefficients(flight, of), _database(wind), geometry)
    return flight, {axis: compared.residual(axis) for axis in AXES}


@cache
def _database(wind: bool):
    return database(wind)


@cache
def _prepared(wind: bool) -> tuple[Flight, Vehicle, FlightView, tuple[Hypothesis, ...]]:
    of = vehicle()
    log = logged(flown(3, _database(wind)), of)
    flight = add_combinations(air_data_at_cg(log, of), of)
    geometry = ReferenceGeometry(
        of.reference.area, of.reference.chord, of.reference.span, (0.0, 0.0, 0.0)
    )
    compared = compare(flight, total_coefficients(flight, of), _database(wind), geometry)
    view = view_of(flight, compared, _database(wind), of)
    library = hypotheses_for(_database(wind), of, flight.channels)
    return log, of, view, tuple(item for item in library if item.kind == "sensor")


def _parameters() -> list[str]:
    return [item.parameter for item in _prepared(False)[3]]


def test_a_perfect_log_leaves_no_residual() -> None:
    log, of, _, _ = _prepared(False)
    _, residual = _processed(log, of, wind=False)
    inner = slice(75, -75)
    for axis in AXES:
        assert np.std(residual[axis][inner]) < 2e-4 + 0.01 * np.std(
            _prepared(False)[2].predicted[axis][inner]
        ), axis


def test_every_sensor_hypothesis_is_perturbed_here() -> None:
    assert set(_parameters()) == set(PERTURBATIONS)
    assert {template.effect for template in SENSORS} <= {
        item.effect for item in _prepared(False)[3]
    }


@pytest.mark.parametrize("wind", [False, True], ids=["body", "wind"])
@pytest.mark.parametrize("parameter", sorted(PERTURBATIONS))
def test_tangent_is_what_the_real_chain_does(parameter: str, wind: bool) -> None:
    log, of, view, library = _prepared(wind)
    (hypothesis,) = (item for item in library if item.parameter == parameter)
    size, perturbed = PERTURBATIONS[parameter]
    more, less = (_processed(*perturbed(log, of, sign * size), wind)[1] for sign in (1.0, -1.0))
    columns = hypothesis.columns(view)
    assert set(columns) == set(AXES)
    inner = slice(75, -75)
    real = {axis: ((more[axis] - less[axis]) / (2 * size))[inner] for axis in AXES}
    usual = {axis: np.std(view.predicted[axis]) for axis in AXES}
    largest = max(rms(real[axis]) / usual[axis] for axis in AXES)
    assert (largest > 0) == ("strake" not in parameter)  # which the database does not know
    for axis in AXES:
        limited = (
            band_limited(columns[axis], view.step, 10.0) if axis in MOMENT_AXES else columns[axis]
        )
        error = rms(limited[inner] - real[axis])
        assert error <= TOLERANCE * rms(real[axis]) + NEGLIGIBLE * largest * usual[axis], (
            axis,
            error,
            rms(real[axis]),
        )


def test_a_bend_counts_by_its_mean_slope_over_what_a_sensor_may_be_wrong() -> None:
    """A table or |beta| has no tangent at its bend; a quarter of a degree of bias sees the
    secant."""
    bent = replace(
        _database(False),
        terms=(*_database(False).terms, Term("even", "CX", parse("-0.05*abs(beta)"))),
    )
    beta = np.linspace(-0.02, 0.02, 401)
    channels = {name: np.full(401, 1.0) for name in bent.inputs} | {
        "beta": beta,
        "alpha": np.zeros(401),
    }
    slope = (
        slopes_by(bent, "beta", channels)["CX"]
        - slopes_by(_database(False), "beta", channels)["CX"]
    )
    assert np.allclose(slope, -0.05 * np.clip(beta / 0.0044, -1.0, 1.0), atol=1e-12)


def test_a_large_zero_error_of_a_surface_is_the_change_of_the_prediction() -> None:
    """Drag that grows with the elevator to either side: 5 deg of zero error turn the sign of its
    slope, and the tangent at the logged deflection is not the change."""
    _, _, view, library = _prepared(False)
    (error,) = (item for item in library if item.parameter == "delta_elevator_bias")
    bent = replace(
        view.database,
        terms=(*view.database.terms, Term("even", "CX", parse("-0.05*abs(delta_elevator)"))),
    )
    there, size = replace(view, database=bent, _slopes={}), np.deg2rad(5.0)
    channels = {**there.channels}
    logged_ = bent.predict(channels).coefficients["CX"]
    true = bent.predict({**channels, "delta_elevator": channels["delta_elevator"] - size})
    change = true.coefficients["CX"] - logged_

    def off(at: float) -> float:
        return rms(size * error.columns(there, at)["CX"] - change) / rms(change - change.mean())

    assert off(size) < 0.15
    assert off(0.0) > 4.0 * off(size)
