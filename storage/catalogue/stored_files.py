"""Hash and size of every stored file, recorded when it was written."""

from collections.abc import Iterator

import sqlalchemy as sa

from aerodb.storage import encoding as enc
from aerodb.storage.catalogue import schema as s
from aerodb.storage.catalogue.file_identity import StoredFile
from aerodb.storage.catalogue.ledger import Ledger


class FileLedger(Ledger):
    """Catalogue queries about stored files."""

    def add_file(self, path: str, sha256: str, size: int) -> None:
        """Record hash (sha256) and size [bytes] of the file at `path` (relative). The newest record
        counts; the same record again changes nothing."""
        c = s.stored_files.c
        values = {
            "path": path,
            "sha256": enc.checked_key(sha256, "the hash of a file"),
            "size": size,
        }
        with self._database.writing() as connection:
            newest = (
                sa.select(c.sha256, c.size)
                .where(c.path == path)
                .order_by(c.sequence.desc())
                .limit(1)
            )
            stored = connection.execute(newest).one_or_none()
            if stored is None or tuple(stored) != (sha256, size):
                connection.execute(
                    sa.insert(s.stored_files).values({**values, "at_utc": enc.time_text(enc.now())})
                )

    def stored_file(self, path: str) -> StoredFile | None:
        """Return the recorded hash (sha256) and size [bytes] of the file at `path` (relative), or
        None."""
        c = s.stored_files.c
        query = (
            sa.select(c.path, c.sha256, c.size)
            .where(c.path == path)
            .order_by(c.sequence.desc())
            .limit(1)
        )
        with self._database.reading() as connection:
            row = connection.execute(query).one_or_none()
        return None if row is None else StoredFile(*row)

    def stored_files(self, start: str, end: str) -> dict[str, StoredFile]:
        """Return path -> file (size [bytes]), for paths from `start` (included) to `end`
        (excluded): used folder by folder."""
        c = s.stored_files.c
        query = (
            sa.select(c.path, c.sha256, c.size)
            .where(c.path >= start, c.path < end)
            .order_by(c.sequence)
        )
        with self._database.reading() as connection:
            return {
                row.path: StoredFile(row.path, row.sha256, row.size)
                for row in connection.execute(query)
            }

    def every_stored_file(self) -> Iterator[StoredFile]:
        """All files by path, read in batches: memory use does not grow with the store."""
        c, after = s.stored_files.c, ""
        newest = sa.select(sa.func.max(c.sequence)).group_by(c.path)
        while True:
            parts = newest.where(c.path > after).order_by(c.path).limit(_PART).scalar_subquery()
            query = (
                sa.select(c.path, c.sha256, c.size).where(c.sequence.in_(parts)).order_by(c.path)
            )
            with self._database.reading() as connection:
                files = [StoredFile(*row) for row in connection.execute(query)]
            yield from files
            if len(files) < _PART:
                return
            after = files[-1].path


#: Rows that are read at once.
_PART = 1000
