"""Intensity and scale of turbulence: recovered, covered by their limits, and open where unknown."""

import numpy as np
import pytest

from aerodb.errors import InputError
from aerodb.estimation import GustSpectrum, gust_spectrum
from aerodb.physics import Form, Turbulence, gust_series

STEP, SPEED, SIGMA, LENGTH, NOISE = 0.1, 60.0, 1.2, 300.0, 0.1


def _estimated(form: Form, component: str, seed: int, n: int = 3000) -> GustSpectrum:
    """Turbulence of the product's series, with white noise."""
    air = Turbulence(form, (LENGTH,) * 3, (SIGMA,) * 3)
    series = gust_series(air, STEP * np.arange(n), SPEED, 10.0, seed)[f"gust_{component}"]
    noise = NOISE * np.random.default_rng([seed, 1]).standard_normal(n)
    return gust_spectrum(series + noise + 5.0, STEP, SPEED, component, form)


@pytest.mark.parametrize(
    ("form", "component"),
    [
        ("dryden", "u"),
        pytest.param("dryden", "w", marks=pytest.mark.campaign),
        pytest.param("von_karman", "u", marks=pytest.mark.campaign),
        ("von_karman", "w"),
    ],
)
def test_a_long_flight_gives_intensity_scale_and_noise(form: Form, component: str) -> None:
    found = _estimated(form, component, seed=1, n=8_000)
    assert found.intensity.value == pytest.approx(SIGMA, rel=0.1)
    assert found.length.value == pytest.approx(LENGTH, rel=0.25)
    # The spectrum of von Karman falls with the power 5/3 only: less of the noise stands clear of it.
    assert found.noise == pytest.approx(NOISE, rel=0.1 if form == "dryden" else 0.25)
    other: Form = "dryden" if form == "von_karman" else "von_karman"
    air = Turbulence(form, (LENGTH,) * 3, (SIGMA,) * 3)
    series = gust_series(air, STEP * np.arange(8_000), SPEED, 10.0, 1)[f"gust_{component}"]
    own, wrong = (
        gust_spectrum(series, STEP, SPEED, component, each).likelihood for each in (form, other)
    )
    assert own > wrong + 2.0


def _covered(form: Form, component: str, seeds: int) -> tuple[int, int]:
    found = [_estimated(form, component, seed) for seed in range(seeds)]
    return (
        sum(each.intensity.low <= SIGMA <= each.intensity.high for each in found),
        sum(each.length.low <= LENGTH <= each.length.high for each in found),
    )


@pytest.mark.parametrize("component", ["u", "w"])
def test_limits_hold_the_truth(component: str) -> None:
    """Of 5 draws at 95 %, fewer than 3 are a chance of 1 in 1000."""
    assert min(_covered("dryden", component, 5)) >= 3


@pytest.mark.campaign
@pytest.mark.parametrize(
    ("form", "component"), [("dryden", "u"), ("dryden", "w"), ("von_karman", "w")]
)
def test_limits_hold_the_truth_in_95_of_100_draws(form: Form, component: str) -> None:
    """Fewer than 89 of 100 are a chance of 1 in 100."""
    counts = _covered(form, component, 100)
    print(form, component, counts)
    assert min(counts) >= 89


def test_of_noise_alone_no_intensity_is_claimed() -> None:
    """The lower limit of the intensity is open or small against the noise."""
    noise = np.random.default_rng(3).standard_normal(3000)
    found = gust_spectrum(0.2 * noise, STEP, SPEED, "w", "dryden")
    assert found.intensity.low < 0.1
    assert found.noise == pytest.approx(0.2, rel=0.05)


def test_a_short_stretch_leaves_the_scale_open() -> None:
    found = _estimated("dryden", "u", seed=2, n=250)
    assert found.length.high > 2.0 * found.length.low
    with pytest.raises(InputError, match="at least 200 samples"):
        gust_spectrum(np.zeros(50), STEP, SPEED, "u", "dryden")
