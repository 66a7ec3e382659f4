"""The record of `make bench`: one row of `docs/reference/benchmarks.md` per run, so that a loss of
speed is seen in the review of the change that brings it."""

import subprocess
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
RECORD = ROOT / "docs" / "reference" / "benchmarks.md"

#: Column of the record -> key of the figure that a benchmark gives.
COLUMNS = {
    "pyulog, 1 h [s]": "pyulog",
    "1 h direct": "hour",
    "memory": "hour memory",
    "1 h Prefect": "hour Prefect",
    "10 min direct": "ten minutes",
    "consistency, 1 h": "consistency",
    "reconstruction, uncompiled [s]": "uncompiled",
    "10 flights, finding [s]": "ten flights",
    "one flight more": "one more",
    "reconstruction, installed [s]": "installed",
    "simulation, one run": "one run",
    "simulation, 64 runs": "64 runs",
    "output error, ATTAS": "output error",
    "output error, 6 degrees [s]": "six degrees",
}


def append(figures: Mapping[str, float], path: Path = RECORD) -> str:
    """Append the figures (key -> value) of one run to the record, with date and commit; what was
    not measured is ``-``. Returns the row."""
    cells = [
        f"{datetime.now(UTC):%Y-%m-%d}",
        commit(),
        *(f"{figures[key]:.2f}" if key in figures else "-" for key in COLUMNS.values()),
    ]
    row = f"| {' | '.join(cells)} |"
    text = path.read_text(encoding="utf-8")
    path.write_text(text.rstrip("\n") + f"\n{row}\n", encoding="utf-8")
    return row


def commit() -> str:
    """The commit that runs, with ``+`` for changes that are not committed; ``-`` outside of a
    checkout."""

    def git(*words: str) -> str:
        done = subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True)
        return done.stdout.strip() if done.returncode == 0 else ""

    known = git("rev-parse", "--short", "HEAD")
    return (known + ("+" if git("status", "--porcelain", "-uno") else "")) if known else "-"
