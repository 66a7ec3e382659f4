"""Declared increments: planted ones are recovered with correct confidence intervals; constraints
and envelopes have the effect that algebra predicts."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest

from aerodb.coefficients.comparison import Comparison
from aerodb.errors import InputError
from aerodb.flight import Flight
from aerodb.increments.estimate import AxisUpdate, Update, estimate_increments
from aerodb.increments.model_file import ModelFile, parse_model_file
from aerodb.increments.validation import HoldOut, validate_on_held_out
from aerodb.support.arrays import Array
from aerodb.tables.database import Term
from aerodb.tables.expression import parse
from aerodb.tables.scattered import ScatteredTable
from tests.support.synthetic import comparison, database, flight, smooth_noise

CHORD_OVER_2V, SPAN_OVER_2V = 2.0 / 140.0, 8.0 / 140.0
BREAK = 0.12

LIFT = """
[[increment]]
axis = "CZ"
terms = ["1", "alpha", "q_hat", "delta_elevator"]
breaks = {alpha = [0.12]}
"""
TRUTH = {"1": -0.02, "alpha": -0.5, "alpha > 0.12": 0.8, "q_hat": -3.0, "delta_elevator": 0.1}


def lift(flown: Flight) -> Array:
    """The planted increment on CZ, written out: two slopes in alpha that meet at the break, pitch
    rate, elevator."""
    alpha, q_hat = flown["alpha"], flown["q"] * CHORD_OVER_2V
    slopes = np.where(alpha < BREAK, -0.5 * alpha, -0.5 * BREAK + 0.8 * (alpha - BREAK))
    return -0.02 + slopes - 3.0 * q_hat + 0.1 * flown["delta_elevator"]


def campaign(
    seed: int,
    planted: Callable[[Flight], Array],
    flights: int = 3,
    lag: float = 0.1,
    size: float = 0.01,
    seconds: float = 30.0,
) -> tuple[list[Flight], list[Comparison]]:
    """Flights, and comparisons whose residual on CZ is what is planted and coloured noise."""
    rng = np.random.default_rng(seed)
    flown = [flight(rng, f"f{k}", seconds) for k in range(flights)]
    noise = [smooth_noise(rng, len(f.time), lag, size) for f in flown]
    return flown, [
        comparison(f, {"CZ": planted(f) + n}, size) for f, n in zip(flown, noise, strict=True)
    ]


def estimated(flown: Sequence[Flight], compared: Sequence[Comparison], model: str) -> AxisUpdate:
    return estimate_increments(flown, compared, parse_model_file(model), database()).axes[0]


def test_planted_slopes_rates_and_surfaces_come_back() -> None:
    rng = np.random.default_rng(1)
    flown = [flight(rng, f"f{k}") for k in range(4)]
    compared = []
    for f in flown:
        p_hat, r_hat = f["p"] * SPAN_OVER_2V, f["r"] * SPAN_OVER_2V
        roll = (
            0.04 * f["beta"]
            - 0.3 * p_hat
            + 0.1 * r_hat
            + smooth_noise(rng, len(f.time), 0.1, 0.002)
        )
        compared.append(
            comparison(f, {"CZ": lift(f) + smooth_noise(rng, len(f.time), 0.1, 0.01), "Cl": roll})
        )
    model = LIFT + '[[increment]]\naxis = "Cl"\nterms = ["beta", "p_hat", "r_hat"]\n'
    update = estimate_increments(flown, compared, parse_model_file(model), database())
    truth = {"CZ": TRUTH, "Cl": {"beta": 0.04, "p_hat": -0.3, "r_hat": 0.1}}
    for axis in update.axes:
        planted = np.array([truth[axis.axis][name] for name in axis.names])
        assert set(axis.names) == set(truth[axis.axis])
        assert np.all(np.abs(axis.estimates - planted) < 4 * axis.standard_errors), (
            axis.axis,
            axis.estimates,
        )
        assert np.all(axis.standard_errors < 0.25 * np.abs(planted)), (
            "else anything would have passed"
        )
    assert update.flights == ("f0", "f1", "f2", "f3")
    assert all(increment.flights == update.flights for increment in update.candidate.increments)


def test_the_rate_of_alpha_can_be_declared_although_no_log_holds_it() -> None:
    """Downwash lags: from the angle's own rate, whose band holds all but a tenth of it here."""
    flown, compared = campaign(
        8, lambda f: -4.0 * np.gradient(f["alpha"], f.step) * CHORD_OVER_2V, size=0.002
    )
    assert all("alphadot" not in f for f in flown)
    model = '[[increment]]\naxis = "CZ"\nterms = ["1", "alphadot_hat"]\n'
    update = estimate_increments(flown, compared, parse_model_file(model), database())
    (axis,) = update.axes
    assert axis.names[1] == "alphadot_hat"
    assert axis.estimates[1] == pytest.approx(-4.0, rel=0.1)
    assert axis.standard_errors[1] < 0.05
    assert "alphadot" in update.candidate.flight_inputs


