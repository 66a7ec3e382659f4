"""From evidence to normal equations: the band, gaps, stored form, units, and what is refused."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from aerodb.errors import InputError
from aerodb.signals.resampling import low_pass
from aerodb.tracing.estimates.campaigns import campaign
from aerodb.tracing.evidence.evidence import Evidence, units
from aerodb.tracing.evidence.low_pass import band_limited, decimation, ends_left_out
from aerodb.tracing.evidence.normal_equations import (
    FlightNormalEquations,
    normal_equations_from_arrays,
    normal_equations_of,
)
from tests.support.tracing_flights import coloured
from tests.support.tracing_small import LIBRARY, SETTINGS, evidence


@pytest.mark.parametrize(("n", "step"), [(1500, 0.04), (997, 0.02), (300, 0.1), (64, 0.04)])
def test_the_band_is_that_of_the_house_low_pass_at_the_samples_that_are_kept(
    n: int, step: float
) -> None:
    values = coloured(np.random.default_rng(1), n, 0.5, step)
    ratio = decimation(step, 1.5)
    expected = low_pass(values, step, ratio * step)[::ratio] if ratio > 1 else values
    ends = ends_left_out(ratio)
    found = band_limited([values], np.ones(n, dtype=bool), step, 1.5)[:, 0]
    assert np.allclose(found, expected[ends : len(expected) - ends], atol=1e-12)


@pytest.mark.parametrize("step", [0.01, 0.02, 0.04, 0.1])
def test_white_noise_is_as_weak_at_the_ends_as_inside(step: float) -> None:
    """The very last sample would come out as it went in: false claims in 8 of 14 campaigns with
    differentiated rates."""
    noise = np.random.default_rng(2).standard_normal((2000, 400))
    spread = band_limited(list(noise.T), np.ones(2000, dtype=bool), step, 1.5).std(axis=1)
    assert spread[[0, -1]].max() < np.sqrt(2.1) * np.median(spread)


def test_gaps_keep_what_is_linear_linear() -> None:
    """Short gaps are bridged alike on both sides, long ones split the flight: a noise-free value is
    still exact."""
    flight = evidence(13)
    usable = {axis: mask.copy() for axis, mask in flight.usable.items()}
    usable["CX"][[100, 101, 640]] = False
    usable["CX"][800:900] = False
    x = flight.columns[LIBRARY[0].id]["CX"]
    residual = {"CX": np.where(usable["CX"], 0.4 * x + 0.1, 99.0), "CZ": flight.residual["CZ"]}
    usable["CZ"][:] = False
    estimates = campaign(
        [normal_equations_of(replace(flight, residual=residual, usable=usable), SETTINGS)], LIBRARY
    ).flight_estimates((0, 1), ())
    assert estimates.estimate[0, 0] == pytest.approx(0.4, abs=1e-9)
    assert estimates.estimate[0, 1] == pytest.approx(0.0, abs=1e-9)


def test_a_gram_returns_from_its_arrays() -> None:
    made = normal_equations_of(replace(evidence(1), noisy=(evidence(1),)), SETTINGS)
    again = normal_equations_from_arrays(made.to_arrays())
    for name in ("matrix", "noisy", "spread", "correlation", "samples", "excitation"):
        assert np.array_equal(getattr(made, name), getattr(again, name))
    assert (again.flight, again.axes, again.hypotheses) == (made.flight, made.axes, made.hypotheses)
    with pytest.raises(InputError, match="format 0"):
        normal_equations_from_arrays({"flight": np.array("x")})


def broken(change: Callable[[Evidence], Evidence]) -> str:
    with pytest.raises(InputError) as caught:
        normal_equations_of(change(evidence(1)), SETTINGS)
    return str(caught.value)


def test_bad_evidence_is_refused_with_its_place() -> None:
    def with_nan(flight: Evidence) -> Evidence:
        values = flight.residual["CX"].copy()
        values[7] = np.nan
        return replace(flight, residual={**flight.residual, "CX": values})

    assert "residual on CX" in broken(with_nan)
    assert "step" in broken(lambda e: replace(e, step=0.0))
    assert "samples" in broken(
        lambda e: replace(e, usable={**e.usable, "CX": np.ones(3, dtype=bool)})
    )
    assert "no axis" in broken(
        lambda e: replace(e, usable={axis: np.zeros(1500, dtype=bool) for axis in e.usable})
    )


def normal_equations(count: int) -> list[FlightNormalEquations]:
    return [normal_equations_of(evidence(seed), SETTINGS) for seed in range(count)]


def test_a_campaign_refuses_another_library_a_flight_twice_and_a_sensor_without_prior() -> None:
    made = normal_equations(2)
    with pytest.raises(InputError, match="another list of effects"):
        campaign(made, LIBRARY[1:])
    with pytest.raises(InputError, match="same flight twice"):
        campaign([made[0], made[0]], LIBRARY)
    with pytest.raises(InputError, match="no prior"):
        campaign(made, [*LIBRARY[:4], replace(LIBRARY[4], prior_sigma=None)])
    with pytest.raises(InputError, match="stands twice"):
        campaign(made, [*LIBRARY, LIBRARY[0]])


def test_manoeuvres_vote_only_when_five_correlation_times_apart() -> None:
    flight = evidence(1)
    cut = units(flight, [(0.0, 15.0), (16.0, 30.0), (20.0, 35.0), (50.0, 55.0)], 1.0)
    assert [u.flight for u in cut] == ["f1@0-15", "f1@20-35", "f1@50-55"]
    assert cut[1].residual["CX"][0] == flight.residual["CX"][500]
    assert cut[1].samples == 376
