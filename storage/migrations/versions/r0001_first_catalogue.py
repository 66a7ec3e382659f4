"""First catalogue: vehicles, logs, flights, results, runs, versions, names, and their relations."""

import sqlalchemy as sa
from alembic import op

from aerodb.storage.catalogue import POSTGRESQL_REFUSAL, append_only_triggers

revision = "r0001"
down_revision = None
branch_labels = None
depends_on = None

_TEXT: sa.types.TypeEngine[str] = sa.Text().with_variant(sa.Text(collation="C"), "postgresql")
_NUMBER: sa.types.TypeEngine[float] = sa.Double().with_variant(sa.REAL(), "sqlite")

#: Table -> primary key and unique constraints; see `append_only_triggers`.
_APPEND_ONLY: dict[str, list[tuple[str, ...]]] = {
    "vehicles": [("name",)],
    "vehicle_texts": [("sequence",)],
    "log_files": [("sha256",)],
    "runs": [("id",)],
    "flights": [("id",), ("vehicle", "name")],
    "flight_records": [("sequence",)],
    "flight_events": [("sequence",)],
    "results": [("key",)],
    "result_inputs": [("key", "input_key")],
    "run_results": [("run", "key")],
    "versions": [("id",), ("vehicle", "id"), ("vehicle", "number")],
    "version_inputs": [("version", "input_key")],
    "version_flights": [("version", "flight")],
    "run_versions": [("run", "version")],
    "name_events": [("sequence",), ("vehicle", "name", "step")],
}

#: Tables with one permitted change: retrying a log, ending a run.
_UPDATE_WHEN = {
    "log_files": "OLD.status = 'quarantined' AND OLD.sha256 = NEW.sha256",
    "runs": "OLD.ended_utc IS NULL AND OLD.id = NEW.id",
}


def upgrade() -> None:
    """Create all tables, and the triggers that make them append-only."""
    _logs_and_runs()
    _flights()
    _results()
    _versions()
    dialect = op.get_bind().dialect.name
    if dialect == "postgresql":
        op.execute(POSTGRESQL_REFUSAL)
    for table, keys in _APPEND_ONLY.items():
        for statement in append_only_triggers(dialect, table, keys, _UPDATE_WHEN.get(table, "")):
            op.execute(statement)


def _logs_and_runs() -> None:
    op.create_table(
        "vehicles",
        sa.Column("name", _TEXT, nullable=False),
        sa.Column("added_utc", _TEXT, nullable=False),
        sa.PrimaryKeyConstraint("name", name=op.f("pk_vehicles")),
        sqlite_strict=True,
    )
    op.create_table(
        "vehicle_texts",
        sa.Column("sequence", sa.Integer(), autoincrement=True, nullable=False),
        sa.Column("vehicle", _TEXT, nullable=False),
        sa.Column("text", _TEXT, nullable=False),
        sa.Column("sha256", _TEXT, nullable=False),
        sa.Column("added_utc", _TEXT, nullable=False),
        sa.ForeignKeyConstraint(
            ["vehicle"], ["vehicles.name"], name=op.f("fk_vehicle_texts_vehicle")
        ),
        sa.PrimaryKeyConstraint("sequence", name=op.f("pk_vehicle_texts")),
        sqlite_strict=True,
    )
    op.create_index(op.f("ix_vehicle_texts_vehicle"), "vehicle_texts", ["vehicle"], unique=False)
    op.create_table(
        "log_files",
        sa.Column("sha256", _TEXT, nullable=False),
        sa.Column("name", _TEXT, nullable=False),
        sa.Column("size", sa.BigInteger().with_variant(sa.Integer(), "sqlite"), nullable=False),
        sa.Column("format", _TEXT, nullable=False),
        sa.Column("status", _TEXT, nullable=False),
        sa.Column("reason", _TEXT, nullable=False),
        sa.Column("damage", _TEXT, nullable=False),
        sa.Column("added_utc", _TEXT, nullable=False),
        sa.CheckConstraint(
            "status IN ('stored', 'damaged', 'quarantined')", name=op.f("ck_log_files_status")
        ),
        sa.PrimaryKeyConstraint("sha256", name=op.f("pk_log_files")),
        sqlite_strict=True,
    )
    op.create_table(
        "runs",
        sa.Column("id", _TEXT, nullable=False),
        sa.Column("flow", _TEXT, nullable=False),
        sa.Column("how", _TEXT, nullable=False),
        sa.Column("started_utc", _TEXT, nullable=False),
        sa.Column("ended_utc", _TEXT, nullable=True),
        sa.Column("state", _TEXT, nullable=False),
        sa.Column("parameters", _TEXT, nullable=False),
        sa.Column("code_version", _TEXT, nullable=False),
        sa.Column("error", _TEXT, nullable=False),
        sa.CheckConstraint("how IN ('server', 'ephemeral', 'direct')", name=op.f("ck_runs_how")),
        sa.CheckConstraint(
            "state IN ('running', 'completed', 'failed', 'crashed', 'cancelled')",
            name=op.f("ck_runs_state"),
        ),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_runs")),
        sqlite_strict=True,
    )
    op.create_index(op.f("ix_runs_state"), "runs", ["state"], unique=False)


