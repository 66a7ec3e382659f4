"""Tables of the catalogue, and the differences between SQLite and PostgreSQL: STRICT tables, text
collation, append-only triggers.

Tables are append-only: a change (a verdict, a retraction, a moved name) is a new row, so every
earlier state can be queried. Only two tables allow updates: the status of a log, when a quarantined
log is ingested again, and a run, once, when it ends. Times are ISO 8601 UTC text with microseconds,
which sorts chronologically on SQLite and PostgreSQL alike. JSON is canonical (RFC 8785).
"""

from collections.abc import Iterable, Sequence
from typing import Any, Final

import sqlalchemy as sa

#: The newest migration. Opening compares this with the stored revision; alembic is imported only
#: where they differ.
HEAD: Final = "r0011"

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


#: SQLite holds 64 bits in every INTEGER and knows no other name for it in a STRICT table.
Whole: Final[sa.types.TypeEngine[int]] = sa.BigInteger().with_variant(sa.Integer(), "sqlite")

#: Text is in order by its bytes, as in SQLite, whatever the language of a PostgreSQL database.
Text: Final[sa.types.TypeEngine[str]] = sa.Text().with_variant(sa.Text(collation="C"), "postgresql")


def _table(name: str, *parts: Any, **options: Any) -> sa.Table:
    return sa.Table(name, metadata, *parts, sqlite_strict=True, **options)


def _text(name: str, *constraints: Any, **options: Any) -> sa.Column[str]:
    return sa.Column(name, Text, *constraints, **{"nullable": False, **options})


def _sequence() -> sa.Column[int]:
    return sa.Column("sequence", sa.Integer, primary_key=True, autoincrement=True)


def _one_of(column: str, values: Iterable[str]) -> sa.CheckConstraint:
    listed = ", ".join(f"'{value}'" for value in values)
    return sa.CheckConstraint(f"{column} IN ({listed})", name=column)


LOG_STATUS: Final = ("stored", "damaged", "quarantined")
VERDICTS: Final = ("good", "limited", "rejected", "unchecked")
FLIGHT_EVENTS: Final = ("verdict", "retracted")
ROLES: Final = ("identified", "held_out", "excluded")
HOW: Final = ("server", "ephemeral", "direct")
INBOX_KINDS: Final = ("tried", "failed", "stored", "duplicate", "quarantined")
NOTE_KINDS: Final = ("comment", "tag", "untag")
USER_ROLES: Final = ("read", "ingest", "release")
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
    sa.Column("size", Whole, nullable=False),
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
    sa.Index("ix_flights_newest", "vehicle", "added_utc"),
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
    _text("user", nullable=True),  # who retracted; verdicts are the program's
    _one_of("kind", FLIGHT_EVENTS),
    _one_of("verdict", VERDICTS),
)

# The reasons of a verdict as data, one for each of its sentences.
verdict_remarks = _table(
    "verdict_remarks",
    sa.Column(
        "event",
        sa.Integer,
        sa.ForeignKey("flight_events.sequence"),
        primary_key=True,
        autoincrement=False,
    ),
    _text("remarks"),
)

# Marks of what flights measured: a new record looks up its own, however many flights there are.
flight_fingerprints = _table(
    "flight_fingerprints",
    sa.Column("mark", Whole, primary_key=True, autoincrement=False),
    _text("flight", sa.ForeignKey("flights.id"), primary_key=True),
    sqlite_with_rowid=False,
)

