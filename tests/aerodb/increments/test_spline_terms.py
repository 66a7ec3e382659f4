"""Splines declared in the model file: their expressions, their estimates, and what becomes of them
in a database."""

import numpy as np
import pytest

from aerodb.errors import InputError
from aerodb.estimation.splines import spline_basis
from aerodb.exchange.native import from_document, to_document
from aerodb.identification.equations import axis_equations
from aerodb.identification.online import OnlineEstimation
from aerodb.increments.chosen_knots import with_chosen_knots
from aerodb.increments.estimate import estimate_increments
from aerodb.increments.model_file import expand, parse_model_file
from aerodb.tables.analysis.consolidation import consolidate
from aerodb.tables.program import evaluate
from aerodb.vehicle import parse_vehicle
from tests.aerodb.increments.test_update import CHORD_OVER_2V, campaign
from tests.support.measured_flights import VEHICLE
from tests.support.synthetic import database, flight

KNOTS = [0.02, 0.09, 0.14, 0.2]
MODEL = """
[[increment]]
axis = "CZ"
terms = ["1", "alpha", "q_hat", "delta_elevator"]
spline = "{kind}"
[increment.knots]
alpha = "0.02 0.09 0.14 0.2 rad"
"delta_elevator over alpha" = [0.02, 0.2]
"""


def lift(flown):
    alpha = flown["alpha"]
    curve = np.interp(alpha, KNOTS, [-0.02, 0.05, 0.11, -0.03])
    slope = np.interp(alpha, [0.02, 0.2], [0.1, 0.4])
    return curve - 3.0 * flown["q"] * CHORD_OVER_2V + slope * flown["delta_elevator"]


@pytest.mark.parametrize("kind", ["linear", "cubic"])
def test_expressions_are_the_basis_functions(kind):
    declared = parse_model_file(MODEL.format(kind=kind)).increment[0]
    flown = flight(np.random.default_rng(3))
    columns = {
        each.name: np.broadcast_to(
            evaluate(each.expression, {**flown.channels, "q_hat": flown["q"]}), flown.time.shape
        )
        for each in expand(declared)
    }
    basis = spline_basis(flown["alpha"], KNOTS, kind)
    assert list(columns) == [
        "1", "alpha at 0.09", "alpha at 0.14", "alpha at 0.2", "q_hat",
        "delta_elevator at alpha 0.02", "delta_elevator at alpha 0.2",
    ]  # fmt: skip
    for k in (1, 2, 3):
        np.testing.assert_allclose(columns[f"alpha at {KNOTS[k]:g}"], basis[:, k], atol=1e-12)
    slope = np.interp(flown["alpha"], [0.02, 0.2], [0.0, 1.0]) * flown["delta_elevator"]
    np.testing.assert_allclose(columns["delta_elevator at alpha 0.2"], slope, atol=1e-12)


def test_planted_splines_come_back_and_fold_into_tables():
    flown, compared = campaign(31, lift)
    update = estimate_increments(
        flown, compared, parse_model_file(MODEL.format(kind="linear")), database()
    )
    axis = update.axes[0]
    truth = [-0.02, 0.07, 0.13, -0.01, -3.0, 0.1, 0.4]
    deviation = (axis.estimates - truth) / axis.standard_errors
    assert np.abs(deviation).max() < 3.5
    layered = update.candidate
    folded = consolidate(layered)
    by_table = dict(zip(axis.names, folded.increments[0].folded, strict=True))
    assert by_table["alpha at 0.14"] == "CZ0"
    channels = {
        "alpha": np.linspace(-0.1, 0.35, 200),
        "beta": 0.0,
        "q_hat": 0.01,
        "delta_elevator": 0.05,
    }
    one, other = (each.predict(channels).coefficients["CZ"] for each in (layered, folded))
    np.testing.assert_allclose(one, other, atol=1e-12)


def cubic(flown):
    alpha = flown["alpha"]
    curve = 0.05 - 2.0 * alpha + 30.0 * alpha**2 - 90.0 * alpha**3
    return curve - 3.0 * flown["q"] * CHORD_OVER_2V + 0.2 * flown["delta_elevator"]