def _flights() -> None:
    op.create_table(
        "flights",
        sa.Column("id", _TEXT, nullable=False),
        sa.Column("vehicle", _TEXT, nullable=False),
        sa.Column("name", _TEXT, nullable=True),
        sa.Column("log_sha256", _TEXT, nullable=False),
        sa.Column("added_utc", _TEXT, nullable=False),
        sa.ForeignKeyConstraint(
            ["log_sha256"], ["log_files.sha256"], name=op.f("fk_flights_log_sha256")
        ),
        sa.ForeignKeyConstraint(["vehicle"], ["vehicles.name"], name=op.f("fk_flights_vehicle")),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_flights")),
        sa.UniqueConstraint("vehicle", "name", name=op.f("uq_flights_vehicle_name")),
        sqlite_strict=True,
    )
    op.create_index(op.f("ix_flights_log_sha256"), "flights", ["log_sha256"], unique=False)
    op.create_index(op.f("ix_flights_name"), "flights", ["name"], unique=False)
    op.create_table(
        "flight_records",
        sa.Column("sequence", sa.Integer(), autoincrement=True, nullable=False),
        sa.Column("flight", _TEXT, nullable=False),
        sa.Column("mapping", _TEXT, nullable=False),
        sa.Column("start_utc", _TEXT, nullable=True),
        sa.Column("duration", _NUMBER, nullable=False),
        sa.Column("samples", sa.Integer(), nullable=False),
        sa.Column("step", _NUMBER, nullable=False),
        sa.Column("added_utc", _TEXT, nullable=False),
        sa.ForeignKeyConstraint(["flight"], ["flights.id"], name=op.f("fk_flight_records_flight")),
        sa.PrimaryKeyConstraint("sequence", name=op.f("pk_flight_records")),
        sqlite_strict=True,
    )
    op.create_index(op.f("ix_flight_records_flight"), "flight_records", ["flight"], unique=False)
    op.create_table(
        "flight_events",
        sa.Column("sequence", sa.Integer(), autoincrement=True, nullable=False),
        sa.Column("flight", _TEXT, nullable=False),
        sa.Column("kind", _TEXT, nullable=False),
        sa.Column("verdict", _TEXT, nullable=True),
        sa.Column("reasons", _TEXT, nullable=False),
        sa.Column("at_utc", _TEXT, nullable=False),
        sa.CheckConstraint("kind IN ('verdict', 'retracted')", name=op.f("ck_flight_events_kind")),
        sa.CheckConstraint(
            "verdict IN ('good', 'limited', 'rejected', 'unchecked')",
            name=op.f("ck_flight_events_verdict"),
        ),
        sa.ForeignKeyConstraint(["flight"], ["flights.id"], name=op.f("fk_flight_events_flight")),
        sa.PrimaryKeyConstraint("sequence", name=op.f("pk_flight_events")),
        sqlite_strict=True,
    )
    op.create_index(op.f("ix_flight_events_flight"), "flight_events", ["flight"], unique=False)


def _results() -> None:
    op.create_table(
        "results",
        sa.Column("key", _TEXT, nullable=False),
        sa.Column("step", _TEXT, nullable=False),
        sa.Column("kind", _TEXT, nullable=False),
        sa.Column("flight", _TEXT, nullable=True),
        sa.Column("path", _TEXT, nullable=False),
        sa.Column("settings", _TEXT, nullable=False),
        sa.Column("result_version", sa.Integer(), nullable=False),
        sa.Column("code_version", _TEXT, nullable=False),
        sa.Column("created_utc", _TEXT, nullable=False),
        sa.ForeignKeyConstraint(["flight"], ["flights.id"], name=op.f("fk_results_flight")),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_results")),
        sqlite_strict=True,
    )
    op.create_index(op.f("ix_results_flight"), "results", ["flight"], unique=False)
    op.create_table(
        "result_inputs",
        sa.Column("key", _TEXT, nullable=False),
        sa.Column("input_key", _TEXT, nullable=False),
        sa.ForeignKeyConstraint(["key"], ["results.key"], name=op.f("fk_result_inputs_key")),
        sa.PrimaryKeyConstraint("key", "input_key", name=op.f("pk_result_inputs")),
        sqlite_strict=True,
    )
    op.create_index(
        op.f("ix_result_inputs_input_key"), "result_inputs", ["input_key"], unique=False
    )
    op.create_table(
        "run_results",
        sa.Column("run", _TEXT, nullable=False),
        sa.Column("key", _TEXT, nullable=False),
        sa.ForeignKeyConstraint(["key"], ["results.key"], name=op.f("fk_run_results_key")),
        sa.ForeignKeyConstraint(["run"], ["runs.id"], name=op.f("fk_run_results_run")),
        sa.PrimaryKeyConstraint("run", "key", name=op.f("pk_run_results")),
        sqlite_strict=True,
    )
    op.create_index(op.f("ix_run_results_key"), "run_results", ["key"], unique=False)


