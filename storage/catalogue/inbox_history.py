"""Inbox history: attempts and outcomes for each file of the inbox. The files themselves are handled
by `aerodb.storage.inbox.folders`."""

from collections.abc import Iterable

import sqlalchemy as sa

from aerodb.storage import encoding as enc
from aerodb.storage.catalogue import schema as s
from aerodb.storage.catalogue.ledger import Ledger, in_parts
from aerodb.storage.catalogue.rows import InboxEvent, InboxKind

ENDINGS: tuple[InboxKind, ...] = ("stored", "duplicate", "quarantined")


class InboxHistory(Ledger):
    """Catalogue queries about the inbox history."""

    def add_inbox_events(self, events: Iterable[InboxEvent]) -> None:
        """Add events of files (table `inbox_events`; sizes [bytes], times [ns]). An outcome that a
        file has already is not added again."""
        with self._database.writing() as connection:
            for event in events:
                if event.kind in ENDINGS and self._last_kind(connection, event) == event.kind:
                    continue
                values = {
                    "path": enc.plain_text(event.path),
                    "vehicle": enc.plain_text(event.vehicle),
                    "size": event.size,
                    "mtime_ns": event.mtime_ns,
                    "kind": event.kind,
                    "sha256": event.sha256,
                    "reason": enc.plain_text(event.reason),
                    "run": event.run,
                    "at_utc": enc.time_text(enc.now()),
                }
                connection.execute(sa.insert(s.inbox_events).values(values))

    @staticmethod
    def _last_kind(connection: sa.Connection, event: InboxEvent) -> str | None:
        c = s.inbox_events.c
        same = (
            (c.path == enc.plain_text(event.path))
            & (c.size == event.size)
            & (c.mtime_ns == event.mtime_ns)
        )
        ended = same & c.kind.in_(ENDINGS) & (c.sha256 == event.sha256)
        return connection.execute(
            sa.select(c.kind).where(ended).order_by(c.sequence.desc()).limit(1)
        ).scalar()

    def inbox_attempts(self, paths: Iterable[str]) -> dict[tuple[str, int, int], tuple[int, str]]:
        """Return (path, size [bytes], mtime_ns) -> number of attempts since the last outcome, and
        the last error.

        A failure without a reason cancels one attempt: the file was not at fault.
        """
        c = s.inbox_events.c
        attempts: dict[tuple[str, int, int], tuple[int, str]] = {}
        with self._database.reading() as connection:
            for part in in_parts({enc.plain_text(path) for path in paths}):
                query = (
                    sa.select(c.path, c.size, c.mtime_ns, c.kind, c.reason)
                    .where(c.path.in_(part))
                    .order_by(c.sequence)
                )
                for row in connection.execute(query):
                    file = (row.path, row.size, row.mtime_ns)
                    times, reason = attempts.get(file, (0, ""))
                    if row.kind in ENDINGS:
                        attempts.pop(file, None)
                    else:
                        excused = row.kind == "failed" and not row.reason
                        attempts[file] = (
                            times + (row.kind == "tried") - excused,
                            row.reason or reason,
                        )
        return attempts

    def inbox_events(
        self, kind: InboxKind | None = None, sha256: str | None = None, limit: int = 100
    ) -> tuple[InboxEvent, ...]:
        """Return events of the inbox (table `inbox_events`), newest first: all, of one kind, or of
        one content (sha256). Unknown ones give none, and no error."""
        c = s.inbox_events.c
        query = sa.select(s.inbox_events).order_by(c.sequence.desc()).limit(limit)
        if kind is not None:
            query = query.where(c.kind == kind)
        if sha256 is not None:
            query = query.where(c.sha256 == sha256)
        with self._database.reading() as connection:
            return tuple(_event(row) for row in connection.execute(query))


def _event(row: sa.Row[tuple[object, ...]]) -> InboxEvent:
    values = {name: value for name, value in row._mapping.items() if name != "sequence"}
    return InboxEvent(**{**values, "at_utc": enc.time_of(values["at_utc"])})
