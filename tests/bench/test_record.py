"""Tests of the benchmarks' record."""

from pathlib import Path

from tests.bench.record import COLUMNS, RECORD, append


def test_a_row_has_a_cell_for_every_column_of_the_record(tmp_path: Path) -> None:
    path = tmp_path / "benchmarks.md"
    path.write_text(RECORD.read_text(encoding="utf-8"), encoding="utf-8")
    row = append({"hour": 1.987, "one more": 1.3}, path)
    lines = path.read_text(encoding="utf-8").splitlines()
    head = next(line for line in lines if line.startswith("| date"))
    assert head == f"| date | commit | {' | '.join(COLUMNS)} |"
    assert lines[-1] == row
    cells = dict(zip(head.split(" | ")[2:], row.split(" | ")[2:], strict=True))
    assert cells["1 h direct"] == "1.99"
    assert cells["memory"] == "-"
