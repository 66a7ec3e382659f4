"""Comments and tags of versions, and dismissals of failed runs."""

import sqlalchemy as sa
from alembic import op

from aerodb.storage.catalogue import append_only_triggers

revision = "r0010"
down_revision = "r0009"
branch_labels = None
depends_on = None

_TEXT: sa.types.TypeEngine[str] = sa.Text().with_variant(sa.Text(collation="C"), "postgresql")


def _events(name: str, of: str, key: str, *parts: sa.schema.SchemaItem) -> None:
    """Create an append-only table of events about rows of another table."""
    op.create_table(
        name,
        sa.Column("sequence", sa.Integer(), autoincrement=True, nullable=False),
        sa.Column(of, _TEXT, nullable=False),
        *parts,
        sa.Column("at_utc", _TEXT, nullable=False),
        sa.Column("user", _TEXT, nullable=False),
        sa.ForeignKeyConstraint([of], [key], name=op.f(f"fk_{name}_{of}")),
        sa.PrimaryKeyConstraint("sequence", name=op.f(f"pk_{name}")),
        sqlite_strict=True,
    )
    op.create_index(op.f(f"ix_{name}_{of}"), name, [of])
    for statement in append_only_triggers(op.get_bind().dialect.name, name, [("sequence",)]):
        op.execute(statement)


def upgrade() -> None:
    """Add both tables."""
    _events(
        "version_notes",
        "version",
        "versions.id",
        sa.Column("kind", _TEXT, nullable=False),
        sa.Column("text", _TEXT, nullable=False),
        sa.CheckConstraint(
            "kind IN ('comment', 'tag', 'untag')", name=op.f("ck_version_notes_kind")
        ),
    )
    _events("run_dismissals", "run", "runs.id", sa.Column("reason", _TEXT, nullable=False))
