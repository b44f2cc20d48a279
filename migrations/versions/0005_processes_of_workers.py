"""Process id of a worker, so that a dead one is not mistaken for one that hangs."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0005"
down_revision = "0004"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Apply."""
    op.add_column("workers", sa.Column("process", sa.String(length=128)))


def downgrade() -> None:
    """Take back."""
    op.drop_column("workers", "process")
