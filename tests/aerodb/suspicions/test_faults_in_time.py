"""Channels that part from the database with time: measured flights beside published derivatives and
flights that obey their database, each with a change planted in a surface's channel."""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aerodb.coefficients.comparison import compare
from aerodb.coefficients.total import total_coefficients
from aerodb.flight import Flight
from aerodb.signals import played
from aerodb.suspicions import limits_flight
from aerodb.suspicions.faults_in_time import faults_in_time
from aerodb.suspicions.mass_events import mass_event_suspicions
from aerodb.suspicions.sized_faults import ALWAYS, Fault
from aerodb.vehicle import add_combinations, parse_vehicle
from tests.campaigns.corrupted import measured as measured_pairs
from tests.campaigns.corrupted import noticed_beside
from tests.campaigns.corruptions import Pair, of_role
from tests.campaigns.databases import database_of
from tests.campaigns.during_flight import sensor, swapped_blocks
from tests.support import effect_flights

FOUR = np.deg2rad(4.0)
#: Noise of a rate [rad/s] that makes two thirds of what the database leaves of a moment.
NOISE = 4e-3
Change = Callable[[np.ndarray, np.ndarray], np.ndarray]


@pytest.fixture(scope="module")
def flight() -> Pair:
    own = effect_flights.vehicle()
    flown = effect_flights.flown(2, effect_flights.database())
    return Pair("taxi", flown, own, database_of(own))


@pytest.fixture
def record(measured: Callable[[str], Path]) -> Pair:
    folder = measured("README.md").parent
    return next(pair for pair in measured_pairs(folder) if "hfb320" in pair.name)


def changed(pair: Pair, role: str, change: Change) -> Pair:
    """The channels of a role after a change of deflection and share of the flight (0 to 1)."""
    flight = pair.flight
    share = (flight.time - flight.time[0]) / np.ptp(flight.time)
    made = {name: change(flight[name], share) for name in of_role(pair, role)}
    return replace(pair, flight=add_combinations(flight.with_channels(made), pair.vehicle))


def drifted(d: np.ndarray, share: np.ndarray) -> np.ndarray:
    return d + FOUR * share


def jumped(d: np.ndarray, share: np.ndarray) -> np.ndarray:
    return d + FOUR * (share > 0.4)


def reversed_(d: np.ndarray, share: np.ndarray) -> np.ndarray:
    return np.where(share > 0.4, -d, d)


def clipped(d: np.ndarray, share: np.ndarray) -> np.ndarray:
    middle = np.median(d)
    most = 0.4 * np.max(np.abs(d - middle))
    return np.clip(d, middle - most, middle + most)


def held(d: np.ndarray, share: np.ndarray) -> np.ndarray:
    where = (share > 0.4) & (share < 0.6)
    return np.where(where, d[np.argmax(where)], d)


def test_a_surface_that_is_wrong_for_a_stretch_is_told_with_both_times(flight: Pair) -> None:
    def turned(d: np.ndarray, share: np.ndarray) -> np.ndarray:
        return np.where((share > 0.35) & (share < 0.65), -d, d)

    (said,) = noticed_beside(changed(flight, "pitch", turned))
    assert (said.channel, said.kind) == ("delta_elevator", "changed")
    assert "air_from" not in said.evidence, "the fault leaves nothing that air would explain"
    begin, end = (flight.flight.duration * share for share in (0.35, 0.65))
    told = re.search(r"from ([\d.]+) to ([\d.]+) s", said.sentence)
    assert told
    start = float(flight.flight.time[0])
    assert float(told[1]) - start == pytest.approx(begin, abs=0.05 * flight.flight.duration)
    assert float(told[2]) - start == pytest.approx(end, abs=0.05 * flight.flight.duration)


def test_a_vane_that_leaves_the_motion_for_a_while_is_told_by_its_axes(record: Pair) -> None:
    """Blocks of its samples are in the wrong order in the middle fifth: neither gain nor delay."""
    made = sensor(("alpha",), swapped_blocks(1.0))(record)
    assert made is not None
    (said,) = noticed_beside(made)
    assert (said.channel, said.kind) == ("alpha", "changed")
    assert "follow the motion" in said.sentence
    assert limits_flight(said)
    told = re.search(r"from ([\d.]+) to ([\d.]+) s", said.sentence)
    assert told
    time = record.flight.time
    begin, end = (time[0] + share * np.ptp(time) for share in (0.4, 0.6))
    assert begin - 1.0 < float(told[1]) < float(told[2]) < end + 1.0


@pytest.mark.parametrize("name", ["alpha", "beta"])
def test_a_vane_that_is_noisy_all_the_time_has_not_left_the_motion(flight: Pair, name: str) -> None:
    rng = np.random.default_rng(7)
    noise = np.convolve(rng.standard_normal(len(flight.flight.time)), np.ones(5) / 5.0, "same")
    made = flight.flight.with_channels({name: flight.flight[name] + np.deg2rad(1.0) * noise})
    assert not any("motion" in s.sentence for s in noticed_beside(replace(flight, flight=made)))