def test_a_jump_at_a_break_is_found() -> None:
    def stalled(f: Flight) -> Array:
        return np.where(f["alpha"] >= BREAK, 0.15, 0.0) - 0.2 * f["alpha"]

    found = estimated(*campaign(3, stalled), LIFT.replace("breaks", "jump = true\nbreaks"))
    by_name = dict(
        zip(found.names, zip(found.estimates, found.standard_errors, strict=True), strict=True)
    )
    for name, planted in {"alpha": -0.2, "alpha > 0.12": -0.2, "alpha jump at 0.12": 0.15}.items():
        value, error = by_name[name]
        assert abs(value - planted) < 4 * error, name
        assert error < 0.1, name


@pytest.mark.parametrize("lag", [pytest.param(0.05, marks=pytest.mark.campaign), 0.3])
def test_intervals_of_95_percent_cover_the_truth_in_95_percent_of_runs(lag: float) -> None:
    """300 seeded campaigns; one standard error of the share that is counted is 1.3 %."""
    runs = [estimated(*campaign(seed, lift, lag=lag), LIFT) for seed in range(300)]
    truth = np.array([TRUTH[name] for name in runs[0].names])
    inside = np.array([np.abs(run.estimates - truth) < 1.96 * run.standard_errors for run in runs])
    assert np.all((inside.mean(axis=0) > 0.90) & (inside.mean(axis=0) < 0.98)), inside.mean(axis=0)
    assert 0.93 < inside.mean() < 0.97


def test_white_standard_errors_would_not_have_covered() -> None:
    """What the coloured covariance is for: the same residuals taken as white give intervals that
    are far too short."""
    from aerodb.estimation.ordinary_least_squares import least_squares

    flown, compared = campaign(0, lift, lag=0.3)
    columns = np.concatenate(
        [np.column_stack([np.ones_like(f["q"]), f["q"] * CHORD_OVER_2V]) for f in flown]
    )
    fit = least_squares(
        columns, np.concatenate([c.residual("CZ") for c in compared]), ["1", "q_hat"]
    )
    assert np.sqrt(fit.white_covariance[1, 1]) < 0.5 * fit.standard_errors[1]


def test_nothing_planted_is_nothing_found() -> None:
    """No increment: t values of a standard normal, and the error on flights not used does not grow
    beyond what k terms cost."""
    t_values, excess = [], []
    for seed in range(100):
        flown, compared = campaign(1000 + seed, lambda f: np.zeros(len(f.time)), flights=4)
        update = estimate_increments(flown[:3], compared[:3], parse_model_file(LIFT), database())
        axis = update.axes[0]
        t_values.append(axis.estimates / axis.standard_errors)
        before = {c.flight: c for c in compared}
        after = {f.id: _with(update, f, c) for f, c in zip(flown, compared, strict=True)}
        validation = validate_on_held_out(
            before, after, HoldOut(("f0", "f1", "f2"), ("f3",), "held-out")
        )[0]
        assert validation.held_out_rms_before is not None
        assert validation.held_out_rms_after is not None
        excess.append(validation.held_out_rms_after / validation.held_out_rms_before - 1.0)
    t = np.array(t_values)
    assert 0.9 < np.sqrt(np.mean(t**2)) < 1.15
    assert 0.025 < np.mean(np.abs(t) > 1.96) < 0.085
    assert np.mean(np.abs(t) > 4) < 0.004
    assert np.mean(excess) < 0.02
    assert np.max(excess) < 0.08


