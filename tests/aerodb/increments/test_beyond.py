"""Flights outside the envelope of what predicts them: held and extrapolated, against errors worked
out by hand."""

import numpy as np
import pytest

from aerodb.coefficients.comparison import compare
from aerodb.coefficients.total import Coefficients
from aerodb.flight import Flight
from aerodb.increments.beyond import beyond_envelopes, with_extrapolated_slopes
from aerodb.nomenclature import AXES
from aerodb.signals.error_measures import rms
from aerodb.tables.database import AeroDatabase
from aerodb.tables.expression import parse
from aerodb.tables.increment import Increment, Interval
from aerodb.tables.reference import ReferenceGeometry
from aerodb.vehicle import parse_vehicle
from tests.support.small_glider import VEHICLE

TIME = np.arange(401) * 0.05
ALPHA = 0.1 + 0.1 * np.sin(0.5 * TIME)  # flown: 0 to .15, one cell of .02


def database(low=0.0, high=0.15):
    increment = Increment(
        "CZ",
        (parse("1"), parse("alpha")),
        np.array([-0.2, -5.0]),
        np.zeros((2, 2)),
        {"alpha": Interval(low, high, 0.02)},
    )
    reference = ReferenceGeometry(0.9, 0.25, 3.6, (-0.4, 0.0, 0.0))
    return AeroDatabase("d", reference, increments=(increment,))


def errors(base, cz):
    flight = Flight("f", "small-glider", TIME, {"V": np.full(401, 25.0), "alpha": ALPHA})
    zero = np.zeros(401)
    coefficients = Coefficients(
        "f",
        TIME,
        {axis: cz if axis == "CZ" else zero for axis in AXES},
        dict.fromkeys(AXES, zero + 0.001),
        {axis: np.ones(401, dtype=bool) for axis in AXES},
        np.broadcast_to((-0.4, 0.0, 0.0), (401, 3)),
        None,
        (),
    )
    reference = parse_vehicle(VEHICLE).reference
    both = (base, with_extrapolated_slopes(base))
    held, free = (compare(flight, coefficients, each, reference) for each in both)
    return beyond_envelopes(flight, base, held, free), held, free


def test_both_errors_where_the_slope_goes_on():
    """What is measured is the line itself: extrapolated is without error, held errs by its fade."""
    (found,), held, _ = errors(database(), -0.2 - 5.0 * ALPHA)
    outside = (ALPHA > 0.15) | (ALPHA < 0.0)
    over = ALPHA[outside]
    weight = np.clip(2.0 - (over - 0.15) / 0.02, 0.0, 1.0)
    assert found.axis == "CZ"
    assert found.share == pytest.approx(outside.mean())
    assert found.extrapolated == pytest.approx(0.0, abs=1e-12)
    assert found.held_outside == pytest.approx(
        rms(-0.2 - 5.0 * over - weight * (-0.2 - 5.0 * 0.15))
    )
    assert found.held == pytest.approx(rms(held.residual("CZ")))
    (excursion,) = found.excursions
    assert excursion.variable == "alpha"
    assert excursion.flight == (pytest.approx(ALPHA.min()), pytest.approx(ALPHA.max()))
    assert excursion.envelope == (0.0, 0.15)
    inside = np.ones(401, dtype=bool)
    for first, last in found.intervals:
        inside[(first <= TIME) & (last >= TIME)] = False
    np.testing.assert_array_equal(~inside, outside)


def test_extrapolated_is_worse_where_the_slope_ends():
    (found,), _, _ = errors(database(), -0.2 - 5.0 * np.minimum(ALPHA, 0.15))
    assert found.extrapolated_outside == pytest.approx(rms(5.0 * (ALPHA[ALPHA > 0.15] - 0.15)))


def test_nothing_is_said_inside():
    assert errors(database(-1.0, 1.0), -5.0 * ALPHA)[0] == ()


def test_the_same_database_inside_the_envelope():
    base, alpha = database(), np.linspace(0.0, 0.15, 20)
    one, two = (
        each.predict({"alpha": alpha}).coefficients["CZ"]
        for each in (base, with_extrapolated_slopes(base))
    )
    np.testing.assert_array_equal(one, two)
