"""Connections of the console: how many there are, and how long each may keep it waiting.

A connection waits for its client (the head of a request, the rest of a body), works, or sends. One
that waits too long is closed. When there are as many as the descriptors allow, a further one closes
the one that has waited longest, so half-sent requests never keep others out.
"""

import asyncio
import functools
from typing import Any, Final

from uvicorn.protocols.http.h11_impl import H11Protocol

from aerodb.flows.web.bodies import is_upload

try:
    import resource
except ImportError:  # a system without limits of descriptors
    resource = None  # type: ignore[assignment]

#: Longest time [s] for the head of a request, and for its body (at most 64 kB).
HEAD_SECONDS: Final = 10.0
BODY_SECONDS: Final = 15.0
#: Slowest reader of an answer, and sender of a log [B/s]: a fifth of a modem's speed.
_LEAST_RATE: Final = 1000.0
#: Descriptors kept for the catalogue, files and child processes.
_KEPT: Final = 256
_MOST: Final = 2000


def raise_descriptor_limit() -> None:
    """Raise the soft limit of open descriptors to what the connections need, if the hard one
    allows it."""
    if resource is None:
        return
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = _MOST + _KEPT
    if hard != resource.RLIM_INFINITY:
        wanted = min(wanted, hard)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))


def most_connections() -> int:
    """Return how many connections the limit of open descriptors leaves room for."""
    if resource is None:
        return _MOST
    soft, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft == resource.RLIM_INFINITY:
        return _MOST
    return max(min(_MOST, soft - _KEPT), soft // 2)


class Connection(H11Protocol):
    """A connection whose client must make progress.

    waiting : those of the server that wait for their client, the longest first. most : the largest
    number of connections.
    """

    def __init__(
        self, *arguments: Any, waiting: dict["Connection", None], most: int, **named: Any
    ) -> None:
        super().__init__(*arguments, **named)
        self._waiting, self._most = waiting, most
        self._awaited: tuple[str, object] = ("", None)
        self._timer: asyncio.TimerHandle | None = None
        self._unsent = self._received = 0

    def connection_made(self, transport: Any) -> None:
        """Take the connection; the one that has waited longest gives way when there are too
        many."""
        super().connection_made(transport)
        self._follow()
        if len(self.connections) > self._most:
            next(iter(self._waiting)).abandon()

    def data_received(self, data: bytes) -> None:
        """Take what the client sent; its time is for a whole head or body, however many parts."""
        self._received += len(data)
        super().data_received(data)
        self._follow()

    def on_response_complete(self) -> None:
        """Wait for the next request once an answer is complete."""
        super().on_response_complete()
        self._follow()

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget the connection."""
        self._stop()
        super().connection_lost(exc)

    def abandon(self) -> None:
        """Close the connection at once."""
        self._stop()
        self.transport.abort()

    def _stop(self) -> None:
        self._waiting.pop(self, None)
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _follow(self) -> None:
        """Start the time of what the connection waits for now, unless it waited for it before."""
        if self.transport.is_closing() and not self.transport.get_write_buffer_size():
            return
        answering = self.cycle is not None and not self.cycle.response_complete
        phase = "head" if not answering else "body" if self.cycle.more_body else "work"
        if (phase, self.cycle) == self._awaited:
            return
        self._awaited = (phase, self.cycle)
        self._stop()
        if phase == "work":
            return
        self._received = 0
        self._unsent = self.transport.get_write_buffer_size()
        if not self._unsent:
            self._waiting[self] = None
        seconds = BODY_SECONDS if phase == "body" else HEAD_SECONDS
        self._timer = self.loop.call_later(seconds, self._late)

    def _late(self) -> None:
        """Close the connection, unless the client is still reading an answer or sending a log."""
        if self._awaited[0] == "body" and is_upload(self.scope) and self._is_sending():
            self._received = 0
            self._waiting.pop(self, None)
            self._waiting[self] = None  # it made progress: others have waited longer
            self._timer = self.loop.call_later(BODY_SECONDS, self._late)
            return
        unsent = self.transport.get_write_buffer_size()
        sent, self._unsent = self._unsent - unsent, unsent
        if unsent and sent >= _LEAST_RATE * HEAD_SECONDS:
            pass
        elif sent and not unsent and not self.transport.is_closing():
            self._waiting[self] = None  # read to its end: now for the next request
        else:
            self.abandon()
            return
        self._timer = self.loop.call_later(HEAD_SECONDS, self._late)

    def _is_sending(self) -> bool:
        """Whether the client sends as fast as it must, or is being held back."""
        return self._received >= _LEAST_RATE * BODY_SECONDS or self.flow.read_paused


def connections(most: int) -> Any:
    """Return what makes the connections of one server, at most `most` at a time."""
    waiting: dict[Connection, None] = {}
    return functools.partial(Connection, waiting=waiting, most=most)
