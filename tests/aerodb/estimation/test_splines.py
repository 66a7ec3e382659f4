"""Splines at knots: against numpy and scipy, the published bin of sweeps and stalls on a simulated
aircraft of that size, and knots chosen from data."""

import numpy as np
import pytest
import scipy.interpolate

from aerodb.errors import InputError
from aerodb.estimation.regression.regression_fit import regression
from aerodb.estimation.splines import chosen_knots, spline_basis
from aerodb.signals.error_measures import theil
from tests.support.caravan import (
    ALPHA,
    ELEVATOR,
    KNOTS,
    LIFT,
    PITCH_RATE,
    bin_equation,
    caravan_bin,
)
from tests.support.equations import coloured

PLACES = np.linspace(-0.1, 0.4, 301)


def test_a_linear_spline_is_linear_interpolation_and_held_beyond():
    values = np.array([0.3, 0.9, 0.2, 1.4, 1.0, 0.5])
    basis = spline_basis(PLACES, KNOTS, "linear")
    np.testing.assert_allclose(basis @ values, np.interp(PLACES, KNOTS, values), atol=1e-14)
    np.testing.assert_allclose(spline_basis(KNOTS, KNOTS, "linear"), np.eye(6), atol=1e-15)
    np.testing.assert_allclose(basis.sum(axis=1), 1.0, atol=1e-14)


def test_a_cubic_spline_is_that_of_scipy_and_reproduces_cubics():
    rng = np.random.default_rng(1)
    values = rng.standard_normal(6)
    inside = np.linspace(KNOTS[0], KNOTS[-1], 200)
    expected = scipy.interpolate.CubicSpline(KNOTS, values)(inside)
    np.testing.assert_allclose(spline_basis(inside, KNOTS, "cubic") @ values, expected, atol=1e-12)
    np.testing.assert_allclose(spline_basis(KNOTS, KNOTS, "cubic"), np.eye(6), atol=1e-13)
    cubic = np.polynomial.Polynomial([1.0, -2.0, 8.0, 30.0])
    np.testing.assert_allclose(
        spline_basis(inside, KNOTS, "cubic") @ cubic(KNOTS), cubic(inside), atol=1e-12
    )
    with pytest.raises(InputError, match="at least two knots"):
        spline_basis(inside, [0.1, 0.1], "cubic")


@pytest.fixture(scope="module")
def flown():
    return caravan_bin(1)


@pytest.mark.parametrize("kind", ["linear", "cubic"])
def test_lift_of_four_sweeps_and_three_stalls(flown, kind):
    """ "Aerodynamic Model Update ..." fits eq. 41 with these knots to such a bin, and prints a fit of
    97.7 % with error parts 0, .004 and .996."""
    names = [f"{np.rad2deg(knot):.0f} deg" for knot in KNOTS]
    bases = [spline_basis(each.alpha, KNOTS, kind) for each in flown]
    fit = regression(bin_equation(flown, bases, names))
    truth = np.interp(KNOTS, ALPHA, LIFT)
    if kind == "linear":  # the simulated table is straight between these knots
        for name, value in zip(names, truth, strict=True):
            assert fit[name].value == pytest.approx(value, abs=3.5 * fit[name].standard_error)
    else:
        np.testing.assert_allclose([fit[n].value for n in names], truth, atol=0.05)
    assert fit["q_hat"].standing == fit["delta_elevator"].standing == "fixed"
    model = np.concatenate([fit.fitted[each.name]["C_lift"] for each in flown])
    whole = theil(model, np.concatenate([each.lift for each in flown]))
    assert whole.fit_percent > 97.7
    assert whole.bias < 0.001
    assert whole.variance < 0.004
    assert whole.covariance > 0.996
    assert any(f"fit {whole.fit_percent:.1f} %" in note for note in fit.notes)
    assert all(fit.theil[each.name]["C_lift"].fit_percent > 95.0 for each in flown)


def test_knots_are_chosen_where_the_lift_bends(flown):
    alpha = np.concatenate([each.alpha for each in flown])
    attached = np.concatenate(
        [each.lift - PITCH_RATE * each.q_hat - ELEVATOR * each.elevator for each in flown]
    )
    lengths = [len(each.lift) for each in flown]
    knots = chosen_knots(alpha, attached, np.zeros((len(alpha), 0)), lengths=lengths)
    assert 5 <= len(knots) <= 8
    for bend in KNOTS[2:5]:  # at 9, 11 and 13 degrees; that at 5 degrees is slight
        assert min(abs(knot - bend) for knot in knots) < np.deg2rad(0.8)


def test_a_straight_line_in_coloured_noise_has_no_knots_between():
    rng = np.random.default_rng(5)
    counts = []
    for _ in range(20):
        x = coloured(rng, 3000, 0.99)
        z = 0.5 * x + coloured(rng, 3000, 0.95)
        counts.append(len(chosen_knots(x, z, np.zeros((3000, 0)))))
    assert np.mean(np.array(counts) == 2) >= 0.8
    with pytest.raises(InputError, match="does not move"):
        chosen_knots(np.ones(50), np.ones(50), np.zeros((50, 0)))


def test_knots_of_a_slope_that_changes():
    rng = np.random.default_rng(7)
    x, control = coloured(rng, 4000, 0.99), coloured(rng, 4000, 0.95)
    slope = np.interp(x, [-1.0, 0.5, 2.0], [1.0, 1.0, -1.0])
    z = slope * control + 0.2 * x + 0.1 * coloured(rng, 4000, 0.8)
    knots = chosen_knots(x, z, np.column_stack([x, np.ones(4000)]), factor=control)
    assert min(abs(knot - 0.5) for knot in knots) < 0.3
