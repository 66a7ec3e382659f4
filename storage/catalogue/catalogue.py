"""The catalogue class, with queries about vehicles, logs, results and runs. Queries about flights,
versions and the rest are in the modules of its base classes.

The row is the commit: files are written first, and only a file with a row exists for the product.
Adding something twice changes nothing. References are resolved here: exact id, then name, then
unique prefix of an id.
"""

import hashlib
import secrets
import socket
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from typing import Any, Final

import sqlalchemy as sa

from aerodb.errors import InputError, UnknownNameError
from aerodb.recording import Damage
from aerodb.storage import encoding as enc
from aerodb.storage.catalogue import schema as s
from aerodb.storage.catalogue.calibrations import CalibrationLedger
from aerodb.storage.catalogue.flight_rows import FlightLedger
from aerodb.storage.catalogue.inbox_history import InboxHistory
from aerodb.storage.catalogue.location import catalogue_location
from aerodb.storage.catalogue.notes import NoteLedger
from aerodb.storage.catalogue.postgresql import (
    note_owner,
    open_postgresql,
    owner_of,
    postgresql_revision,
)
from aerodb.storage.catalogue.repeats import RepeatLedger
from aerodb.storage.catalogue.rows import (
    How,
    LogRow,
    LogStatus,
    ResultRow,
    RunRow,
    RunState,
    VehicleRow,
)
from aerodb.storage.catalogue.run_queries import RunQueries
from aerodb.storage.catalogue.schema import HEAD
from aerodb.storage.catalogue.sqlite import open_sqlite, sqlite_revision
from aerodb.storage.catalogue.stored_files import FileLedger
from aerodb.storage.catalogue.users import UserLedger
from aerodb.storage.catalogue.versions import VersionLedger
from aerodb.storage.disk_errors import translated_disk_errors

#: File of a workspace whose catalogue is in PostgreSQL: its id there.
_WORKSPACE_ID: Final = "locks/workspace_id"


