"""Keys and quotas, audit, webhooks, chunks of spread jobs, turns of owners, workers and counters."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0002"
down_revision = "0001"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Apply."""
    op.create_table(
        "api_keys",
        sa.Column("id", sa.String(length=64), nullable=False),
        sa.Column("owner", sa.String(length=64), nullable=False),
        sa.Column("name", sa.String(length=64), nullable=False),
        sa.Column("prefix", sa.String(length=16), nullable=False),
        sa.Column("secret_sha256", sa.String(length=64), nullable=False),
        sa.Column("scopes", sa.JSON(), nullable=False),
        sa.Column("max_jobs_in_flight", sa.Integer()),
        sa.Column("max_flights_per_day", sa.BigInteger()),
        sa.Column("max_stored_bytes", sa.BigInteger()),
        sa.Column("created_at", sa.Double(), nullable=False),
        sa.Column("expires_at", sa.Double()),
        sa.Column("revoked_at", sa.Double()),
        sa.Column("last_used_at", sa.Double()),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_api_keys")),
        sa.UniqueConstraint("prefix", name=op.f("uq_api_keys_prefix")),
    )
    op.create_index("ix_api_keys_owner", "api_keys", ["owner"])
    op.create_table(
        "audit_log",
        sa.Column("id", sa.String(length=64), nullable=False),
        sa.Column("at", sa.Double(), nullable=False),
        sa.Column("owner", sa.String(length=64)),
        sa.Column("key_id", sa.String(length=64)),
        sa.Column("action", sa.String(length=64), nullable=False),
        sa.Column("target", sa.String(length=160)),
        sa.Column("outcome", sa.String(length=32), nullable=False),
        sa.Column("request_id", sa.String(length=64)),
        sa.Column("address", sa.String(length=64)),
        sa.Column("detail", sa.JSON()),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_audit_log")),
    )
    op.create_index("ix_audit_log_at", "audit_log", ["at"])
    op.create_index("ix_audit_log_owner_at", "audit_log", ["owner", "at"])
    op.create_table(
        "counters",
        sa.Column("name", sa.String(length=120), nullable=False),
        sa.Column("value", sa.BigInteger(), nullable=False),
        sa.PrimaryKeyConstraint("name", name=op.f("pk_counters")),
    )
    op.create_table(
        "key_usage",
        sa.Column("key_id", sa.String(length=64), nullable=False),
        sa.Column("day", sa.Integer(), autoincrement=False, nullable=False),
        sa.Column("flights", sa.BigInteger(), nullable=False),
        sa.PrimaryKeyConstraint("key_id", "day", name=op.f("pk_key_usage")),
    )
    op.create_table(
        "owners",
        sa.Column("owner", sa.String(length=64), nullable=False),
        sa.Column("served_at", sa.Double(), server_default=sa.text("0"), nullable=False),
        sa.PrimaryKeyConstraint("owner", name=op.f("pk_owners")),
    )
    op.execute("INSERT INTO owners (owner) SELECT DISTINCT owner FROM jobs")
    op.create_table(
        "webhooks",
        sa.Column("id", sa.String(length=64), nullable=False),
        sa.Column("owner", sa.String(length=64), nullable=False),
        sa.Column("url", sa.String(length=2000), nullable=False),
        sa.Column("events", sa.JSON(), nullable=False),
        sa.Column("secret", sa.String(length=128), nullable=False),
        sa.Column("failures", sa.Integer(), nullable=False),
        sa.Column("disabled_at", sa.Double()),
        sa.Column("disabled_reason", sa.String(length=200)),
        sa.Column("created_at", sa.Double(), nullable=False),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_webhooks")),
    )
    op.create_index("ix_webhooks_owner_id", "webhooks", ["owner", "id"])
    op.create_table(
        "workers",
        sa.Column("name", sa.String(length=128), nullable=False),
        sa.Column("version", sa.String(length=32), nullable=False),
        sa.Column("slots", sa.Integer(), nullable=False),
        sa.Column("busy", sa.Integer(), nullable=False),
        sa.Column("started_at", sa.Double(), nullable=False),
        sa.Column("seen_at", sa.Double(), nullable=False),
        sa.Column("stopped_at", sa.Double()),
        sa.PrimaryKeyConstraint("name", name=op.f("pk_workers")),
    )
    op.create_index("ix_workers_seen_at", "workers", ["seen_at"])
    op.create_table(
        "job_chunks",
        sa.Column("job_id", sa.String(length=64), nullable=False),
        sa.Column("generation", sa.Integer(), autoincrement=False, nullable=False),
        sa.Column("number", sa.Integer(), autoincrement=False, nullable=False),
        sa.Column("owner", sa.String(length=64), nullable=False),
        sa.Column("status", sa.String(length=16), nullable=False),
        sa.Column("attempt", sa.Integer(), nullable=False),
        sa.Column("fence", sa.Integer(), nullable=False),
        sa.Column("worker", sa.String(length=128)),
        sa.Column("lease_until", sa.Double()),
        sa.Column("task", sa.LargeBinary(), nullable=False),
        sa.Column("outcome", sa.LargeBinary()),
        sa.Column("at", sa.Double(), nullable=False),
        sa.CheckConstraint("status IN ('open', 'running', 'done')", name=op.f("ck_job_chunks_status")),
        sa.ForeignKeyConstraint(
            ["job_id"], ["jobs.id"], name=op.f("fk_job_chunks_job_id"), ondelete="CASCADE"
        ),
        sa.PrimaryKeyConstraint("job_id", "generation", "number", name=op.f("pk_job_chunks")),
    )
    op.create_index("ix_job_chunks_status_lease_until", "job_chunks", ["status", "lease_until"])
    op.create_index("ix_job_chunks_status_owner_job_id", "job_chunks", ["status", "owner", "job_id"])
    op.create_table(
        "webhook_deliveries",
        sa.Column("id", sa.String(length=64), nullable=False),
        sa.Column("webhook_id", sa.String(length=64), nullable=False),
        sa.Column("job_id", sa.String(length=64)),
        sa.Column("type", sa.String(length=64), nullable=False),
        sa.Column("payload", sa.JSON(), nullable=False),
        sa.Column("status", sa.String(length=16), nullable=False),
        sa.Column("attempt", sa.Integer(), nullable=False),
        sa.Column("fence", sa.Integer(), nullable=False),
        sa.Column("next_at", sa.Double()),
        sa.Column("response_status", sa.Integer()),
        sa.Column("error", sa.String(length=300)),
        sa.Column("created_at", sa.Double(), nullable=False),
        sa.Column("finished_at", sa.Double()),
        sa.ForeignKeyConstraint(
            ["webhook_id"], ["webhooks.id"], name=op.f("fk_webhook_deliveries_webhook_id"), ondelete="CASCADE"
        ),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_webhook_deliveries")),
        sa.UniqueConstraint("webhook_id", "job_id", name=op.f("uq_webhook_deliveries_webhook_id_job_id")),
    )
    op.create_index(
        "ix_webhook_deliveries_status_finished_at", "webhook_deliveries", ["status", "finished_at"]
    )
    op.create_index("ix_webhook_deliveries_status_next_at", "webhook_deliveries", ["status", "next_at"])
    op.create_index("ix_webhook_deliveries_webhook_id_id", "webhook_deliveries", ["webhook_id", "id"])
    op.add_column("jobs", sa.Column("key_id", sa.String(length=64)))
    op.add_column("jobs", sa.Column("request_id", sa.String(length=64)))
    op.add_column("jobs", sa.Column("traceparent", sa.String(length=128)))
    op.add_column("jobs", sa.Column("spread", sa.Boolean(), server_default=sa.text("FALSE"), nullable=False))
    op.add_column(
        "jobs", sa.Column("flights_estimated", sa.BigInteger(), server_default=sa.text("0"), nullable=False)
    )
    op.add_column("jobs", sa.Column("flights", sa.BigInteger(), server_default=sa.text("0"), nullable=False))
    op.add_column(
        "jobs", sa.Column("size_bytes", sa.BigInteger(), server_default=sa.text("0"), nullable=False)
    )
    op.add_column("jobs", sa.Column("label", sa.String(length=100)))
    op.drop_index("ix_jobs_status_priority_id", table_name="jobs")
    op.create_index("ix_jobs_status_published_at", "jobs", ["status", "published_at"])
    op.create_index("ix_jobs_owner_label_id", "jobs", ["owner", "label", "id"])
    op.create_index("ix_jobs_key_id_status", "jobs", ["key_id", "status"])
    op.create_index("ix_jobs_status_finished_at", "jobs", ["status", "finished_at"])
    op.create_index(
        "ix_jobs_status_owner_priority_id", "jobs", ["status", "owner", sa.text("priority DESC"), "id"]
    )
    op.add_column("trajectories", sa.Column("key_id", sa.String(length=64)))
    op.add_column(
        "trajectories", sa.Column("size_bytes", sa.BigInteger(), server_default=sa.text("0"), nullable=False)
    )
    op.create_index("ix_trajectories_key_id", "trajectories", ["key_id"])
    op.create_index("ix_trajectories_created_at", "trajectories", ["created_at"])