def _with(update: Update, flown: Flight, compared: Comparison) -> Comparison:
    added = (
        update.candidate.predict(flown.channels).coefficients["CZ"]
        - database().predict(flown.channels).coefficients["CZ"]
    )
    return replace(compared, predicted={"CZ": compared.predicted["CZ"] + added})


TRIMMED = """
[[increment]]
axis = "CZ"
terms = ["1", "alpha", "delta_elevator"]
"""
TRIMS = np.array([-0.06, 0.0, 0.06])


def _trimmed(seed: int) -> tuple[list[Flight], list[Comparison]]:
    """Three flights with another trim each, whose constant does not follow the elevator as the
    elevator's effect would."""
    flown, _ = campaign(seed, lambda f: np.zeros(len(f.time)))
    rng = np.random.default_rng(10_000 + seed)
    flown = [
        f.with_channels({"delta_elevator": f["delta_elevator"] + trim})
        for f, trim in zip(flown, TRIMS, strict=True)
    ]
    residuals = [
        0.02
        - 0.5 * f["alpha"]
        + 0.4 * f["delta_elevator"]
        - 0.9 * trim
        + smooth_noise(rng, len(f.time), 0.1, 0.01)
        for f, trim in zip(flown, TRIMS, strict=True)
    ]
    return flown, [
        comparison(f, {"CZ": residual}, 0.01) for f, residual in zip(flown, residuals, strict=True)
    ]


def test_flights_trimmed_differently_pull_at_slopes_unless_each_has_its_own_constant() -> None:
    """60 campaigns. One constant: the elevator's effect is lost, and the interval says otherwise.
    Own ones: intervals cover, and the constant that enters is their mean, as uncertain as they
    differ."""
    own = TRIMMED + "own_constants = true\n"
    common = [estimated(*_trimmed(seed), TRIMMED) for seed in range(60)]
    assert np.mean([run.estimates[2] for run in common]) < 0.1
    assert (
        np.mean([abs(run.estimates[2] - 0.4) < 1.96 * run.standard_errors[2] for run in common])
        < 0.25
    )
    runs = [estimated(*_trimmed(seed), own) for seed in range(60)]
    truth = np.array([0.02, -0.5, 0.4])
    assert runs[0].names == ("1", "alpha", "delta_elevator")
    errors = np.array([run.standard_errors for run in runs])
    inside = np.array([np.abs(run.estimates - truth) for run in runs]) < 1.96 * errors
    assert np.all(inside[:, 1:].mean(axis=0) > 0.88)
    assert np.all(
        np.abs(np.mean([run.estimates for run in runs], axis=0)[1:] - truth[1:])
        < 0.3 * errors[:, 1:].mean(axis=0)
    )
    scatter = float(np.std(-0.9 * TRIMS, ddof=1)) / np.sqrt(3.0)
    assert np.all(errors[:, 0] > 0.9 * scatter)
    assert np.all(inside[:, 0])


def test_for_one_flight_its_own_constant_changes_nothing() -> None:
    flown, compared = campaign(4, lift, flights=1)
    own = estimated(flown, compared, LIFT + "own_constants = true\n")
    common = estimated(flown, compared, LIFT)
    assert own.names == common.names
    np.testing.assert_allclose(own.estimates, common.estimates, rtol=1e-9)
    np.testing.assert_allclose(own.covariance, common.covariance, rtol=1e-7)
    np.testing.assert_allclose(own.vif, common.vif, rtol=1e-7)


def test_own_constants_need_the_constant() -> None:
    with pytest.raises(InputError, match="own_constants without the term '1'"):
        parse_model_file(ONE + "own_constants = true\n")
    switched = campaign(6, lambda f: np.zeros(len(f.time)))
    flown = [
        f.with_channels({"delta_elevator": np.full(len(f.time), trim)})
        for f, trim in zip(switched[0], TRIMS, strict=True)
    ]
    found = estimated(flown, switched[1], TRIMMED + "own_constants = true\n")
    assert found.dependent == {"delta_elevator": ("1",)}
    assert "delta_elevator" not in found.names