class Catalogue(
    FlightLedger,
    RepeatLedger,
    CalibrationLedger,
    VersionLedger,
    FileLedger,
    InboxHistory,
    RunQueries,
    UserLedger,
    NoteLedger,
):
    """The catalogue of one workspace. Safe to use from several threads and processes at once."""

    _folder: Path | None = None

    @classmethod
    def open(cls, path: Path, create: bool = True) -> "Catalogue":
        """Open the catalogue at `path`, or in the PostgreSQL database that the settings next to it
        name (`aerodb.storage.catalogue.location`), and migrate it to the newest schema. If it does
        not exist, create it, or raise InputError without `create`."""
        place = catalogue_location(path)
        if not place.url:
            return cls(open_sqlite(path, create))
        catalogue = cls(open_postgresql(place.url, create))
        catalogue._folder = path.parent
        return catalogue

    def require_own(self) -> None:
        """Raise InputError where another workspace has begun runs in this database; otherwise it
        belongs to this one from now on.

        Whether a run is alive is known from locks in its workspace's folder: two workspaces would
        take each other's runs for crashed. An SQLite file is in its workspace.
        """
        if self._folder is None:
            return
        file = self._folder / _WORKSPACE_ID
        with self._database.reading() as connection:
            owner = owner_of(connection)
        if owner is None:
            with self._database.writing() as connection:
                owner = owner_of(connection)  # another process may have been faster
                if owner is None:
                    where = f"{socket.gethostname()}:{self._folder.absolute()}"
                    with translated_disk_errors(file):
                        file.parent.mkdir(exist_ok=True)
                        if not file.is_file():
                            file.write_text(f"{secrets.token_hex(16)}\n", encoding="ascii")
                        note_owner(connection, file.read_text(encoding="ascii").strip(), where)
                    return
        id, where = owner
        if not file.is_file() or file.read_text(encoding="ascii").strip() != id:
            raise InputError(
                f"the catalogue belongs to another workspace, {where}",
                self._database.where,
                f"name another database in the settings; if that workspace is gone, write {id}"
                f" into {file}",
            )

    @staticmethod
    def pending_migration(path: Path) -> tuple[str, str] | None:
        """Return the stored and the newest schema of the catalogue that `open` would migrate; None
        if it is of the newest schema, or does not exist. Changes nothing. StoreError where it
        cannot be read."""
        place = catalogue_location(path)
        if not place.begun:
            return None
        stored = postgresql_revision(place.url) if place.url else sqlite_revision(path)
        return None if stored in (None, HEAD) else (str(stored), HEAD)

    @classmethod
    def in_file(cls, path: Path) -> "Catalogue":
        """Open the SQLite file at `path` regardless of the settings next to it: the catalogue of a
        backup."""
        return cls(open_sqlite(path))

    def close(self) -> None:
        """Close all connections."""
        self._database.close()

    def __enter__(self) -> "Catalogue":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @contextmanager
    def transaction(self) -> Iterator[None]:
        """Context manager that makes all calls inside one atomic transaction; no other writer can
        interfere (`Database.writing`). Raises StoreBusyError where another writer keeps the
        lock."""
        with self._database.writing():
            yield

    # Vehicles

    def add_vehicle(self, name: str, text: str) -> VehicleRow:
        """Store the text of a vehicle file; earlier texts are kept. The same text again changes
        nothing. Raises InputError for a name of other than letters, digits, ``-`` and ``_``;
        schema: docs/reference/conventions.md, section "Vehicle file"."""
        enc.checked(name, enc.VEHICLE_NAME, "the name of a vehicle")
        digest = hashlib.sha256(text.encode("utf-8")).hexdigest()
        at = enc.time_text(enc.now())
        with self._database.writing() as connection:
            newest = self._vehicle_texts(connection, name)[-1:]
            if not newest:
                connection.execute(sa.insert(s.vehicles).values(name=name, added_utc=at))
            if not newest or newest[0].sha256 != digest:
                values = {"vehicle": name, "text": text, "sha256": digest, "added_utc": at}
                connection.execute(sa.insert(s.vehicle_texts).values(values))
        return self.vehicle(name)

    def vehicle(self, name: str, sha256: str = "") -> VehicleRow:
        """Return a vehicle with its newest text, or with the text of this `sha256`;
        UnknownNameError when there is none. Schema: docs/reference/conventions.md, section "Vehicle
        file"."""
        with self._database.reading() as connection:
            self._require_vehicle(connection, name)
            texts = self._vehicle_texts(connection, name)
        for row in reversed(texts):
            if sha256 in ("", row.sha256):
                return row
        raise UnknownNameError(
            f"no text with sha256 {enc.shown(sha256)}",
            f"vehicle {name}",
            "omit the hash to get the newest text",
        )

    def vehicles(self) -> tuple[VehicleRow, ...]:
        """Return all vehicles by name, each with its newest text."""
        with self._database.reading() as connection:
            names = connection.scalars(
                sa.select(s.vehicles.c.name).order_by(s.vehicles.c.name)
            ).all()
            return tuple(self._vehicle_texts(connection, name)[-1] for name in names)

    @staticmethod
    def _vehicle_texts(connection: sa.Connection, name: str) -> list[VehicleRow]:
        c = s.vehicle_texts.c
        rows = connection.execute(
            sa.select(c.vehicle, c.text, c.sha256, c.added_utc)
            .where(c.vehicle == name)
            .order_by(c.sequence)
        )
        return [VehicleRow(r.vehicle, r.text, r.sha256, enc.time_of(r.added_utc)) for r in rows]

    # Logs

    def add_log(
        self,
        sha256: str,
        *,
        name: str,
        size: int,
        format: str,
        status: LogStatus,
        reason: str = "",
        damage: Iterable[Damage] = (),
    ) -> bool:
        """Store a log and its status; returns whether it is new. size : [bytes]. Raises InputError
        where the hash is no sha256.

        A quarantined log that is ingested again gets its new status; an accepted log is never
        quarantined later.
        """
        enc.checked_key(sha256, "the hash of a log")
        judged = {
            "format": format,
            "status": status,
            "reason": enc.plain_text(reason),
            "damage": enc.damage_to_json(damage),
        }
        with self._database.writing() as connection:
            mine = s.log_files.c.sha256 == sha256
            stored = connection.execute(sa.select(s.log_files.c.status).where(mine)).scalar()
            if stored is None:
                values = {
                    "sha256": sha256,
                    "name": enc.plain_text(name),
                    "size": size,
                    "added_utc": enc.time_text(enc.now()),
                }
                connection.execute(sa.insert(s.log_files).values({**values, **judged}))
            elif stored == "quarantined":
                connection.execute(sa.update(s.log_files).where(mine).values(judged))
            return stored is None

    def log(self, ref: str) -> LogRow | None:
        """Return the log with this sha256, or None: no error for an unknown one, unlike
        `vehicle`."""
        with self._database.reading() as connection:
            row = connection.execute(
                sa.select(s.log_files).where(s.log_files.c.sha256 == ref)
            ).one_or_none()
        return None if row is None else _log(row)

    def logs(self, status: LogStatus | None = None) -> tuple[LogRow, ...]:
        """All logs, or those of one status, oldest first."""
        query = sa.select(s.log_files).order_by(s.log_files.c.added_utc, s.log_files.c.sha256)
        if status is not None:
            query = query.where(s.log_files.c.status == status)
        with self._database.reading() as connection:
            return tuple(_log(row) for row in connection.execute(query))

    # Results

    def add_result(
        self,
        key: str,
        *,
        step: str,
        kind: str,
        path: str,
        result_version: int,
        flight: str | None = None,
        settings: Mapping[str, Any] | None = None,
        code_version: str = "",
        inputs: Iterable[str] = (),
        run: str | None = None,
    ) -> bool:
        """Store a result whose file is at `path` (relative to the workspace); returns whether it is
        new.

        An existing key is unchanged, but `run` is recorded as using it. Raises UnknownNameError for
        the flight or the run, InputError for a key that is no sha256.
        """
        enc.checked_key(key, "the key of a result")
        _check_relative(path)
        row = {
            "key": key,
            "step": enc.checked(step, enc.WORD, "the name of a step"),
            "kind": enc.checked(kind, enc.WORD, "a kind of result"),
            "flight": flight,
            "path": path,
            "settings": enc.to_json(dict(settings or {})),
            "result_version": result_version,
            "code_version": code_version,
        }
        edges = [
            {"key": key, "input_key": enc.checked_key(i, "the hash of an input")}
            for i in sorted(set(inputs))
        ]
        with self._database.writing() as connection:
            if flight is not None:
                self._require_flight(connection, flight)
            new = (
                connection.execute(
                    sa.select(s.results.c.key).where(s.results.c.key == key)
                ).scalar()
                is None
            )
            if new:
                mine = sa.false() if flight is None else s.results.c.flight == flight
                at = self._stamp(connection, s.results.c.created_utc, mine)
                connection.execute(sa.insert(s.results).values({**row, "created_utc": at}))
                if edges:
                    connection.execute(sa.insert(s.result_inputs), edges)
            if run is not None:
                self._note_run(connection, s.run_results, run, {"key": key})
            return new

    def result(self, key: str) -> ResultRow | None:
        """The result with this key, or None."""
        with self._database.reading() as connection:
            rows = self._results(connection, s.results.c.key == key)
        return rows[0] if rows else None

    def results_of(self, flight: str, step: str | None = None) -> tuple[ResultRow, ...]:
        """All results of a flight (its id), or those of one step, oldest first."""
        where = s.results.c.flight == flight
        with self._database.reading() as connection:
            return self._results(
                connection, where if step is None else where & (s.results.c.step == step)
            )

    @staticmethod
    def _results(connection: sa.Connection, where: sa.ColumnElement[bool]) -> tuple[ResultRow, ...]:
        rows = connection.execute(
            sa.select(s.results).where(where).order_by(s.results.c.created_utc, s.results.c.key)
        ).all()
        edge = s.result_inputs.c
        pairs = connection.execute(
            sa.select(edge.key, edge.input_key)
            .join(s.results, s.results.c.key == edge.key)
            .where(where)
            .order_by(edge.input_key)
        ).all()
        inputs: dict[str, list[str]] = {}
        for pair in pairs:
            inputs.setdefault(pair.key, []).append(pair.input_key)
        return tuple(_result(row, tuple(inputs.get(row.key, ()))) for row in rows)

    # Runs

    def start_run(
        self,
        flow: str,
        *,
        how: How,
        parameters: Mapping[str, Any] | None = None,
        code_version: str = "",
        id: str = "",
    ) -> RunRow:
        """Record the start of a run; `id` is generated if the orchestrator gives none. Raises
        InputError where the catalogue is another workspace's (`require_own`)."""
        self.require_own()
        run = enc.checked(id, enc.RUN_ID, "the id of a run") if id else secrets.token_hex(16)
        row = {
            "id": run,
            "flow": enc.checked(flow, enc.WORD, "the name of a flow"),
            "how": how,
            "state": "running",
            "parameters": enc.to_json(dict(parameters or {})),
            "code_version": code_version,
            "error": "",
        }
        with self._database.writing() as connection:
            if (
                connection.execute(sa.select(s.runs.c.id).where(s.runs.c.id == run)).scalar()
                is None
            ):
                at = self._stamp(connection, s.runs.c.started_utc)
                connection.execute(sa.insert(s.runs).values({**row, "started_utc": at}))
        return self.run(run)

    def end_run(self, id: str, state: RunState, error: str = "") -> RunRow:
        """Record how a run ended (`RunState`). Raises ValueError for ``running``, UnknownNameError
        for an unknown run. The first end counts: a run marked as crashed cannot complete later."""
        if state == "running":
            raise ValueError("a run does not end as 'running'")
        with self._database.writing() as connection:
            begun = connection.execute(
                sa.select(s.runs.c.started_utc).where(s.runs.c.id == id)
            ).scalar()
            at = enc.after(enc.time_of(begun) if begun else None)
            values = {
                "state": state,
                "ended_utc": enc.time_text(at),
                "error": enc.plain_text(error),
            }
            open_run = (s.runs.c.id == id) & s.runs.c.ended_utc.is_(None)
            connection.execute(sa.update(s.runs).where(open_run).values(values))
        return self.run(id)

    def run(self, id: str) -> RunRow:
        """Return one run (table `runs`, times in UTC); UnknownNameError when there is none."""
        with self._database.reading() as connection:
            row = connection.execute(sa.select(s.runs).where(s.runs.c.id == id)).one_or_none()
        if row is None:
            raise UnknownNameError(
                f"unknown run {enc.shown(id)}", remedy="check the id against the list of runs"
            )
        return self._run_row(row)

    def runs(self, state: RunState | None = None, limit: int = 100) -> tuple[RunRow, ...]:
        """The newest runs, or those in one state, newest first."""
        query = sa.select(s.runs).order_by(s.runs.c.started_utc.desc(), s.runs.c.id).limit(limit)
        if state is not None:
            query = query.where(s.runs.c.state == state)
        with self._database.reading() as connection:
            return tuple(self._run_row(row) for row in connection.execute(query))


def _check_relative(path: str) -> None:
    parts = PurePosixPath(path)
    if (
        not path.isprintable()
        or parts.is_absolute()
        or ".." in parts.parts
        or "\\" in path
        or not parts.parts
    ):
        raise InputError(
            f"{enc.shown(path)} is not a path inside the workspace",
            remedy="use a relative path with forward slashes",
        )


def _log(row: sa.Row[Any]) -> LogRow:
    damage, added = enc.damage_from_json(row.damage), enc.time_of(row.added_utc)
    return LogRow(row.sha256, row.name, row.size, row.format, row.status, row.reason, damage, added)


def _result(row: sa.Row[Any], inputs: tuple[str, ...]) -> ResultRow:
    values = {
        **row._mapping,
        "settings": enc.from_json(row.settings),
        "created_utc": enc.time_of(row.created_utc),
    }
    return ResultRow(**values, inputs=inputs)
