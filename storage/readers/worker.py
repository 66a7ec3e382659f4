"""The process that parses logs: ``python -m aerodb.storage.readers.worker``.

It reads one job per line (JSON) from standard input, forks a child for it, and answers with one
line. The child gets resource limits, reads the log and writes its topics in the format of the
store; the worker itself never reads a log and supervises the child. The modules that read a kind of
log are imported and compiled once, before the first job of that kind or at the start for the
suffixes given as arguments, so a child costs only a fork. When the process that started the worker
dies, the worker and the child die too.
"""

import json
import os
import select
import signal
import sys
import tempfile
import time
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, Final, Literal, NoReturn

import numpy as np

from aerodb.errors import InputError, StoreError
from aerodb.recording import Topic
from aerodb.storage.confinement import confine, how_it_ended
from aerodb.storage.disk_errors import remove, translated_disk_errors
from aerodb.storage.files import write_topics
from aerodb.storage.limits import Limits
from aerodb.storage.readers.any_format import (
    DATAFLASH_SUFFIX,
    ULOG_SUFFIXES,
    import_reader,
    read_log,
)
from aerodb.storage.writers import write_ulog

_ANSWER_BYTES: Final = 1 << 20
_LATER: Final = (
    "check the log at its source, or raise [limits] in the workspace settings and ingest it again"
)


def main() -> None:
    """Serve jobs until standard input ends."""
    # Output of libraries must not be mixed with the answers.
    answers = os.fdopen(os.dup(1), "w", encoding="ascii")
    os.dup2(2, 1)
    for suffix in sys.argv[1:]:
        prepare_reader(suffix)
    while line := os.read(0, 1 << 16):
        while not line.endswith(b"\n") and (more := os.read(0, 1 << 16)):
            line += more
        answers.write(json.dumps(answer(json.loads(line))) + "\n")
        answers.flush()


@cache
def prepare_reader(suffix: str) -> None:
    """Import the reader of logs with this suffix, once for all children; for ULog and DataFlash,
    read a log of our own, which loads the compiled loops."""
    import_reader(suffix)
    if suffix == DATAFLASH_SUFFIX:
        from aerodb.storage.readers.dataflash import framed

        framed(np.zeros(4, dtype=np.uint8))
    if suffix not in ULOG_SUFFIXES:
        return
    with tempfile.TemporaryDirectory() as folder:
        log, time_ = Path(folder) / "own.ulg", np.arange(1, 50, dtype=np.float64) * 0.02
        write_ulog(log, [Topic("own", time_, {"x": time_, "y": time_.astype(np.float32)})])
        write_topics(Path(folder) / "topics", read_log(log))


def answer(job: dict[str, Any]) -> dict[str, str]:
    """Run a job ``{log, folder, limits}`` in a child, and return its result: ``done``, or
    ``refused`` or ``store`` with the texts of an error."""
    limits = Limits(**job["limits"])
    prepare_reader(Path(job["log"]).suffix.lower())
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reading)
        _parse(Path(job["log"]), Path(job["folder"]), limits, writing)
    os.close(writing)
    reply, end = _listen(reading, limits.wall)
    os.close(reading)
    if not reply:
        os.kill(child, signal.SIGKILL)
    _, status = os.waitpid(child, 0)
    if end == "master":  # nobody waits for the answer any more
        remove(Path(job["folder"]))
        os._exit(0)
    if reply:
        document: dict[str, str] = json.loads(reply)
        return document
    code = os.waitstatus_to_exitcode(status)
    ended = how_it_ended(code, end == "late", limits, "its parsing", "the reader")
    return _refusal(ended, job["log"], _LATER)


def _listen(reading: int, seconds: float) -> tuple[bytes, Literal["", "late", "master"]]:
    """Output of the child until it ends; or a note that it was still running after `seconds`, or
    that the worker's parent died."""
    until, received = time.monotonic() + seconds, b""
    while True:
        ready, _, _ = select.select([reading, 0], [], [], max(until - time.monotonic(), 0.0))
        if not ready:
            return b"", "late"
        if 0 in ready:
            return b"", "master"
        part = os.read(reading, 1 << 16)
        received += part
        if not part or len(received) > _ANSWER_BYTES:
            return received, ""


def _refusal(what: str, where: str, remedy: str, kind: str = "refused") -> dict[str, str]:
    return {"ended": kind, "what": what, "where": where, "remedy": remedy}


def _parse(log: Path, folder: Path, limits: Limits, writing: int) -> NoReturn:
    """The child: read the log under its limits, write its topics, report the result, and exit
    without returning."""
    try:
        confine(limits)
        reply = _read(log, folder, limits)
        os.write(writing, json.dumps(reply).encode("ascii"))
    finally:
        os._exit(0)


def _read(log: Path, folder: Path, limits: Limits) -> dict[str, str]:
    try:
        # Stored data do not depend on the location of the log.
        recording = replace(read_log(log), source=log.name)
        with translated_disk_errors(folder):
            write_topics(folder, recording)
    except StoreError as error:
        return _refusal(error.what, error.where, error.remedy, "store")
    except InputError as error:
        return _refusal(error.what, error.where, error.remedy)
    except MemoryError:
        return _refusal(
            f"its parsing needs more than {limits.memory / 1e6:.0f} MB of memory", str(log), _LATER
        )
    except RecursionError:
        return _refusal(
            "its content is nested too deeply",
            str(log),
            "no recorder writes such a log: check its source",
        )
    # A library fails on bytes that it does not expect: only this log cannot be used.
    except Exception as error:
        what = f"its parsing failed: {type(error).__name__}: {str(error)[:200]}"
        return _refusal(what, str(log), "report it, with the log, as a bug of aerodb")
    return {"ended": "done"}


if __name__ == "__main__":
    main()
