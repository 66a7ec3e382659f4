"""What is noticed of corrupted flights and wrong vehicle files: simulated flights in every run, the
measured ones with the campaigns (`python -m tests.campaigns.corrupted` prints the table)."""

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.campaigns.corrupted import FILES, FLIGHTS, Pair, attack, noticed, simulated
from tests.campaigns.corrupted import measured as measured_pairs

#: Kinds that no bound on aircraft of all sizes can see: a quarter more or less inertia.
UNSEEN = {"inertia in slug ft2"}
#: Share of silent flights over all kinds but those, as measured, with a margin of one in fifty.
SILENT = 0.12


@pytest.fixture(scope="module")
def flights() -> list[Pair]:
    return list(simulated(flights=1))


def test_right_flights_raise_nothing(flights: list[Pair]) -> None:
    for pair in flights:
        assert noticed(pair) == ()


@pytest.mark.parametrize("record", ["attas", "twin_otter", "hfb320", "citation"])
def test_right_measured_flights_raise_nothing(measured_folder: Path, record: str) -> None:
    for pair in measured_pairs(measured_folder):
        if pair.name.startswith(record):
            assert noticed(pair) == (), pair.name


@pytest.fixture
def measured_folder(measured: Callable[[str], Path]) -> Path:
    return measured("README.md").parent


@pytest.mark.parametrize(
    "kind",
    [
        "elevator reversed",
        "rudder reversed",
        "elevator in percent",
        "elevator in microseconds",
        "density and qbar of slug/ft3",
        "density zero",
        "qbar in psf",
    ],
)
def test_corruptions_of_simulated_flights_are_noticed(flights: list[Pair], kind: str) -> None:
    count = attack(flights, {kind: FLIGHTS[kind]})[kind]
    assert count.noticed
    assert count.silent == []


def test_wrong_vehicle_files_are_noticed(flights: list[Pair]) -> None:
    table = attack(flights, {kind: FILES[kind] for kind in FILES if kind not in UNSEEN})
    assert [kind for kind, count in table.items() if count.silent] == []


@pytest.mark.campaign
def test_few_corruptions_are_silent(flights: list[Pair], measured_folder: Path) -> None:
    pairs = [*flights, *measured_pairs(measured_folder)]
    kinds = {kind: each for kind, each in (FLIGHTS | FILES).items() if kind not in UNSEEN}
    counts = attack(pairs, kinds).values()
    silent = sum(len(count.silent) for count in counts)
    assert silent <= SILENT * (silent + sum(len(count.noticed) for count in counts))
