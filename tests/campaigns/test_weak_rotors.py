"""A weak rotor is named when its flight is ingested, and none in a sound flight.

Of the sound flights, gusts made all dampings of one seem small, as if its inertia were wrong. In the
other the effect of sideslip seemed to change with time.
"""

from pathlib import Path
from typing import Any

import pytest

from tests.campaigns.weak_rotors import SHARE, WEAK, conditions, prepared, report, rightly, said


@pytest.fixture(scope="module")
def prepared_in(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    folder = tmp_path_factory.mktemp("weak-rotors")
    return prepared(folder), folder


def test_conditions_differ_by_seed() -> None:
    one, other = conditions(1), conditions(2)
    assert all(str(one[key]) != str(other[key]) for key in one)


def test_a_weak_rotor_is_named_and_no_sound_one(prepared_in: tuple[Path, Path]) -> None:
    weak = said(*prepared_in, 1, True)
    sound = [said(*prepared_in, seed, False)["named"] for seed in (1041, 1002)]
    ((channel, kind, share, _),) = weak["named"]
    assert (channel, kind) == (f"rotor_{WEAK}", "thrust")
    assert share == pytest.approx(SHARE - 1.0, abs=0.04)
    assert sound == [[], []]


def test_a_rotor_that_is_not_the_weak_one_counts_as_wrong() -> None:
    right = _line(1, True, [f"rotor_{WEAK}", "thrust", -0.08, 0.01])
    other = _line(2, True, ["rotor_1", "thrust", 0.05, 0.01])
    sound = _line(3, False, ["rotor_1", "thrust", 0.05, 0.01])
    assert [rightly(line) for line in (right, other, sound)] == [True, False, False]
    told = report([right, other, sound])
    assert f"rotor {WEAK} weak: 1 of 2 right" in told
    assert "sound: 0 of 1 right" in told


def test_a_battery_is_named_rightly_only_by_what_it_took() -> None:
    took = (1.0 - conditions(1003)["sag"]) ** 2 - 1.0
    named = ["battery_voltage", "sag", took + 0.05, 0.02]
    line = _line(1003, False, named)
    assert rightly(line)
    assert not rightly(line | {"regulated": True})
    assert not rightly(_line(1003, False, [*named[:2], took + 0.07, 0.02]))
    assert "sound: 1 of 1 right; battery named in 1" in report([line])


def _line(seed: int, weak: bool, named: list[Any]) -> dict[str, Any]:
    return {"seed": seed, "weak": weak, "regulated": False, "named": [named]}


@pytest.mark.campaign
def test_rates(prepared_in: tuple[Path, Path]) -> None:
    weak = [said(*prepared_in, seed, True) for seed in range(1, 11)]
    sound = [said(*prepared_in, seed, False) for seed in range(1001, 1101)]
    assert sum(map(rightly, weak)) >= 9
    held = [said(*prepared_in, seed, False, regulated=True) for seed in range(2001, 2021)]
    assert all(map(rightly, [*sound, *held])), report([*sound, *held])
