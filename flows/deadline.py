"""The longest that a whole run may take: what hangs must not keep the next night from its work."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from aerodb.errors import AeroError


class OutOfTimeError(AeroError, TimeoutError):
    """A run has taken longer than it may. What it stored stays, and the same run again goes on from
    there."""


class _TimeUp(BaseException):
    """Ends a run from within: nothing that deals with the errors of a log or of a step may take it
    for one."""


@contextmanager
def at_most(seconds: float, where: str) -> Iterator[None]:
    """Ends what is done within, once it has lasted for so many `seconds`; OutOfTimeError then.

    Only the main thread of a process can be interrupted so, and only where the system has a timer
    for it; elsewhere nothing is limited. Compiled code comes to its end first.
    """
    if (
        not hasattr(signal, "setitimer")
        or threading.current_thread() is not threading.main_thread()
    ):
        yield
        return

    def end(*_: Any) -> None:
        raise _TimeUp(f"took longer than {seconds:g} s")

    before = signal.signal(signal.SIGALRM, end)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    except _TimeUp as up:
        remedy = (
            "run it again: it goes on where it was; or set [limits] run in the workspace's settings"
        )
        raise OutOfTimeError(str(up), where, remedy) from up
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
