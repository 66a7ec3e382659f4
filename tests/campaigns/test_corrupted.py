"""What is noticed of corrupted flights and wrong vehicle files: simulated flights in every run, the
measured ones with the campaigns (`python -m tests.campaigns.corrupted` prints the table)."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aerodb.conditioning import flag_unusable
from aerodb.conditioning.frozen import torn
from aerodb.suspicions import examine, limits_flight
from aerodb.suspicions.failed import failed_suspicions
from tests.campaigns.corrupted import (
    Count,
    attack,
    during,
    fleet,
    lacking,
    noticed,
    noticed_beside,
    other_aircraft,
    simulated,
)
from tests.campaigns.corrupted import measured as measured_pairs
from tests.campaigns.corruptions import BELIEVABLE, FILES, FLIGHTS, Pair, is_field_named
from tests.campaigns.during_flight import SENSORS, SURFACES
from tests.campaigns.right_flights import jsbsim, right_flights

#: Largest share of faults during a flight that matter and are silent, as measured with a margin.
SILENT_DURING = 0.16
#: The same of those that are said and of which no suspicion names a channel that is wrong.
MISNAMED_DURING = 0.07
#: Largest shares of silent flights and files over all kinds, as measured with a margin.
SILENT = {"flights": 0.02, "files": 0.02}


@pytest.fixture(scope="module")
def flights() -> list[Pair]:
    return list(simulated(flights=1))


def said(pair: Pair) -> tuple[str, ...]:
    return tuple(each.sentence for each in (*noticed(pair), *noticed_beside(pair)))


def silent(table: Mapping[str, Count]) -> dict[str, list[str]]:
    return {kind: count.silent for kind, count in table.items() if count.silent}


def test_right_flights_raise_nothing(flights: list[Pair]) -> None:
    for pair in flights:
        assert said(pair) == ()


@pytest.mark.parametrize("record", ["attas", "twin_otter", "hfb320", "citation"])
def test_right_measured_flights_raise_nothing(measured_folder: Path, record: str) -> None:
    for pair in measured_pairs(measured_folder):
        if pair.name.startswith(record):
            assert said(pair) == (), pair.name


@pytest.mark.parametrize(
    ("name", "condition"),
    [
        ("f16", "moderate turbulence"),  # gusts roll it: least squares find no damping
        ("A320", "severe turbulence"),
        ("T38", "alpha 5x"),
        ("737", "coarse"),  # rates rest for seconds within one step of their channel
    ],
)
def test_right_flights_under_other_conditions_raise_nothing(
    tmp_path: Path, name: str, condition: str
) -> None:
    assert said(jsbsim(tmp_path, name, condition)) == ()


def test_a_coarse_rate_that_freezes_is_told(tmp_path: Path) -> None:
    pair = jsbsim(tmp_path, "737", "coarse")
    held = np.where(pair.flight.time > 20.0, pair.flight["q"][500], pair.flight["q"])
    frozen = replace(pair, flight=flag_unusable(pair.flight.with_channels({"q": held})))
    told = examine(frozen.flight, vehicle=frozen.vehicle).suspicions
    assert [each.channel for each in told] == ["q"]


@pytest.mark.campaign
def test_all_right_flights_raise_nothing(tmp_path: Path) -> None:
    for pair in right_flights(tmp_path):
        assert said(pair) == (), pair.name


@pytest.fixture
def measured_folder(measured: Callable[[str], Path]) -> Path:
    return measured("README.md").parent


@pytest.mark.parametrize("kind", FLIGHTS)
def test_corruptions_of_simulated_flights_are_noticed(flights: list[Pair], kind: str) -> None:
    assert silent(attack(flights, {kind: FLIGHTS[kind]})) == {}


def test_wrong_vehicle_files_are_noticed(flights: list[Pair]) -> None:
    table = attack(flights, FILES)
    assert silent(table) == {}
    assert {kind: count.misnamed for kind, count in table.items() if count.misnamed} == {}
    assert len(table["inertia in slug ft2"].beside) == len(flights)


def test_a_sentence_names_a_field_that_is_wrong(flights: list[Pair]) -> None:
    right = flights[0]
    mass, inertia, span = (FILES[kind](right) for kind in ("mass in g", "Iyy a tenth", "half span"))
    assert mass is not None
    assert inertia is not None
    assert span is not None
    for wrong, sentence, named in (
        (mass, "Mass, area or density is wrong", True),
        (mass, "Ixx, Iyy and Izz are too small", False),
        (inertia, "mass 2 kg fits none of the moments of inertia", True),
        (inertia, "Ixx is 3 kg m^2", False),
        (span, "one of [reference] is wrong", True),
        (span, "the unit of spanwise flow is wrong", False),
        (right, "mass, Ixx, area and span are wrong", False),
    ):
        assert is_field_named(right, wrong, sentence) == named, sentence


#: Kinds with believable values that the simulated flights tell beside their database.
TOLD = (
    "mass .7 times",
    "CG .25 m for .25 chords",
    "thrust zero",
    "thrust reversed",
    "aileron and rudder exchanged",
)


@pytest.mark.parametrize("kind", TOLD)
def test_wrong_files_of_believable_values_are_noticed(flights: list[Pair], kind: str) -> None:
    count = attack(flights, {kind: BELIEVABLE[kind]})[kind]
    assert count.cases > 0
    assert count.silent == []


@pytest.mark.parametrize("kind", [*TOLD, "mass .85 times", "thrust in lbf"])
def test_wrong_files_of_a_measured_flight_are_noticed(measured_folder: Path, kind: str) -> None:
    """ATTAS beside its published derivatives (Jategaonkar, Flight Vehicle System Identification,
    2015)."""
    pair = next(pair for pair in measured_pairs(measured_folder) if "AilRud" in pair.name)
    count = attack([pair], {kind: BELIEVABLE[kind]})[kind]
    assert (count.cases, count.silent) == (1, [])


@pytest.mark.parametrize(
    "kind",
    [
        "elevator reversed from .4 on",
        "elevator jumps 4 deg",
        "record held 3 s",
    ],
)
def test_faults_during_a_flight_are_named(flights: list[Pair], kind: str) -> None:
    found = during(flights, kind, most=2)
    assert found.material > 0
    assert found.silent == []
    assert found.misnamed == []


@pytest.mark.parametrize(
    ("kind", "last"), [("record's blocks of 1 s swapped", 0.6), ("record repeated 5 s", 0.483)]
)
def test_a_record_out_of_order_loses_the_stretch_only(
    tmp_path: Path, kind: str, last: float
) -> None:
    right = jsbsim(tmp_path, "T38", "another flight")
    made = SENSORS[kind](right)
    assert made is not None
    (told,) = (s for s in failed_suspicions(made.flight) if s.sentence.startswith("the record"))
    time = made.flight.time
    begin, end = (time[0] + over * np.ptp(time) for over in (0.4, last))
    assert told.evidence["from"] == pytest.approx(begin, abs=2.0)
    assert told.evidence["to"] == pytest.approx(end, abs=2.0)
    lost = ~made.flight.usable(["alpha"]) & right.flight.usable(["alpha"])
    assert lost[(time > begin + 2.0) & (time < end - 2.0)].all()
    assert not lost[(time < begin - 2.0) | (time > end + 2.0)].any()


@pytest.mark.parametrize("every", [1, 5])
def test_records_at_a_slower_rate_are_whole(flights: list[Pair], every: int) -> None:
    """Samples that are held, or lie on straight lines, all jump, or bend, at once."""
    for pair in flights:
        n = np.arange(len(pair.flight.time))
        for made in (
            {name: v[n // every * every] for name, v in pair.flight.channels.items()},
            {
                name: np.interp(n, n[::every], v[::every])
                for name, v in pair.flight.channels.items()
            },
        ):
            assert torn(pair.flight.with_channels(made)) == []


@pytest.mark.parametrize("moving", [4, 6, 9])
def test_noise_tears_no_record(flights: list[Pair], moving: int) -> None:
    flight = max((pair.flight for pair in flights), key=lambda each: len(each.time))
    names = ("phi", "theta", "psi", "p", "q", "r", "alpha", "beta", "V")
    rng = np.random.default_rng(moving)
    for _ in range(50):
        made = {name: np.zeros(len(flight.time)) for name in names}
        made |= {name: rng.standard_normal(len(flight.time)) for name in names[:moving]}
        assert torn(flight.with_channels(made)) == []


def test_an_aircraft_that_is_pushed_twice_tears_no_record(flights: list[Pair]) -> None:
    """All channels jump at once there, but angles turn as the rates say."""
    flight = max((pair.flight for pair in flights), key=lambda each: len(each.time))
    rng, n = np.random.default_rng(0), len(flight.time)
    made = {name: 1e-3 * rng.standard_normal(n) for name in ("p", "q", "r", "alpha", "beta", "V")}
    for at in (n // 2, n // 2 + round(3.0 / flight.step)):
        for values in made.values():
            values[at : at + 3] += 0.5
    angles = zip(("phi", "theta", "psi"), ("p", "q", "r"), strict=True)
    made |= {angle: np.cumsum(made[rate]) * flight.step for angle, rate in angles}
    assert torn(flight.with_channels(made)) == []
    late = {name: np.roll(values, 1) for name, values in made.items()}
    late |= {angle: 20.0 * late[angle] for angle in ("phi", "theta", "psi")}
    assert len(torn(flight.with_channels(late))) == 1


@pytest.mark.campaign
def test_few_faults_during_a_flight_are_silent(measured_folder: Path, tmp_path: Path) -> None:
    pairs = [*fleet(tmp_path), *simulated(), *measured_pairs(measured_folder)]
    found = [during(pairs, kind, most=4) for kind in {**SURFACES, **SENSORS}]
    silent, misnamed = (
        sum(map(len, each)) for each in zip(*((f.silent, f.misnamed) for f in found), strict=True)
    )
    assert silent <= SILENT_DURING * sum(each.material for each in found)
    assert misnamed <= MISNAMED_DURING * sum(each.said for each in found)


@pytest.mark.campaign
def test_databases_that_lack_an_effect_make_no_file_wrong(tmp_path: Path) -> None:
    for pair in lacking(list(fleet(tmp_path))):
        assert not any(limits_flight(each) for each in noticed_beside(pair)), pair.name


@pytest.mark.campaign
def test_right_flights_of_jsbsims_aircraft_raise_nothing(tmp_path: Path) -> None:
    for pair in fleet(tmp_path):
        assert said(pair) == (), pair.name


@pytest.mark.campaign
def test_few_corruptions_are_silent(measured_folder: Path, tmp_path: Path) -> None:
    pairs = [*simulated(), *measured_pairs(measured_folder), *fleet(tmp_path)]
    files = attack(pairs, FILES) | {"another aircraft": other_aircraft(pairs)}
    for what, table in (("flights", attack(pairs, FLIGHTS)), ("files", files)):
        cases = sum(count.cases for count in table.values())
        assert sum(len(count.silent) for count in table.values()) <= SILENT[what] * cases
