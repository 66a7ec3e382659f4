"""Users with roles, and the chain of hashes over all events, those that are there included."""

import sqlalchemy as sa
from alembic import op

from aerodb.storage.catalogue import append_only_triggers, link_rows

revision = "r0008"
down_revision = "r0007"
branch_labels = None
depends_on = None

_TEXT: sa.types.TypeEngine[str] = sa.Text().with_variant(sa.Text(collation="C"), "postgresql")
#: Tables of events before this migration.
_EVENTS = (
    "vehicle_texts",
    "flight_records",
    "flight_events",
    "flight_repeats",
    "stored_files",
    "inbox_events",
    "flight_calibrations",
    "name_events",
)
#: Table -> primary key and unique constraints; see `append_only_triggers`.
_APPEND_ONLY: dict[str, list[tuple[str, ...]]] = {
    "user_events": [("sequence",)],
    "chain": [("number",), ("of_table", "of_sequence")],
}


def upgrade() -> None:
    """Add the tables and who retracted, link what is stored, and make the tables append-only."""
    op.add_column("flight_events", sa.Column("user", _TEXT, nullable=True))
    op.create_table(
        "user_events",
        sa.Column("sequence", sa.Integer(), autoincrement=True, nullable=False),
        sa.Column("name", _TEXT, nullable=False),
        sa.Column("kind", _TEXT, nullable=False),
        sa.Column("role", _TEXT, nullable=True),
        sa.Column("token_sha256", _TEXT, nullable=True),
        sa.Column("at_utc", _TEXT, nullable=False),
        sa.Column("by", _TEXT, nullable=False),
        sa.CheckConstraint("kind IN ('added', 'removed')", name=op.f("ck_user_events_kind")),
        sa.CheckConstraint(
            "role IN ('read', 'ingest', 'release')", name=op.f("ck_user_events_role")
        ),
        sa.PrimaryKeyConstraint("sequence", name=op.f("pk_user_events")),
        sqlite_strict=True,
    )
    op.create_table(
        "chain",
        sa.Column("number", sa.Integer(), autoincrement=False, nullable=False),
        sa.Column("of_table", _TEXT, nullable=False),
        sa.Column("of_sequence", sa.Integer(), nullable=False),
        sa.Column("sha256", _TEXT, nullable=False),
        sa.PrimaryKeyConstraint("number", name=op.f("pk_chain")),
        sa.UniqueConstraint("of_table", "of_sequence", name=op.f("uq_chain_of_table_of_sequence")),
        sqlite_strict=True,
    )
    connection = op.get_bind()
    for name in _EVENTS:
        table = sa.Table(name, sa.MetaData(), autoload_with=connection, resolve_fks=False)
        link_rows(connection, table, 0)
    for name, keys in _APPEND_ONLY.items():
        for statement in append_only_triggers(connection.dialect.name, name, keys):
            op.execute(statement)
