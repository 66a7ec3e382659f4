"""Tests of the table that says where the time of a run goes."""

import time
from pathlib import Path

import pytest

from tests.bench.__main__ import _ingest, measure
from tests.bench.record import RECORD
from tests.bench.timers import PROCESSES, REST, STAGES, TOTAL, Timers
from tests.bench.where_time_goes import BEFORE, keep, table, where_time_goes


def test_a_stage_within_a_stage_counts_for_the_inner_one_alone() -> None:
    timers = Timers({}, 0, [])
    with timers.stage("outer"):
        time.sleep(0.02)
        for _ in range(2):
            with timers.stage("inner"):
                time.sleep(0.05)
    assert timers.rows["inner"][0] >= 0.1
    assert timers.rows["outer"][0] < timers.rows["inner"][0]
    assert [timers.rows[name][2] for name in ("outer", "inner")] == [1, 2]


def test_a_table_stands_in_place_of_the_one_before(tmp_path: Path) -> None:
    path = tmp_path / "benchmarks.md"
    path.write_text(RECORD.read_text(encoding="utf-8"), encoding="utf-8")
    for seconds in (1.25, 2.5):
        keep(table({"1 h, direct": {"mapping": [seconds, 1.0, 2.0]}}), path)
    text = path.read_text(encoding="utf-8")
    assert "| mapping | 2.50 (1.00) / 2 |" in text
    assert "1.25 (1.00)" not in text
    assert (
        text.rpartition("## Record")[2]
        == RECORD.read_text(encoding="utf-8").rpartition("## Record")[2]
    )


def test_the_stages_of_a_run_make_up_its_time(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    where_time_goes(tmp_path, (20.0,), measure, _ingest, record=False, ways=("direct",))
    lines = [line for line in capsys.readouterr().out.splitlines() if line.startswith("|")][2:]
    cells = {line.split(" | ")[0].strip("| "): line.split(" | ")[1].strip("| ") for line in lines}
    assert all(cells[stage] != "-" for stage in (*STAGES, PROCESSES, REST, TOTAL, BEFORE))
    seconds = {stage: float(cell.split()[0]) for stage, cell in cells.items()}
    whole = seconds.pop(TOTAL)
    del seconds[BEFORE]
    assert min(seconds.values()) >= 0.0
    assert sum(seconds.values()) == pytest.approx(whole, abs=0.01 * len(seconds))