ONE = '[[increment]]\naxis = "CZ"\nterms = ["alpha"]\n'
TWO = '[[increment]]\naxis = "CZ"\nterms = ["alpha", "delta_elevator"]\n'


def _two(seed: int = 5) -> tuple[list[Flight], list[Comparison]]:
    return campaign(seed, lambda f: -0.5 * f["alpha"] + 0.1 * f["delta_elevator"])


def test_a_prior_is_weighed_by_its_sigma() -> None:
    """One term: precision-weighted mean of estimate and prior, by hand."""
    free = estimated(*_two(), ONE)
    e, s = float(free.estimates[0]), float(free.standard_errors[0])
    m, sigma = e + 1.0, 2.0 * s
    found = estimated(*_two(), ONE + f"prior = {{alpha = [{m!r}, {sigma!r}]}}\n")
    assert found.estimates[0] == pytest.approx((4 * e + m) / 5, rel=1e-10)
    assert found.standard_errors[0] == pytest.approx(s * np.sqrt(4 / 5), rel=1e-10)
    loose = estimated(*_two(), ONE + f"prior = {{alpha = [{m!r}, 1e6]}}\n")
    assert loose.estimates[0] == pytest.approx(e, rel=1e-9)


def test_a_fixed_term_moves_the_others_by_their_covariance() -> None:
    free = estimated(*_two(), TWO)
    e, c = free.estimates, free.covariance
    found = estimated(*_two(), TWO + "fixed = {delta_elevator = 0.3}\n")
    assert found.estimates[1] == 0.3
    assert found.standard_errors[1] == 0.0
    assert found.estimates[0] == pytest.approx(e[0] + c[0, 1] / c[1, 1] * (0.3 - e[1]), rel=1e-9)
    assert found.covariance[0, 0] == pytest.approx(c[0, 0] - c[0, 1] ** 2 / c[1, 1], rel=1e-9)
    assert found.correlation.tolist() == [[1.0, 0.0], [0.0, 1.0]]
    assert found.at_bound == ()


def test_bounds_are_kept_and_named_and_do_nothing_inside() -> None:
    free = estimated(*_two(), TWO)
    e, c = free.estimates, free.covariance
    found = estimated(*_two(), TWO + "bounds = {delta_elevator = [-1.0, 0.05]}\n")
    assert found.estimates[1] == pytest.approx(0.05, abs=1e-9)
    assert found.estimates[0] == pytest.approx(e[0] + c[0, 1] / c[1, 1] * (0.05 - e[1]), rel=1e-6)
    assert found.at_bound == ("delta_elevator",)
    inside = estimated(*_two(), TWO + "bounds = {delta_elevator = [-1.0, 1.0]}\n")
    assert inside.estimates.tolist() == e.tolist()
    assert inside.at_bound == ()
    both = estimated(
        *_two(), TWO + "bounds = {alpha = [0.0, 1.0]}\nfixed = {delta_elevator = 0.3}\n"
    )
    assert both.estimates[1] == 0.3
    assert both.estimates[0] == pytest.approx(0.0, abs=1e-9)


def test_a_term_that_does_not_move_is_left_out_and_named() -> None:
    flown, compared = _two()
    flown = [f.with_channels({"delta_landing_gear": np.ones(len(f.time))}) for f in flown]
    model = TWO.replace('"delta_elevator"', '"delta_elevator", "delta_landing_gear"')
    update = estimate_increments(flown, compared, parse_model_file(model), database())
    assert update.axes[0].not_excited == ("delta_landing_gear",)
    assert update.axes[0].names == ("alpha", "delta_elevator")
    assert "delta_landing_gear" not in update.candidate.inputs
    still = '[[increment]]\naxis = "CZ"\nterms = ["delta_landing_gear"]\n'
    with pytest.raises(InputError, match="no declared term on CZ is excited"):
        estimate_increments(flown, compared, parse_model_file(still), database())


