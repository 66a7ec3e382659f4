"""Shapes of wrong channels against the channels that make them, and what databases lack."""

from collections.abc import Callable

import numpy as np
import pytest

from aerodb.signals import played
from aerodb.suspicions.shapes import fast, is_off, lacked, most_explained, slack, still

TIME = np.arange(0.0, 60.0, 0.1)
#: What the surface did [rad].
TRUE = 0.1 * np.sin(2.0 * np.pi * TIME / 6.0) + 0.03 * np.sin(1.7 * TIME)


def held(values: np.ndarray) -> np.ndarray:
    """Three stretches of 2 s that stand still."""
    made = values.copy()
    for start in (100, 250, 400):
        made[start : start + 20] = values[start]
    return made


@pytest.mark.parametrize(
    ("log", "least"),
    [
        (lambda d: np.clip(d, -0.07, 0.07), 0.98),
        (lambda d: np.where(np.abs(d) < 0.03, 0.0, d), 0.95),
        (held, 0.7),
    ],
    ids=["clipped", "dead band", "held"],
)
def test_a_channel_that_stands_still_is_off_by_what_it_missed(
    log: Callable[[np.ndarray], np.ndarray], least: float
) -> None:
    shown = log(TRUE)
    alike = [np.corrcoef(shape, shown - TRUE)[0, 1] for shape in still(shown)]
    assert max(alike) > least
    assert any(is_off(shape) for shape in still(shown))


def test_a_channel_that_moves_is_off_by_nothing() -> None:
    assert list(still(TRUE)) == []
    assert not any(is_off(shape) for shape in fast(TRUE))


def test_a_linkage_with_play_parts_by_the_way_that_its_channel_went() -> None:
    shown = played(TRUE, 0.03)
    alike = [np.corrcoef(shape, shown - TRUE)[0, 1] for shape in slack(shown)]
    assert min(alike) < -0.95


def test_samples_that_are_off_in_time_are_fast() -> None:
    late = np.random.default_rng(1).integers(-3, 4, len(TIME))
    shown = TRUE[np.clip(np.arange(len(TIME)) + late, 0, len(TIME) - 1)]
    (shape,) = fast(shown)
    assert is_off(shape)
    assert np.corrcoef(shape, shown - TRUE)[0, 1] > 0.85


def test_a_product_that_a_database_lacks_explains_what_it_leaves() -> None:
    rng = np.random.default_rng(2)
    moving = {name: rng.standard_normal(len(TIME)) for name in ("alpha", "q", "delta_elevator")}
    basis = np.linalg.qr(np.column_stack([np.ones_like(TIME), *moving.values()]))[0]
    columns = lacked(moving, {}, TIME)
    for left, share in (
        (moving["alpha"] * moving["delta_elevator"], 1.0),
        (rng.standard_normal(len(TIME)), 0.02),
    ):
        left = left - basis @ (basis.T @ left)
        assert most_explained(columns, basis, {"Cm": left})["Cm"] == pytest.approx(share, abs=0.02)
