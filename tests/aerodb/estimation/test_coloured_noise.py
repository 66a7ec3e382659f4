"""The model of coloured residuals where they are band-limited, as those of differentiated rates."""

import numpy as np
import pytest
from scipy.signal import correlate, firwin, lfilter

from aerodb.estimation.coloured_noise import autoregressive_noise

STEP, SAMPLES = 0.02, 600


@pytest.mark.parametrize("differentiated", [False, True])
@pytest.mark.parametrize("frequency", [0.5, 1.0, 2.0])
def test_sums_of_residuals_with_an_empty_band_scatter_as_told(frequency, differentiated) -> None:
    """The variance of ``x'v`` is exact for noise v of a known filter: 5 Hz low pass, at 50 Hz."""
    taps = firwin(81, 5.0, fs=1.0 / STEP)
    if differentiated:
        taps = np.convolve(taps, [0.5, 0.0, -0.5])
    time = STEP * np.arange(SAMPLES)
    moved = np.sin(2.0 * np.pi * frequency * time) * np.hanning(SAMPLES)
    exact = float(np.sum(correlate(moved, taps) ** 2))
    told = []
    for seed in range(40):
        white = np.random.default_rng(seed).standard_normal(SAMPLES + len(taps))
        residual = lfilter(taps, [1.0], white)[len(taps) :]
        told.append(float(autoregressive_noise([residual]).summed(moved[:, None])[0, 0]))
    assert np.sqrt(np.median(told) / exact) == pytest.approx(1.0, abs=0.17)
