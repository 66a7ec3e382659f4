"""Confidence intervals of filter error and the Kalman filters over many flights in turbulence."""

from collections.abc import Callable

import pytest

from aerodb.estimation import Fit, extended_kalman, filter_error, unscented_kalman
from tests.support import short_period
from tests.support.golden import same

TRUTH = short_period.STABLE
CASES: dict[str, tuple[Callable[..., Fit], float]] = {
    "filter error": (filter_error, 0.0),
    "filter error, coloured": (filter_error, 0.6),
    "extended Kalman": (extended_kalman, 0.0),
    "unscented Kalman": (unscented_kalman, 0.0),
}
#: Value and standard error of each parameter, of the first record.
KNOWN: dict[str, list[tuple[str, float, float]]] = {
    "filter error": [
        ("Z_alpha", -1.19, 0.0101),
        ("Z_de", -0.0868, 0.0134),
        ("M_alpha", -3.96, 0.0403),
        ("M_q", -1.58, 0.0302),
        ("M_de", -7.01, 0.0746),
    ],
    "filter error, coloured": [
        ("Z_alpha", -1.2, 0.0182),
        ("Z_de", -0.0761, 0.0234),
        ("M_alpha", -3.95, 0.0693),
        ("M_q", -1.56, 0.0522),
        ("M_de", -6.98, 0.124),
    ],
    "extended Kalman": [
        ("Z_alpha", -1.19, 0.00992),
        ("Z_de", -0.0867, 0.0133),
        ("M_alpha", -3.96, 0.0412),
        ("M_q", -1.58, 0.03),
        ("M_de", -7.01, 0.0742),
    ],
    "unscented Kalman": [
        ("Z_alpha", -1.19, 0.00992),
        ("Z_de", -0.0867, 0.0133),
        ("M_alpha", -3.96, 0.0412),
        ("M_q", -1.58, 0.03),
        ("M_de", -7.01, 0.0742),
    ],
}


def _fit(case: str, seed: int) -> Fit:
    method, coloured = CASES[case]
    model = short_period.model({name: 0.8 * value for name, value in TRUTH.items()})
    record = short_period.flown(TRUTH, 0.02, seed, coloured=coloured)
    fit = method(model, [record], process_noise=("g1",))
    assert fit.converged
    assert coloured == 0.0 or any("correlated from sample to sample" in n for n in fit.notes)
    return fit


@pytest.mark.parametrize("case", CASES)
def test_the_first_record_gives_what_it_always_gave(case: str) -> None:
    """Noise that is correlated in time, which no filter here models, is told."""
    fit = _fit(case, 0)
    found = [(name, float(fit[name].value), float(fit[name].standard_error)) for name in TRUTH]
    assert same(found, KNOWN[case])


@pytest.mark.campaign
@pytest.mark.parametrize("case", CASES)
def test_intervals_hold_the_truth(case: str) -> None:
    """95 % intervals hold it in 92 to 98 % of the runs."""
    runs, held = 300, 0
    for seed in range(runs):
        fit = _fit(case, seed)
        for name, value in TRUTH.items():
            low, high = fit.interval(name)
            held += low <= value <= high
    assert 0.92 <= held / (runs * len(TRUTH)) <= 0.98
