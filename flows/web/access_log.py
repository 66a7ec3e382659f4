"""The access log: who asked for what, and what came of it; one JSON document a line.

It is bounded: files rotate, and requests that were refused at the door are written at most
`REFUSED` times a minute and counted beyond, so nobody pushes earlier lines out without a token.
"""

import json
import logging
import os
import threading
import time
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

LARGEST: Final = 10 << 20
FILES: Final = 5
REFUSED: Final = 120
_LONGEST: Final = 300
_logger: Final = logging.getLogger(__name__)


class AccessLog:
    """The log at `path`, which several processes may append to; older lines are in ``path.1`` to
    ``path.4``."""

    def __init__(self, path: Path) -> None:
        self._path, self._lock, self._descriptor = path, threading.Lock(), -1
        self._minute, self._refused, self._left_out = 0, 0, 0

    def write(self, known: bool, **entry: Any) -> None:
        """Append a line; a disk that refuses it stops no request.

        known : whether the request was admitted.
        """
        if not (known or self._may_refuse()):
            return
        at = datetime.now(UTC).isoformat(timespec="milliseconds")
        left_out, self._left_out = self._left_out, 0
        content = {"at_utc": at, **entry} | ({"left_out_before": left_out} if left_out else {})
        short = {
            name: value[:_LONGEST] if isinstance(value, str) else value
            for name, value in content.items()
        }
        line = json.dumps(short, ensure_ascii=True).encode("ascii") + b"\n"
        try:
            with self._lock:
                os.write(self._opened(), line)
        except OSError as error:
            _logger.warning("the access log cannot be written: %s", error.strerror)

    def _may_refuse(self) -> bool:
        minute = int(time.monotonic() // 60)
        if minute != self._minute:
            self._minute, self._refused = minute, 0
        self._refused += 1
        if self._refused > REFUSED:
            self._left_out += 1
        return self._refused <= REFUSED

    def _opened(self) -> int:
        """Return the descriptor of the file that is at the path now, after rotating a full one."""
        for _ in range(2):
            try:
                there = os.stat(self._path)
            except FileNotFoundError:
                there = None
            ours = os.fstat(self._descriptor) if self._descriptor >= 0 else None
            if there is not None and there.st_size >= LARGEST:
                self._rotate()
                continue
            if ours is None or there is None or ours.st_ino != there.st_ino:
                self._reopen()
            break
        return self._descriptor

    def _reopen(self) -> None:
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1
        flags = os.O_WRONLY | os.O_CREAT | os.O_APPEND
        self._descriptor = os.open(self._path, flags, 0o600)

    def _rotate(self) -> None:
        for number in range(FILES - 1, 0, -1):
            older = self._path if number == 1 else Path(f"{self._path}.{number - 1}")
            with suppress(FileNotFoundError):
                os.replace(older, f"{self._path}.{number}")