def test_the_zero_of_an_accelerometer_that_jumps_is_told_with_its_size(flight: Pair) -> None:
    own = flight.flight
    name = "ay" if "ay" in own else "ay_imu"
    share = (own.time - own.time[0]) / np.ptp(own.time)
    made = own.with_channels({name: own[name] + np.where(share > 0.4, 1.0, 0.0)})
    (said,) = noticed_beside(replace(flight, flight=made))
    assert (said.channel, said.kind) == ("ay", "zero")
    assert said.evidence["change"] == pytest.approx(1.0, rel=0.2)
    assert "m/s2" in said.sentence


def test_right_flights_raise_nothing(flight: Pair, record: Pair) -> None:
    assert noticed_beside(flight) == ()
    assert noticed_beside(record) == ()


@pytest.mark.parametrize("change", [drifted, jumped])
def test_a_zero_that_moves_in_a_measured_flight(record: Pair, change: Change) -> None:
    """HFB-320 beside its published derivatives (Jategaonkar, Flight Vehicle System Identification,
    2015)."""
    found = [s for s in noticed_beside(changed(record, "pitch", change)) if s.kind == "zero"]
    (said,) = found
    assert said.channel == "delta_elevator"
    assert limits_flight(said)


@pytest.mark.parametrize("change", [drifted, jumped])
def test_a_zero_that_moves_is_told_with_its_size(flight: Pair, change: Change) -> None:
    (said,) = noticed_beside(changed(flight, "pitch", change))
    assert (said.channel, said.kind) == ("delta_elevator", "zero")
    # The channel shows four degrees more, which the moment lacks.
    assert said.evidence["change"] == pytest.approx(-FOUR, rel=0.15)


def test_a_zero_that_moves_is_told_where_gusts_hold_most_of_the_rest(flight: Pair) -> None:
    """The noise of a rate makes moments of its own: the zero explains a third of the rest."""
    own, rng = flight.flight, np.random.default_rng(5)
    gusts = np.convolve(rng.standard_normal(len(own.time)), np.ones(5) / 5.0, "same")
    made = own.with_channels({"r": own["r"] + NOISE * gusts})
    noisy = replace(flight, flight=made)
    assert noticed_beside(noisy) == ()
    (said,) = noticed_beside(changed(noisy, "yaw", jumped))
    assert said.channel.startswith("delta_rudder")
    assert said.kind == "zero"


@pytest.mark.parametrize(("role", "name"), [("pitch", "elevator"), ("yaw", "rudder")])
def test_a_surface_whose_effect_turns_is_told_with_its_time(
    flight: Pair, role: str, name: str
) -> None:
    """One that `flight ingest` sees already is not looked for again."""
    (said,) = noticed_beside(changed(flight, role, reversed_))
    assert said.channel.startswith(f"delta_{name}")
    assert said.kind in ("changed", "sign")
    if said.kind == "changed":
        assert said.evidence["change"] == pytest.approx(-2.0, abs=0.3)


@pytest.mark.parametrize("change", [clipped, held])
def test_a_channel_that_stands_still_for_a_while(flight: Pair, change: Change) -> None:
    (said,) = noticed_beside(changed(flight, "pitch", change))
    assert (said.channel, said.kind) == ("delta_elevator", "stuck")
    assert "stands still" in said.sentence


def late(seconds: float, begin: float = 0.0) -> Change:
    """Samples of 20 ms."""
    shift = round(seconds / 0.02)
    return lambda d, share: np.where(share >= begin, np.roll(d, shift), d)


def test_a_delay_that_begins_in_flight_is_told_with_its_time(flight: Pair) -> None:
    found = noticed_beside(changed(flight, "pitch", late(0.3, 0.5)))
    (said,) = (each for each in found if each.channel == "delta_elevator")
    assert "late" in said.sentence
    if said.kind == "changed":
        assert said.evidence["change"] == pytest.approx(-0.3, abs=0.12)


@pytest.mark.parametrize(("size", "told"), [(0.5, True), (2.8, False)])
def test_a_delay_is_told_as_far_as_its_first_order_reaches(size: float, told: bool) -> None:
    fault = Fault("alpha", "delay", ALWAYS, {}, {"CZ": 0.5, "Cm": 0.3}, size, 0.01, 50.0)
    assert fault.is_large(likeliest=True, alone=True, beyond=False) == told


def test_a_gain_that_grows_is_told_with_its_size(flight: Pair) -> None:
    """Logged from once to twice: a radian of the log does half of what it did."""
    found = noticed_beside(changed(flight, "pitch", lambda d, share: d * (1.0 + share)))
    (said,) = (each for each in found if each.channel == "delta_elevator")
    assert said.kind == "changed"
    assert said.evidence["change"] == pytest.approx(-0.5, abs=0.15)
    assert limits_flight(said)


