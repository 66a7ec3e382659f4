"""Hashes of all rows that are not events, those that are there included."""

import sqlalchemy as sa
from alembic import op

from aerodb.storage.catalogue import append_only_triggers, link_stored_rows

revision = "r0009"
down_revision = "r0008"
branch_labels = None
depends_on = None

_TEXT: sa.types.TypeEngine[str] = sa.Text().with_variant(sa.Text(collation="C"), "postgresql")
#: Tables whose rows are linked, as of this migration.
_LINKED = (
    "vehicles",
    "flights",
    "flight_fingerprints",
    "results",
    "result_inputs",
    "calibrations",
    "versions",
    "version_inputs",
    "version_flights",
)


def upgrade() -> None:
    """Add the table, link what is stored, and make the table append-only."""
    op.create_table(
        "row_links",
        sa.Column("number", sa.Integer(), autoincrement=False, nullable=False),
        sa.Column("of_table", _TEXT, nullable=False),
        sa.Column("of_group", _TEXT, nullable=False),
        sa.Column("content_sha256", _TEXT, nullable=False),
        sa.Column("sha256", _TEXT, nullable=False),
        sa.PrimaryKeyConstraint("number", name=op.f("pk_row_links")),
        sqlite_strict=True,
    )
    connection = op.get_bind()
    for name in _LINKED:
        table = sa.Table(name, sa.MetaData(), autoload_with=connection, resolve_fks=False)
        link_stored_rows(connection, table)
    for statement in append_only_triggers(connection.dialect.name, "row_links", [("number",)]):
        op.execute(statement)