def _versions() -> None:
    op.create_table(
        "versions",
        sa.Column("id", _TEXT, nullable=False),
        sa.Column("vehicle", _TEXT, nullable=False),
        sa.Column("number", sa.Integer(), nullable=False),
        sa.Column("parent", _TEXT, nullable=True),
        sa.Column("content", _TEXT, nullable=False),
        sa.Column("content_sha256", _TEXT, nullable=False),
        sa.Column("settings", _TEXT, nullable=False),
        sa.Column("report", _TEXT, nullable=False),
        sa.Column("run", _TEXT, nullable=True),
        sa.Column("created_utc", _TEXT, nullable=False),
        sa.ForeignKeyConstraint(["run"], ["runs.id"], name=op.f("fk_versions_run")),
        sa.ForeignKeyConstraint(
            ["vehicle", "parent"], ["versions.vehicle", "versions.id"], name="fk_versions_parent"
        ),
        sa.ForeignKeyConstraint(["vehicle"], ["vehicles.name"], name=op.f("fk_versions_vehicle")),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_versions")),
        sa.UniqueConstraint("vehicle", "id", name=op.f("uq_versions_vehicle_id")),
        sa.UniqueConstraint("vehicle", "number", name=op.f("uq_versions_vehicle_number")),
        sqlite_strict=True,
    )
    op.create_index(op.f("ix_versions_parent"), "versions", ["parent"], unique=False)
    op.create_table(
        "version_inputs",
        sa.Column("version", _TEXT, nullable=False),
        sa.Column("input_key", _TEXT, nullable=False),
        sa.ForeignKeyConstraint(
            ["version"], ["versions.id"], name=op.f("fk_version_inputs_version")
        ),
        sa.PrimaryKeyConstraint("version", "input_key", name=op.f("pk_version_inputs")),
        sqlite_strict=True,
    )
    op.create_index(
        op.f("ix_version_inputs_input_key"), "version_inputs", ["input_key"], unique=False
    )
    op.create_table(
        "version_flights",
        sa.Column("version", _TEXT, nullable=False),
        sa.Column("flight", _TEXT, nullable=False),
        sa.Column("role", _TEXT, nullable=False),
        sa.Column("reason", _TEXT, nullable=False),
        sa.CheckConstraint(
            "role IN ('identified', 'held_out', 'excluded')", name=op.f("ck_version_flights_role")
        ),
        sa.ForeignKeyConstraint(["flight"], ["flights.id"], name=op.f("fk_version_flights_flight")),
        sa.ForeignKeyConstraint(
            ["version"], ["versions.id"], name=op.f("fk_version_flights_version")
        ),
        sa.PrimaryKeyConstraint("version", "flight", name=op.f("pk_version_flights")),
        sqlite_strict=True,
    )
    op.create_index(op.f("ix_version_flights_flight"), "version_flights", ["flight"], unique=False)
    op.create_table(
        "run_versions",
        sa.Column("run", _TEXT, nullable=False),
        sa.Column("version", _TEXT, nullable=False),
        sa.ForeignKeyConstraint(["run"], ["runs.id"], name=op.f("fk_run_versions_run")),
        sa.ForeignKeyConstraint(["version"], ["versions.id"], name=op.f("fk_run_versions_version")),
        sa.PrimaryKeyConstraint("run", "version", name=op.f("pk_run_versions")),
        sqlite_strict=True,
    )
    op.create_index(op.f("ix_run_versions_version"), "run_versions", ["version"], unique=False)
    op.create_table(
        "name_events",
        sa.Column("sequence", sa.Integer(), autoincrement=True, nullable=False),
        sa.Column("vehicle", _TEXT, nullable=False),
        sa.Column("name", _TEXT, nullable=False),
        sa.Column("step", sa.Integer(), nullable=False),
        sa.Column("version", _TEXT, nullable=False),
        sa.Column("previous", _TEXT, nullable=True),
        sa.Column("at_utc", _TEXT, nullable=False),
        sa.Column("user", _TEXT, nullable=False),
        sa.Column("reason", _TEXT, nullable=False),
        sa.ForeignKeyConstraint(
            ["vehicle", "version"],
            ["versions.vehicle", "versions.id"],
            name="fk_name_events_version",
        ),
        sa.PrimaryKeyConstraint("sequence", name=op.f("pk_name_events")),
        sa.UniqueConstraint(
            "vehicle", "name", "step", name=op.f("uq_name_events_vehicle_name_step")
        ),
        sqlite_strict=True,
    )
