"""`python -m tests.bench --profile`: where the time of a per-flight run goes, as a table of stages
(`tests.bench.timers`), kept in docs/reference/benchmarks.md.

The run is that of ``make bench --only flight``. Each is a process of its own, after what that
bench does not count either; how long this takes is a row of its own.
"""

import os
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

from tests.bench.generated_log import write_log
from tests.bench.record import RECORD, commit
from tests.bench.timers import PROCESSES, REST, STAGES, TOTAL

#: Where the table stands in the record.
BEGIN: Final = "## Where the time goes\n"
END: Final = "## Record\n"
#: Stage of what happens before the run.
BEFORE: Final = "before: imports, first worker, Prefect's server"
ROWS: Final = (*STAGES, PROCESSES, REST, TOTAL, BEFORE)

Measured = Mapping[str, Sequence[float]]  # stage -> seconds, processor seconds, calls
Measure = Callable[[str, str], dict[str, Any]]

_TIMED: Final = """
import time
before = time.perf_counter(), time.process_time()
from tests.bench import timers
timers.install()
{imports}
timers.TIMERS.rows.clear()
timers.TIMERS.elsewhere = 0.0
before = time.perf_counter() - before[0], time.process_time() - before[1]
"""
_ROWS: Final = """
began = time.perf_counter(), time.process_time()
{body}
spent = time.perf_counter() - began[0], time.process_time() - began[1]
answer = {{**timers.whole_run(*spent), {first!r}: [*before, 1]}}
"""


def where_time_goes(
    folder: Path,
    seconds: Sequence[float],
    measure: Measure,
    ingest: Callable[[Path, Path, str], tuple[str, str]],
    record: bool,
    ways: Sequence[str] = ("direct", "auto"),
) -> None:
    """Print the table for logs of these lengths [s], longest first, directly and under Prefect; put
    it into the record.

    ingest : imports and body of a run of a log in a workspace.
    """
    columns: dict[str, Measured] = {}
    for length in sorted(seconds, reverse=True):
        log = folder / f"profile-{length:g}.ulg"
        write_log(log, length)
        for how in ways:
            name = "direct" if how == "direct" else "Prefect"
            workspace = folder / f"profile-{length:g}-{how}"
            imports, body = ingest(workspace, log, how)
            done = measure(_TIMED.format(imports=imports), _ROWS.format(body=body, first=BEFORE))
            columns[f"{_length(length)}, {name}"] = done["answer"]
        log.unlink()
    text = table(columns)
    print(text)
    if record:
        keep(text)


def _length(seconds: float) -> str:
    return f"{seconds / 3600:g} h" if seconds >= 3600 else f"{seconds / 60:g} min"


def table(columns: Mapping[str, Measured]) -> str:
    """A Markdown table with a row per stage and, for each run, seconds, processor seconds and
    calls: ``1.52 (1.40) / 3``."""
    lines = [f"| stage | {' | '.join(columns)} |", "|---|" + "---|" * len(columns)]
    for stage in ROWS:
        cells = [
            _cell(measured[stage]) if stage in measured else "-" for measured in columns.values()
        ]
        lines.append(f"| {stage} | {' | '.join(cells)} |")
    return "\n".join(lines)


def _cell(row: Sequence[float]) -> str:
    seconds, processor, calls = row
    return f"{seconds:.2f} ({processor:.2f}) / {calls:.0f}"


def keep(text: str, path: Path = RECORD) -> None:
    """Put a table in place of the one that the record has."""
    before, _, rest = path.read_text(encoding="utf-8").partition(BEGIN)
    _, _, after = rest.partition(END)
    load = os.getloadavg()[0]
    said = (
        f"\n{datetime.now(UTC):%Y-%m-%d}, {commit()}, {os.cpu_count()} cores, load {load:.1f} at the"
        " end. Each cell: seconds (processor seconds) / calls.\n\n"
    )
    path.write_text(f"{before}{BEGIN}{said}{text}\n\n{END}{after}", encoding="utf-8")
