"""A process for what must not harm this one: its environment, its limits, and how it ended."""

import ctypes
import math
import os
import resource
import signal
import sys
from contextlib import suppress
from pathlib import Path
from typing import Final

from aerodb.storage.limits import Limits

_DEATH_SIGNAL: Final = 1  # PR_SET_PDEATHSIG of prctl(2)
#: Environment variables passed on; a confined process does not get any others.
_PASSED: Final = (
    "PATH",
    "HOME",
    "LANG",
    "LC_ALL",
    "TMPDIR",
    "TZ",
    "NUMBA_CACHE_DIR",
    "LD_LIBRARY_PATH",
    "SYSTEMROOT",
    "PYTHONPATH",
)


def confined_environment() -> dict[str, str]:
    """Return the environment of a confined process: no tokens or passwords, one BLAS thread."""
    own = {"OPENBLAS_NUM_THREADS": "1", "PYTHONUTF8": "1"}
    return {name: os.environ[name] for name in _PASSED if name in os.environ} | own


def subordinate() -> None:
    """On Linux, let this process end with the thread that started it, and be the first to go where
    the machine's memory runs out."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_DEATH_SIGNAL, signal.SIGKILL)
        with suppress(OSError):
            Path("/proc/self/oom_score_adj").write_text("1000", encoding="ascii")


def confine(limits: Limits) -> None:
    """Set the limits of this process; the memory limit is in addition to what code and libraries
    already use. On Linux it also ends with the thread that started it."""
    subordinate()
    most = _address_space() + limits.memory
    resource.setrlimit(resource.RLIMIT_AS, (most, most))
    seconds = max(int(limits.processor), 1)
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 5))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def confine_next(limits: Limits) -> None:
    """Set the limits of the next job of a process that does one after another, in addition to the
    memory that it has and the processor time that it has spent.

    The memory counted is what the process may write to (RLIMIT_DATA): threads reserve address space
    that they never use, and stored files are mapped.
    """
    _, hard = resource.getrlimit(resource.RLIMIT_DATA)
    resource.setrlimit(resource.RLIMIT_DATA, (_at_most(_written() + limits.memory, hard), hard))
    usage = resource.getrusage(resource.RUSAGE_SELF)
    spent = math.ceil(usage.ru_utime + usage.ru_stime)
    _, hard = resource.getrlimit(resource.RLIMIT_CPU)
    seconds = max(int(limits.processor), 1)
    resource.setrlimit(resource.RLIMIT_CPU, (_at_most(spent + seconds, hard), hard))


def lift_memory_limit() -> None:
    """Let this process have memory again, so that it can say that it had too little."""
    _, hard = resource.getrlimit(resource.RLIMIT_DATA)
    resource.setrlimit(resource.RLIMIT_DATA, (hard, hard))


def _at_most(limit: int, hard: int) -> int:
    return limit if hard == resource.RLIM_INFINITY else min(limit, hard)


def _written() -> int:
    """Memory of this process that it may write to [bytes], if the system tells."""
    try:
        status = Path("/proc/self/status").read_text(encoding="ascii")
        return 1024 * int(status.partition("VmData:")[2].split(maxsplit=1)[0])
    except (OSError, IndexError):
        return 2_000_000_000  # what code and libraries take on Linux


def _address_space() -> int:
    """Address space already used by this process [bytes], if the system tells."""
    try:
        return (
            int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
            * resource.getpagesize()
        )
    except OSError:
        return 2_000_000_000  # what code and libraries take on Linux


def how_it_ended(code: int, late: bool, limits: Limits, what: str, program: str) -> str:
    """Return why a confined process gave no answer.

    code : exit code, negative for a signal. late : whether it was stopped after `limits.wall`.
    what : what it did ("its parsing"). program : what ran there ("the reader").
    """
    if late:
        return f"{what} was stopped after {limits.wall:g} s"
    if code >= 0:
        return f"{what} ended {program} (exit code {code})"
    if -code == signal.SIGXCPU:
        return f"{what} was stopped after {limits.processor:g} s of processor time"
    if -code == signal.SIGKILL:
        return f"{what} was killed by the system, most likely because memory ran out"
    return f"{what} crashed {program} ({signal.Signals(-code).name})"
