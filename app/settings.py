"""Settings of the service, read from ``MORPHID_*`` environment variables, refusing unsafe combinations."""

from __future__ import annotations

import ipaddress
from pathlib import Path
from typing import Literal, Self
from urllib.parse import unquote, urlsplit

from pydantic import Field, ValidationError, model_validator
from pydantic_settings import BaseSettings, SettingsConfigDict

from app.broker import canonical

LOOPBACK_NAMES = frozenset({"localhost", "ip6-localhost"})
# what examples, images and tutorials come with, and what is tried first
DEFAULT_PASSWORDS = frozenset(
    {"morphid", "postgres", "password", "passwort", "changeme", "secret", "admin", "root", "test"}
)


class UnsafeSettings(ValueError):
    """The settings contradict one another or would expose the service; the message says what to change."""


def is_loopback(host: str) -> bool:
    """Tell whether `host` (a name or an address, with or without brackets) reaches this machine only."""
    bare = host.strip("[]").lower()
    if bare in LOOPBACK_NAMES:
        return True
    try:
        return ipaddress.ip_address(bare).is_loopback
    except ValueError:
        return False


class Settings(BaseSettings):
    """Everything that an operator may set; defaults serve one user on one machine."""

    model_config = SettingsConfigDict(env_prefix="MORPHID_", extra="forbid", frozen=True)

    data_dir: Path = Field(default=Path("var"), description="Folder of the SQLite file and local state.")
    database_url: str = Field(
        default="",
        description="SQLAlchemy URL; empty means SQLite in `data_dir`. Postgres for several hosts.",
    )
    broker_url: str = Field(
        default="redis://127.0.0.1:6399/0",
        description="Redis or Valkey for wake-up messages: `redis://`, `rediss://` (TLS) or `unix://`.",
    )
    host: str = Field(default="127.0.0.1", description="Address the API listens on.")
    port: int = Field(default=8000, ge=0, le=65535)
    auth: Literal["auto", "keys", "off"] = Field(
        default="auto",
        description="`keys`: every request needs an API key; `off`: none; `auto`: beyond this machine.",
    )
    allow_open: bool = Field(
        default=False,
        description="Serve beyond this machine without API keys: everyone who reaches the port may use it.",
    )
    allowed_hosts: str = Field(
        default="",
        description="Names that the service goes by, with commas between; without keys others are refused.",
    )
    max_body_bytes: int = Field(
        default=64 * 2**20, ge=1024, description="Largest request body, counted as it streams."
    )
    body_grace_s: float = Field(
        default=20.0, gt=0.0, le=3600.0, description="Time to send a body of any size; larger ones get more."
    )
    max_connections: int = Field(
        default=4096, ge=8, le=100_000, description="Connections at once; event streams count."
    )
    header_timeout_s: float = Field(
        default=10.0, gt=0.0, le=600.0, description="Time to send the headers of a request."
    )
    write_timeout_s: float = Field(
        default=30.0, gt=0.0, le=3600.0, description="A client that reads nothing for so long is hung up on."
    )
    parsers: int = Field(
        default=2,
        ge=1,
        le=64,
        description="Uploads and large bodies that are read at once, each by a process.",
    )
    parser_memory_bytes: int = Field(
        default=512 * 2**20, ge=128 * 2**20, description="Memory of each of these processes."
    )
    max_wait_s: float = Field(
        default=60.0, ge=0.0, le=600.0, description="Longest `Prefer: wait` that is honoured."
    )
    event_poll_s: float = Field(
        default=0.2, gt=0.0, le=10.0, description="How often watched jobs are looked at."
    )
    keep_alive_s: float = Field(
        default=15.0, gt=0.0, le=300.0, description="Comment line on an idle event stream."
    )
    lease_s: float = Field(default=60.0, gt=0.0, description="Life of a worker's claim without a heartbeat.")
    heartbeat_s: float = Field(default=10.0, gt=0.0, description="How often a worker renews its claim.")
    republish_after_s: float = Field(
        default=15.0, gt=0.0, description="A queued job not claimed for this long gets a new wake-up message."
    )
    job_max_attempts: int = Field(default=3, ge=1, le=100)
    job_max_seconds: float = Field(
        default=6 * 3600.0, gt=0.0, description="Deadline of a job without its own."
    )
    keep_jobs_days: float = Field(
        default=0.0, ge=0.0, description="Finished jobs are deleted after this; 0: never. Models are kept."
    )
    keep_trajectories_days: float = Field(
        default=0.0, ge=0.0, description="Uploaded flights are deleted after this; 0: never."
    )
    keep_deliveries_days: float = Field(
        default=30.0, ge=0.0, description="Webhook messages are forgotten after this; 0: never."
    )
    keep_audit_days: float = Field(
        default=365.0, ge=0.0, description="Entries of the audit log are forgotten after this; 0: never."
    )

    webhook_allow_private: bool = Field(
        default=False,
        description="For development: webhooks may go to private addresses, and by http to loopback.",
    )

    log_format: Literal["text", "json"] = Field(
        default="text", description="Lines for eyes, or one JSON object per line for machines."
    )
    log_level: Literal["debug", "info", "warning", "error"] = Field(
        default="info", description="Least severity that is logged."
    )
    traces: str = Field(
        default="", description="Address of an OpenTelemetry collector (OTLP over HTTP); empty: no traces."
    )
    worker_seen_every_s: float = Field(
        default=5.0, gt=0.0, le=60.0, description="How often a worker shows that it takes jobs."
    )

    @model_validator(mode="after")
    def _fill_and_refuse(self) -> Self:
        if not self.database_url:
            url = f"sqlite:///{self.data_dir.expanduser().resolve() / 'morphid.sqlite3'}"
            object.__setattr__(self, "database_url", url)
        if self.auth == "off" and not self.allow_open and not is_loopback(self.host):
            raise UnsafeSettings(
                f"host {self.host} is reachable from other machines and MORPHID_AUTH=off demands no keys. "
                "Leave MORPHID_AUTH out to have them demanded, "
                "or set MORPHID_ALLOW_OPEN=1 to let everyone in on purpose."
            )
        self._refuse_default_password()
        if self.webhook_allow_private and not is_loopback(self.host):
            raise UnsafeSettings(
                f"host {self.host} is reachable from other machines and MORPHID_WEBHOOK_ALLOW_PRIVATE would "
                "let them send into this network. Leave it out: it is for development on one machine."
            )
        object.__setattr__(self, "broker_url", canonical(self.broker_url))
        broker_host = urlsplit(self.broker_url).hostname or ""
        if self.uses_sqlite and broker_host and not is_loopback(broker_host):
            raise UnsafeSettings(
                f"the broker is on another host ({broker_host}) but the database is an SQLite file, which "
                "hosts cannot share. Set MORPHID_DATABASE_URL to a Postgres database, or use a broker here."
            )
        if self.heartbeat_s * 2 > self.lease_s:
            raise UnsafeSettings(
                "heartbeat_s must be at most half of lease_s: one late heartbeat would lose a healthy job. "
                "Lower MORPHID_HEARTBEAT_S or raise MORPHID_LEASE_S."
            )
        return self

    def _refuse_default_password(self) -> None:
        parts = urlsplit(self.database_url)
        password = unquote(parts.password or "")
        if self.uses_sqlite or not parts.hostname or is_loopback(parts.hostname):
            return
        if password.lower() in DEFAULT_PASSWORDS or (password and password == unquote(parts.username or "")):
            raise UnsafeSettings(
                "the password in MORPHID_DATABASE_URL is one that everybody tries first, and the database at "
                f"{parts.hostname} can be reached over a network. Choose another: `openssl rand -hex 24` "
                "makes one."
            )

    @property
    def demands_keys(self) -> bool:
        """Whether a request needs an API key."""
        if self.auth == "auto":
            return not self.allow_open and not is_loopback(self.host)
        return self.auth == "keys"

    @property
    def host_names(self) -> frozenset[str]:
        """Names that the operator allows in the Host header."""
        names = (name.strip().lower() for name in self.allowed_hosts.split(","))
        return frozenset(name for name in names if name)

    @property
    def uses_sqlite(self) -> bool:
        """Whether the job store is an SQLite file."""
        return self.database_url.startswith("sqlite")


def load_settings(**overrides: object) -> Settings:
    """Read the environment, with `overrides` on top.

    Raises
    ------
    UnsafeSettings
        With one sentence per problem, fit to be printed to the operator.
    """
    try:
        return Settings(**overrides)  # type: ignore[arg-type]  # checked by pydantic itself
    except ValidationError as error:
        sentences = []
        for item in error.errors():
            where = ".".join(str(part) for part in item["loc"])
            message = item["msg"].removeprefix("Value error, ")
            sentences.append(f"MORPHID_{where.upper()}: {message}" if where else message)
        raise UnsafeSettings("\n".join(sentences)) from None
