"""Index for the newest runs of a flow, so that lists of findings and queries for the last run of a
flow read no other runs."""

from alembic import op

revision = "r0006"
down_revision = "r0005"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Add the index."""
    op.create_index("ix_runs_flow", "runs", ["flow", "started_utc"], unique=False)
