"""Storage: models count in quotas, ended jobs keep no state, lists have indexes, and SQLite frees pages."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0004"
down_revision = "0003"
branch_labels = None
depends_on = None

ENDED = "('succeeded', 'failed', 'cancelled', 'expired')"


def upgrade() -> None:
    """Apply."""
    op.add_column("models", sa.Column("key_id", sa.String(length=64)))
    op.add_column(
        "models", sa.Column("size_bytes", sa.BigInteger(), server_default=sa.text("0"), nullable=False)
    )
    op.execute(
        "UPDATE models SET size_bytes = length(document), "
        "key_id = (SELECT jobs.key_id FROM jobs WHERE jobs.id = models.job_id)"
    )
    op.create_index("ix_models_key_id", "models", ["key_id"])
    op.create_index("ix_jobs_owner_status_id", "jobs", ["owner", "status", "id"])
    op.create_index("ix_jobs_owner_operation_status_id", "jobs", ["owner", "operation", "status", "id"])
    op.create_index("ix_jobs_owner_created_at_id", "jobs", ["owner", "created_at", "id"])
    _drop_state_of_ended_jobs()


def _drop_state_of_ended_jobs() -> None:
    """Delete the state of ended jobs, which never continue, and recount their sizes, events included."""
    ended = f"(SELECT id FROM jobs WHERE status IN {ENDED})"  # noqa: S608 - constants of this file
    for table in ("job_checkpoints", "job_chunks"):
        op.execute(f"DELETE FROM {table} WHERE job_id IN {ended}")  # noqa: S608 - as above
    parts = (
        "SELECT sum(length(document)) FROM job_requests WHERE job_id = jobs.id",
        "SELECT sum(length(document)) FROM job_results WHERE job_id = jobs.id",
        "SELECT sum(size_bytes) FROM artifacts WHERE job_id = jobs.id",
        "SELECT sum(length(CAST(payload AS TEXT))) FROM job_events WHERE job_id = jobs.id",
    )
    total = " + ".join(f"coalesce(({part}), 0)" for part in parts)
    op.execute(f"UPDATE jobs SET size_bytes = {total} WHERE status IN {ENDED}")  # noqa: S608 - as above


def downgrade() -> None:
    """Undo."""
    op.drop_index("ix_jobs_owner_created_at_id", table_name="jobs")
    op.drop_index("ix_jobs_owner_operation_status_id", table_name="jobs")
    op.drop_index("ix_jobs_owner_status_id", table_name="jobs")
    op.drop_index("ix_models_key_id", table_name="models")
    op.drop_column("models", "size_bytes")
    op.drop_column("models", "key_id")
