"""What hangs on inputs that flights lack, against changes and residuals worked out by hand."""

import numpy as np
import pytest

from aerodb.coefficients.comparison import compare
from aerodb.coefficients.inputs import input_uses, lacking_inputs, with_held_inputs
from aerodb.coefficients.total import Coefficients
from aerodb.errors import InputError
from aerodb.flight import Flight
from aerodb.nomenclature import AXES
from aerodb.signals.error_measures import rms
from aerodb.tables.database import AeroDatabase, Term, Variable
from aerodb.tables.expression import parse
from aerodb.tables.reference import ReferenceGeometry
from aerodb.vehicle import parse_vehicle
from tests.support.small_glider import VEHICLE

N = 500
TIME = np.arange(N) * 0.02
ALPHA = 0.05 + 0.03 * np.sin(2.0 * TIME)
TERMS = {
    "CZ": "-5*alpha - 2*alphadot_hat",
    "CX": "-0.02*parachute - 0.1*size_of_beta",
    "Cm": "-1.2*delta_elevator",
}


def database(**more):
    return AeroDatabase(
        "d",
        ReferenceGeometry(0.9, 0.25, 3.6, (-0.4, 0.0, 0.0)),
        variables={"size_of_beta": Variable(parse("abs(beta)"), "1", "size of beta")},
        terms=tuple(Term(f"t{axis}", axis, parse(text)) for axis, text in TERMS.items()),
        free_inputs={"parachute": "air parachute"},
        **more,
    )


def flight(**more):
    channels = {"V": np.full(N, 25.0), "alpha": ALPHA, "beta": 0.02 * np.cos(TIME), **more}
    return Flight("f", "small-glider", TIME, channels)


def uses(flown, base):
    """By name, and the comparison with all that is lacking held at zero."""
    vehicle = parse_vehicle(VEHICLE)
    held = with_held_inputs(base, lacking_inputs(base, [flown.channels]))
    measured = {axis: 0.01 * np.sin(3.0 * TIME) for axis in AXES}
    coefficients = Coefficients(
        "f",
        TIME,
        measured,
        {axis: np.full(N, 1e-3) for axis in AXES},
        {axis: np.ones(N, dtype=bool) for axis in AXES},
        np.broadcast_to((-0.4, 0.0, 0.0), (N, 3)),
        None,
        (),
    )
    comparison = compare(flown, coefficients, held, vehicle.reference)
    return {u.name: u for u in input_uses(held, vehicle, [(flown, comparison)])}, comparison


def test_change_over_the_plausible_range_beside_the_residual():
    found, comparison = uses(flight(), database())
    parachute, elevator = found["parachute"], found["delta_elevator_held"]
    (effect,) = parachute.effects
    assert (effect.axis, effect.change) == ("CX", pytest.approx(0.02))
    assert effect.share == pytest.approx(0.02 / rms(comparison.residual("CX")))
    assert parachute.range.origin.startswith("one unit")
    (effect,) = elevator.effects  # limits of the vehicle file: 25 deg
    assert (effect.axis, effect.change) == ("Cm", pytest.approx(1.2 * np.deg2rad(25.0)))


def test_from_motion_says_what_zero_would_leave_out_and_what_the_flights_bear_out():
    found, comparison = uses(flight(), database())
    (effect,) = found["alphadot"].effects
    rate = 2.0 * 0.06 * 0.25 / 50.0  # largest alphadot c / (2 V), times the derivative
    assert (effect.axis, effect.change) == ("CZ", pytest.approx(rate, rel=0.05))
    (effect,) = found["size_of_beta"].effects
    assert (effect.axis, effect.change) == ("CX", pytest.approx(0.002, rel=1e-3))
    beta = 0.1 * np.abs(0.02 * np.cos(TIME))
    for each in found["size_of_beta"].residuals:
        assert each.now == pytest.approx(np.std(comparison.residual("CX")))
        assert each.with_zero == pytest.approx(np.std(comparison.residual("CX") - beta))


def test_nothing_to_say_where_flights_have_everything():
    given = flight(delta_elevator=0.1 * ALPHA, alphadot=np.gradient(ALPHA, TIME))
    base = with_held_inputs(database(), ["parachute"])
    assert lacking_inputs(base, [given.channels]) == ()
    assert set(uses(given, base)[0]) == {"size_of_beta", "parachute"}


def test_without_flights_only_what_no_log_can_hold_is_lacking():
    assert lacking_inputs(database(), []) == ("parachute",)
    held = with_held_inputs(database(), ["parachute"])
    (use,) = input_uses(held, parse_vehicle(VEHICLE), [], ["parachute"])
    assert use.effects is None
    assert not use.accepted


def test_only_inputs_of_terms_can_be_held():
    with pytest.raises(InputError, match="cannot be held"):
        with_held_inputs(database(), ["delta_rudder"])
    with pytest.raises(InputError, match="cannot be held"):
        with_held_inputs(database(), ["V"])


def test_held_at_zero_predicts_as_with_zero_given():
    base, given = database(), flight(delta_elevator=0 * TIME, alphadot=0 * TIME)
    held = with_held_inputs(base, ["parachute", "delta_elevator", "alphadot"])
    channels = {**given.channels, "parachute": 0 * TIME}
    one, two = (each.predict(channels).coefficients for each in (base, held))
    assert not {"parachute", "delta_elevator", "alphadot"} & set(held.inputs)
    for axis in AXES:
        np.testing.assert_array_equal(one[axis], two[axis])
