"""What a bias or a delay leaves in estimates: standard errors that hold it cover the truth, those
without do not."""

from dataclasses import replace

import numpy as np
import pytest

from aerodb.coefficients.comparison import band_limited, compare
from aerodb.coefficients.total import total_coefficients
from aerodb.effects.flight_view import view_of
from aerodb.flight import Flight
from aerodb.increments.estimate import ConsiderParameter, estimate_increments
from aerodb.increments.model_file import parse_model_file
from aerodb.loop import ReconstructionErrors
from aerodb.loop.consider import consider_parameters, sensor_consider_parameters
from aerodb.nomenclature import AXES, MOMENT_AXES
from aerodb.signals.error_measures import rms
from aerodb.support.arrays import Array
from aerodb.tables.reference import ReferenceGeometry
from aerodb.vehicle import Vehicle, add_combinations, with_measured
from aerodb.vehicle.probe import air_data_at_cg
from tests.support.effect_flights import database as whole_database
from tests.support.effect_flights import flown, flown_together, logged, vehicle
from tests.support.synthetic import comparison, database, flight, smooth_noise

MODEL = '[[increment]]\naxis = "CZ"\nterms = ["1", "alpha", "q_hat"]\n'
SIGMA = {"alpha_bias": 0.002, "V_bias": 0.3}


def _columns(of: Flight) -> dict[str, Array]:
    """What a biased alpha and a biased airspeed do to CZ of a lift curve -5 alpha at 70 m/s, by
    hand."""
    return {"alpha_bias": 5.0 + 2.0 * of["alpha"], "V_bias": 2.0 / 70.0 * 5.0 * of["alpha"]}


def _distances(runs: int, shared: bool, told: bool) -> Array:
    """(runs, 3) estimates in standard errors, of three flights with nothing to find but biases
    drawn anew in each run."""
    found = []
    for seed in range(runs):
        rng = np.random.default_rng(seed)
        flights = [flight(rng, f"f{k}", 20.0) for k in range(3)]
        drawn = [{name: s * rng.standard_normal() for name, s in SIGMA.items()} for _ in flights]
        errors = [drawn[0]] * 3 if shared else drawn
        residuals = [
            sum(e[n] * x for n, x in _columns(f).items())
            for f, e in zip(flights, errors, strict=True)
        ]
        noise = [smooth_noise(rng, len(f.time), 0.1, 0.002) for f in flights]
        compared = [
            comparison(f, {"CZ": r + x}) for f, r, x in zip(flights, residuals, noise, strict=True)
        ]
        known = {
            f.id: [
                ConsiderParameter(n, SIGMA[n], shared, {"CZ": x}) for n, x in _columns(f).items()
            ]
            for f in flights
        }
        update = estimate_increments(
            flights, compared, parse_model_file(MODEL), database(), known if told else None
        )
        found.append(update.axes[0].estimates / update.axes[0].standard_errors)
    return np.array(found)


def test_intervals_hold_what_the_residual_cannot_show() -> None:
    """One error in all flights, 300 campaigns: normalised estimates have unit size and 95 %
    intervals cover, where those of the residual alone miss by tens of standard errors."""
    told = _distances(300, shared=True, told=True)
    size = np.sqrt(np.mean(told**2, axis=0))
    assert np.all((size > 0.87) & (size < 1.15)), size
    assert 0.92 < np.mean(np.abs(told) < 1.96) < 0.98
    alone = np.sqrt(np.mean(_distances(40, shared=True, told=False) ** 2, axis=0))
    assert np.all(alone[:2] > 10.0)


def test_what_each_flight_has_for_itself_is_held_with_something_to_spare() -> None:
    """Errors that differ from flight to flight show in the residual in part, so that they count
    more than once; without them the intervals of three flights are still too short by two."""
    told = _distances(150, shared=False, told=True)
    size = np.sqrt(np.mean(told**2, axis=0))
    assert np.all((size > 0.6) & (size < 1.1)), size
    alone = np.sqrt(np.mean(_distances(150, shared=False, told=False) ** 2, axis=0))
    assert np.all(alone[:2] > 1.5)


def test_without_doubts_nothing_changes() -> None:
    rng = np.random.default_rng(0)
    one = flight(rng, "f0")
    compared = comparison(one, {"CZ": smooth_noise(rng, len(one.time), 0.1, 0.01)})
    plain, empty = (
        estimate_increments([one], [compared], parse_model_file(MODEL), database(), d).axes[0]
        for d in (None, {})
    )
    np.testing.assert_array_equal(plain.covariance, empty.covariance)
    more = {
        "f0": [ConsiderParameter("alpha_bias", 0.002, True, {"CZ": np.full(len(one.time), 5.0)})]
    }
    doubted = estimate_increments(
        [one], [compared], parse_model_file(MODEL), database(), more
    ).axes[0]
    np.testing.assert_array_equal(doubted.estimates, plain.estimates)
    # a constant moves the constant alone
    assert doubted.covariance[0, 0] - plain.covariance[0, 0] == pytest.approx(0.01**2)
    np.testing.assert_allclose(doubted.standard_errors[1:], plain.standard_errors[1:])


