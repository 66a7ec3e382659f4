"""Results of conditioning and flight-path reconstruction: marks and repeats of flights,
calibrations and their bindings."""

import sqlalchemy as sa
from alembic import op

from aerodb.storage.catalogue import append_only_triggers

revision = "r0003"
down_revision = "r0002"
branch_labels = None
depends_on = None

_TEXT: sa.types.TypeEngine[str] = sa.Text().with_variant(sa.Text(collation="C"), "postgresql")
_NUMBER: sa.types.TypeEngine[float] = sa.Double().with_variant(sa.REAL(), "sqlite")
_WHOLE: sa.types.TypeEngine[int] = sa.BigInteger().with_variant(sa.Integer(), "sqlite")

#: Table -> primary key and unique constraints; see `append_only_triggers`.
_APPEND_ONLY: dict[str, list[tuple[str, ...]]] = {
    "flight_fingerprints": [("mark", "flight")],
    "flight_repeats": [("sequence",)],
    "calibrations": [("id",), ("vehicle", "number")],
    "flight_calibrations": [("sequence",)],
}


def upgrade() -> None:
    """Add the tables, and the triggers that make them append-only."""
    _repetitions()
    _calibrations()
    for table, keys in _APPEND_ONLY.items():
        for statement in append_only_triggers(op.get_bind().dialect.name, table, keys):
            op.execute(statement)


def _repetitions() -> None:
    op.create_table(
        "flight_fingerprints",
        sa.Column("mark", _WHOLE, nullable=False, autoincrement=False),
        sa.Column("flight", _TEXT, nullable=False),
        sa.ForeignKeyConstraint(
            ["flight"], ["flights.id"], name=op.f("fk_flight_fingerprints_flight")
        ),
        sa.PrimaryKeyConstraint("mark", "flight", name=op.f("pk_flight_fingerprints")),
        sqlite_strict=True,
        sqlite_with_rowid=False,
    )
    op.create_table(
        "flight_repeats",
        sa.Column("sequence", sa.Integer(), autoincrement=True, nullable=False),
        sa.Column("flight", _TEXT, nullable=False),
        sa.Column("original", _TEXT, nullable=False),
        sa.Column("share", _NUMBER, nullable=False),
        sa.Column("stretches", _TEXT, nullable=False),
        sa.Column("at_utc", _TEXT, nullable=False),
        sa.ForeignKeyConstraint(["flight"], ["flights.id"], name=op.f("fk_flight_repeats_flight")),
        sa.ForeignKeyConstraint(
            ["original"], ["flights.id"], name=op.f("fk_flight_repeats_original")
        ),
        sa.PrimaryKeyConstraint("sequence", name=op.f("pk_flight_repeats")),
        sqlite_strict=True,
    )
    op.create_index(op.f("ix_flight_repeats_flight"), "flight_repeats", ["flight"], unique=False)
    op.create_index(
        op.f("ix_flight_repeats_original"), "flight_repeats", ["original"], unique=False
    )


def _calibrations() -> None:
    op.create_table(
        "calibrations",
        sa.Column("id", _TEXT, nullable=False),
        sa.Column("vehicle", _TEXT, nullable=False),
        sa.Column("number", sa.Integer(), nullable=False),
        sa.Column("parent", _TEXT, nullable=True),
        sa.Column("content", _TEXT, nullable=False),
        sa.Column("created_utc", _TEXT, nullable=False),
        sa.Column("run", _TEXT, nullable=True),
        sa.Column("reason", _TEXT, nullable=False),
        sa.ForeignKeyConstraint(["run"], ["runs.id"], name=op.f("fk_calibrations_run")),
        sa.ForeignKeyConstraint(
            ["parent"], ["calibrations.id"], name=op.f("fk_calibrations_parent")
        ),
        sa.ForeignKeyConstraint(
            ["vehicle"], ["vehicles.name"], name=op.f("fk_calibrations_vehicle")
        ),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_calibrations")),
        sa.UniqueConstraint("vehicle", "number", name=op.f("uq_calibrations_vehicle_number")),
        sqlite_strict=True,
    )
    op.create_table(
        "flight_calibrations",
        sa.Column("sequence", sa.Integer(), autoincrement=True, nullable=False),
        sa.Column("flight", _TEXT, nullable=False),
        sa.Column("calibration", _TEXT, nullable=False),
        sa.Column("at_utc", _TEXT, nullable=False),
        sa.Column("run", _TEXT, nullable=True),
        sa.ForeignKeyConstraint(
            ["calibration"], ["calibrations.id"], name=op.f("fk_flight_calibrations_calibration")
        ),
        sa.ForeignKeyConstraint(
            ["flight"], ["flights.id"], name=op.f("fk_flight_calibrations_flight")
        ),
        sa.ForeignKeyConstraint(["run"], ["runs.id"], name=op.f("fk_flight_calibrations_run")),
        sa.PrimaryKeyConstraint("sequence", name=op.f("pk_flight_calibrations")),
        sqlite_strict=True,
    )
    op.create_index(
        op.f("ix_flight_calibrations_flight"), "flight_calibrations", ["flight"], unique=False
    )
