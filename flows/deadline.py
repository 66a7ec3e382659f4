"""Time limit of a whole run, so that a run that hangs does not block the next one."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from aerodb.errors import AeroError


class OutOfTimeError(AeroError, TimeoutError):
    """A run exceeded its time limit.

    Its results stay stored, and the same run continues from them when it is started again.
    """


class _TimeUp(BaseException):
    """Ends a run from within; not an Exception, so that no error handling of a log or step catches
    it."""


@contextmanager
def at_most(seconds: float, where: str) -> Iterator[None]:
    """End the enclosed code after `seconds` with OutOfTimeError.

    Works only in the main thread of a process, and only if the system has an interval timer; there
    is no limit otherwise. Compiled code runs to its end first.
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
        remedy = "run it again: it resumes where it stopped; or raise [limits] run in settings.toml"
        raise OutOfTimeError(str(up), where, remedy) from up
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
