"""Database versions in the catalogue: adding and finding them. Versions never change.

Their names are in `aerodb.storage.catalogue.names`, their lineage in
`aerodb.storage.catalogue.lineage`.
"""

from collections.abc import Iterable, Mapping
from datetime import datetime
from typing import Any

import sqlalchemy as sa

from aerodb.errors import InputError, UnknownNameError, nearest
from aerodb.storage import encoding as enc
from aerodb.storage.catalogue import schema as s
from aerodb.storage.catalogue.ledger import NAMES_COMPARED, in_parts
from aerodb.storage.catalogue.lineage import LineageLedger
from aerodb.storage.catalogue.names import NameLedger
from aerodb.storage.catalogue.rows import FlightRole, Role, VersionDocuments, VersionRow
from aerodb.storage.catalogue.version_queries import (
    header,
    headers,
    last_event,
    names_of,
    newest_headers,
    no_version,
    roles_of,
)


class VersionLedger(NameLedger, LineageLedger):
    """Catalogue queries about versions."""

    def add_version(
        self,
        id: str,
        *,
        vehicle: str,
        parent: str | None,
        content: str,
        content_sha256: str,
        settings: Mapping[str, Any],
        report: Mapping[str, Any],
        flights: Iterable[FlightRole] = (),
        inputs: Iterable[str] = (),
        run: str | None = None,
    ) -> VersionRow:
        """Store a version under the vehicle's next label. An id that is stored already changes
        nothing and gives the stored row.

        content : the database document, JSON text in SI units. inputs : keys of the results (or
        hashes of the files) it was made from. Raises InputError when a flight belongs to another
        vehicle, or when its role violates the hold-out rule (docs/method/updates.md, section
        "Hold-out"): a flight that identified an ancestor never validates a descendant, and a flight
        held out by an ancestor is not used for identification later.
        """
        enc.checked_key(id, "the id of a version")
        uses = list(flights)
        row = {
            "id": id,
            "vehicle": vehicle,
            "parent": parent,
            "content": content,
            "content_sha256": enc.checked_key(content_sha256, "the hash of a content"),
            "settings": enc.to_json(dict(settings)),
            "report": enc.to_json(dict(report)),
            "run": run,
        }
        edges = [
            {"version": id, "input_key": enc.checked_key(i, "the hash of an input")}
            for i in sorted(set(inputs))
        ]
        with self._database.writing() as connection:
            self._require_vehicle(connection, vehicle)
            stored = headers(connection, s.versions.c.id == id)
            if not stored:
                _check_parent(connection, vehicle, parent)
                _check_uses(connection, vehicle, uses, roles_of(connection, parent))
                last = newest_headers(connection, vehicle, 1)
                at = enc.after(*(version.created_utc for version in last))
                values = {
                    **row,
                    "number": _last_number(connection, vehicle) + 1,
                    "created_utc": enc.time_text(at),
                }
                connection.execute(sa.insert(s.versions).values(values))
                if uses:
                    used = [
                        {
                            "version": id,
                            "flight": u.flight,
                            "role": u.role,
                            "reason": enc.plain_text(u.reason),
                        }
                        for u in uses
                    ]
                    connection.execute(sa.insert(s.version_flights), used)
                if edges:
                    connection.execute(sa.insert(s.version_inputs), edges)
                stored = headers(connection, s.versions.c.id == id)
            if run is not None:
                self._note_run(connection, s.run_versions, run, {"version": id})
            return stored[0]

    def version(self, vehicle: str, ref: str, as_of: datetime | None = None) -> VersionRow:
        """The version referred to by `ref`: an id, a name such as ``released``, a label (``v0007``)
        or a unique prefix of an id.

        as_of : resolve `ref` as of that time. UnknownNameError with the nearest name when there is
        no such version.
        """
        c = s.versions.c
        mine = c.vehicle == vehicle
        if as_of is not None:
            mine = mine & (c.created_utc <= enc.time_text(as_of))
        with self._database.reading() as connection:
            self._require_vehicle(connection, vehicle)
            if enc.REFERENCE.fullmatch(ref):
                label = enc.LABEL.fullmatch(ref)
                event = last_event(connection, vehicle, ref, as_of)
                match = header(connection, mine & (c.id == (event.version if event else ref)))
                if match is None and label is not None:
                    match = header(connection, mine & (c.number == int(label[1])))
                if match is None and event is None:
                    id = self._by_prefix(connection, c.id, ref, mine)
                    match = header(connection, c.id == id) if id is not None else None
                if match is not None:
                    return match
            labels = [row.label for row in newest_headers(connection, vehicle, NAMES_COMPARED)]
            names = names_of(connection, vehicle)
        remedy = (
            nearest(ref[:128], [*names, *labels])
            if labels
            else "import a database first: aerodb database import"
        )
        when = f" as of {enc.time_text(as_of)}" if as_of is not None else ""
        raise UnknownNameError(
            f"unknown version {enc.shown(ref)}{when}", f"vehicle {vehicle}", remedy
        )

    def versions(
        self, vehicle: str, limit: int | None = None, before: int | None = None
    ) -> tuple[VersionRow, ...]:
        """Return all versions of a vehicle, or the newest `limit` of them, or of those with a
        number below `before`; oldest first. UnknownNameError for an unknown vehicle."""
        with self._database.reading() as connection:
            self._require_vehicle(connection, vehicle)
            return tuple(newest_headers(connection, vehicle, limit, before))

    def count_versions(self, vehicle: str) -> int:
        """Return the number of versions of a vehicle; equal to its newest number, because there are
        no gaps."""
        with self._database.reading() as connection:
            return _last_number(connection, vehicle)

    def version_of_id(self, id: str) -> VersionRow:
        """Return the version (`VersionRow`) with this full id; UnknownNameError when there is
        none."""
        with self._database.reading() as connection:
            row = header(connection, s.versions.c.id == id)
        if row is None:
            raise no_version(id)
        return row

    def versions_by_id(self, ids: Iterable[str]) -> dict[str, VersionRow]:
        """Return id -> version, for those of `ids` that exist; no error for the others."""
        with self._database.reading() as connection:
            return {
                row.id: row
                for part in in_parts(set(ids))
                for row in headers(connection, s.versions.c.id.in_(part))
            }

    def version_documents(self, id: str) -> VersionDocuments:
        """Return content (SI units), settings and report of a version (its id); UnknownNameError
        where there is none. Report: docs/reference/contract.md, section "JSON"."""
        c = s.versions.c
        with self._database.reading() as connection:
            row = connection.execute(
                sa.select(c.content, c.settings, c.report).where(c.id == id)
            ).one_or_none()
        if row is None:
            raise no_version(id)
        return VersionDocuments(row.content, enc.from_json(row.settings), enc.from_json(row.report))

    def reports_of(self, ids: Iterable[str]) -> dict[str, Mapping[str, Any]]:
        """Return id -> the report that the version was made with, for those of `ids` that exist; no
        error for the others."""
        return self._documents(s.versions.c.report, ids)

    def settings_of(self, ids: Iterable[str]) -> dict[str, Mapping[str, Any]]:
        """Return id -> the settings that made the version, for those of `ids` that exist; no error
        for the others."""
        return self._documents(s.versions.c.settings, ids)

    def _documents(
        self, column: sa.Column[str], ids: Iterable[str]
    ) -> dict[str, Mapping[str, Any]]:
        """Id -> the JSON of one column, for those of `ids` that exist."""
        id = s.versions.c.id
        with self._database.reading() as connection:
            return {
                version: enc.from_json(text)
                for part in in_parts(set(ids))
                for version, text in connection.execute(sa.select(id, column).where(id.in_(part)))
            }


