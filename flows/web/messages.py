"""What the console says on stderr, so that nobody can fill a disk with it: a traceback once for
each place, and a bounded number of lines a minute."""

import logging
import time
from typing import Any, Final

#: Lines a minute, and the longest one; tracebacks that are kept in mind.
LINES: Final = 30
_LONGEST: Final = 400
_PLACES: Final = 200
_LONGEST_TRACEBACK: Final = 8000


class Sparing(logging.StreamHandler[Any]):
    """A handler of log records that writes at most `LINES` of them a minute, and how many it left
    out."""

    def __init__(self) -> None:
        super().__init__()
        self._minute, self._written, self._left_out = 0, 0, 0
        self._places: set[tuple[str, str, int]] = set()

    def emit(self, record: logging.LogRecord) -> None:
        """Write a record, unless this minute has had enough."""
        minute = int(time.monotonic() // 60)
        if minute != self._minute:
            self._minute, self._written = minute, 0
        if self._written >= LINES:
            self._left_out += 1
            return
        self._written += 1
        super().emit(record)

    def format(self, record: logging.LogRecord) -> str:
        """Return the record as one line; the first error of a place has its traceback."""
        text = " ".join(record.getMessage().split())[:_LONGEST]
        error = record.exc_info[1] if record.exc_info else None
        if error is not None:
            text = f"{text}: {type(error).__name__}: {' '.join(str(error).split())}"[:_LONGEST]
            place = _place_of(error)
            if place not in self._places and len(self._places) < _PLACES:
                self._places.add(place)
                trace = logging.Formatter().formatException(
                    (type(error), error, error.__traceback__)
                )
                text = f"{text}\n{trace[-_LONGEST_TRACEBACK:]}"
        left_out, self._left_out = self._left_out, 0
        further = f"aerodb web: {left_out} further messages were left out\n" if left_out else ""
        return f"{further}aerodb web: {text}"

    def handleError(self, record: logging.LogRecord) -> None:
        """A message that cannot be written (a closed terminal, a full disk) stops nothing."""


def _place_of(error: BaseException) -> tuple[str, str, int]:
    trace = error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    where = ("", 0) if trace is None else (trace.tb_frame.f_code.co_filename, trace.tb_lineno)
    return (type(error).__name__, *where)
