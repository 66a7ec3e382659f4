"""Rolls with right friction claim nothing, and friction that is 20 % off is found and repaired: few of
each, and the rates."""

from pathlib import Path

import pytest

from tests.campaigns.rolls import conditions, grouped, prepared, report, rightly, said

#: Pairs of the suite.
RIGHT, PLANTED = range(1, 4), (1002,)


@pytest.fixture(scope="module")
def prepared_in(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    pytest.importorskip("jsbsim")
    folder = tmp_path_factory.mktemp("rolls")
    return prepared(folder), folder


def test_conditions_differ_by_seed_and_within_a_pair() -> None:
    drawn = [each for seed in (1, 2) for each in conditions(seed)]
    assert len({str(each["wind"]) for each in drawn}) == len(drawn)


@pytest.mark.heavy
def test_right_friction_is_left_and_wrong_one_repaired(prepared_in: tuple[Path, Path]) -> None:
    lines = [said(*prepared_in, seed, False) for seed in RIGHT]
    lines += [said(*prepared_in, seed, True) for seed in PLANTED]
    assert all(map(rightly, lines)), report(lines)
    sizes = [abs(size) for line in lines for size in line["off"].values()]
    assert sum(size < 3.0 for size in sizes) >= len(sizes) - 1


def test_what_is_claimed_beside_counts_as_wrong() -> None:
    claim = ["parameter@all:mu_side", "suspected", 0.1, ["parameter@all:mu_side"]]
    both = [f"parameter@all:mu_{name}" for name in ("roll", "brake")]
    none = {"seed": 1, "planted": False, "claims": [], "after": {}, "off": {"mu_brake": 2.5}}
    none |= {"added": []}
    one = {**none, "claims": [claim], "off": {"mu_brake": -0.5}}
    mended = {**one, "planted": True, "after": {"mu_brake": 0.221}}
    beside = {**mended, "after": {"mu_brake": 0.221, "mu_side": 4.4}}
    far = {**mended, "after": {"mu_brake": 0.23}}
    group = {**none, "planted": True, "claims": [[both[0], "alias_group", 0.02, both]], "off": {}}
    lines = [none, one, mended, beside, far, group]
    assert [rightly(line) for line in lines] == [True, False, True, False, False, False]
    assert [grouped(line) for line in lines] == [False] * 5 + [True]
    told = report(lines)
    assert "right friction: 1 of 2 right" in told
    assert "brakes 20 % off: 1 of 4 right, 1 named in a group" in told
    assert "mu_brake: true value in 4 of 5" in told


@pytest.mark.campaign
def test_rates(prepared_in: tuple[Path, Path]) -> None:
    right = [said(*prepared_in, seed, False) for seed in range(1, 101)]
    planted = [said(*prepared_in, 1000 + seed, True) for seed in range(1, 11)]
    assert sum(map(rightly, right)) >= 95, report(right)
    assert sum(map(rightly, planted)) + sum(map(grouped, planted)) >= 9, report(planted)