def _last_number(connection: sa.Connection, vehicle: str) -> int:
    last = connection.execute(
        sa.select(sa.func.max(s.versions.c.number)).where(s.versions.c.vehicle == vehicle)
    ).scalar()
    return last or 0


def _check_parent(connection: sa.Connection, vehicle: str, parent: str | None) -> None:
    if (
        parent is not None
        and header(connection, (s.versions.c.vehicle == vehicle) & (s.versions.c.id == parent))
        is None
    ):
        raise no_version(parent, vehicle)


def _check_uses(
    connection: sa.Connection, vehicle: str, uses: list[FlightRole], before: Mapping[str, Role]
) -> None:
    c = s.flights.c
    ids = [use.flight for use in uses]
    known: set[str] = set()
    for part in in_parts(ids):
        known.update(
            connection.scalars(sa.select(c.id).where(c.vehicle == vehicle, c.id.in_(part)))
        )
    for use in uses:
        if use.flight not in known:
            raise InputError(
                f"unknown flight id {enc.shown(use.flight)}",
                f"vehicle {vehicle}",
                "add the flight first",
            )
        earlier = before.get(use.flight, "excluded")
        if "excluded" not in (use.role, earlier) and use.role != earlier:
            what = (
                f"flight {use.flight[:12]} cannot be {use.role.replace('_', ' ')}: in an ancestor"
                f" it is {earlier.replace('_', ' ')}"
            )
            raise InputError(
                what,
                f"vehicle {vehicle}",
                "a flight keeps its role along a line: give it the same role, or exclude it",
            )
