"""Residuals against inputs: scipy's correlation, the rate of false alarms, and a delay that a model
lacks."""

import numpy as np
import pytest
from scipy.signal import correlate, correlation_lags, lfilter
from scipy.stats import norm

from aerodb.estimation import TimeHistory, dependent, input_correlations

STEP = 0.02


def doublets(time):
    return 0.05 * (np.abs(time - 1.5) < 0.5) - 0.04 * (np.abs(time - 0.55 * time[-1]) < 0.4)


def looked_at(left, moved, name="one"):
    record = TimeHistory(name, STEP * np.arange(len(left)), {"da": moved}, {"p": left})
    return input_correlations({name: {"p": left}}, [record])


def test_the_coefficient_is_scipys_and_the_bound_of_one_lag_the_normal_one() -> None:
    rng = np.random.default_rng(3)
    moved = rng.standard_normal(4000)
    left = rng.standard_normal(4000) + 0.3 * np.roll(moved, 7)
    found = looked_at(left, moved)[0]
    left, moved = left - left.mean(), moved - moved.mean()
    whole = correlate(left, moved) / np.sqrt((left @ left) * (moved @ moved))
    lags = correlation_lags(len(left), len(moved))
    assert found.lag == pytest.approx(7 * STEP)
    assert found.correlation == pytest.approx(whole[lags == 7].item(), rel=1e-9)
    # white residuals: 1/sqrt(n) for each lag (Bartlett); 999 lags of white input are 999 tests
    assert found.bound * np.sqrt(4000) == pytest.approx(-norm.ppf(0.025 / 999), rel=0.02)
    assert found.p_value < 1e-12


@pytest.mark.parametrize("pole", [0.0, 0.9])
def test_independent_residuals_stay_within_the_bound(pole) -> None:
    time, outside, alarms = STEP * np.arange(600), 0, 0
    for seed in range(200):
        noise = np.random.default_rng(seed).standard_normal(800)
        found = looked_at(lfilter([1.0], [1.0, -pole], noise)[200:], doublets(time))
        outside += abs(found[0].correlation) > found[0].bound
        alarms += len(dependent(found))
    assert 2 <= outside <= 20  # 5 % of 200 are 10
    assert alarms <= 6


def test_several_records_of_two_rates_with_gaps_count_together() -> None:
    records, residuals = [], {}
    for number, step in enumerate((0.02, 0.04)):
        rng, time = np.random.default_rng(number), step * np.arange(500)
        moved = np.interp(time, np.arange(0.0, 30.0, 0.1), rng.standard_normal(300))
        late = np.interp(time - 0.4, time, moved)
        left = 0.4 * late + rng.standard_normal(500)
        left[100:110] = np.nan
        records.append(TimeHistory(f"r{number}", time, {"da": moved}, {"p": left}))
        residuals[f"r{number}"] = {"p": left}
    found = dependent(input_correlations(residuals, records))[0]
    assert found.part == "all"
    assert found.lag == pytest.approx(0.4, abs=0.05)


def test_an_effect_that_changes_sign_half_way_shows_in_the_halves_only() -> None:
    time = STEP * np.arange(1000)
    moved = 0.05 * np.sign(np.sin(2.0 * time))
    left = moved * np.where(time < 10.0, 1.0, -1.0)
    left = np.roll(left, 10) + 0.05 * np.random.default_rng(4).standard_normal(1000)
    found = dependent(looked_at(left, moved))
    assert {each.part for each in found} == {"first half", "second half"}
    assert {np.sign(each.correlation) for each in found if each.lag < 0.5} == {-1.0, 1.0}


def test_what_stands_still_has_no_correlation() -> None:
    left = np.random.default_rng(0).standard_normal(100)
    assert looked_at(left, np.zeros(100)) == looked_at(np.zeros(100), left) == ()
    assert looked_at(left[:3], left[:3]) == ()
    assert input_correlations({}, []) == ()
