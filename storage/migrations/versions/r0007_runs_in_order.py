"""Index for the newest run of all flows: if the clock was set back, a new run is still dated after
it."""

from alembic import op

revision = "r0007"
down_revision = "r0006"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Add the index."""
    op.create_index(op.f("ix_runs_started_utc"), "runs", ["started_utc"], unique=False)
