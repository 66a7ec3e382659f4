"""The same flight in another file, whole, in part or resampled, is found; different flights never
are."""

from collections.abc import Callable
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d

from aerodb.conditioning.duplicates import FEWEST_MARKS, fingerprint, shared_samples
from aerodb.flight import Flight
from tests.support.jsbsim_campaign import as_logged, flown
from tests.support.jsbsim_cases import B737, lowering
from tests.support.kinematic_flights import kinematic_flight
from tests.support.measured_flights import ATTAS, RECORDS, as_flight


@pytest.fixture(scope="module")
def records(measured: Callable[[str], Path]) -> dict[str, Flight]:
    return {name: as_flight(measured(name)) for name in RECORDS}


def _programme(**start: float) -> Flight:
    """A Boeing 737 in JSBSim under one programme of inputs, from these initial conditions."""
    plan = lowering(0)
    begun = {
        **plan.start,
        **{f"ic/{name.replace('_', '-')}": value for name, value in start.items()},
    }
    return as_logged(
        flown(B737, replace(plan, start=begun, seconds=40.0)),
        "flown",
        "737",
        np.random.default_rng(1),
    )


def resampled(
    flight: Flight, rate: float, start: float, end: float, rounding: int | None = None
) -> Flight:
    """The flight from `start` to `end` [s] at another rate, on a clock of its own, and with few
    digits."""
    time = np.arange(start, end, 1.0 / rate)
    channels = {name: CubicSpline(flight.time, flight[name])(time) for name in flight.channels}
    if rounding is not None:
        channels = {name: np.round(values, rounding) for name, values in channels.items()}
    return replace(flight, id="again", time=time - time[0] + 700.0, channels=channels, flags={})


def test_attas_ail_rud_repeats_both_records_sample_for_sample(records: dict[str, Flight]) -> None:
    both = records["attas/fAttasAilRud1.mat"]
    stored = {name: fingerprint(flight) for name, flight in records.items() if flight is not both}
    common = {name: len(fingerprint(both) & marks) for name, marks in stored.items()}
    assert {name for name, count in common.items() if count >= FEWEST_MARKS} == {
        "attas/fAttasAil1.mat",
        "attas/fAttasRud1.mat",
    }
    for name, start in (("attas/fAttasAil1.mat", 50.08), ("attas/fAttasRud1.mat", 110.16)):
        (shared,) = shared_samples(both, records[name])
        assert shared.samples == 751
        assert shared.start_a == pytest.approx(start, abs=1e-6)
        assert shared.end_a - shared.start_a == pytest.approx(30.0, abs=1e-6)
        assert shared.start_b == pytest.approx(shared.start_a, abs=1e-6)
        assert shared.difference < 1e-9


def test_no_other_measured_records_share_samples(records: dict[str, Flight]) -> None:
    prints = {name: fingerprint(flight) for name, flight in records.items()}
    repeated = {ATTAS[1], ATTAS[2], ATTAS[3]}
    for a, b in combinations(records, 2):
        if not {a, b} <= repeated or (a, b) == (ATTAS[1], ATTAS[2]):
            assert len(prints[a] & prints[b]) < 3
            assert shared_samples(records[a], records[b]) == ()


@pytest.mark.parametrize("rate", [25.0, 18.3, 100.0])
def test_a_resampled_part_is_found_with_its_place(records: dict[str, Flight], rate: float) -> None:
    for name, (start, end) in {ATTAS[0]: (3.013, 20.0), ATTAS[2]: (112.0071, 136.0)}.items():
        flight = records[name]
        part = resampled(flight, rate, start, end, rounding=4)
        assert len(fingerprint(part) & fingerprint(flight)) >= FEWEST_MARKS
        found = shared_samples(part, flight)
        assert sum(shared.end_a - shared.start_a for shared in found) > 0.9 * (end - start)
        assert found[0].start_b - found[0].start_a == pytest.approx(start - 700.0, abs=2e-3)


def test_two_stretches_with_different_clocks_are_two_findings() -> None:
    flight = kinematic_flight(31, seconds=60.0)
    first, second = slice(200, 1000), slice(1700, 2700)
    channels = {
        name: np.concatenate([flight[name][first], flight[name][second]])
        for name in flight.channels
    }
    n = 1800
    mixed = replace(flight, id="mixed", time=0.02 * np.arange(n), channels=channels)
    found = shared_samples(mixed, flight)
    assert [shared.start_b - shared.start_a for shared in found] == [
        pytest.approx(4.0, abs=1e-3),
        pytest.approx(18.0, abs=1e-3),
    ]
    assert sum(shared.samples for shared in found) > 0.95 * n


