"""Indices for what would grow with the catalogue: all that a list of versions shows, so that it
never reads past the documents, which are large; the moves of a vehicle's names in their order; and
those to a version."""

from alembic import op

revision = "r0002"
down_revision = "r0001"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Adds the indices; rows stay as they are."""
    columns = ["vehicle", "number", "id", "parent", "content_sha256", "run", "created_utc"]
    op.create_index("ix_versions_header", "versions", columns, unique=False)
    op.create_index("ix_name_events_order", "name_events", ["vehicle", "sequence"], unique=False)
    op.create_index("ix_name_events_version", "name_events", ["vehicle", "version"], unique=False)
