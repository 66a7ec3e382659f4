"""Seconds and calls of the stages of a run, in the run's own process and in its workers.

A stage is a few functions of the product. Each function is replaced, wherever it is named, by one
that takes the time; a stage within a stage counts for the inner one alone.
"""

import functools
import importlib
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

#: Stage -> functions (module:name) that it consists of.
STAGES: Final[Mapping[str, tuple[str, ...]]] = {
    "reading: file to arrays": ("aerodb.storage.readers.any_format:read_log",),
    "reading: topics to the store": ("aerodb.storage.files.flights:write_topics",),
    "mapping": (
        "aerodb.logs.mapping:choose_mapping",
        "aerodb.logs.usable_flight:usable_flight",
    ),
    "conditioning and checks of the log": (
        "aerodb.tasks.steps.conditioning:examined",
        "aerodb.conditioning.duplicates:fingerprint",
    ),
    "reconstruction: records": ("aerodb.consistency.output_error.estimation:decimated_records",),
    "reconstruction: search": ("aerodb.consistency.output_error.gauss_newton:search",),
    "reconstruction: covariances": ("aerodb.consistency.output_error.reconstruction:_covariances",),
    "reconstruction: position of the vanes": (
        "aerodb.consistency.output_error.installation:vane_position",
    ),
    "reconstruction: gusts and noise": ("aerodb.consistency.smoother.smoothing:intensities_of",),
    "reconstruction: whole flight": (
        "aerodb.consistency.output_error.estimation:reconstruct_flight",
    ),
    "reconstruction: smoothing": ("aerodb.consistency.corrected:_smoothed",),
    "reconstruction: all else": ("aerodb.consistency.whole_flight:make_consistent",),
    "coefficients": (
        "aerodb.coefficients.total:total_coefficients",
        "aerodb.coefficients.comparison:compare",
    ),
    "checks against the database": ("aerodb.suspicions.database:against_database",),
    "store: files": (
        "aerodb.storage.files.flights:write_flight",
        "aerodb.storage.files.flights:write_results",
        "aerodb.storage.files.flights:read_flight",
        "aerodb.storage.files.flights:read_results",
        "aerodb.storage.files.flights:read_recording",
        "aerodb.storage.catalogue.file_identity:measured",
        "aerodb.storage.workspace:put_in_place",
    ),
    "store: catalogue": (
        "aerodb.storage.catalogue.database:Database.reading",
        "aerodb.storage.catalogue.database:Database.writing",
    ),
}
#: Stage of what a worker is asked and answers, beside what it does: forks, pickles, waiting.
PROCESSES: Final = "processes: start and exchange"
#: Stage of what none of the others is.
REST: Final = "orchestration and all else"
TOTAL: Final = "whole run"

Row = list[float]  # seconds, processor seconds, calls


@dataclass
class Timers:
    """Stage -> seconds, processor seconds of the process, and calls; of one thread at a time, the
    owner, which waits for the others that it starts. elsewhere : processor seconds of workers."""

    rows: dict[str, Row]
    owner: int
    open: list[Row]
    elsewhere: float = 0.0

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Context whose time counts for a stage, without that of stages within it."""
        if threading.get_ident() != self.owner and self.open:
            yield  # a thread that the owner waits for
            return
        self.owner = threading.get_ident()
        within: Row = [0.0, 0.0, 0.0]
        self.open.append(within)
        wall, processor = time.perf_counter(), time.process_time()
        try:
            yield
        finally:
            spent = [time.perf_counter() - wall, time.process_time() - processor]
            self.open.pop()
            self.add(name, [spent[0] - within[0], spent[1] - within[1], 1.0])
            if self.open:
                self.open[-1][0] += spent[0]
                self.open[-1][1] += spent[1]

    def add(self, name: str, more: Row) -> None:
        """Add seconds, processor seconds and calls to a stage."""
        row = self.rows.setdefault(name, [0.0, 0.0, 0.0])
        row[:] = [a + b for a, b in zip(row, more, strict=True)]


TIMERS: Final = Timers({}, threading.get_ident(), [])
_installed: Final[set[str]] = set()


def install() -> None:
    """Replace the functions of the stages in this process, and what its workers are given."""
    from aerodb.tasks.workers import beginning, parsing, pool

    for place in (each for places in STAGES.values() for each in places):
        importlib.import_module(place.partition(":")[0])
    _take_times()
    plain_environment, plain_done = beginning.confined_environment, pool.done

    def environment() -> dict[str, str]:  # workers import this module too
        return plain_environment() | {"PYTHONPATH": str(Path(__file__).resolve().parents[2])}

    def done(job: pool.Job) -> Any:
        with TIMERS.stage(PROCESSES):
            timed = replace(job, function=in_worker, arguments=(job.function, job.arguments))
            answer, rows, inside = plain_done(timed)
            for name, row in rows.items():
                TIMERS.add(name, row)
                TIMERS.elsewhere += row[1]
            TIMERS.open[-1][0] += inside
        return answer

    beginning.confined_environment = environment
    pool.done = parsing.done = done


def whole_run(seconds: float, processor: float) -> dict[str, Row]:
    """All rows of a run that took so many seconds, and processor seconds in this process: with
    `TOTAL`, and with what no stage has in `REST`."""
    total = [seconds, processor + TIMERS.elsewhere, 1.0]
    TIMERS.rows.setdefault(REST, [0.0, 0.0, 1.0])
    known = [sum(row[k] for name, row in TIMERS.rows.items() if name != REST) for k in (0, 1)]
    rest = [total[0] - known[0], total[1] - known[1], 1.0]
    return {**TIMERS.rows, REST: rest, TOTAL: total}


def in_worker(
    function: Callable[..., Any], arguments: tuple[Any, ...]
) -> tuple[Any, dict[str, Row], float]:
    """Do a job of a worker with the timers; its result, their rows, and seconds in all."""
    wall = time.perf_counter()
    _take_times()
    TIMERS.rows.clear()
    TIMERS.open.clear()
    with TIMERS.stage(REST):
        result = function(*arguments)
    return result, dict(TIMERS.rows), time.perf_counter() - wall


def _take_times() -> None:
    """Replace the functions of the stages whose modules this process has imported."""
    for stage, places in STAGES.items():
        for place in places:
            if place not in _installed and place.partition(":")[0] in sys.modules:
                _installed.add(place)
                _replace(stage, place)


def _replace(stage: str, place: str) -> None:
    """Replace a function by one that takes the time of a stage, in every module that names it."""
    module, _, name = place.partition(":")
    owner, _, attribute = name.rpartition(".")
    holder: Any = sys.modules[module]
    holder = getattr(holder, owner) if owner else holder
    plain = getattr(holder, attribute)

    @functools.wraps(plain)
    def timed(*args: Any, **keywords: Any) -> Any:
        with TIMERS.stage(stage):
            return plain(*args, **keywords)

    @functools.wraps(plain)
    @contextmanager
    def timed_transaction(*args: Any, **keywords: Any) -> Iterator[Any]:
        with TIMERS.stage(stage), plain(*args, **keywords) as connection:
            yield connection

    new = timed_transaction if owner else timed
    setattr(holder, attribute, new)
    for other in list(sys.modules.values()):
        if getattr(other, "__name__", "").startswith("aerodb"):
            for key in [key for key, value in vars(other).items() if value is plain]:
                setattr(other, key, new)