def downgrade() -> None:
    """Undo."""
    op.drop_index("ix_trajectories_created_at", table_name="trajectories")
    op.drop_index("ix_trajectories_key_id", table_name="trajectories")
    op.drop_column("trajectories", "size_bytes")
    op.drop_column("trajectories", "key_id")
    op.drop_index("ix_jobs_status_owner_priority_id", table_name="jobs")
    op.drop_index("ix_jobs_status_finished_at", table_name="jobs")
    op.drop_index("ix_jobs_key_id_status", table_name="jobs")
    op.drop_index("ix_jobs_owner_label_id", table_name="jobs")
    op.drop_index("ix_jobs_status_published_at", table_name="jobs")
    op.create_index("ix_jobs_status_priority_id", "jobs", ["status", "priority", "id"])
    op.drop_column("jobs", "label")
    op.drop_column("jobs", "size_bytes")
    op.drop_column("jobs", "flights")
    op.drop_column("jobs", "flights_estimated")
    op.drop_column("jobs", "spread")
    op.drop_column("jobs", "traceparent")
    op.drop_column("jobs", "request_id")
    op.drop_column("jobs", "key_id")
    op.drop_index("ix_webhook_deliveries_webhook_id_id", table_name="webhook_deliveries")
    op.drop_index("ix_webhook_deliveries_status_next_at", table_name="webhook_deliveries")
    op.drop_index("ix_webhook_deliveries_status_finished_at", table_name="webhook_deliveries")
    op.drop_table("webhook_deliveries")
    op.drop_index("ix_job_chunks_status_owner_job_id", table_name="job_chunks")
    op.drop_index("ix_job_chunks_status_lease_until", table_name="job_chunks")
    op.drop_table("job_chunks")
    op.drop_index("ix_workers_seen_at", table_name="workers")
    op.drop_table("workers")
    op.drop_index("ix_webhooks_owner_id", table_name="webhooks")
    op.drop_table("webhooks")
    op.drop_table("owners")
    op.drop_table("key_usage")
    op.drop_table("counters")
    op.drop_index("ix_audit_log_owner_at", table_name="audit_log")
    op.drop_index("ix_audit_log_at", table_name="audit_log")
    op.drop_table("audit_log")
    op.drop_index("ix_api_keys_owner", table_name="api_keys")
    op.drop_table("api_keys")
