"""The low-pass and the lag, against scipy.signal."""

import numpy as np
import pytest
from scipy.signal import firwin, kaiserord, lfilter, oaconvolve

from aerodb.signals import (
    band_passed,
    first_order_lag,
    low_pass_taps,
    low_passed,
    low_passed_rate,
    smooth,
)
from aerodb.signals.resampling import low_pass


@pytest.mark.parametrize("ratio", [1.5, 2.0, 3.7, 25.0, 100.0])
def test_the_low_pass_is_that_of_scipy(ratio: float) -> None:
    taps, beta = kaiserord(60.0, 2.0 * (0.5 - 0.35) / ratio)
    expected = firwin(2 * (taps // 2) + 1, (0.35 + 0.5) / ratio, window=("kaiser", beta))
    assert low_pass_taps(ratio) == pytest.approx(expected, rel=0.0, abs=1e-15)


@pytest.mark.parametrize("count", [64, 1001, 30000])
def test_what_passes_is_what_scipy_passes(count: int) -> None:
    values = 9000.0 + np.random.default_rng(2).standard_normal(count).cumsum()
    taps = low_pass_taps(4.0)
    padded = np.pad(values, len(taps) // 2, mode="reflect", reflect_type="odd")
    expected = oaconvolve(padded, taps, mode="valid")
    assert low_pass(values, 0.01, 0.04) == pytest.approx(expected, rel=0.0, abs=1e-10)


def test_the_lag_is_that_of_scipy_and_stops_at_a_gap() -> None:
    command = np.random.default_rng(1).standard_normal(4000)
    a = np.exp(-0.02 / 0.3)
    expected, _ = lfilter([0.0, 1.0 - a], [1.0, -a], command, zi=np.array([command[0]]))
    assert first_order_lag(command, 0.02, 0.3) == pytest.approx(expected, rel=0.0, abs=1e-13)
    command[100] = np.nan
    response = first_order_lag(command, 0.02, 0.3)
    assert np.isfinite(response[:101]).all()
    assert np.isnan(response[101:]).all()


def test_the_band_keeps_what_lies_between_and_nothing_else() -> None:
    """Sines at .02, 1 and 8 Hz on a slope; a band of .1 to 3 Hz keeps the second."""
    step, n = 0.02, 10_000
    time = step * np.arange(n)
    kept = np.sin(2 * np.pi * 1.0 * time)
    others = np.sin(2 * np.pi * 0.02 * time) + np.sin(2 * np.pi * 8.0 * time) + 0.3 * time
    band = band_passed(kept + others, step, 0.1, 3.0)
    inner = slice(n // 10, -n // 10)
    assert np.abs(band - kept)[inner].max() < 0.02
    both = low_passed(kept + others, step, 3.0) - low_passed(kept + others, step, 0.1)
    assert np.abs(band - both).max() < 1e-12


@pytest.mark.parametrize("n", [4999, 5000, 20001])
def test_what_is_low_passed_is_its_series_whatever_the_number_of_samples(n: int) -> None:
    """Sums of sines and cosines of a few frequencies, term by term; 4999 is 5000 less one, a prime."""
    step, bandwidth = 0.004, 2.0
    values = np.random.default_rng(n).standard_normal(n).cumsum()
    order = np.arange(round(2.2 * bandwidth * step * (n - 1)) + 1)
    share = np.clip(0.5 + (1 - order / (2 * step * (n - 1)) / bandwidth) / 0.1, 0.0, 1.0)
    gain = 0.5 * (1 - np.cos(np.pi * share))
    angles = np.pi / (n - 1) * np.outer(np.arange(n), order)
    half = np.ones(n)
    half[[0, -1]] = 0.5
    cosines = np.cos(angles)
    expected = (
        cosines @ (np.where(order, 2.0, 1.0) * gain * (cosines.T @ (half * values))) / (n - 1)
    )
    assert np.abs(low_passed_rate(values, step, bandwidth) - expected).max() < 1e-9
    smoothed = smooth(values, step, bandwidth)
    sines = np.sin(angles)
    series = gain * (sines.T @ (values - smoothed.line)) * 2.0 / (n - 1)
    expected = smoothed.line + sines @ series
    assert np.abs(low_passed(values, step, bandwidth) - expected).max() < 1e-9
    assert np.abs(smoothed.value - expected).max() < 1e-9


def test_a_rate_is_low_passed_to_its_ends_as_the_derivative_of_a_record_is() -> None:
    """A roll rate that has begun to move: its derivative in closed form, low-passed, is what `smooth`
    makes of the record. What is continued oddly has another end, in error by a fifth."""
    step = 0.02
    time = step * np.arange(500)
    record = np.sin(9.0 * time) - 0.3 * np.exp(-time / 0.2)
    exact = 9.0 * np.cos(9.0 * time) + 1.5 * np.exp(-time / 0.2)
    made = smooth(record, step, 5.0).rate
    size = np.abs(exact).max()
    assert np.abs(low_passed_rate(exact, step, 5.0) - made).max() < 0.02 * size
    assert np.abs(low_passed(exact, step, 5.0) - made).max() > 0.1 * size
    constant = np.full(100, 3.0)
    assert low_passed_rate(constant, step, 5.0) == pytest.approx(constant)
    with pytest.raises(ValueError, match="too few"):
        low_passed_rate(constant[:5], step, 5.0)
