"""Every table of the service. Times are database time: seconds since 1970 UTC as a double."""

from __future__ import annotations

from sqlalchemy import (
    JSON,
    Boolean,
    CheckConstraint,
    Column,
    Double,
    ForeignKey,
    Index,
    Integer,
    LargeBinary,
    MetaData,
    String,
    Table,
)

metadata = MetaData(
    naming_convention={
        "ix": "ix_%(table_name)s_%(column_0_N_name)s",
        "uq": "uq_%(table_name)s_%(column_0_N_name)s",
        "ck": "ck_%(table_name)s_%(constraint_name)s",
        "fk": "fk_%(table_name)s_%(column_0_N_name)s",
        "pk": "pk_%(table_name)s",
    }
)

STATUSES = ("queued", "running", "cancelling", "succeeded", "failed", "cancelled", "expired")

jobs = Table(
    "jobs",
    metadata,
    Column("id", String(64), primary_key=True),
    Column("owner", String(64), nullable=False),
    Column("operation", String(32), nullable=False),
    Column("status", String(16), nullable=False),
    Column("priority", Integer, nullable=False),
    Column("summary", JSON, nullable=False),  # small: what the listing shows of the request
    Column("progress", JSON),
    Column("error", JSON),
    Column("attempt", Integer, nullable=False),
    Column("max_attempts", Integer, nullable=False),
    Column(
        "fence", Integer, nullable=False
    ),  # rises with every claim; a write with an old one changes nothing
    Column("worker", String(128)),
    Column("lease_until", Double),
    Column("event_seq", Integer, nullable=False),  # the last event's number
    Column("model_id", String(64)),
    Column("partial", Boolean, nullable=False),  # the stored result is the best so far, not the end
    Column("max_seconds", Double),
    Column("deadline_at", Double),  # set by the first claim
    Column("published_at", Double, nullable=False),  # when a wake-up message was last handed out
    Column("created_at", Double, nullable=False),
    Column("started_at", Double),
    Column("updated_at", Double, nullable=False),
    Column("finished_at", Double),
    CheckConstraint("status IN ({})".format(", ".join(f"'{name}'" for name in STATUSES)), name="status"),
    Index("ix_jobs_owner_id", "owner", "id"),
    Index("ix_jobs_status_priority_id", "status", "priority", "id"),
    Index("ix_jobs_status_lease_until", "status", "lease_until"),
)


def _job_key(*, primary_key: bool = True) -> Column[str]:
    return Column(
        "job_id",
        String(64),
        ForeignKey("jobs.id", ondelete="CASCADE"),
        primary_key=primary_key,
        nullable=False,
    )


job_requests = Table(
    "job_requests",
    metadata,
    _job_key(),
    Column("document", LargeBinary, nullable=False),  # deflated JSON with every sample inline
    Column("sha256", String(64), nullable=False),
)

job_events = Table(
    "job_events",
    metadata,
    _job_key(),
    Column("seq", Integer, primary_key=True, autoincrement=False),
    Column("type", String(32), nullable=False),
    Column("payload", JSON, nullable=False),
    Column("at", Double, nullable=False),
)

job_checkpoints = Table(
    "job_checkpoints",
    metadata,
    _job_key(),
    Column("data", LargeBinary, nullable=False),
    Column("fence", Integer, nullable=False),
    Column("at", Double, nullable=False),
)

job_results = Table(
    "job_results",
    metadata,
    _job_key(),
    Column("document", LargeBinary, nullable=False),  # deflated JSON
    Column("partial", Boolean, nullable=False),
    Column("at", Double, nullable=False),
)

artifacts = Table(
    "artifacts",
    metadata,
    _job_key(),
    Column("name", String(160), primary_key=True),
    Column("media_type", String(80), nullable=False),
    Column("size_bytes", Integer, nullable=False),
    Column("data", LargeBinary, nullable=False),
    Column("at", Double, nullable=False),
)

idempotency_keys = Table(
    "idempotency_keys",
    metadata,
    Column("owner", String(64), primary_key=True),
    Column("key", String(255), primary_key=True),
    Column("operation", String(32), nullable=False),
    Column("sha256", String(64), nullable=False),
    Column("job_id", String(64), nullable=False),  # no foreign key: written before its job to win the race
    Column("at", Double, nullable=False),
    Index("ix_idempotency_keys_job_id", "job_id"),
)

trajectories = Table(
    "trajectories",
    metadata,
    Column("id", String(64), primary_key=True),
    Column("owner", String(64), nullable=False),
    Column("name", String(64), nullable=False),
    Column("rows", Integer, nullable=False),
    Column("duration_s", Double, nullable=False),
    Column("document", LargeBinary, nullable=False),  # deflated JSON columns
    Column("created_at", Double, nullable=False),
    Index("ix_trajectories_owner_id", "owner", "id"),
)

models = Table(
    "models",
    metadata,
    Column("id", String(64), primary_key=True),
    Column("owner", String(64), nullable=False),
    Column("name", String(200), nullable=False),
    Column("job_id", String(64), ForeignKey("jobs.id", ondelete="SET NULL")),  # a model outlives its job
    Column("links_per_wing", Integer),
    Column("document", LargeBinary, nullable=False),  # deflated JSON: model, aircraft, flight, fit
    Column("created_at", Double, nullable=False),
    Index("ix_models_owner_id", "owner", "id"),
    Index("ix_models_job_id", "job_id"),
)
