"""The algebra of tracing against independent answers: direct least squares, scipy's t-test, closed
forms, simulated hierarchies."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy import stats

from aerodb.effects.hypothesis import Hypothesis
from aerodb.errors import InputError
from aerodb.tracing.decision.next_flight import excitation_needed
from aerodb.tracing.estimates.campaigns import campaign
from aerodb.tracing.estimates.kernels import contracted
from aerodb.tracing.estimates.per_flight import FlightEstimates, HypothesisBias
from aerodb.tracing.estimates.significance import (
    holm,
    moderated_variance,
    over_flights,
    paired_p,
    scatter_p,
)
from aerodb.tracing.evidence.autoregression import correlation_time, fit, whiten
from aerodb.tracing.evidence.evidence import Evidence
from aerodb.tracing.evidence.low_pass import band_limited
from aerodb.tracing.evidence.normal_equations import first_stage, normal_equations_of
from aerodb.tracing.settings import TracingSettings
from tests.support.tracing_flights import coloured
from tests.support.tracing_small import LIBRARY, SETTINGS, STEP, evidence, term

Array = np.ndarray


def whitened(flight: Evidence) -> tuple[Array, Array]:
    """Trims, hypotheses and residual of both axes, filtered here step by step and stacked: what a
    Gram is the product of."""
    stacked = []
    for number, axis in enumerate(("CX", "CZ")):
        every = np.ones(flight.samples, dtype=bool)
        zero = np.zeros(flight.samples)
        columns = [*(flight.columns[h.id].get(axis, zero) for h in LIBRARY), flight.residual[axis]]
        limited = band_limited(columns, every, STEP, SETTINGS.bandwidth)
        record = limited[:, -1] - limited[:, -1].mean()
        coefficients, spread = fit([record], SETTINGS.order)
        intercepts = np.zeros((len(limited), 2))
        intercepts[:, number] = 1.0
        stacked.append(whiten(np.column_stack([intercepts, limited]), coefficients) / spread)
    rows = np.concatenate(stacked)
    return rows[:, :-1], rows[:, -1]


@pytest.mark.parametrize("accepted", [(), (1,)])
@pytest.mark.parametrize("freed", [(), (3,)])
def test_votes_are_those_of_direct_least_squares_with_the_priors_as_extra_rows(
    accepted: tuple[int, ...], freed: tuple[int, ...]
) -> None:
    flight = evidence(3, {LIBRARY[0].id: 0.4})
    estimates = campaign([normal_equations_of(flight, SETTINGS)], LIBRARY).flight_estimates(
        accepted, freed
    )
    columns, response = whitened(flight)
    for place, _ in enumerate(LIBRARY):
        others = [n for n in (*accepted, 3, 4) if n != place]
        chosen = [0, 1, *(2 + n for n in others), 2 + place]
        prior = np.zeros((len(others), len(chosen)))
        for row, n in enumerate(others):
            if LIBRARY[n].kind == "sensor" and n not in freed:
                prior[row, 2 + row] = 1.0 / float(LIBRARY[n].prior_sigma or np.inf)
        design = np.vstack([columns[:, chosen], prior])
        solution = np.linalg.lstsq(design, np.r_[response, np.zeros(len(others))], rcond=None)[0]
        variance = np.linalg.inv(design.T @ design)[-1, -1]
        assert estimates.estimate[0, place] == pytest.approx(solution[-1], rel=1e-6)
        assert estimates.information[0, place] == pytest.approx(1.0 / variance, rel=1e-6)
        # What a unit error of each sensor adds: the same fit to the sensor's column in place of the
        # residual.
        for row, s in enumerate((3, 4)):
            if s != place:
                sensor_bias = np.linalg.lstsq(
                    design, np.r_[columns[:, 2 + s], np.zeros(len(others))], rcond=None
                )[0][-1]
                assert estimates.biases.at([place])[0].sensor_bias[0, row] == pytest.approx(
                    sensor_bias, abs=1e-6
                )


def test_vif_is_one_over_the_tolerance_of_a_regression_on_the_nuisances() -> None:
    flight = evidence(5)
    estimates = campaign([normal_equations_of(flight, SETTINGS)], LIBRARY).flight_estimates(
        (1,), (3, 4)
    )
    columns, _ = whitened(flight)
    intercepts, column = columns[:, :2], columns[:, 2]
    within = column - intercepts @ np.linalg.lstsq(intercepts, column, rcond=None)[0]
    nuisances = columns[:, [0, 1, 3, 5, 6]]
    left = column - nuisances @ np.linalg.lstsq(nuisances, column, rcond=None)[0]
    assert estimates.inflation[0, 0] == pytest.approx((within @ within) / (left @ left), rel=1e-6)


def test_without_noise_every_vote_is_the_planted_value() -> None:
    flight = evidence(7, {LIBRARY[0].id: 0.4})
    truth = 0.4 * flight.columns[LIBRARY[0].id]["CX"]
    silent = {
        "CX": flight.usable["CX"],
        "CZ": ~flight.usable["CZ"],
    }  # else its noise would move the sensors
    exact = replace(flight, residual={"CX": truth + 0.02, "CZ": truth}, usable=silent)
    estimates = campaign([normal_equations_of(exact, SETTINGS)], LIBRARY).flight_estimates((), ())
    assert estimates.estimate[0, 0] == pytest.approx(0.4, abs=1e-6)


def test_units_of_columns_do_not_matter() -> None:
    flight = evidence(9, {LIBRARY[0].id: 0.4})
    scaled = {**flight.columns, LIBRARY[0].id: {"CX": 1e4 * flight.columns[LIBRARY[0].id]["CX"]}}
    first, second = (
        campaign([normal_equations_of(e, SETTINGS)], LIBRARY).flight_estimates((), ())
        for e in (flight, replace(flight, columns=scaled))
    )
    assert second.estimate[0, 0] * 1e4 == pytest.approx(first.estimate[0, 0], rel=1e-6)
    assert second.estimate[0, 1] == pytest.approx(first.estimate[0, 1], rel=1e-6)


def test_a_constant_per_flight_changes_no_vote_but_that_of_the_constant() -> None:
    offset = Hypothesis(
        "zero_offset", ("CX",), "", "CX_0", "aerodynamic", "1", (-9.0, 9.0), None, "constant"
    )
    library = (*LIBRARY, offset)
    flight = evidence(11)
    flight = replace(flight, columns={**flight.columns, offset.id: {"CX": np.ones(flight.samples)}})
    moved = replace(flight, residual={**flight.residual, "CX": flight.residual["CX"] + 0.7})
    first, second = (
        campaign([normal_equations_of(e, SETTINGS)], library).flight_estimates((), ())
        for e in (flight, moved)
    )
    assert np.allclose(first.estimate[0, :5], second.estimate[0, :5], atol=1e-9)
    assert second.estimate[0, 5] - first.estimate[0, 5] == pytest.approx(0.7, rel=1e-9)
    columns, response = whitened(flight)
    prior = np.hstack([np.zeros((2, 2)), np.diag([1 / 0.5, 1 / 0.2])])
    design = np.vstack([columns[:, [0, 1, 5, 6]], prior])
    direct = np.linalg.lstsq(design, np.r_[response, 0.0, 0.0], rcond=None)[0]
    assert first.estimate[0, 5] == pytest.approx(direct[0], rel=1e-6)
    assert first.information[0, 5] == pytest.approx(
        1.0 / np.linalg.inv(design.T @ design)[0, 0], rel=1e-6
    )


@pytest.mark.parametrize(("size", "least"), [(1, 1.0), (7, 1.0), (38, 1e-3), (38, 1e-9)])
def test_the_compiled_elimination_gives_what_the_inverse_gives(size: int, least: float) -> None:
    """Quasi-definite: a part of the pairs is negative, in any order; the smallest eigenvalue of
    each part is about `least`."""
    rng = np.random.default_rng(size)
    flights, cache, width, negative = 5, size + 3, 11, size // 4
    orthogonal = np.linalg.qr(rng.standard_normal((flights, cache, cache)))[0]
    pairs = (orthogonal * np.geomspace(least, 1.0, cache)) @ orthogonal.transpose(0, 2, 1)
    members, beside = rng.permutation(cache)[:size], rng.standard_normal((flights, cache, width))
    down = members[:negative]
    pairs[:, down[:, None], down] *= -1.0
    extra, units = np.where(np.arange(size) < negative, -1e-11, 1e-11), np.arange(0, size, 2)
    left, right = np.array([10, 2]), np.array([0, 4, 4, 9])
    squares, across = (
        np.empty((flights, len(right) + len(units))),
        np.empty((flights, 2, len(right) + len(units))),
    )
    contracted(pairs, beside, members, extra, left, right, units, squares, across)
    matrices = pairs[:, members[:, None], members] + np.diag(extra)
    unit = np.broadcast_to(np.eye(size)[:, units], (flights, size, len(units)))
    u, v = (
        np.concatenate([beside[:, members][:, :, right], unit], axis=2),
        beside[:, members][:, :, left],
    )
    solution = np.linalg.inv(matrices) @ u
    for found, expected in (
        (squares, (u * solution).sum(axis=1)),
        (across, v.transpose(0, 2, 1) @ solution),
    ):
        assert (
            np.abs(found - expected).max()
            < 1e-15 * np.linalg.cond(matrices).max() * np.abs(expected).max()
        )


def test_a_nuisance_without_excitation_and_a_duplicate_leave_the_others_unchanged() -> None:
    """A column of zeros, and one that stands twice: nothing but the ridge tells the two apart."""
    columns = np.random.default_rng(1).standard_normal((400, 4))
    columns = np.column_stack([columns[:, :3], np.zeros(400), columns[:, 2], columns[:, 3]]) / 20.0
    pairs, members = (columns.T @ columns)[None], np.arange(5)
    squares, across = np.empty((1, 1)), np.empty((1, 1, 1))
    five = np.array([5])
    contracted(pairs, pairs, members, np.full(5, 1e-11), five, five, np.arange(0), squares, across)
    fitted = columns[:, :3] @ np.linalg.lstsq(columns[:, :3], columns[:, 5], rcond=None)[0]
    assert squares[0, 0] == pytest.approx(fitted @ fitted, rel=1e-8)
    assert across[0, 0, 0] == pytest.approx(fitted @ fitted, rel=1e-8)


@dataclass(frozen=True)
class Stated:
    """Errors that are given: leak (flights, k, sensors), one shift for all."""

    sensor_bias: Array
    simex_bias: float

    def at(self, places: Sequence[int]) -> list[HypothesisBias]:
        return [
            HypothesisBias(
                self.sensor_bias[:, place], np.full(len(self.sensor_bias), self.simex_bias)
            )
            for place in places
        ]


def plain_estimates(
    estimate: Array, information: Array, sensor_bias: Array | None = None, simex_bias: float = 0.0
) -> FlightEstimates:
    stated = Stated(
        np.zeros((*estimate.shape, 1)) if sensor_bias is None else sensor_bias, simex_bias
    )
    return FlightEstimates(estimate, information, information, stated)


def test_without_borrowing_and_sensors_it_is_students_t_test_over_flights() -> None:
    rng = np.random.default_rng(2)
    estimate = rng.normal(0.3, 1.0, (7, 5))
    test = over_flights(
        plain_estimates(estimate, np.full((7, 5), 2.0)),
        np.zeros(1),
        replace(SETTINGS, prior_dof=1e-9),
        3,
    )
    expected = stats.ttest_1samp(estimate, 0.0)
    assert np.allclose(test.p, expected.pvalue)
    low, high = expected.confidence_interval()
    for place in range(5):
        assert test.interval(place) == pytest.approx((low[place], high[place]))


def test_the_moderated_t_has_the_degrees_of_freedom_that_smyth_derives() -> None:
    """Smyth 2004, sec. 3: if s0^2/sigma^2 ~ chi2(d0)/d0, then t with the posterior variance has d0
    + d degrees of freedom."""
    rng = np.random.default_rng(4)
    d0, flights, many = 4.0, 4, 40_000
    sigma = np.sqrt(d0 / rng.chisquare(d0, many))
    values = sigma * rng.standard_normal((flights, many))
    dof = np.full(many, flights - 1.0)
    variance = moderated_variance(values.var(axis=0, ddof=1), dof, np.ones(many), d0)
    t = values.mean(axis=0) / np.sqrt(variance / flights)
    assert stats.kstest(t, stats.t(d0 + flights - 1).cdf).pvalue > 0.01
    assert stats.kstest(t, stats.t(flights - 1).cdf).pvalue < 1e-6


def test_a_sensor_that_may_explain_an_estimate_takes_its_significance() -> None:
    estimate = np.array([[1.0], [1.1], [0.9], [1.05]])
    information = np.full((4, 1), 400.0)
    free = over_flights(plain_estimates(estimate, information), np.array([0.3]), SETTINGS, 3)
    sensor_bias = np.full((4, 1, 1), 2.0)
    bound = over_flights(
        plain_estimates(estimate, information, sensor_bias), np.array([0.3]), SETTINGS, 3
    )
    assert free.p[0] < 1e-4
    assert bound.systematic[0] == pytest.approx(2.0 * 2.0 * 0.3)
    assert bound.p[0] > 0.5
    assert over_flights(
        plain_estimates(estimate, information, simex_bias=-0.7), np.array([0.3]), SETTINGS, 3
    ).systematic[0] == pytest.approx(1.05)


def test_errors_that_are_each_flights_own_are_judged_by_how_they_differ() -> None:
    """Three biases of one size with random signs, each known to a tenth of it: moderation would
    call their mean significant far too often."""
    rng = np.random.default_rng(12)
    estimate = rng.normal(0.0, 1.0, (3, 20_000))
    estimates = plain_estimates(estimate, np.full(estimate.shape, 100.0))
    every = np.arange(estimate.shape[1])
    own = over_flights(estimates, np.zeros(1), SETTINGS, 3, own=every)
    variance = np.square(own.standard_error) * 3
    assert np.all(variance >= estimate.var(axis=0, ddof=1) - 1e-12)
    # one of them among hypotheses that do agree: their scatter is no measure of its own
    mixed = np.tile(estimate[:, :1], (1, 9))
    mixed[:, 1:] = rng.normal(0.0, 0.1, (3, 8))
    few = plain_estimates(mixed, np.full(mixed.shape, 100.0))
    shared = over_flights(few, np.zeros(1), SETTINGS, 3)
    apart = over_flights(few, np.zeros(1), SETTINGS, 3, own=(0,))
    assert apart.p[0] > 2.0 * shared.p[0]
    assert np.array_equal(apart.p[1:], shared.p[1:])


def test_a_p_value_with_a_systematic_bound_never_falls_below_that_without() -> None:
    rng = np.random.default_rng(8)
    estimates = plain_estimates(
        rng.standard_normal((5, 40)), np.ones((5, 40)), rng.standard_normal((5, 40, 1))
    )
    assert np.all(
        over_flights(estimates, np.array([0.4]), SETTINGS, 3).p
        >= over_flights(estimates, np.zeros(1), SETTINGS, 3).p - 1e-12
    )


def test_holm_is_the_closed_test_of_bonferroni() -> None:
    """Holm rejects H_i at level a exactly if each intersection that holds H_i has a p below a /
    size (Marcus 1976)."""
    rng = np.random.default_rng(6)
    for _ in range(50):
        p = rng.uniform(0.0, 0.2, 5)
        adjusted = holm(p, 5)
        subsets = [[i for i in range(5) if mask >> i & 1] for mask in range(1, 32)]
        closed = [max(min(1.0, len(s) * p[s].min()) for s in subsets if i in s) for i in range(5)]
        assert np.allclose(adjusted, closed)
    assert holm(np.array([0.01, 0.5]), 10)[0] == pytest.approx(0.1)


def test_scatter_p_is_pitmans_and_morgans() -> None:
    rng = np.random.default_rng(3)
    a = rng.standard_normal(9)
    b = 0.5 * a + 2.0 * rng.standard_normal(9)
    ratio, r = a.var() / b.var(), np.corrcoef(a, b)[0, 1]
    # as textbooks write it: t = (F - 1) sqrt(n - 2) / (2 sqrt(F (1 - r^2)))
    t = (ratio - 1.0) * np.sqrt(7) / (2.0 * np.sqrt(ratio * (1.0 - r**2)))
    assert scatter_p(a, b) == pytest.approx(stats.t(7).cdf(t))
    assert scatter_p(np.array([0.0, 1.0]), np.array([0.0, 9.0])) == 1.0
    pairs = rng.standard_normal((2000, 2, 4))
    false = np.mean([scatter_p(x, 0.6 * x + 0.8 * y) < 0.05 for x, y in pairs])
    assert 0.035 < false < 0.065


def test_paired_p_is_scipys() -> None:
    rng = np.random.default_rng(1)
    a, b = rng.normal(0.4, 1.0, (2, 9))
    assert paired_p(a, b) == pytest.approx(stats.ttest_rel(a, b, alternative="greater").pvalue)
    assert paired_p(np.array([1.0]), np.array([0.0])) == 1.0


def test_noise_that_takes_from_an_estimate_makes_no_doubt_that_it_is_there() -> None:
    """A shift towards zero is attenuation: the interval widens, the test does not. One away from
    zero could have made it."""
    estimate = np.array([[1.0], [1.1], [0.9], [1.05]])
    information = np.full((4, 1), 100.0)
    plain, taken, given = (
        over_flights(
            plain_estimates(estimate, information, simex_bias=simex_bias), np.zeros(1), SETTINGS, 3
        )
        for simex_bias in (0.0, -0.4, 0.4)
    )
    assert taken.p[0] == plain.p[0]
    assert given.p[0] > 5.0 * plain.p[0]
    assert taken.interval(0) == given.interval(0)
    assert taken.bound[0] == given.bound[0] == pytest.approx(plain.bound[0] + 0.6)


def test_simex_shift_is_the_known_attenuation_of_a_linear_regressor() -> None:
    """Noise of variance s on a regressor of variance 1 shrinks its slope to 1/(1 + s); doubled, to
    1/(1 + 2 s). The products are linear in s, so that the shrinkage follows exactly, as long as the
    noise is less than a quarter of the whole."""
    column = term("slope", "CX")
    found = []
    for seed in range(40):
        rng = np.random.default_rng([seed, 1])
        x = coloured(rng, 4000, 0.8)
        residual = {"CX": 2.0 * x + 0.1 * coloured(rng, 4000, 0.8)}
        once = x + np.sqrt(0.1) * coloured(rng, 4000, 0.8)
        twice = once + np.sqrt(0.1) * coloured(rng, 4000, 0.8)
        usable = {"CX": np.ones(4000, dtype=bool)}
        noisy = Evidence("copy", STEP, residual, usable, {column.id: {"CX": twice}})
        flight = Evidence(f"f{seed}", STEP, residual, usable, {column.id: {"CX": once}}, (noisy,))
        estimates = campaign(
            [normal_equations_of(flight, replace(SETTINGS, order=0))], [column]
        ).flight_estimates((), ())
        found.append((estimates.estimate[0, 0], estimates.biases.at([0])[0].simex_bias[0]))
    estimate, simex_bias = np.mean(found, axis=0)
    assert estimate == pytest.approx(2.0 / 1.1, rel=0.03)
    assert simex_bias == pytest.approx(2.0 / 1.1 - 2.0, rel=0.15)


@pytest.mark.parametrize(("size", "by_units"), [(0.7, True), (1.4, False)])
def test_of_a_column_that_is_noise_for_a_large_part_nothing_is_believed(
    size: float, by_units: bool
) -> None:
    """A regressor whose noise is in the residual as well: all of the estimate may come from it,
    from a quarter of noise on. Of manoeuvres, which are not extrapolated, from a half on."""
    column = term("slope", "CX")
    rng = np.random.default_rng(2)
    x, first, second = (coloured(rng, 4000, 0.8) for _ in range(3))
    usable = {"CX": np.ones(4000, dtype=bool)}
    once, twice = (
        Evidence(name, STEP, {"CX": noise}, usable, {column.id: {"CX": size * x + noise}})
        for name, noise in (("f", first), ("copy", first + second))
    )
    equations = normal_equations_of(replace(once, noisy=(twice,)), replace(SETTINGS, order=0))
    estimates = campaign([equations], [column]).flight_estimates((), ())
    estimate = estimates.estimate[0, 0]
    assert estimate == pytest.approx(1.0 / (1.0 + size**2), rel=0.1)
    assert estimates.biases.at([0])[0].simex_bias[0] == estimate
    units = campaign([equations], [column], extrapolated=False).flight_estimates((), ())
    assert bool(units.biases.at([0])[0].simex_bias[0] == estimate) is by_units


def test_an_autoregression_is_recovered_and_leaves_white_noise() -> None:
    rng = np.random.default_rng(3)
    e = rng.standard_normal(20_000)
    v = np.zeros(20_000)
    for k in range(2, len(v)):
        v[k] = 1.2 * v[k - 1] - 0.5 * v[k - 2] + e[k]
    coefficients, spread = fit([v[:12_000], v[12_000:]], 4)
    assert len(coefficients) == 2
    assert coefficients == pytest.approx([1.2, -0.5], abs=0.02)
    assert spread == pytest.approx(1.0, abs=0.02)
    white = whiten(v[:, None], coefficients)[:, 0]
    assert len(white) == len(v) - 2
    lagged = [float(white[k:] @ white[:-k]) / float(white @ white) for k in range(1, 6)]
    assert np.abs(lagged).max() < 0.03


def test_white_noise_is_given_no_coefficients() -> None:
    rng = np.random.default_rng(12)
    assert sum(len(fit([rng.standard_normal(400)], 4)[0]) for _ in range(50)) <= 5


def test_correlation_time_of_a_first_order_process() -> None:
    rng = np.random.default_rng(5)
    assert correlation_time([coloured(rng, 60_000, 0.8)], STEP) == pytest.approx(0.8, rel=0.15)


def test_an_instrument_frees_a_rate_from_what_the_controller_answers_to_the_residual() -> None:
    """q = command + gain * residual: least squares makes a slope out of the feedback, two stages do
    not."""
    column = term("slope", "CX")
    plain, instrumented = [], []
    for seed in range(40):
        rng = np.random.default_rng([seed, 2])
        command, noise = coloured(rng, 3000, 0.6), coloured(rng, 3000, 0.6)
        flight = Evidence(
            f"f{seed}",
            STEP,
            {"CX": noise},
            {"CX": np.ones(3000, dtype=bool)},
            {column.id: {"CX": command + 0.5 * noise}},
        )
        for found, given in ((plain, {}), (instrumented, {column.id: {"CX": command}})):
            made = normal_equations_of(replace(flight, instruments=given), SETTINGS)
            found.append(campaign([made], [column]).flight_estimates((), ()).estimate[0, 0])
    assert np.mean(plain) == pytest.approx(0.5 / 1.25, rel=0.15)  # cov(q, v) / var(q)
    assert abs(np.mean(instrumented)) < 4.0 * np.std(instrumented) / np.sqrt(40)
    assert np.mean(plain) > 5.0 * np.std(plain) / np.sqrt(40)


def test_the_first_stage_is_the_regression_on_constant_and_instrument() -> None:
    rng = np.random.default_rng(3)
    constant, x, z = 0.3 * np.ones(50), rng.standard_normal((50, 2)), np.zeros((50, 2))
    z[:, 0] = x[:, 0] + rng.standard_normal(50)
    design = np.column_stack([constant, z[:, 0]])
    fitted = design @ np.linalg.lstsq(design, x[:, 0], rcond=None)[0]
    found = first_stage(constant, x, z)
    assert np.allclose(found[:, 0], fitted)
    assert np.array_equal(found[:, 1], x[:, 1])


def test_settings_are_hashed_whole_and_checked() -> None:
    assert TracingSettings().sha256 == TracingSettings().sha256 != TracingSettings(kappa=3.0).sha256
    with pytest.raises(InputError, match="fewest"):
        TracingSettings(fewest=2)


def test_the_excitation_that_is_asked_for_has_the_power_that_is_promised() -> None:
    value, known, per_flight = 0.7, 3.0, 2.0
    factor = excitation_needed(value, known, per_flight, 0.05)
    information = known + factor**2 * per_flight
    assert stats.norm.sf(stats.norm.isf(0.05) - value * np.sqrt(information)) == pytest.approx(
        0.8, abs=1e-3
    )
    assert excitation_needed(9.0, 3.0, 2.0, 0.05) == 0.0
