"""Webhooks: one try at a time for each destination, pauses after failures, and receivers that answered."""

from __future__ import annotations

from urllib.parse import urlsplit

import sqlalchemy as sa
from alembic import op

revision = "0003"
down_revision = "0002"
branch_labels = None
depends_on = None

INDEX = "ix_webhook_deliveries_webhook_id_status_next_at_id"


def upgrade() -> None:
    """Apply; existing webhooks have already shown that their receivers want the messages."""
    op.add_column("webhooks", sa.Column("destination", sa.String(300), nullable=False, server_default=""))
    for name in ("sending_until", "paused_until"):
        column = sa.Column(name, sa.Double(), nullable=False, server_default=sa.text("0"))
        op.add_column("webhooks", column)
    op.add_column("webhooks", sa.Column("verified_at", sa.Double()))
    op.create_index(INDEX, "webhook_deliveries", ["webhook_id", "status", "next_at", "id"])
    webhooks = sa.table(
        "webhooks", *(sa.column(name) for name in ("id", "url", "destination", "verified_at", "created_at"))
    )
    op.execute(sa.update(webhooks).values(verified_at=webhooks.c.created_at))
    connection = op.get_bind()
    for row in connection.execute(sa.select(webhooks.c.id, webhooks.c.url)).all():
        changed = sa.update(webhooks).where(webhooks.c.id == row.id).values(destination=_destination(row.url))
        connection.execute(changed)


def _destination(url: str) -> str:
    parts = urlsplit(url)
    port = parts.port or (443 if parts.scheme == "https" else 80)
    return f"{parts.scheme}://{(parts.hostname or '').rstrip('.')}:{port}"


def downgrade() -> None:
    """Undo."""
    op.drop_index(INDEX, table_name="webhook_deliveries")
    for name in ("verified_at", "paused_until", "sending_until", "destination"):
        op.drop_column("webhooks", name)
