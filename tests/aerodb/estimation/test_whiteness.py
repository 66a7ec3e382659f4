"""Whether innovations are white: a statistic worked out by hand, the stated rate of false alarms, and
the correlations that must be found."""

import numpy as np
import pytest
from scipy.stats import chi2

from aerodb.estimation.whiteness import FALSE_ALARMS, coloured_innovations, ljung_box


def test_the_statistic_is_ljungs_and_boxs() -> None:
    """By its definition: n (n + 2) sum_k r_k^2 / (n - k) of twenty lags, chi-square."""
    series = np.random.default_rng(3).standard_normal(400)
    n, power = len(series), float(series @ series)
    r = np.array([float(series[k:] @ series[:-k]) / power for k in range(1, 21)])
    statistic = n * (n + 2.0) * np.sum(r**2 / (n - np.arange(1, 21)))
    p_value, correlation = ljung_box([series])
    assert correlation == pytest.approx(r[0], rel=1e-12)
    assert p_value == pytest.approx(chi2.sf(statistic, 20))


def innovations(rng: np.random.Generator, correlation: float, n: int = 300) -> dict:
    series = rng.standard_normal((n, 4))
    for i in range(1, n):
        series[i, 0] += correlation * series[i - 1, 0]
    return {"r": dict(zip("Vaqp", series.T, strict=True))}


def test_white_innovations_are_called_coloured_no_more_often_than_stated() -> None:
    rng = np.random.default_rng(4)
    alarms = sum(bool(coloured_innovations(innovations(rng, 0.0))) for _ in range(2000))
    assert alarms <= 2000 * FALSE_ALARMS


@pytest.mark.parametrize("correlation", [0.43, -0.36])
def test_correlated_innovations_are_found_with_their_sign(correlation: float) -> None:
    rng = np.random.default_rng(5)
    found = [coloured_innovations(innovations(rng, correlation)) for _ in range(100)]
    assert np.mean([list(each) == ["V"] for each in found]) > 0.85
    mean = np.mean([each["V"] for each in found if "V" in each])
    assert mean == pytest.approx(correlation, abs=0.05)


def test_of_no_innovations_nothing_is_said() -> None:
    assert coloured_innovations({}) == {}
    assert coloured_innovations({"r": {"V": np.zeros(5)}}) == {}
    assert coloured_innovations({"r": {"V": np.full(300, np.nan)}}) == {}
