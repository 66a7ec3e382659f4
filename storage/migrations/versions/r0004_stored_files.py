"""Hashes of all stored files, to detect files that have changed since they were written."""

import sqlalchemy as sa
from alembic import op

from aerodb.storage.catalogue import append_only_triggers

revision = "r0004"
down_revision = "r0003"
branch_labels = None
depends_on = None

_TEXT: sa.types.TypeEngine[str] = sa.Text().with_variant(sa.Text(collation="C"), "postgresql")
_WHOLE: sa.types.TypeEngine[int] = sa.BigInteger().with_variant(sa.Integer(), "sqlite")


def upgrade() -> None:
    """Add the table, and the triggers that make it append-only."""
    op.create_table(
        "stored_files",
        sa.Column("sequence", sa.Integer(), autoincrement=True, nullable=False),
        sa.Column("path", _TEXT, nullable=False),
        sa.Column("sha256", _TEXT, nullable=False),
        sa.Column("size", _WHOLE, nullable=False),
        sa.Column("at_utc", _TEXT, nullable=False),
        sa.PrimaryKeyConstraint("sequence", name=op.f("pk_stored_files")),
        sqlite_strict=True,
    )
    op.create_index(op.f("ix_stored_files_path"), "stored_files", ["path"], unique=False)
    for statement in append_only_triggers(
        op.get_bind().dialect.name, "stored_files", [("sequence",)]
    ):
        op.execute(statement)
