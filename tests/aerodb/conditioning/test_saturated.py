"""Sensors that stand at the ends of their range: planted, and where nothing may be found."""

from typing import Any

import numpy as np
import pytest

from aerodb.conditioning import flag_unusable, saturated
from aerodb.flight import Flight
from aerodb.suspicions.failed import failed_suspicions

STEP = 0.02
TIME = np.arange(0.0, 60.0, STEP)


def flown(**channels: Any) -> Flight:
    """Waves with noise in all rates, and these channels (n,)."""
    rng, noise = np.random.default_rng(5), 1e-3
    made = {
        name: size * np.sin(rate * TIME) + noise * rng.standard_normal(len(TIME))
        for name, size, rate in (("p", 0.3, 2.1), ("q", 0.1, 1.3), ("r", 0.05, 2.2))
    }
    made |= {"V": np.full_like(TIME, 40.0)}
    return Flight("waves", "waves", TIME, {**made, **channels})


def test_a_clipped_rate_is_left_out_where_it_is_clipped_and_said_once() -> None:
    flight = flown()
    clipped = flight.with_channels({"q": np.clip(flight["q"], -0.08, 0.07)})
    where = saturated(clipped, "q")
    assert np.array_equal(where, np.isin(clipped["q"], (-0.08, 0.07)) & where)
    assert where.sum() > 0.95 * np.isin(clipped["q"], (-0.08, 0.07)).sum()
    assert not flag_unusable(clipped).usable(["q"])[where].any()
    (said,) = failed_suspicions(flag_unusable(clipped))
    assert said.channel == "q"
    assert said.sentence.startswith("q comes to -0.08 and 0.07 rad/s")
    assert said.evidence["seconds"] == pytest.approx(STEP * where.sum())
    assert not any(saturated(clipped, name).any() for name in ("p", "r"))


@pytest.mark.parametrize(
    "q",
    [
        pytest.param(flown()["q"], id="as it is"),
        pytest.param(np.round(flown()["q"] / 0.02) * 0.02, id="in coarse steps"),
        pytest.param(np.repeat(flown()["q"][::5], 5), id="logged slower"),
        pytest.param(np.minimum(flown()["q"], flown()["q"][100]) * (TIME < 2.0), id="held once"),
        pytest.param(np.zeros_like(TIME), id="never changes"),
    ],
)
def test_a_rate_that_is_not_clipped(q: np.ndarray) -> None:
    assert not saturated(flown(q=q), "q").any()


def test_the_trim_of_a_simulation_is_no_end_of_a_range() -> None:
    """Where nothing moves, a rate may come back to its least value."""
    moved = np.sin(2.0 * TIME) > 0.0
    still = {name: np.where(moved, np.sin(2.0 * TIME), 0.0) for name in ("p", "q", "r")}
    assert not any(saturated(flown(**still), name).any() for name in still)
    assert saturated(flown(q=still["q"]), "q").any()
