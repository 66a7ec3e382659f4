"""What people read first: verdict, change, next command within five lines, then one small table;
and the same numbers as in the JSON document."""

import re
from pathlib import Path

import pytest

from aerodb.nomenclature import AXES
from tests.support.command import asked
from tests.support.shared_workspace import SharedWorkspaces
from tests.support.small_glider import NAME, channels, write_csv
from tests.support.terminal import on_terminal

WIDTHS = (80, 120)


def place_of(lines: list[str], word: str) -> int:
    """The number of the first line that begins with `word`, counted from 1."""
    return next(k for k, line in enumerate(lines, 1) if line.strip().startswith(word))


@pytest.mark.parametrize("columns", WIDTHS)
def test_ingest_begins_with_its_verdict_and_has_a_line_per_flight(
    columns: int, tmp_path: Path, shared: SharedWorkspaces
) -> None:
    workspace = shared.prepared(tmp_path / "w").root
    logs = [write_csv(tmp_path / f"flight{seed}.csv", channels(seed)) for seed in (11, 12, 13)]
    words = ("flight", "ingest", *map(str, logs), "--vehicle", NAME, "--direct")
    code, lines = on_terminal(workspace, columns, *words)
    outcomes = asked(workspace, *words)
    assert code == 0
    assert lines[0] == f"{NAME}: 3 of 3 logs stored: 3 limited; 0 refused"
    assert place_of(lines, "next") <= 5
    assert len(lines) <= 14, "three lines above, two per flight, four around them"
    assert all(len(line) <= columns for line in lines if "aerodb " not in line)
    for outcome in outcomes:
        place = place_of(lines, Path(outcome["log"]).name)
        shown = re.findall(r"-(?= |$)|\S+(?= %)", lines[place - 1].split("limited")[1])
        assert len(shown) == len(AXES)
        for axis, percent in zip(AXES, shown, strict=True):
            entry = outcome["comparison"]["axes"][axis]
            if percent == "-":
                assert entry["variation"] == 0.0
                continue
            of_flown = entry["rms_residual"] / entry["variation"]
            assert entry["of_flown"] == pytest.approx(of_flown)
            assert float(percent) == pytest.approx(100 * of_flown, rel=0.06)
        reason = " ".join(outcome["consistency"]["reasons"][0].split())
        assert lines[place].strip()[:30] == reason[:30], "its first reason, in the line below"
