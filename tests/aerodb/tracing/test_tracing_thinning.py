"""Fewer samples, the same evidence: what thinning a flight before its columns are made changes, and
what it must not."""

from dataclasses import replace

import numpy as np
import pytest

from aerodb.coefficients.comparison import Comparison, compare
from aerodb.coefficients.total import total_coefficients
from aerodb.consistency.smoother.state_error_spectrum import StateNoise
from aerodb.effects.flight_view import view_of
from aerodb.effects.library import hypotheses_for
from aerodb.flight import Flight
from aerodb.tables.database import AeroDatabase
from aerodb.tracing.estimates.campaigns import campaign
from aerodb.tracing.evidence import thinning
from aerodb.tracing.evidence.flight_evidence import evidence_of
from aerodb.tracing.evidence.normal_equations import normal_equations_of
from aerodb.tracing.evidence.state_errors import noisy_copies
from aerodb.tracing.evidence.thinning import thinned
from aerodb.tracing.settings import TracingSettings
from tests.support import effect_flights
from tests.support.effect_flights import database, flown, vehicle
from tests.support.tracing_flights import FLOOR, LAG, coloured

#: Hz; 50 Hz become 12.5.
BAND = 1.0


def compared(flight: Flight, model: AeroDatabase) -> Comparison:
    return compare(flight, total_coefficients(flight, vehicle()), model, vehicle().reference)


@pytest.fixture(autouse=True)
def long(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is long begins at half a minute here: flights of five take long to make."""
    monkeypatch.setattr(thinning, "LONG", 30.0)


@pytest.fixture(scope="module")
def flight() -> Flight:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(effect_flights, "SECONDS", 60.0)
        return flown(3, database())


def missing_lift(flight: Flight, comparison: Comparison, value: float) -> Comparison:
    """The comparison with an effect in what was measured that the database lacks, and coloured
    noise on all axes."""
    generator, measured = np.random.default_rng(8), dict(comparison.measured)
    for axis, size in FLOOR.items():
        measured[axis] = measured[axis] + size * coloured(
            generator, len(flight.time), LAG, flight.step
        )
    measured["CZ"] = measured["CZ"] + value * (flight["alpha"] - flight["alpha"].mean())
    return replace(comparison, measured=measured)


def test_what_is_in_the_band_stays(flight: Flight) -> None:
    thin, beside = thinned(flight, compared(flight, database()), BAND)
    assert thin.step == pytest.approx(0.08)
    assert np.array_equal(thin.time, flight.time[::4])
    assert (
        len(beside.time)
        == len(thin.time)
        == len(beside.usable["CZ"])
        == len(beside.predicted["CZ"])
    )
    inside = slice(30, -30)
    for name in ("alpha", "beta", "delta_elevator", "V"):
        whole = flight[name][::4]
        assert np.abs(thin[name] - whole)[inside].max() < 2e-3 * np.ptp(whole), (
            f"{name}: sums of sines up to .7 Hz"
        )


def test_noise_above_the_rate_does_not_come_back_as_something_slow(flight: Flight) -> None:
    fast = np.sin(2.0 * np.pi * 12.4 * flight.time)  # every fourth sample of it would be .1 Hz
    thin, _ = thinned(flight.with_channels({"alpha": fast}), compared(flight, database()), BAND)
    assert np.abs(thin["alpha"][30:-30]).max() < 2e-3


def test_the_votes_are_those_of_all_samples(flight: Flight) -> None:
    """Every estimate differs by a small part of its standard error; the information is the same."""
    hypotheses = hypotheses_for(database(), vehicle(), flight.channels)
    settings = TracingSettings(bandwidth=BAND, order=1)
    beside = missing_lift(flight, compared(flight, database()), 0.2)
    made = [
        campaign(
            [
                normal_equations_of(
                    evidence_of(view_of(*given, database(), vehicle()), hypotheses), settings
                )
            ],
            hypotheses,
        ).flight_estimates((), ())
        for given in ((flight, beside), thinned(flight, beside, BAND))
    ]
    whole, thin = made
    shown = (whole.information[0] > 0.0) & (whole.inflation[0] < 100.0)
    assert shown.sum() > 30
    error = np.abs(whole.estimate[0] - thin.estimate[0])[shown] * np.sqrt(
        whole.information[0][shown]
    )
    assert np.quantile(error, 0.9) < 0.3
    ratio = np.sqrt(thin.information[0][shown] / whole.information[0][shown])
    assert np.quantile(ratio, 0.05) > 0.85
    assert np.quantile(ratio, 0.95) < 1.15


def test_what_is_in_a_long_gap_stays_in_it_and_a_short_one_is_bridged(flight: Flight) -> None:
    beside = compared(flight, database())
    usable = {axis: good.copy() for axis, good in beside.usable.items()}
    wild = {axis: values.copy() for axis, values in beside.measured.items()}
    for part in (slice(1000, 1300), slice(2001, 2004)):
        usable["CZ"][part] = False
        wild["CZ"][part] += 50.0
    _, clean = thinned(flight, replace(beside, usable=usable), BAND)
    _, after = thinned(flight, replace(beside, measured=wild, usable=usable), BAND)
    assert np.array_equal(clean.measured["CZ"], after.measured["CZ"])
    good = after.usable["CZ"]
    assert not good[249:326].any(), "one sample more on each side of the gap"
    assert good[:249].all()
    assert good[326:500].all()
    assert good[502:].all()


def test_without_more_noise_a_copy_is_the_flight_and_with_it_only_the_noise_is_added(
    flight: Flight,
) -> None:
    beside = missing_lift(flight, compared(flight, database()), 0.2)
    thin, near = thinned(flight, beside, BAND)
    none = StateNoise("smoother", (0.01, 6.0), {"alpha": 0.0}, {"alpha": (0.0,)})
    ((_, same),) = noisy_copies(thin, none, database(), vehicle(), 1, near)
    for axis in near.usable:
        assert np.allclose(same.residual(axis), near.residual(axis), atol=1e-14)
    offset = replace(none, offset={"alpha": 0.01})
    ((copy, moved),) = noisy_copies(thin, offset, database(), vehicle(), 1, near)
    shift = float(np.mean(copy["alpha"] - thin["alpha"]))
    expected = (
        database().predict(copy.channels).coefficients["CZ"]
        - database().predict(thin.channels).coefficients["CZ"]
    )
    assert shift != 0.0
    assert np.allclose(near.residual("CZ") - moved.residual("CZ"), expected, atol=1e-10)


def test_what_is_short_or_slow_is_left_alone(
    flight: Flight, monkeypatch: pytest.MonkeyPatch
) -> None:
    beside = compared(flight, database())
    assert thinned(flight, beside, 3.0) == (flight, beside)
    monkeypatch.setattr(thinning, "LONG", 300.0)
    assert thinned(flight, beside, BAND) == (flight, beside)
