"""Confidence intervals of filter error and the Kalman filters over many flights in turbulence."""

from collections.abc import Callable

import pytest

from aerodb.estimation import Fit, extended_kalman, filter_error, unscented_kalman
from tests.support import short_period


@pytest.mark.heavy
@pytest.mark.parametrize(
    ("method", "coloured", "few"),
    [
        (filter_error, 0.0, 10),
        (filter_error, 0.6, 6),
        (extended_kalman, 0.0, 4),
        (unscented_kalman, 0.0, 4),
    ],
)
def test_intervals_hold_the_truth(
    method: Callable[..., Fit], coloured: float, few: int, trials: Callable[[int, int], int]
) -> None:
    """95 % intervals hold it in 92 to 98 % of the runs; few runs show gross errors only. Noise that is
    correlated in time, which no filter here models, is told."""
    truth, runs, held = short_period.STABLE, trials(few, 300), 0
    model = short_period.model({name: 0.8 * value for name, value in truth.items()})
    for seed in range(runs):
        record = short_period.flown(truth, 0.02, seed, coloured=coloured)
        fit = method(model, [record], process_noise=("g1",))
        assert fit.converged
        assert coloured == 0.0 or any("correlated from sample to sample" in n for n in fit.notes)
        for name, value in truth.items():
            low, high = fit.interval(name)
            held += low <= value <= high
    share = held / (runs * len(truth))
    assert 0.92 <= share <= 0.98 if runs >= 300 else share >= 0.8
