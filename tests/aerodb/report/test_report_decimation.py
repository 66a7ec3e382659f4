"""Fewer points, no extreme lost: against a plain loop, on long records, with gaps; and the windows
of a console."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerodb.report.decimation import decimated, extremes, flagged_stretches

NUMBERS = st.floats(-1e6, 1e6, allow_nan=False) | st.just(float("nan"))


def plain(values: np.ndarray, points: int) -> list[int]:
    """The same, stretch by stretch in a loop."""
    n = len(values)
    if n <= points:
        return list(range(n))
    size, kept = -(-n // (points // 2)), {0, n - 1}
    for start in range(0, n, size):
        known = [k for k in range(start, min(n, start + size)) if np.isfinite(values[k])]
        kept |= (
            {min(known, key=lambda k: values[k]), max(known, key=lambda k: values[k])}
            if known
            else {start}
        )
    return sorted(kept)


@given(st.lists(NUMBERS, min_size=1, max_size=200), st.integers(2, 60))
def test_it_is_what_a_plain_loop_finds(values: list[float], points: int) -> None:
    array = np.array(values)
    found = extremes(array, points)
    assert found.tolist() == plain(array, points)
    assert len(found) <= points + 2


def test_a_spike_of_one_sample_in_an_hour_is_seen() -> None:
    """360,000 samples: a picture of 2,000 points shows a single wild sample at its own time, in its
    own size."""
    n = 360_000
    time, values = np.arange(n) / 100.0, np.sin(np.arange(n) / 5000.0)
    values[123_457] = 9.0
    shown_time, shown = decimated(time, values, 2000)
    assert len(shown) <= 2002
    assert (shown_time[np.argmax(shown)], shown.max(), shown.min()) == (1234.57, 9.0, values.min())
    assert (shown_time[0], shown_time[-1]) == (0.0, time[-1])


def test_a_window_opens_to_full_resolution_and_reaches_its_edges() -> None:
    time = np.arange(100_000) / 100.0
    shown_time, shown = decimated(time, np.sin(time), 2000, start=500.0, end=510.0)
    inside = (shown_time >= 500.0) & (shown_time <= 510.0)
    assert np.array_equal(shown_time[inside], time[50_000:51_001])
    assert (shown_time[0], shown_time[-1]) == (499.99, 510.01)
    assert np.array_equal(shown, np.sin(shown_time))
    assert len(decimated(time, time, 100, start=2000.0, end=3000.0)[0]) <= 2, (
        "a window beyond the record holds its last sample"
    )


def test_a_gap_stays_a_gap() -> None:
    values = np.ones(10_000)
    values[3000:6000] = np.nan
    kept = extremes(values, 100)
    assert np.isnan(values[kept]).sum() == 15, (
        "50 stretches of 200 samples, 15 of them without a value"
    )
    assert len(extremes(np.full(5000, np.nan), 100)) == 51


def test_too_few_points_are_refused() -> None:
    with pytest.raises(ValueError, match="at least 2"):
        extremes(np.zeros(5), 1)


@given(st.lists(st.booleans(), min_size=1, max_size=80), st.integers(1, 10))
def test_flagged_stretches_cover_every_flagged_sample(flags: list[bool], most: int) -> None:
    time, flagged = np.arange(len(flags), dtype=float), np.array(flags)
    found = flagged_stretches(time, flagged, most)
    covered = np.zeros(len(flags), dtype=bool)
    for start, end in found:
        covered |= (time >= start) & (time <= end)
    assert len(found) <= most
    assert np.all(covered[flagged])
    if len(found) < most:
        assert np.array_equal(covered, flagged), (
            "nothing is shaded that is not flagged, unless there are too many stretches"
        )
