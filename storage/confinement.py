"""A process for what must not harm this one: its environment, its limits, and how it ended."""

import ctypes
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


def confine(limits: Limits) -> None:
    """Set the limits of this process; the memory limit is in addition to what code and libraries
    already use. On Linux it also ends with the thread that started it."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_DEATH_SIGNAL, signal.SIGKILL)
        with suppress(OSError):  # where memory runs out all the same, this process goes first
            Path("/proc/self/oom_score_adj").write_text("1000", encoding="ascii")
    most = _address_space() + limits.memory
    resource.setrlimit(resource.RLIMIT_AS, (most, most))
    seconds = max(int(limits.processor), 1)
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 5))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    signal.signal(signal.SIGINT, signal.SIG_IGN)


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