# A flight and one stored before it that have samples in common.
flight_repeats = _table(
    "flight_repeats",
    _sequence(),
    _text("flight", sa.ForeignKey("flights.id"), index=True),
    _text("original", sa.ForeignKey("flights.id"), index=True),
    sa.Column("share", Number, nullable=False),
    _text("stretches"),
    _text("at_utc"),
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

# An input is the hash of a log, a vehicle text, a version or another result: no foreign key fits
# them all.
result_inputs = _table(
    "result_inputs",
    _text("key", sa.ForeignKey("results.key"), primary_key=True),
    _text("input_key", primary_key=True, index=True),
)

# What the bytes of a stored file were when it was written; a file that was written again has a
# further row.
stored_files = _table(
    "stored_files",
    _sequence(),
    _text("path", index=True),
    _text("sha256"),
    sa.Column("size", Whole, nullable=False),
    _text("at_utc"),
)

runs = _table(
    "runs",
    _text("id", primary_key=True),
    _text("flow"),
    _text("how"),
    _text("started_utc", index=True),
    _text("ended_utc", nullable=True),
    _text("state", index=True),
    _text("parameters"),
    _text("code_version"),
    _text("error"),
    _one_of("how", HOW),
    _one_of("state", RUN_STATES),
    sa.Index("ix_runs_flow", "flow", "started_utc"),
)

# What happened to each file of the inbox: that it was tried, and in which of the three ways it
# ended.
inbox_events = _table(
    "inbox_events",
    _sequence(),
    _text("path"),
    _text("vehicle"),
    sa.Column("size", Whole, nullable=False),
    sa.Column("mtime_ns", Whole, nullable=False),
    _text("kind"),
    _text("sha256", index=True),
    _text("reason"),
    _text("run", sa.ForeignKey("runs.id"), nullable=True),
    _text("at_utc"),
    _one_of("kind", INBOX_KINDS),
    # In PostgreSQL a hash index (migration r0005). An option of that dialect here would import the
    # dialect wherever a catalogue is opened.
    sa.Index("ix_inbox_events_path", "path"),
    sa.Index("ix_inbox_events_kind", "kind", "sequence"),
)

# Sensor parameters with their covariance, as immutable versions; a flight is bound to the newest of
# its bindings.
calibrations = _table(
    "calibrations",
    _text("id", primary_key=True),
    _text("vehicle", sa.ForeignKey("vehicles.name")),
    sa.Column("number", sa.Integer, nullable=False),
    _text("parent", sa.ForeignKey("calibrations.id"), nullable=True),
    _text("content"),
    _text("created_utc"),
    _text("run", sa.ForeignKey("runs.id"), nullable=True),
    _text("reason"),
    sa.UniqueConstraint("vehicle", "number"),
)

flight_calibrations = _table(
    "flight_calibrations",
    _sequence(),
    _text("flight", sa.ForeignKey("flights.id"), index=True),
    _text("calibration", sa.ForeignKey("calibrations.id")),
    _text("at_utc"),
    _text("run", sa.ForeignKey("runs.id"), nullable=True),
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
    sa.ForeignKeyConstraint(
        ["vehicle", "parent"], ["versions.vehicle", "versions.id"], name="fk_versions_parent"
    ),
    # All that a list shows, in its order: it never reads past the documents, which may be
    # megabytes.
    sa.Index(
        "ix_versions_header",
        "vehicle",
        "number",
        "id",
        "parent",
        "content_sha256",
        "run",
        "created_utc",
    ),
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
    sa.ForeignKeyConstraint(
        ["vehicle", "version"], ["versions.vehicle", "versions.id"], name="fk_name_events_version"
    ),
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


# A user has the role and the token of the newest event; tokens are random, so a plain hash of them
# cannot be guessed.
user_events = _table(
    "user_events",
    _sequence(),
    _text("name"),
    _text("kind"),
    _text("role", nullable=True),
    _text("token_sha256", nullable=True),
    _text("at_utc"),
    _text("by"),
    _one_of("kind", ("added", "removed")),
    _one_of("role", USER_ROLES),
)

# Comments and tags of versions; a version has the tags whose newest event adds them.
version_notes = _table(
    "version_notes",
    _sequence(),
    _text("version", sa.ForeignKey("versions.id"), index=True),
    _text("kind"),
    _text("text"),
    _text("at_utc"),
    _text("user"),
    _one_of("kind", NOTE_KINDS),
)

# Failed runs that a person looked at and does not retry.
run_dismissals = _table(
    "run_dismissals",
    _sequence(),
    _text("run", sa.ForeignKey("runs.id"), index=True),
    _text("reason"),
    _text("at_utc"),
    _text("user"),
)

# A link for each row of the tables above that have a `sequence`; see `chain.py`.
chain = _table(
    "chain",
    sa.Column("number", sa.Integer, primary_key=True, autoincrement=False),
    _text("of_table"),
    sa.Column("of_sequence", sa.Integer, nullable=False),
    _text("sha256"),
    sa.UniqueConstraint("of_table", "of_sequence"),
)

# Links of all other rows; see `row_links.py`.
row_links = _table(
    "row_links",
    sa.Column("number", sa.Integer, primary_key=True, autoincrement=False),
    _text("of_table"),
    _text("of_group"),
    _text("content_sha256"),
    _text("sha256"),
)


def append_only_triggers(
    dialect: str, table: str, keys: Sequence[Sequence[str]], update_when: str = ""
) -> list[str]:
    """Return the SQL statements of a `dialect` that create the append-only triggers of `table`.

    keys : its primary key and unique constraints, as column names; see `sqlite_triggers`.
    update_when : SQL condition on OLD and NEW under which an update is allowed.
    """
    return (
        sqlite_triggers(table, keys, update_when)
        if dialect == "sqlite"
        else postgresql_triggers(table, update_when)
    )


def sqlite_triggers(table: str, keys: Sequence[Sequence[str]], update_when: str = "") -> list[str]:
    """Return append-only triggers for SQLite, as SQL (`append_only_triggers`). ``INSERT OR
    REPLACE`` deletes without firing delete triggers, so an insert with an existing key is refused
    as well."""
    refuse = f"SELECT RAISE(ABORT, '{table}: rows are never changed or deleted')"
    same = [" AND ".join(f'"{column}" = NEW."{column}"' for column in key) for key in keys]
    taken = " OR ".join(f"EXISTS (SELECT 1 FROM {table} WHERE {condition})" for condition in same)
    condition = f" WHEN NOT ({update_when})" if update_when else ""
    return [
        f"CREATE TRIGGER {table}_no_update BEFORE UPDATE ON {table}{condition} BEGIN {refuse}; END",
        f"CREATE TRIGGER {table}_no_delete BEFORE DELETE ON {table} BEGIN {refuse}; END",
        (
            f"CREATE TRIGGER {table}_no_replace BEFORE INSERT ON {table} WHEN {taken} BEGIN"
            f" {refuse}; END"
        ),
    ]


#: Function that the PostgreSQL triggers call; created with the first table.
POSTGRESQL_REFUSAL: Final = """
CREATE FUNCTION refuse_change() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
    RAISE EXCEPTION '%: rows are never changed or deleted', TG_TABLE_NAME
        USING ERRCODE = 'integrity_constraint_violation';
END $$"""


def postgresql_triggers(table: str, update_when: str = "") -> list[str]:
    """Return append-only triggers for PostgreSQL, which call `refuse_change` and so raise an error;
    there ``TRUNCATE`` fires no delete trigger and ``ON CONFLICT`` updates."""
    condition = f" WHEN (NOT ({update_when}))" if update_when else ""
    call = "EXECUTE FUNCTION refuse_change()"
    return [
        f"CREATE TRIGGER {table}_no_update BEFORE UPDATE ON {table} FOR EACH ROW{condition} {call}",
        f"CREATE TRIGGER {table}_no_delete BEFORE DELETE ON {table} FOR EACH ROW {call}",
        f"CREATE TRIGGER {table}_no_truncate BEFORE TRUNCATE ON {table} FOR EACH STATEMENT {call}",
    ]
