"""Internal consistency of the catalogue: database integrity, recomputed identities, references and
name histories.

Rows are streamed, so memory use does not grow with the catalogue.
"""

import hashlib
import json
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, Final

import sqlalchemy as sa

from aerodb.consistency import calibration
from aerodb.errors import AeroError
from aerodb.exchange import database_content_sha256, from_document
from aerodb.storage import encoding as enc
from aerodb.storage.catalogue import (
    Ledger,
    broken_links,
    broken_rows,
    has_link,
    is_intact,
    newest_link,
    seal,
)
from aerodb.storage.catalogue import schema as s
from aerodb.storage.upkeep.problems import CHAIN, WorkspaceProblem
from aerodb.storage.upkeep.schema_comparison import differences
from aerodb.support import version_id
from aerodb.tables import CheckCase, failed_check_cases

Count = Callable[[str, int], None]

_RESTORE: Final = "restore the workspace from a backup: aerodb restore"
#: SQLSTATE insufficient_privilege of PostgreSQL.
_NOT_ALLOWED: Final = "42501"
#: Step of the stored normal equations of flights.
_NORMAL_EQUATIONS: Final = "gram"


def _catalogue_problem(what: str, where: str, remedy: str = _RESTORE) -> WorkspaceProblem:
    return WorkspaceProblem("catalogue", what, where, remedy)


class Audit(Ledger):
    """Consistency checks over all tables of the catalogue. Not a part of `Catalogue`, because the
    checks import the numerical packages."""

    @classmethod
    def of(cls, other: Ledger) -> "Audit":
        """The audit of an open catalogue."""
        return cls(other._database)

    def problems(self, count: Count) -> Iterator[WorkspaceProblem]:
        """Yield every problem of the catalogue; call `count` with the name and number of the items
        checked. Errors of the database become problems."""
        sound = True
        for check in (
            _database,
            _texts,
            _calibrations,
            _versions,
            _edges,
            _names,
            _chain,
            _incomplete,
        ):
            try:
                with self._database.reading() as connection:
                    for problem in check(connection.execution_options(yield_per=200), count):
                        sound = False
                        yield problem
            except (sa.exc.DBAPIError, UnicodeDecodeError) as error:
                text, sound = str(getattr(error, "orig", error)).splitlines()[0], False
                yield _catalogue_problem(f"it cannot be read: {text[:200]}", "catalogue")
        if sound:  # where it is damaged is known otherwise
            yield from _sealed(self._database.file, count)

    def seal(self) -> None:
        """Seal SQLite's file, in which no problem was found."""
        if self._database.file is not None:
            seal(self._database.file)

    def newest_link(self) -> str:
        """Hash of the newest link of the chain; empty without one."""
        with self._database.reading() as connection:
            return newest_link(connection)[1]

    def has_link(self, sha256: str) -> bool:
        """Return whether a hash (sha256) that was noted is still in the `chain`; StoreError where
        it cannot be read."""
        with self._database.reading() as connection:
            return has_link(connection, sha256)

    def results_without_file(self) -> tuple[str, ...]:
        """Paths of results whose file has no recorded hash."""
        known = sa.select(s.stored_files.c.path)
        with self._database.reading() as connection:
            return tuple(
                connection.scalars(
                    sa.select(s.results.c.path).where(s.results.c.path.not_in(known))
                )
            )


def _sealed(file: Path | None, count: Count) -> Iterator[WorkspaceProblem]:
    """The bytes of SQLite's file, where it was sealed."""
    intact = None if file is None else is_intact(file)
    if intact is not None:
        count("sealed catalogues", 1)
    if intact is False:
        yield _catalogue_problem(
            "its bytes changed after aerodb had closed it: they are damaged, or another program"
            " wrote to it",
            "catalogue.sqlite",
        )


