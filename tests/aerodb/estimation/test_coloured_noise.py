"""The model of coloured residuals where they are band-limited, as those of differentiated rates."""

import numpy as np
import pytest

from aerodb.estimation.coloured_noise import autoregressive_noise
from aerodb.signals import low_passed, smooth

STEP, SAMPLES, BAND = 0.02, 400, 5.0


@pytest.mark.parametrize("differentiated", [False, True])
def test_sums_of_residuals_with_an_empty_band_scatter_as_told(differentiated) -> None:
    """The variance of ``x'v`` is exact for ``v = S e`` with white e and the matrix S of a filter:
    ``|S' x|^2``."""
    one = np.eye(SAMPLES)
    rows = [
        smooth(e, STEP, BAND).rate if differentiated else low_passed(e, STEP, BAND) for e in one
    ]
    filtered = np.array(rows).T
    time = STEP * np.arange(SAMPLES)
    white = np.random.default_rng(0).standard_normal((SAMPLES, 40))
    for frequency in (0.5, 1.0, 2.0, 3.0):
        moved = np.sin(2.0 * np.pi * frequency * time) * np.hanning(SAMPLES)
        exact = float(np.sum((filtered.T @ moved) ** 2))
        told = [
            float(autoregressive_noise([residual]).summed(moved[:, None])[0, 0])
            for residual in (filtered @ white).T
        ]
        ratio = np.sqrt(np.median(told) / exact)
        assert ratio == pytest.approx(1.0, abs=0.2), frequency