def test_a_cubic_spline_comes_back_and_is_kept_by_a_stored_database():
    flown, compared = campaign(33, lambda each: cubic({**each.channels, "alpha": held(each)}))
    update = estimate_increments(
        flown, compared, parse_model_file(MODEL.format(kind="cubic")), database()
    )
    again = from_document(to_document(update.candidate))
    channels = {
        "alpha": np.linspace(0.0, 0.25, 100),
        "beta": 0.0,
        "q_hat": 0.0,
        "delta_elevator": 0.02,
    }
    one, other = (each.predict(channels).coefficients["CZ"] for each in (update.candidate, again))
    np.testing.assert_array_equal(one, other)
    inside = np.linspace(0.03, 0.19, 50)
    curve = update.candidate.increments[0].evaluate({**channels, "alpha": inside})
    expected = cubic({"alpha": inside, "q": 0.0, "delta_elevator": 0.02})
    assert np.all(np.abs(curve.value - expected) < 4.0 * curve.standard_error)
    assert curve.standard_error.max() < 0.005


def held(flown):
    """Alpha between the outer knots, beyond which a spline is held."""
    return np.clip(flown["alpha"], KNOTS[0], KNOTS[-1])


@pytest.mark.parametrize("own", ["", "own_constants = true\n[increment.knots]"])
def test_knots_left_to_the_flights_are_where_the_residual_bends(own):
    """A residual that bends at 0.02, 0.14 and 0.2 rad; at 0.09 rad hardly."""
    flown, compared = campaign(35, lambda each: lift({**each.channels, "delta_elevator": 0.0}))
    text = MODEL.format(kind="linear").replace('"0.02 0.09 0.14 0.2 rad"', '"chosen"')
    text = text.replace("[increment.knots]", own or "[increment.knots]")
    model = parse_model_file(text)
    assert model.increment[0].knots["alpha"] == ()
    settled = with_chosen_knots(flown, compared, model, database())
    knots = settled.increment[0].knots["alpha"]
    assert settled.increment[0].knots["delta_elevator over alpha"] == (0.02, 0.2)
    for bend in (0.02, 0.14, 0.2):
        assert min(abs(knot - bend) for knot in knots) < 0.012
    assert len(knots) <= 8
    axis = estimate_increments(flown, compared, model, database()).axes[0]
    assert f"alpha at {knots[1]:.4g}" in axis.names
    (equation,) = axis_equations(flown, compared, model, database())
    assert f"CZ_alpha at {knots[1]:.4g}" in equation.parameters.names


def test_knots_of_what_does_not_move_cannot_be_chosen():
    flown, compared = campaign(37, lift, flights=1)
    text = MODEL.format(kind="linear").replace(
        '"delta_elevator over alpha" = [0.02, 0.2]', 'q_hat = "chosen"'
    )
    still = flown[0].with_channels({"q": np.zeros(len(flown[0].time))})
    with pytest.raises(
        InputError, match="knots of q_hat on CZ: the variable of a spline does not move"
    ):
        with_chosen_knots([still], compared, parse_model_file(text), database())


def test_degrees_are_converted():
    text = MODEL.format(kind="linear").replace("0.02 0.09 0.14 0.2 rad", "1, 5, 9 deg")
    knots = parse_model_file(text).increment[0].knots["alpha"]
    assert knots == pytest.approx(np.deg2rad([1.0, 5.0, 9.0]))


@pytest.mark.parametrize(
    ("was", "now", "what"),
    [
        ('"delta_elevator over alpha"', '"delta_elevater over alpha"', "not a term"),
        ("[0.02, 0.2]", "[0.2, 0.02]", "increase"),
        ("[0.02, 0.2]", "[0.2]", "at least two"),
        ("0.2 rad", "0.2 furlongs", "cannot be converted"),
        ("0.02 0.09", "0.02 nine", "knots"),
        ('spline = "linear"', 'spline = "quintic"', "linear"),
    ],
)
def test_a_wrong_knot_is_said(was, now, what):
    with pytest.raises(InputError, match=what):
        parse_model_file(MODEL.format(kind="linear").replace(was, now))


def test_knots_cannot_be_chosen_while_a_log_arrives():
    model = parse_model_file(
        MODEL.format(kind="linear").replace('"0.02 0.09 0.14 0.2 rad"', '"chosen"')
    )
    with pytest.raises(InputError, match="has not arrived"):
        OnlineEstimation(model, parse_vehicle(VEHICLE), None, None)
