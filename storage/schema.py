"""The tables of the catalogue, and the one place that knows what only SQLite has (STRICT tables, guarding triggers).

Rows are facts and are appended: what changes later (a verdict, a retraction, where a name points) is a further row, so
that every earlier state can be asked for. Only two tables may be updated: a log's status, when a quarantined log is
tried again, and a run, once, when it ends. Times are ISO 8601 UTC text with microseconds: sorted as text they are
sorted in time, on SQLite and PostgreSQL alike. JSON is canonical (RFC 8785).
"""

from collections.abc import Iterable, Sequence
from typing import Any, Final

import sqlalchemy as sa

#: The newest migration. Opening compares this with the stored revision; alembic is imported only where they differ.
HEAD: Final = "r0002"

metadata = sa.MetaData(
    naming_convention={
        "pk": "pk_%(table_name)s",
        "fk": "fk_%(table_name)s_%(column_0_name)s",
        "uq": "uq_%(table_name)s_%(column_0_N_name)s",
        "ck": "ck_%(table_name)s_%(constraint_name)s",
        "ix": "ix_%(table_name)s_%(column_0_N_name)s",
    }
)

Number: Final[sa.types.TypeEngine[float]] = sa.Double().with_variant(
    sa.REAL(), "sqlite"
)  # STRICT knows REAL, which PostgreSQL has as 4 bytes


def _table(name: str, *parts: Any) -> sa.Table:
    return sa.Table(name, metadata, *parts, sqlite_strict=True)


def _text(name: str, *constraints: Any, **options: Any) -> sa.Column[str]:
    return sa.Column(name, sa.Text, *constraints, **{"nullable": False, **options})


def _sequence() -> sa.Column[int]:
    return sa.Column("sequence", sa.Integer, primary_key=True, autoincrement=True)


def _one_of(column: str, values: Iterable[str]) -> sa.CheckConstraint:
    listed = ", ".join(f"'{value}'" for value in values)
    return sa.CheckConstraint(f"{column} IN ({listed})", name=column)


LOG_STATUS: Final = ("stored", "damaged", "quarantined")
VERDICTS: Final = ("good", "limited", "rejected", "unchecked")
ROLES: Final = ("identified", "held_out", "excluded")
HOW: Final = ("server", "ephemeral", "direct")
RUN_STATES: Final = ("running", "completed", "failed", "crashed", "cancelled")

vehicles = _table("vehicles", _text("name", primary_key=True), _text("added_utc"))

vehicle_texts = _table(
    "vehicle_texts",
    _sequence(),
    _text("vehicle", sa.ForeignKey("vehicles.name"), index=True),
    _text("text"),
    _text("sha256"),
    _text("added_utc"),
)

log_files = _table(
    "log_files",
    _text("sha256", primary_key=True),
    _text("name"),
    sa.Column("size", sa.BigInteger().with_variant(sa.Integer(), "sqlite"), nullable=False),
    _text("format"),
    _text("status"),
    _text("reason"),
    _text("damage"),
    _text("added_utc"),
    _one_of("status", LOG_STATUS),
)

flights = _table(
    "flights",
    _text("id", primary_key=True),
    _text("vehicle", sa.ForeignKey("vehicles.name")),
    _text("name", nullable=True, index=True),
    _text("log_sha256", sa.ForeignKey("log_files.sha256"), index=True),
    _text("added_utc"),
    sa.UniqueConstraint("vehicle", "name"),
)

# A flight may be processed again with a better mapping: the newest record counts.
flight_records = _table(
    "flight_records",
    _sequence(),
    _text("flight", sa.ForeignKey("flights.id"), index=True),
    _text("mapping"),
    _text("start_utc", nullable=True),
    sa.Column("duration", Number, nullable=False),
    sa.Column("samples", sa.Integer, nullable=False),
    sa.Column("step", Number, nullable=False),
    _text("added_utc"),
)

flight_events = _table(
    "flight_events",
    _sequence(),
    _text("flight", sa.ForeignKey("flights.id"), index=True),
    _text("kind"),
    _text("verdict", nullable=True),
    _text("reasons"),
    _text("at_utc"),
    _one_of("kind", ("verdict", "retracted")),
    _one_of("verdict", VERDICTS),
)

results = _table(
    "results",
    _text("key", primary_key=True),
    _text("step"),
    _text("kind"),
    _text("flight", sa.ForeignKey("flights.id"), nullable=True, index=True),
    _text("path"),
    _text("settings"),
    sa.Column("result_version", sa.Integer, nullable=False),
    _text("code_version"),
    _text("created_utc"),
)

