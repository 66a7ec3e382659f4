"""An index for the newest runs of a flow: lists of findings, and what asks for a flow's last run,
read no other runs."""

from alembic import op

revision = "r0006"
down_revision = "r0005"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Adds the index."""
    op.create_index("ix_runs_flow", "runs", ["flow", "started_utc"], unique=False)
