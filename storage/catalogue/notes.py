"""What people note: comments and tags of versions, and failed runs that are dismissed."""

from collections.abc import Iterable

import sqlalchemy as sa

from aerodb.errors import InputError, UnknownNameError
from aerodb.storage import encoding as enc
from aerodb.storage.catalogue import schema as s
from aerodb.storage.catalogue.ledger import Ledger, in_parts
from aerodb.storage.catalogue.rows import NoteKind, NoteRow

_LONGEST = 10_000  # characters of a comment or a reason


class NoteLedger(Ledger):
    """Catalogue queries about what people note."""

    def add_note(self, version: str, kind: NoteKind, text: str, *, user: str) -> None:
        """Add a comment to a version (its id), or give it a tag or take one away; a tag that is, or
        is not, there already changes nothing, nor does the user's comment that is the newest note.
        InputError for an empty comment or a tag that is not allowed; table `version_notes`."""
        where = f"version {version[:12]}"
        if kind == "comment":
            _words(text, "a comment", where)
        else:
            enc.checked(text, enc.VERSION_NAME, "a tag")
            if (text in self.tags_of(self.notes_of([version])[version])) == (kind == "tag"):
                return
        note = {"kind": kind, "text": enc.plain_text(text), "user": enc.plain_text(user)}
        with self._database.writing() as connection:
            newest = self.notes_of([version])[version][-1:]
            if kind == "comment" and any(
                note == {"kind": each.kind, "text": each.text, "user": each.user} for each in newest
            ):
                return  # a command that was killed after it had written it, and runs again
            at = enc.time_text(enc.now())
            connection.execute(
                sa.insert(s.version_notes).values({"version": version, "at_utc": at, **note})
            )

    def notes_of(self, versions: Iterable[str]) -> dict[str, tuple[NoteRow, ...]]:
        """Return version (id) -> its notes (table `version_notes`), oldest first; an empty tuple,
        and no error, where there are none."""
        ids, c = list(versions), s.version_notes.c
        found: dict[str, list[NoteRow]] = {id: [] for id in ids}
        with self._database.reading() as connection:
            for part in in_parts(ids):
                query = sa.select(s.version_notes).where(c.version.in_(part)).order_by(c.sequence)
                for row in connection.execute(query):
                    at = enc.time_of(row.at_utc)
                    note = NoteRow(row.version, row.kind, row.text, at, row.user)
                    found[row.version].append(note)
        return {id: tuple(notes) for id, notes in found.items()}

    @staticmethod
    def tags_of(notes: Iterable[NoteRow]) -> tuple[str, ...]:
        """Return the tags that a version has after these notes of it, sorted."""
        tags: set[str] = set()
        for note in notes:
            if note.kind == "tag":
                tags.add(note.text)
            elif note.kind == "untag":
                tags.discard(note.text)
        return tuple(sorted(tags))

    def dismiss_run(self, run: str, reason: str, *, user: str) -> None:
        """Note that a failed run (its id) needs nothing more; it is no longer unresolved
        (`RunQueries.unresolved_runs`). InputError without a reason, UnknownNameError for an unknown
        run."""
        _words(reason, "a dismissal", f"run {run[:12]}")
        with self._database.writing() as connection:
            known = sa.select(s.runs.c.id).where(s.runs.c.id == run)
            if connection.execute(known).scalar() is None:
                raise UnknownNameError(f"unknown run {enc.shown(run)}", remedy="see aerodb status")
            connection.execute(
                sa.insert(s.run_dismissals).values(
                    {
                        "run": run,
                        "reason": enc.plain_text(reason),
                        "at_utc": enc.time_text(enc.now()),
                        "user": enc.plain_text(user),
                    }
                )
            )


def _words(text: str, what: str, where: str) -> None:
    if not text.strip() or len(text) > _LONGEST:
        raise InputError(f"{what} needs words, at most {_LONGEST} characters", where, "write them")