# An input is the hash of a log, a vehicle text, a version or another result: no foreign key fits them all.
result_inputs = _table(
    "result_inputs",
    _text("key", sa.ForeignKey("results.key"), primary_key=True),
    _text("input_key", primary_key=True, index=True),
)

runs = _table(
    "runs",
    _text("id", primary_key=True),
    _text("flow"),
    _text("how"),
    _text("started_utc"),
    _text("ended_utc", nullable=True),
    _text("state", index=True),
    _text("parameters"),
    _text("code_version"),
    _text("error"),
    _one_of("how", HOW),
    _one_of("state", RUN_STATES),
)

versions = _table(
    "versions",
    _text("id", primary_key=True),
    _text("vehicle", sa.ForeignKey("vehicles.name")),
    sa.Column("number", sa.Integer, nullable=False),
    _text("parent", nullable=True, index=True),
    _text("content"),
    _text("content_sha256"),
    _text("settings"),
    _text("report"),
    _text("run", sa.ForeignKey("runs.id"), nullable=True),
    _text("created_utc"),
    sa.UniqueConstraint("vehicle", "number"),
    sa.UniqueConstraint("vehicle", "id"),
    # A parent, and a version that a name points at, belong to the same vehicle.
    sa.ForeignKeyConstraint(["vehicle", "parent"], ["versions.vehicle", "versions.id"], name="fk_versions_parent"),
    # All that a list shows, in its order: it never reads past the documents, which may be megabytes.
    sa.Index("ix_versions_header", "vehicle", "number", "id", "parent", "content_sha256", "run", "created_utc"),
)

version_inputs = _table(
    "version_inputs",
    _text("version", sa.ForeignKey("versions.id"), primary_key=True),
    _text("input_key", primary_key=True, index=True),
)

version_flights = _table(
    "version_flights",
    _text("version", sa.ForeignKey("versions.id"), primary_key=True),
    _text("flight", sa.ForeignKey("flights.id"), primary_key=True, index=True),
    _text("role"),
    _text("reason"),
    _one_of("role", ROLES),
)

name_events = _table(
    "name_events",
    _sequence(),
    _text("vehicle"),
    _text("name"),
    sa.Column("step", sa.Integer, nullable=False),
    _text("version"),
    _text("previous", nullable=True),
    _text("at_utc"),
    _text("user"),
    _text("reason"),
    # Two writers that both saw step n cannot both write step n + 1, whatever the isolation level.
    sa.UniqueConstraint("vehicle", "name", "step"),
    sa.ForeignKeyConstraint(["vehicle", "version"], ["versions.vehicle", "versions.id"], name="fk_name_events_version"),
    sa.Index("ix_name_events_order", "vehicle", "sequence"),
    sa.Index("ix_name_events_version", "vehicle", "version"),
)

run_results = _table(
    "run_results",
    _text("run", sa.ForeignKey("runs.id"), primary_key=True),
    _text("key", sa.ForeignKey("results.key"), primary_key=True, index=True),
)

run_versions = _table(
    "run_versions",
    _text("run", sa.ForeignKey("runs.id"), primary_key=True),
    _text("version", sa.ForeignKey("versions.id"), primary_key=True, index=True),
)


def sqlite_guards(table: str, keys: Sequence[Sequence[str]], update_when: str = "") -> list[str]:
    """SQLite triggers that make `table` append-only.

    keys : its primary key and unique constraints, as column names. ``INSERT OR REPLACE`` deletes without firing delete
    triggers, so that an insert on a taken key is refused as well. update_when : SQL condition on OLD under which an update
    is allowed all the same.
    """
    refuse = f"SELECT RAISE(ABORT, '{table}: rows are never changed or deleted')"
    same = [" AND ".join(f'"{column}" = NEW."{column}"' for column in key) for key in keys]
    taken = " OR ".join(f"EXISTS (SELECT 1 FROM {table} WHERE {condition})" for condition in same)
    condition = f" WHEN NOT ({update_when})" if update_when else ""
    return [
        f"CREATE TRIGGER {table}_no_update BEFORE UPDATE ON {table}{condition} BEGIN {refuse}; END",
        f"CREATE TRIGGER {table}_no_delete BEFORE DELETE ON {table} BEGIN {refuse}; END",
        f"CREATE TRIGGER {table}_no_replace BEFORE INSERT ON {table} WHEN {taken} BEGIN {refuse}; END",
    ]