def test_a_bias_does_not_hide_a_repetition() -> None:
    flight = kinematic_flight(32)
    biased = flight.with_channels({"q": flight["q"] + 0.01, "az": flight["az"] - 0.2})
    (shared,) = shared_samples(biased, flight)
    assert shared.samples > 0.95 * len(flight.time)


def test_flights_with_the_same_plan_but_their_own_noise_are_different() -> None:
    flights = [kinematic_flight(seed) for seed in range(40, 52)]
    prints = [fingerprint(flight) for flight in flights]
    assert max(len(a & b) for a, b in combinations(prints, 2)) < 3
    assert all(shared_samples(a, b) == () for a, b in combinations(flights[:6], 2))


@pytest.mark.parametrize(
    "change", [{"V": 15.0}, {"altitude": 300.0}, {"theta": 0.03}, {"psi": 0.5}]
)
def test_the_same_inputs_at_another_condition_are_another_flight(change: dict[str, float]) -> None:
    flight = kinematic_flight(34)
    flight = flight.with_channels(
        {
            "altitude": 900.0
            + np.cumsum(flight["V"] * np.sin(flight["theta"] - flight["alpha"])) * flight.step
        }
    )
    assert set(change) <= set(flight.channels)
    other = flight.with_channels({name: flight[name] + size for name, size in change.items()})
    assert len(fingerprint(flight) & fingerprint(other)) >= FEWEST_MARKS
    assert shared_samples(other, flight) == ()
    assert shared_samples(resampled(flight, 31.0, 3.0, 30.0, rounding=4), flight) != ()


def test_a_whole_turn_of_heading_and_another_origin_are_no_other_flight() -> None:
    flight = kinematic_flight(35)
    rng = np.random.default_rng(1)
    track = {name: np.cumsum(rng.standard_normal(len(flight.time))) for name in ("north", "east")}
    flight = flight.with_channels(track)
    moved = flight.with_channels(
        {
            "psi": flight["psi"] + 2 * np.pi,
            "north": flight["north"] + 1e4,
            "east": flight["east"] - 300.0,
        }
    )
    (shared,) = shared_samples(moved, flight)
    assert shared.samples > 0.95 * len(flight.time)


def test_a_programme_flown_again_at_another_condition_in_jsbsim_is_no_repeat() -> None:
    first = _programme(vc_kts=200.0, h_sl_ft=6000.0)
    assert (
        sum(shared.samples for shared in shared_samples(resampled(first, 20.0, 2.0, 38.0), first))
        > 600
    )
    for start in ((215.0, 6000.0), (200.0, 8000.0), (205.0, 7000.0)):
        assert shared_samples(_programme(vc_kts=start[0], h_sl_ft=start[1]), first) == ()


def test_a_periodic_motion_costs_no_more_than_another_and_is_still_found() -> None:
    """Its one mark comes thousands of times: the pairs of two such records would fill the
    memory."""
    time = 0.02 * np.arange(180_000)
    channels = {"q": 0.1 * np.sin(3.0 * time), "r": 0.05 * np.sin(3.0 * time + 1.0)}
    flight = Flight("periodic", "synthetic", time, channels)
    found = shared_samples(flight, replace(flight, id="again"))
    assert sum(shared.samples for shared in found) > 0.99 * len(time)


def test_two_hours_of_turbulence_have_no_mark_in_common() -> None:
    """So a look-up of marks finds nothing to compare, however many flights are stored."""
    prints = []
    for seed in range(4):
        rng = np.random.default_rng(seed)
        noise = {
            name: gaussian_filter1d(rng.standard_normal(180_000), 15.0)
            for name in ("p", "q", "r", "ay", "az")
        }
        prints.append(
            fingerprint(Flight(f"t{seed}", "synthetic", 0.02 * np.arange(180_000), noise))
        )
    assert min(map(len, prints)) > 5000
    assert max(len(a & b) for a, b in combinations(prints, 2)) < FEWEST_MARKS


def test_fingerprints_fit_a_database_and_nothing_gives_none() -> None:
    marks = fingerprint(kinematic_flight(33))
    assert len(marks) > 50
    assert all(0 <= mark < 2**63 for mark in marks)
    still = Flight(
        "still", "synthetic", 0.02 * np.arange(500), {"q": np.zeros(500), "r": np.full(500, np.nan)}
    )
    assert fingerprint(still) == frozenset()
    assert shared_samples(still, still) == ()
