"""Mutated logs, databases and TOML files by the command line: none is a fault of aerodb, and none
costs the right log beside it (`python -m tests.campaigns.mutated` takes other seeds)."""

import subprocess
from pathlib import Path

import numpy as np
import pytest

from tests.campaigns.mutated import Campaign, said
from tests.campaigns.mutations import mutated


@pytest.mark.campaign
def test_no_mutated_file_is_a_fault(tmp_path: Path) -> None:
    campaign = Campaign(tmp_path, seed=3)
    campaign.logs(540)
    told = campaign.others(363)
    assert told.faults == []
    assert sum(told.cases.values()) == 540 + 363


def test_a_command_that_is_at_fault_is_told_from_one_that_refuses() -> None:
    def ended(code: int, words: str) -> list[str]:
        return said(subprocess.CompletedProcess([], code, "", words))

    assert ended(3, "aerodb: bad.csv: a number is missing") == []
    assert ended(1, "aerodb: KeyError: 'x'\nthis is a bug in aerodb")
    assert ended(3, "aerodb: a.csv: mapping failed\nreport it with this log, as a fault of aerodb")
    assert ended(-9, "")


def test_mutations_change_most_files() -> None:
    rng, data = np.random.default_rng(5), b'name = "a"\narea = 1.5\n' * 20
    assert sum(mutated(data, rng) != data for _ in range(100)) > 90