def _database(connection: sa.Connection, count: Count) -> Iterator[WorkspaceProblem]:
    """Integrity checks of the database itself: pages and indices where it supports that, foreign
    keys, and the text of every table, index, trigger and view."""
    own = _of_sqlite if connection.dialect.name == "sqlite" else _of_postgresql
    yield from own(connection)
    # A cursor of the server, which a stream of rows has, makes no schema.
    connection.execution_options(yield_per=None, stream_results=False)
    try:
        found = list(differences(connection))
    except sa.exc.ProgrammingError as error:
        if getattr(error.orig, "sqlstate", "") != _NOT_ALLOWED:
            raise
        yield _catalogue_problem(
            "its tables and triggers cannot be compared: its user may make no schema for that",
            "catalogue",
            "GRANT CREATE ON DATABASE ... TO that user, then verify again",
        )
        found = []
    for what, where in found:
        yield _catalogue_problem(what, where)
    count("tables", len(s.metadata.tables))


def _of_sqlite(connection: sa.Connection) -> Iterator[WorkspaceProblem]:
    for (text,) in connection.exec_driver_sql("PRAGMA integrity_check").all():
        if text != "ok":
            yield _catalogue_problem(text, "catalogue.sqlite")
    for row in connection.exec_driver_sql("PRAGMA foreign_key_check").all():
        yield _catalogue_problem(
            f"row {row[1]} refers to a missing row of {row[2]}", f"table {row[0]}"
        )


def _of_postgresql(connection: sa.Connection) -> Iterator[WorkspaceProblem]:
    """Foreign keys, which a superuser can bypass. Pages are covered by the server's own checksums
    where those are enabled."""
    for name, table in sorted(s.metadata.tables.items()):
        for edge in table.foreign_key_constraints:
            child, parent = table.alias(), edge.referred_table.alias()
            pairs = [
                (child.c[part.parent.name], parent.c[part.column.name]) for part in edge.elements
            ]
            there = sa.exists().where(*(one == other for one, other in pairs))
            lost = sa.select(sa.func.count()).where(*(one.is_not(None) for one, _ in pairs), ~there)
            if number := connection.execute(lost).scalar_one():
                yield _catalogue_problem(
                    f"{number} rows refer to missing rows of {edge.referred_table.name}",
                    f"table {name}",
                )


def _texts(connection: sa.Connection, count: Count) -> Iterator[WorkspaceProblem]:
    c = s.vehicle_texts.c
    for row in connection.execute(sa.select(c.vehicle, c.text, c.sha256)):
        count("vehicle files", 1)
        if hashlib.sha256(row.text.encode("utf-8")).hexdigest() != row.sha256:
            yield _catalogue_problem(
                "its text differs from the text that was stored",
                f"vehicle {row.vehicle}",
                "add the vehicle file again",
            )


def _calibrations(connection: sa.Connection, count: Count) -> Iterator[WorkspaceProblem]:
    c = s.calibrations.c
    for row in connection.execute(sa.select(c.id, c.content)):
        count("calibrations", 1)
        try:
            same = calibration.from_document(enc.from_json(row.content)).id == row.id
        except (AeroError, ValueError, KeyError, TypeError):
            same = False
        if not same:
            yield _catalogue_problem(
                "its content does not match its id", f"calibration {row.id[:12]}"
            )


def _versions(connection: sa.Connection, count: Count) -> Iterator[WorkspaceProblem]:
    """Each version: its id recomputed from its inputs, the hash of its numbers, its check
    cases."""
    c, e = s.versions.c, s.version_inputs.c
    columns = (
        c.id,
        c.vehicle,
        c.number,
        c.parent,
        c.settings,
        c.content,
        c.content_sha256,
        c.report,
    )
    for row in connection.execute(sa.select(*columns)):
        count("versions", 1)
        inputs = connection.scalars(sa.select(e.input_key).where(e.version == row.id)).all()
        try:
            wrong = _wrong_with(row, inputs)
        except (AeroError, ValueError, KeyError, TypeError) as error:
            wrong = f"cannot be read: {str(error)[:200]}"
        if wrong:
            yield _catalogue_problem(wrong, f"v{row.number:04d} of {row.vehicle}")


def _wrong_with(row: Any, inputs: Sequence[str]) -> str:
    if version_id(row.vehicle, row.parent, inputs, enc.from_json(row.settings)) != row.id:
        return "its inputs and settings do not match its id"
    database = from_document(json.loads(row.content))
    if database_content_sha256(database) != row.content_sha256:
        return "its numbers differ from the numbers that were stored"
    cases = [CheckCase(**case) for case in enc.from_json(row.report).get("check_cases", [])]
    return next(iter(failed_check_cases(database, cases)), "")