def test_a_term_that_others_make_up_stops_neither_them_nor_another_axis() -> None:
    """Sideslip to one side only: its size is sideslip, to the last digit."""
    rng = np.random.default_rng(9)
    flown, compared = [], []
    for k in range(3):
        f = flight(rng, f"f{k}")
        f = f.with_channels({"beta": 0.1 + 0.05 * np.tanh(f["beta"] / 0.03)})
        planted = {"CY": -0.8 * f["beta"], "CZ": 0.3 * f["alpha"]}
        noise = {axis: smooth_noise(rng, len(f.time), 0.1, 0.01) for axis in planted}
        flown.append(f)
        compared.append(comparison(f, {axis: planted[axis] + noise[axis] for axis in planted}))
    side = '[[increment]]\naxis = "CY"\nterms = ["1", "beta", "abs(beta)", "r_hat"]\n'
    update = estimate_increments(flown, compared, parse_model_file(side + ONE), database())
    lateral, normal = update.axes
    assert lateral.names == ("1", "beta", "r_hat")
    assert dict(lateral.dependent) == {"abs(beta)": ("beta",)}
    assert normal.dependent == {}
    assert normal.estimates[0] == pytest.approx(0.3, abs=4.0 * normal.standard_errors[0])
    without = estimated(flown, compared, side.replace(' "abs(beta)",', ""))
    assert lateral.estimates.tolist() == without.estimates.tolist()
    both = [f.with_channels({"beta": f["beta"] - 0.1}) for f in flown]
    told = estimated(both, compared, side)
    assert told.dependent == {}
    assert "abs(beta)" in told.names


def test_surfaces_that_moved_together_are_an_alias_group() -> None:
    rng = np.random.default_rng(8)
    model = '[[increment]]\naxis = "CZ"\nterms = ["1", "alpha", "delta_elevator", "delta_flap"]\n'

    def flown(share: float) -> tuple[list[Flight], list[Comparison]]:
        flights, compared = campaign(9, lambda f: 0.1 * f["delta_elevator"])
        own = [smooth_noise(rng, len(f.time), 0.5, 0.05) for f in flights]
        mixed = [
            share * f["delta_elevator"] + np.sqrt(1 - share**2) * o
            for f, o in zip(flights, own, strict=True)
        ]
        return [
            f.with_channels({"delta_flap": m}) for f, m in zip(flights, mixed, strict=True)
        ], compared

    tied, compared = flown(0.985)
    correlation = np.corrcoef(
        np.concatenate([[f["delta_elevator"], f["delta_flap"]] for f in tied], axis=1)
    )[0, 1]
    assert correlation > 0.97
    found = estimated(tied, compared, model)
    assert found.aliases == (("delta_elevator", "delta_flap"),)
    assert found.vif[found.names.index("delta_flap")] > 10
    assert estimated(*flown(0.3), model).aliases == ()
    # Where one of the two is known, nothing is left to confuse.
    assert estimated(tied, compared, model + "fixed = {delta_flap = 0.0}\n").aliases == ()
    exact = [f.with_channels({"delta_flap": 2.0 * f["delta_elevator"]}) for f in tied]
    one = estimated(exact, compared, model)
    assert dict(one.dependent) == {"delta_flap": ("delta_elevator",)}
    assert "delta_flap" not in one.names


def test_increments_hold_for_one_cell_beyond_the_flights_and_fade_over_the_next() -> None:
    """Breakpoints over alpha stand 0.1 apart; the flights go from 0.05 to 0.15 rad."""
    flown, compared = campaign(11, lambda f: -0.5 * np.clip(f["alpha"], 0.05, 0.15))
    flown = [f.with_channels({"alpha": np.clip(f["alpha"], 0.05, 0.15)}) for f in flown]
    update = estimate_increments(flown, compared, parse_model_file(ONE), database())
    increment, slope = update.candidate.increments[0], update.axes[0].estimates[0]
    interval = increment.envelope["alpha"]
    assert (interval.low, interval.high) == (0.05, 0.15)
    assert interval.cell == pytest.approx(0.1, rel=1e-12)
    alpha = np.array([0.1, 0.15, 0.20, 0.25, 0.30, 0.35, 0.36, 1.2, -0.05, -0.10, -0.16])
    added = update.candidate.predict({"alpha": alpha, "beta": 0.0}).coefficients["CZ"]
    added = added - database().predict({"alpha": alpha, "beta": 0.0}).coefficients["CZ"]
    edge = slope * 0.15
    assert added[:7] == pytest.approx(
        [slope * 0.1, edge, edge, edge, 0.5 * edge, 0.0, 0.0], abs=1e-12
    )
    assert added[8:] == pytest.approx([slope * 0.05, 0.5 * slope * 0.05, 0.0], abs=1e-12)
    assert added[[7, 10]].tolist() == [0.0, 0.0], "far away nothing changes, to the last digit"
    errors = increment.evaluate({"alpha": alpha, "beta": 0.0}).standard_error
    assert errors[7] == pytest.approx(abs(edge), rel=1e-9), (
        "fully faded, the correction itself is the doubt"
    )


