"""A process for what must not harm this one: its limits, and how it ended."""

import ctypes
import math
import resource
import signal
import sys
from contextlib import suppress
from pathlib import Path
from typing import Final

from aerodb.storage.landlock import landlock_version
from aerodb.storage.limits import Limits
from aerodb.storage.no_connections import can_refuse_connections

_DEATH_SIGNAL: Final = 1  # PR_SET_PDEATHSIG of prctl(2)


def subordinate() -> None:
    """Let this process leave interrupts to the one that started it, and write no image of its
    memory; on Linux, end with the thread that started it, and be the first to go where the
    machine's memory runs out."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_DEATH_SIGNAL, signal.SIGKILL)
        with suppress(OSError):
            Path("/proc/self/oom_score_adj").write_text("1000", encoding="ascii")


def confine(limits: Limits, *, for_good: bool = False) -> None:
    """Set the limits of the next job of this process, in addition to the memory that it has and the
    processor time that it has spent; `for_good`, so that it cannot lift them again.

    Memory [bytes], processor time [s]. The memory counted is what the process may write to
    (RLIMIT_DATA): threads reserve address space that they never use, and stored files are mapped.
    """
    _limit(resource.RLIMIT_DATA, _taken("VmData:") + limits.memory, for_good)
    usage = resource.getrusage(resource.RUSAGE_SELF)
    spent = math.ceil(usage.ru_utime + usage.ru_stime)
    _limit(resource.RLIMIT_CPU, spent + max(int(limits.processor), 1), for_good, grace=5)


def _limit(kind: int, most: int, for_good: bool, grace: int = 0) -> None:
    """Set a limit; `for_good`, also the hard one, which is `grace` above it."""
    _, hard = resource.getrlimit(kind)
    unlimited = hard == resource.RLIM_INFINITY
    if for_good:
        hard = most + grace if unlimited else min(most + grace, hard)
        unlimited = False
    refused = () if sys.platform == "linux" else (ValueError, OSError)  # the limit does not hold
    with suppress(*refused):
        resource.setrlimit(kind, (most if unlimited else min(most, hard), hard))


def reader_reach() -> str:
    """Return what the process that reads a log could reach beside its log on this system; empty
    where the system keeps it from all."""
    reached = [
        *([] if landlock_version() else ["files that its user may read (no Landlock)"]),
        *([] if can_refuse_connections() else ["connections (no seccomp)"]),
    ]
    return " and ".join(reached)


def environment_memory() -> float:
    """Return the memory that the environment (``ulimit``) leaves this process and those that it
    starts in addition to code [bytes]; infinite without a limit."""
    space, data = (
        resource.getrlimit(resource.RLIMIT_AS)[0],
        resource.getrlimit(resource.RLIMIT_DATA)[1],
    )
    left = [(space, "VmSize:"), (data, "VmData:")]
    return min(
        (most - _taken(what) for most, what in left if most != resource.RLIM_INFINITY),
        default=math.inf,
    )


def lift_memory_limit() -> None:
    """Let this process have memory again, so that it can say that it had too little (a MemoryError
    of what `confine` limits)."""
    _, hard = resource.getrlimit(resource.RLIMIT_DATA)
    resource.setrlimit(resource.RLIMIT_DATA, (hard, hard))


def _taken(what: str) -> int:
    """Memory of this process [bytes], if the system tells: all (``VmSize:``), or what it may write
    to (``VmData:``)."""
    try:
        status = Path("/proc/self/status").read_text(encoding="ascii")
        return 1024 * int(status.partition(what)[2].split(maxsplit=1)[0])
    except (OSError, IndexError):
        return 2_000_000_000  # what code and libraries take on Linux


def how_it_ended(code: int, late: bool, limits: Limits, what: str, program: str) -> str:
    """Return why a confined process gave no answer, with times [s] of its limits.

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
