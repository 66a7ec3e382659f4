"""An index for the newest run of all: where the clock was set back, a run begins after it all the
same."""

from alembic import op

revision = "r0007"
down_revision = "r0006"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Adds the index."""
    op.create_index(op.f("ix_runs_started_utc"), "runs", ["started_utc"], unique=False)