def _residuals(of: Flight) -> tuple[Flight, dict[str, Array]]:
    described = vehicle()
    of = add_combinations(air_data_at_cg(of, described), described)
    geometry = ReferenceGeometry(
        described.reference.area,
        described.reference.chord,
        described.reference.span,
        (0.0, 0.0, 0.0),
    )
    compared = compare(of, total_coefficients(of, described), whole_database(False), geometry)
    return of, {axis: compared.residual(axis) for axis in AXES}


def test_an_airspeed_takes_its_dynamic_pressure_along() -> None:
    """Against the real chain: the airspeed of a log and the qbar made of it, .2 m/s too high,
    processed again."""
    raw = logged(flown(3, whole_database(False)), vehicle())
    shift = 0.2
    moved = raw.with_channels(
        {"V": raw["V"] + shift, "qbar": raw["qbar"] * (1.0 + shift / raw["V"]) ** 2}
    )
    base, before = _residuals(raw)
    after = _residuals(moved)[1]
    described = vehicle()
    compared = compare(
        base, total_coefficients(base, described), whole_database(False), described.reference
    )
    view = view_of(base, compared, whole_database(False), described)
    (doubt,) = sensor_consider_parameters(view, {"V_bias": shift, "p_bias": 1.0})
    assert (doubt.name, doubt.shared) == ("V_bias", True)
    assert not sensor_consider_parameters(view, {"V_bias": shift}, own=("V_bias",))[0].shared
    inner = slice(50, -50)
    most = max(rms((after[axis] - before[axis])[inner]) for axis in AXES)
    for axis in AXES:
        column = (
            band_limited(doubt.columns[axis], view.step, view.bandwidth)
            if axis in MOMENT_AXES
            else doubt.columns[axis]
        )
        off = rms((shift * column - (after[axis] - before[axis]))[inner])
        assert off < 0.05 * rms((after[axis] - before[axis])[inner]) + 0.01 * most, axis


def test_vehicle_data_are_as_wrong_as_the_vehicle_file_says() -> None:
    """Thirty campaigns of three flights with Iyy, CG and elevator drawn from what [measured] states:
    the intervals of Cm hold the truth, and without it miss by several standard errors."""
    plain, truth = vehicle(), whole_database(False)
    stated = with_measured(plain, ["Iyy=3 %", "cg_x=20 mm", "delta_elevator=2 %"])
    declared = parse_model_file(
        '[[increment]]\naxis = "Cm"\nterms = ["1", "alpha", "q_hat", "delta_elevator"]\n'
        "own_constants = true\n"
    )
    draws = [np.random.default_rng([7, number]) for number in range(30)]
    vehicles = [
        _with_errors(plain, 0.03 * rng.standard_normal(), 0.02 * rng.standard_normal())
        for rng in draws
    ]
    flew = flown_together(
        range(90), truth, [each for each in vehicles for _ in range(3)], seconds=20.0
    )
    told, alone = [], []
    for number, rng in enumerate(draws):
        scale = 1.0 + 0.02 * rng.standard_normal()
        flights, compared = [], []
        for each in flew[3 * number : 3 * number + 3]:
            seen = each.with_channels({"delta_elevator": scale * each["delta_elevator"]})
            made = total_coefficients(seen, stated, angular_acceleration="logged")
            noise = smooth_noise(rng, len(each.time), 0.1, 0.002)
            made = replace(made, values={**made.values, "Cm": made.values["Cm"] + noise})
            flights.append(seen)
            compared.append(compare(seen, made, truth, stated.reference))
        nothing = {one.id: ReconstructionErrors() for one in flights}
        for of, found in ((stated, told), (plain, alone)):
            doubt = consider_parameters(nothing, of, truth, flights, compared)
            (axis,) = estimate_increments(flights, compared, declared, truth, doubt).axes
            found.append(axis.estimates[1:] / axis.standard_errors[1:])
    size = np.sqrt(np.mean(np.square(told), axis=0))
    assert np.all((size > 0.6) & (size < 1.3)), size
    assert np.mean(np.abs(told) < 1.96) > 0.9
    assert np.sqrt(np.mean(np.square(alone), axis=0)).max() > 2.0


def _with_errors(of: Vehicle, inertia: float, forward: float) -> Vehicle:
    """The vehicle that flies where the file of `of` states an Iyy that is `inertia` too large, and a
    CG that is `forward` m too far ahead."""
    x, y, z = of.mass.cg
    mass = of.mass.model_copy(
        update={"Iyy": of.mass.Iyy / (1.0 + inertia), "cg": (x - forward, y, z)}
    )
    return of.model_copy(update={"mass": mass})
