"""What a thousand logs at once cost beside their time: memory that stays as it was after the first
ones, and queries that answer.

That each ends where it belongs is in `test_inbox.py`.
"""

import statistics
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import psutil
import pytest

from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.workspace import Workspace
from tests.support.glider_runs import prepared
from tests.support.small_glider import NAME, channels, write_files, write_parquet
from tests.support.sweeps import QUICK, swept

#: Megabytes that may come beside those of the first logs.
_GROWTH = 30.0
#: Bytes that a process may keep at hand (`aerodb.tasks.workers.memory_cache`): less than in use, so that
#: this is full after the first logs.
_KEPT = 4_000_000


@dataclass
class Seen:
    """What was seen while a sweep lasted: flights stored, megabytes of this process and those it
    started, seconds of queries."""

    flights: list[int] = field(default_factory=list)
    megabytes: list[float] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)
    unanswered: list[Exception] = field(default_factory=list)

    def look(self, workspace: Workspace) -> None:
        begun = time.monotonic()
        with Catalogue.open(workspace.catalogue) as catalogue:
            catalogue.newest_flights(NAME, 10)
            self.flights.append(len(catalogue.flights(NAME)))
        self.seconds.append(time.monotonic() - begun)
        own = psutil.Process()
        held = 0
        for process in (own, *own.children(recursive=True)):
            try:
                held += process.memory_info().rss
            except psutil.NoSuchProcess:  # one that read a log, and has ended
                continue
        self.megabytes.append(held / 1e6)

    def between(self, first: float, last: float, of: int) -> float:
        """The median of the megabytes while between these shares of the logs were stored."""
        chosen = [
            mb
            for mb, flights in zip(self.megabytes, self.flights, strict=True)
            if first * of <= flights <= last * of
        ]
        return statistics.median(chosen)


@pytest.mark.campaign
def test_memory_stays_as_it_was_and_queries_answer(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    record_property: Callable[[str, object], None],
) -> None:
    monkeypatch.setattr("aerodb.tasks.workers.memory_cache._MAX_BYTES", _KEPT)
    workspace, number = (
        prepared(tmp_path / "w", write_files(tmp_path / "logs", 1)[0].parent),
        1000,
    )
    (workspace.root / "settings.toml").write_text(QUICK, encoding="utf-8")
    (workspace.inbox / NAME).mkdir()
    for k in range(number):
        write_parquet(
            workspace.inbox / NAME / f"flight{k}.parquet", channels(1000 + k, seconds=6.0)
        )
    seen, over = Seen(), threading.Event()

    def watch() -> None:
        while True:
            last = over.wait(0.1)  # one more query when all is stored
            try:
                seen.look(workspace)
            except Exception as error:
                seen.unanswered.append(error)
            if last:
                return

    watching = threading.Thread(target=watch)
    watching.start()
    try:
        document = swept(workspace)
    finally:
        over.set()
        watching.join()
    assert {entry["kind"] for entry in document["files"]} == {"stored"}
    assert seen.unanswered == []
    assert seen.flights == sorted(seen.flights)
    assert seen.flights[-1] == number
    early, late = seen.between(0.2, 0.4, number), seen.between(0.8, 1.0, number)
    told = {
        "early MB": early,
        "late MB": late,
        "median s": statistics.median(seen.seconds),
        "longest s": max(seen.seconds),
    }
    for name, value in told.items():
        record_property(name, round(value, 3))
    print(f"{number} logs, {len(seen.seconds)} queries: {told}")
    assert late - early < _GROWTH, told