def test_samples_whose_regressor_is_flagged_do_not_identify() -> None:
    """A gap in a channel that only the model file uses once went into the fit with whatever stood
    there."""
    flown, compared = _two()
    gap = np.zeros(len(flown[0].time), dtype=bool)
    gap[100:180] = True
    broken = flown[0].with_channels(
        {"delta_elevator": np.where(gap, np.nan, flown[0]["delta_elevator"])}
    )
    wild = (
        flown[1]
        .with_channels({"q": np.where(gap, 1e6, flown[1]["q"])})
        .with_flag("q", "wild_point", gap)
    )
    model = TWO.replace('"delta_elevator"', '"delta_elevator", "q_hat"')
    found = estimated([broken, wild, flown[2]], compared, model)
    left = [replace(c, usable={"CZ": c.usable["CZ"] & ~gap}) for c in compared[:2]]
    expected = estimated(flown, [*left, compared[2]], model)
    assert found.estimates == pytest.approx(expected.estimates, rel=1e-12)
    assert found.standard_errors == pytest.approx(expected.standard_errors, rel=1e-12)


def test_what_cannot_be_estimated_is_refused_with_the_nearest_name() -> None:
    flown, compared = _two()

    def refused(model: str, message: str, compared: Sequence[Comparison] = compared) -> None:
        with pytest.raises(InputError, match=message):
            estimate_increments(flown, compared, parse_model_file(model), database())

    refused(
        TWO.replace("delta_elevator", "delta_elevatr"),
        "no channel 'delta_elevatr'[^\n]*\ndid you mean 'delta_elevator'",
    )
    refused(ONE.replace("CZ", "CX"), "no flight gives a usable sample on CX")
    refused(
        ONE,
        "no flight gives a usable sample on CZ",
        [replace(c, usable={"CZ": ~c.usable["CZ"]}) for c in compared],
    )
    for faulty, message in (
        (ONE.replace('"CZ"', '"Cz"'), "did you mean 'CZ'"),
        (ONE.replace("terms", "trems"), "did you mean 'terms'"),
        (ONE + "prior = {alhpa = [0.0, 1.0]}\n", "did you mean 'alpha'"),
        (ONE + "breaks = {alpha = [0.2, 0.1]}\n", "must increase"),
        (ONE + "prior = {alpha = [0.0, 0.0]}\n", "positive sigma"),
        (ONE + "bounds = {alpha = [1.0, 0.0]}\n", "lower, upper"),
        (ONE + ONE, "declared twice"),
        ("", "increment"),
    ):
        with pytest.raises(InputError, match=message):
            parse_model_file(faulty)
    with pytest.raises(InputError):
        estimate_increments(
            [],
            [],
            ModelFile.model_validate({"increment": [{"axis": "CZ", "terms": ["1"]}]}),
            database(),
        )


def test_a_database_with_an_ungridded_table_can_be_updated_too() -> None:
    """Its calls have no breakpoints to take a cell from: looking for some once ended in a
    KeyError."""
    points = np.array([[-0.5, -1.0], [0.5, -1.0], [-0.5, 1.0], [0.5, 1.0]])
    cloud = ScatteredTable("CLOUD", ("alpha", "q"), points, np.array([0.0, 0.1, 0.2, 0.3]))
    terms = (Term("cloud", "CZ", parse("CLOUD(alpha, q)")),)
    made = replace(database(), tables={}, terms=terms, scattered={"CLOUD": cloud})
    flights, comparisons = campaign(1, lift)
    update = estimate_increments(flights, comparisons, parse_model_file(LIFT), made)
    flown = np.concatenate([one["alpha"] for one in flights])
    assert update.candidate.increments[0].envelope["alpha"].cell == pytest.approx(np.ptp(flown))
