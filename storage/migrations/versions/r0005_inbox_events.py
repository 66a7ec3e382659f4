"""Events of the files in the inbox, and an index for the newest flights of a vehicle."""

import sqlalchemy as sa
from alembic import op

from aerodb.storage.catalogue import append_only_triggers

revision = "r0005"
down_revision = "r0004"
branch_labels = None
depends_on = None

_TEXT: sa.types.TypeEngine[str] = sa.Text().with_variant(sa.Text(collation="C"), "postgresql")
_WHOLE: sa.types.TypeEngine[int] = sa.BigInteger().with_variant(sa.Integer(), "sqlite")


def upgrade() -> None:
    """Add the table, the index, and the triggers that make the table append-only."""
    op.create_table(
        "inbox_events",
        sa.Column("sequence", sa.Integer(), autoincrement=True, nullable=False),
        sa.Column("path", _TEXT, nullable=False),
        sa.Column("vehicle", _TEXT, nullable=False),
        sa.Column("size", _WHOLE, nullable=False),
        sa.Column("mtime_ns", _WHOLE, nullable=False),
        sa.Column("kind", _TEXT, nullable=False),
        sa.Column("sha256", _TEXT, nullable=False),
        sa.Column("reason", _TEXT, nullable=False),
        sa.Column("run", _TEXT, nullable=True),
        sa.Column("at_utc", _TEXT, nullable=False),
        sa.CheckConstraint(
            "kind IN ('tried', 'failed', 'stored', 'duplicate', 'quarantined')",
            name=op.f("ck_inbox_events_kind"),
        ),
        sa.ForeignKeyConstraint(["run"], ["runs.id"], name=op.f("fk_inbox_events_run")),
        sa.PrimaryKeyConstraint("sequence", name=op.f("pk_inbox_events")),
        sqlite_strict=True,
    )
    op.create_index(
        op.f("ix_inbox_events_path"),
        "inbox_events",
        ["path"],
        unique=False,
        postgresql_using="hash",
    )
    op.create_index(op.f("ix_inbox_events_sha256"), "inbox_events", ["sha256"], unique=False)
    op.create_index("ix_inbox_events_kind", "inbox_events", ["kind", "sequence"], unique=False)
    op.create_index("ix_flights_newest", "flights", ["vehicle", "added_utc"], unique=False)
    for statement in append_only_triggers(
        op.get_bind().dialect.name, "inbox_events", [("sequence",)]
    ):
        op.execute(statement)