def _edges(connection: sa.Connection, count: Count) -> Iterator[WorkspaceProblem]:
    """Every input refers to a result, a log, a vehicle text, a version or a calibration.

    Two kinds of input refer to things that are not stored: the file that a version without parent
    was imported from, and the database for which normal equations were formed, which may be an
    intermediate candidate of the loop.
    """
    known = sa.union_all(
        sa.select(s.results.c.key),
        sa.select(s.log_files.c.sha256),
        sa.select(s.vehicle_texts.c.sha256),
        sa.select(s.versions.c.id),
        sa.select(s.calibrations.c.id),
    )
    r, i, v, w = s.results.c, s.result_inputs.c, s.versions.c, s.version_inputs.c
    for table, name in ((s.result_inputs, "edges"), (s.version_inputs, "edges")):
        count(name, connection.execute(sa.select(sa.func.count()).select_from(table)).scalar_one())
    lost = (
        sa.select(i.key, r.step, i.input_key)
        .join(s.results, r.key == i.key)
        .where(i.input_key.not_in(known))
    )
    for row in connection.execute(lost.where(r.step != _NORMAL_EQUATIONS)):
        yield _catalogue_problem(
            f"its input {row.input_key[:12]} is missing", f"result {row.key[:12]} ({row.step})"
        )
    resolved = sa.select(i.key).where(i.input_key.in_(known))
    for key in connection.scalars(sa.select(r.key).where(r.key.not_in(resolved))):
        yield _catalogue_problem("all of its inputs are missing", f"result {key[:12]}")
    broken = sa.select(w.version, w.input_key).join(s.versions, v.id == w.version)
    for row in connection.execute(broken.where(v.parent.is_not(None), w.input_key.not_in(known))):
        yield _catalogue_problem(
            f"its input {row.input_key[:12]} is missing", f"version {row.version[:12]}"
        )


def _names(connection: sa.Connection, count: Count) -> Iterator[WorkspaceProblem]:
    """Every move of a name starts at the version where the previous move ended."""
    c = s.name_events.c
    last: dict[tuple[str, str], tuple[int, Any]] = {}
    for row in connection.execute(
        sa.select(c.vehicle, c.name, c.step, c.version, c.previous).order_by(
            c.vehicle, c.name, c.step
        )
    ):
        count("moves of names", 1)
        step, version = last.get((row.vehicle, row.name), (0, None))
        if (row.step, row.previous) != (step + 1, version):
            yield _catalogue_problem(
                f"move {row.step} does not start where the previous move ended",
                f"'{row.name}' of {row.vehicle}",
            )
        last = {(row.vehicle, row.name): (row.step, row.version)}


def _chain(connection: sa.Connection, count: Count) -> Iterator[WorkspaceProblem]:
    """Every event has the content that it had when it was linked, and none is missing or added."""
    count("linked events", newest_link(connection)[0])
    for what, where in (*broken_links(connection), *broken_rows(connection)):
        yield WorkspaceProblem(CHAIN, what, where, _RESTORE)


def _incomplete(connection: sa.Connection, count: Count) -> Iterator[WorkspaceProblem]:
    """Flights without channels and logs without flights. Both are added in one transaction, so
    there should be none."""
    f, r = s.flights.c, s.results.c
    count(
        "flights",
        connection.execute(sa.select(sa.func.count()).select_from(s.flights)).scalar_one(),
    )
    taken_in = sa.select(r.flight).where(r.step == "ingest", r.flight.is_not(None))
    for id in connection.scalars(sa.select(f.id).where(f.id.not_in(taken_in))):
        yield _catalogue_problem("it has no channels", f"flight {id[:12]}", "ingest its log again")
    g = s.log_files.c
    for sha256 in connection.scalars(
        sa.select(g.sha256).where(
            g.status != "quarantined", g.sha256.not_in(sa.select(f.log_sha256))
        )
    ):
        yield _catalogue_problem(
            "it is stored, but it has no flight", f"log {sha256[:12]}", "ingest it again"
        )