def test_play_in_the_linkage_of_a_surface(flight: Pair) -> None:
    """The surface follows the logged servo through a play of 3 deg; what the log shows moved it."""
    half = np.deg2rad(1.5)
    found = noticed_beside(changed(flight, "pitch", lambda d, share: played(d, half)))
    assert any(each.channel == "delta_elevator" for each in found)


def scaled(record: Pair, name: str, factor: float) -> Pair:
    """A channel at another scale in the second half of a flight."""
    own = record.flight
    share = (own.time - own.time[0]) / np.ptp(own.time)
    made = own.with_channels({name: np.where(share > 0.5, factor, 1.0) * own[name]})
    return replace(record, flight=made)


@pytest.mark.parametrize(("name", "factor"), [("alpha", 0.6), ("az", 1.5)])
def test_a_sensor_whose_scale_changes_is_told_by_all_axes(
    record: Pair, name: str, factor: float
) -> None:
    """Force and pitching moment together tell the vane from the accelerometer."""
    found = noticed_beside(scaled(record, name, factor))
    (said,) = (each for each in found if "CZ" in each.sentence)
    assert (said.channel, said.kind) == (name, "changed")
    assert limits_flight(said)


@pytest.mark.parametrize(("name", "factor"), [("alpha", 0.6), ("az", 1.5)])
def test_what_one_axis_cannot_tell_apart_is_named_together(
    record: Pair, name: str, factor: float
) -> None:
    """Of the force alone, a vane and an accelerometer explain the same."""
    wrong = scaled(record, name, factor).flight
    compared = compare(
        wrong,
        total_coefficients(wrong, record.vehicle),
        record.database,
        record.vehicle.reference,
    )
    force = {"CZ": compared.measured["CZ"]}
    (said,) = faults_in_time(
        wrong,
        record.vehicle,
        {"CZ": {"alpha": -4.32785}},
        force,
        compared.predicted,
        compared.usable,
        alone=True,
    )
    assert "alpha" in said.sentence
    assert "az" in said.sentence


def test_a_side_force_that_turns_its_sign(flight: Pair) -> None:
    own = flight.flight
    late = own.time > 8.0
    made = own.with_channels({"ay": np.where(late, -own["ay"], own["ay"])})
    (said,) = noticed_beside(replace(flight, flight=made))
    assert (said.channel, said.kind) == ("ay", "changed")
    assert said.evidence["change"] == pytest.approx(-2.0, abs=0.4)


def test_an_accelerometer_far_from_the_cg_that_turns_its_sign(flight: Pair) -> None:
    """It reads more of the turning than of the side force."""
    far = parse_vehicle(effect_flights.VEHICLE.replace("imu = [-1.4,", "imu = [4.0,"))
    shown, own = effect_flights.logged(flight.flight, far), flight.flight
    there = {n: v for n, v in own.channels.items() if n not in ("ax", "ay", "az")}
    imu = {name: shown[name] for name in ("ax_imu", "ay_imu", "az_imu")}
    right = Flight(own.id, far.name, own.time, {**there, **imu})
    assert not noticed_beside(replace(flight, flight=right, vehicle=far))
    turned = np.where(own.time > 8.0, -imu["ay_imu"], imu["ay_imu"])
    wrong = right.with_channels({"ay_imu": turned})
    (said,) = noticed_beside(replace(flight, flight=wrong, vehicle=far))
    assert (said.channel, said.kind) == ("ay", "changed")
    assert -2.1 < said.evidence["change"] < -1.0  # products of rates are no motion of the basis


def test_a_gain_that_grows_is_told_where_noise_is_most_of_what_is_left(flight: Pair) -> None:
    """No time is sought: none of 700 flights without a fault has one that is likeliest."""
    rng = np.random.default_rng(5)
    noise = 4.0 * NOISE * rng.standard_normal(len(flight.flight.time))
    noisy = flight.flight.with_channels({"q": flight.flight["q"] + noise})
    right = replace(flight, flight=noisy)
    assert not noticed_beside(right)
    (said,) = noticed_beside(changed(right, "pitch", lambda d, share: d * (1.0 + share)))
    assert (said.channel, said.kind) == ("delta_elevator", "changed")
    assert "over the whole flight" in said.sentence


def test_a_surface_that_stands_while_nothing_happens_is_none(flight: Pair) -> None:
    """What rests exactly, and was flown so."""
    own = flight.flight
    rest = {name: np.round(own[name], 1) for name in of_role(flight, "yaw")}
    quiet = {name: np.zeros_like(values) for name, values in rest.items()}
    assert all(s.kind != "stuck" or s.channel.startswith("delta_rudder")
               for s in noticed_beside(replace(flight, flight=own.with_channels(quiet))))  # fmt: skip


def test_a_jump_of_a_channel_is_no_mass(flight: Pair, record: Pair) -> None:
    vane = np.where(record.flight.time > 30.0, 0.6, 1.0) * record.flight["alpha"]
    assert mass_event_suspicions(record.flight.with_channels({"alpha": vane}), record.vehicle) == ()
    made = changed(flight, "pitch", jumped)
    assert mass_event_suspicions(made.flight, made.vehicle) == ()
