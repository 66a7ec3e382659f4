"""Indices for queries whose cost would grow with the catalogue.

They cover the columns shown in a list of versions, so that listing does not read the large
documents; the moves of a vehicle's names in order; and the moves to a version.
"""

from alembic import op

revision = "r0002"
down_revision = "r0001"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Add the indices; rows are unchanged."""
    columns = ["vehicle", "number", "id", "parent", "content_sha256", "run", "created_utc"]
    op.create_index("ix_versions_header", "versions", columns, unique=False)
    op.create_index("ix_name_events_order", "name_events", ["vehicle", "sequence"], unique=False)
    op.create_index("ix_name_events_version", "name_events", ["vehicle", "version"], unique=False)
