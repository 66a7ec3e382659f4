"""The low-pass and the lag, against scipy.signal."""

import numpy as np
import pytest
from scipy.signal import firwin, kaiserord, lfilter, oaconvolve

from aerodb.signals import band_passed, first_order_lag, low_pass_taps, low_passed
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
