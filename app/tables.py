"""Every table of the service. Times are database time: seconds since 1970 UTC as a double."""

from __future__ import annotations

from sqlalchemy import (
    JSON,
    BigInteger,
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
    UniqueConstraint,
    text,
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
CHUNK_STATUSES = ("open", "running", "done")
ZERO = text("0")  # default for rows older than a column


def _one_of(statuses: tuple[str, ...]) -> CheckConstraint:
    return CheckConstraint(
        "status IN ({})".format(", ".join(f"'{name}'" for name in statuses)), name="status"
    )


jobs = Table(
    "jobs",
    metadata,
    Column("id", String(64), primary_key=True),
    Column("owner", String(64), nullable=False),
    Column("operation", String(32), nullable=False),
    Column("status", String(16), nullable=False),
    Column("priority", Integer, nullable=False),
    Column("summary", JSON, nullable=False),  # small: the part of the request shown in lists
    Column("progress", JSON),
    Column("error", JSON),
    Column("attempt", Integer, nullable=False),
    Column("max_attempts", Integer, nullable=False),
    # rises with every claim; writes with an old one have no effect
    Column("fence", Integer, nullable=False),
    Column("worker", String(128)),
    Column("lease_until", Double),
    Column("event_seq", Integer, nullable=False),  # number of the last event
    Column("model_id", String(64)),
    Column("partial", Boolean, nullable=False),  # the stored result is the best so far, not the final one
    Column("max_seconds", Double),
    Column("deadline_at", Double),  # before the first claim: latest start; afterwards: latest end
    Column("published_at", Double, nullable=False),  # when a wake-up message was last handed out
    Column("created_at", Double, nullable=False),
    Column("started_at", Double),
    Column("updated_at", Double, nullable=False),
    Column("finished_at", Double),
    Column("key_id", String(64)),  # the API key that posted it; None if keys are off
    Column("request_id", String(64)),  # of the call that posted it, to connect its logs with the worker's
    Column("traceparent", String(128)),  # W3C trace context of that call
    Column("spread", Boolean, nullable=False, server_default=text("FALSE")),  # its work is in job_chunks
    Column("flights_estimated", BigInteger, nullable=False, server_default=ZERO),  # charged until it ends
    Column("flights", BigInteger, nullable=False, server_default=ZERO),  # flown so far
    # request, result, files; events too at the end
    Column("size_bytes", BigInteger, nullable=False, server_default=ZERO),
    Column("label", String(100)),  # chosen by the owner, to find the job again
    _one_of(STATUSES),
    Index("ix_jobs_owner_id", "owner", "id"),
    # lists are per owner, newest first: with any filter, the rows of a page are adjacent in the index
    Index("ix_jobs_owner_status_id", "owner", "status", "id"),
    Index("ix_jobs_owner_operation_status_id", "owner", "operation", "status", "id"),
    Index("ix_jobs_owner_label_id", "owner", "label", "id"),
    Index("ix_jobs_owner_created_at_id", "owner", "created_at", "id"),
    Index("ix_jobs_status_published_at", "status", "published_at"),
    Index("ix_jobs_status_lease_until", "status", "lease_until"),
    Index("ix_jobs_status_finished_at", "status", "finished_at"),  # for retention and for durations of jobs
    Index("ix_jobs_key_id_status", "key_id", "status"),  # what a key has in flight
)

# for turns: the most urgent job first, then the oldest
Index("ix_jobs_status_owner_priority_id", jobs.c.status, jobs.c.owner, jobs.c.priority.desc(), jobs.c.id)

owners = Table(
    "owners",
    metadata,
    Column("owner", String(64), primary_key=True),
    # when a worker last took one of their jobs
    Column("served_at", Double, nullable=False, server_default=ZERO),
)


def _job_key() -> Column[str]:
    return Column("job_id", String(64), ForeignKey("jobs.id", ondelete="CASCADE"), primary_key=True)


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

job_chunks = Table(
    "job_chunks",
    metadata,
    _job_key(),
    Column("generation", Integer, primary_key=True, autoincrement=False),
    Column("number", Integer, primary_key=True, autoincrement=False),
    Column("owner", String(64), nullable=False),
    Column("status", String(16), nullable=False),
    Column("attempt", Integer, nullable=False),
    Column("fence", Integer, nullable=False),  # of this chunk; rises with every claim
    Column("worker", String(128)),
    Column("lease_until", Double),
    Column("task", LargeBinary, nullable=False),  # what to fly
    Column("outcome", LargeBinary),  # the outcome; stored once
    Column("at", Double, nullable=False),
    _one_of(CHUNK_STATUSES),
    Index("ix_job_chunks_status_owner_job_id", "status", "owner", "job_id"),
    Index("ix_job_chunks_status_lease_until", "status", "lease_until"),
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
    # no foreign key: written before its job to win the race
    Column("job_id", String(64), nullable=False, index=True),
    Column("at", Double, nullable=False),
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
    Column("created_at", Double, nullable=False, index=True),
    Column("key_id", String(64), index=True),
    Column("size_bytes", BigInteger, nullable=False, server_default=ZERO),
    Index("ix_trajectories_owner_id", "owner", "id"),
)

models = Table(
    "models",
    metadata,
    Column("id", String(64), primary_key=True),
    Column("owner", String(64), nullable=False),
    Column("name", String(200), nullable=False),
    # a model outlives its job
    Column("job_id", String(64), ForeignKey("jobs.id", ondelete="SET NULL"), index=True),
    Column("links_per_wing", Integer),
    Column("document", LargeBinary, nullable=False),  # deflated JSON: model, aircraft, flight, fit
    Column("created_at", Double, nullable=False),
    # of the job that identified it: a model counts in the same quota
    Column("key_id", String(64), index=True),
    Column("size_bytes", BigInteger, nullable=False, server_default=ZERO),
    Index("ix_models_owner_id", "owner", "id"),
)

api_keys = Table(
    "api_keys",
    metadata,
    Column("id", String(64), primary_key=True),
    Column("owner", String(64), nullable=False, index=True),  # keys of one owner see the same jobs
    Column("name", String(64), nullable=False),
    Column("prefix", String(16), nullable=False, unique=True),  # the public part of the key
    Column(
        "secret_sha256", String(64), nullable=False
    ),  # of the secret, 256 random bits: no slow hash needed
    Column("scopes", JSON, nullable=False),
    Column("max_jobs_in_flight", Integer),  # None: no limit
    Column("max_flights_per_day", BigInteger),
    Column("max_stored_bytes", BigInteger),
    Column("created_at", Double, nullable=False),
    Column("expires_at", Double),
    Column("revoked_at", Double),
    Column("last_used_at", Double),
)

key_usage = Table(
    "key_usage",
    metadata,
    Column("key_id", String(64), primary_key=True),
    Column("day", Integer, primary_key=True, autoincrement=False),  # days since 1970 UTC, database time
    Column("flights", BigInteger, nullable=False),  # estimated when a job is posted, corrected when it ends
)

audit_log = Table(
    "audit_log",
    metadata,
    Column("id", String(64), primary_key=True),
    Column("at", Double, nullable=False, index=True),
    Column("owner", String(64)),
    Column("key_id", String(64)),
    Column("action", String(64), nullable=False),  # job.cancel, key.create, auth.refused ...
    Column("target", String(160)),
    Column("outcome", String(32), nullable=False),
    Column("request_id", String(64)),
    Column("address", String(64)),
    Column("detail", JSON),
    Index("ix_audit_log_owner_at", "owner", "at"),
)

webhooks = Table(
    "webhooks",
    metadata,
    Column("id", String(64), primary_key=True),
    Column("owner", String(64), nullable=False),
    Column("url", String(2000), nullable=False),
    Column("destination", String(300), nullable=False, server_default=""),  # scheme, host and port of the url
    Column("events", JSON, nullable=False),  # event types that are sent
    Column("secret", String(128), nullable=False),  # signing needs it in plain text; shown once, on creation
    Column("failures", Integer, nullable=False),  # consecutive failed tries
    # of the destination; the same in all rows of one owner's webhooks to it
    Column("sending_until", Double, nullable=False, server_default=ZERO),  # lease of the try in progress
    Column("paused_until", Double, nullable=False, server_default=ZERO),  # after a failure
    Column("verified_at", Double),  # when the receiver answered the challenge; if None, nothing else is sent
    Column("disabled_at", Double),
    Column("disabled_reason", String(200)),
    Column("created_at", Double, nullable=False),
    Index("ix_webhooks_owner_id", "owner", "id"),
)

webhook_deliveries = Table(
    "webhook_deliveries",
    metadata,
    Column("id", String(64), primary_key=True),  # the message id: the same in every try
    Column("webhook_id", String(64), ForeignKey("webhooks.id", ondelete="CASCADE"), nullable=False),
    Column("job_id", String(64)),  # no foreign key: a delivery outlives its job
    Column("type", String(64), nullable=False),
    Column("payload", JSON, nullable=False),
    Column("status", String(16), nullable=False),  # waiting, delivered, given_up
    Column("attempt", Integer, nullable=False),
    Column("fence", Integer, nullable=False),  # rises with every claim by a sender
    Column("next_at", Double),  # time of the next try, or end of a sender's lease; None when finished
    Column("response_status", Integer),
    Column("error", String(300)),
    Column("created_at", Double, nullable=False),
    Column("finished_at", Double),
    Index("ix_webhook_deliveries_status_next_at", "status", "next_at"),
    Index("ix_webhook_deliveries_webhook_id_id", "webhook_id", "id"),
    Index("ix_webhook_deliveries_webhook_id_status_next_at_id", "webhook_id", "status", "next_at", "id"),
    Index("ix_webhook_deliveries_status_finished_at", "status", "finished_at"),  # retention
    UniqueConstraint("webhook_id", "job_id"),  # a job ends once: one delivery of it per webhook
)

workers = Table(
    "workers",
    metadata,
    Column("name", String(128), primary_key=True),
    Column("version", String(32), nullable=False),
    Column("slots", Integer, nullable=False),  # jobs it can run at once
    Column("busy", Integer, nullable=False),
    Column("started_at", Double, nullable=False),
    Column("seen_at", Double, nullable=False, index=True),  # last sign of life
    Column("stopped_at", Double),  # it shut down regularly
    Column("process", String(128)),  # identity from `app.health.presence`
)

counters = Table(
    "counters",
    metadata,
    Column("name", String(120), primary_key=True),  # with its labels: jobs_finished{status="failed"}
    Column("value", BigInteger, nullable=False),
)
