"""Settings of the service: options, then ``MORPHID_*`` variables, then defaults; unsafe settings are refused.

Every process and every command reads them here, so that options, variables and defaults have the same meaning
everywhere.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import Literal, Self
from urllib.parse import unquote, urlsplit

from pydantic import Field, ValidationError, model_validator
from pydantic_settings import BaseSettings, SettingsConfigDict

from app.broker import canonical
from app.database_address import UnusableAddress, require_usable, sqlite_url
from app.loopback import is_loopback

PREFIX = "MORPHID_"
# variables read elsewhere: by the command line (address of the service) and the examples
NO_SETTINGS = frozenset({"url", "api_key", "search"})
CLOSE = 0.75  # similarity of a name to a setting above which a typing error is suspected
# passwords of examples, images and tutorials, which attackers try first
DEFAULT_PASSWORDS = frozenset(
    {"morphid", "postgres", "password", "passwort", "changeme", "secret", "admin", "root", "test"}
)


class UnsafeSettings(ValueError):
    """The settings are contradictory or would expose the service; the message says what to change."""


class Settings(BaseSettings):
    """Everything that an operator may set; the defaults suit one user on one machine."""

    model_config = SettingsConfigDict(
        env_prefix=PREFIX,
        env_ignore_empty=True,  # `VARIABLE=` in a shell or a compose file counts as not set
        extra="forbid",
        frozen=True,
    )

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
    workers: int = Field(
        default=1, ge=1, le=1024, description="Jobs that run at once; they share the cores of a machine."
    )
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
        description="Host names of the service, separated by commas; without keys others are refused.",
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
    max_streams_per_owner: int = Field(
        default=200,
        ge=1,
        le=100_000,
        description="Event streams of one owner at once in a process, and as many requests that wait.",
    )
    header_timeout_s: float = Field(
        default=10.0, gt=0.0, le=600.0, description="Time to send the headers of a request."
    )
    write_timeout_s: float = Field(
        default=30.0, gt=0.0, le=3600.0, description="Disconnect a client that reads nothing for this long."
    )
    parsers: int = Field(
        default=2,
        ge=1,
        le=64,
        description="Uploads and large bodies read at once, each by its own process.",
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
    reap_every_s: float = Field(
        default=10.0,  # lease 60 s + one round + loading the kernels stay within 90 s of a worker's death
        gt=0.0,
        le=3600.0,
        description="Interval of the search for jobs whose worker is lost.",
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
    webhook_dial_only: str = Field(
        default="",
        description="Hosts that webhooks may go to, as URLs name them, `host` or `host:port`, with commas "
        "between; no other host is contacted. Empty: any.",
    )

    log_format: Literal["text", "json"] = Field(
        default="text", description="`text` for people or `json`, one object per line."
    )
    log_level: Literal["debug", "info", "warning", "error"] = Field(
        default="info", description="Minimum severity that is logged."
    )
    traces: str = Field(
        default="", description="Address of an OpenTelemetry collector (OTLP over HTTP); empty: no traces."
    )
    worker_seen_every_s: float = Field(
        default=5.0, gt=0.0, le=60.0, description="How often a worker shows that it takes jobs."
    )

    @model_validator(mode="after")
    def _fill_and_refuse(self) -> Self:
        object.__setattr__(self, "data_dir", _found_from_everywhere(self.data_dir))
        try:
            if self.database_url:
                require_usable(self.database_url)
            else:
                object.__setattr__(self, "database_url", sqlite_url(self.data_dir / "morphid.sqlite3"))
        except UnusableAddress as error:
            name = "MORPHID_DATABASE_URL" if self.database_url else "MORPHID_DATA_DIR"
            raise UnsafeSettings(f"{name}: {error}") from None
        if self.auth == "off" and not self.allow_open and not is_loopback(self.host):
            raise UnsafeSettings(
                f"host {self.host} is reachable from other machines and MORPHID_AUTH=off demands no keys. "
                "Leave MORPHID_AUTH out to have them demanded, "
                "or set MORPHID_ALLOW_OPEN=1 to allow everyone deliberately."
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
                "the password in MORPHID_DATABASE_URL is one that attackers try first, and the database at "
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
    def names_broker(self) -> bool:
        """Whether the operator configured a broker; otherwise `morphid serve` starts one."""
        return "broker_url" in self.model_fields_set

    @property
    def host_names(self) -> frozenset[str]:
        """Names that the operator allows in the Host header."""
        return _listed(self.allowed_hosts)

    @property
    def webhook_hosts(self) -> frozenset[str]:
        """Hosts that webhooks may go to; empty: any."""
        return _listed(self.webhook_dial_only)

    @property
    def uses_sqlite(self) -> bool:
        """Whether the job store is an SQLite file."""
        return self.database_url.startswith("sqlite")


def _listed(text: str) -> frozenset[str]:
    """Names in a comma-separated text."""
    names = (name.strip().lower() for name in text.split(","))
    return frozenset(name for name in names if name)


def _found_from_everywhere(folder: Path) -> Path:
    """Expand a folder: ``~`` is the home folder; ``~name`` is a plain folder if no user has that name."""
    try:
        return folder.expanduser().resolve()
    except RuntimeError:
        if folder.parts[0] != "~":
            return folder.resolve()
        raise UnsafeSettings(
            f"MORPHID_DATA_DIR: the home folder of {folder} is not known. Write the path in full."
        ) from None


def doubtful_variables(environment: Mapping[str, str] = os.environ) -> Iterator[str]:
    """Return a message for each ``MORPHID_...`` variable that is not a setting but resembles one."""
    known = Settings.model_fields.keys() | NO_SETTINGS
    for name in sorted(environment):
        bare = name.lower().removeprefix(PREFIX.lower())
        if not name.upper().startswith(PREFIX) or bare in known:
            continue
        meant = get_close_matches(bare, Settings.model_fields, n=1, cutoff=CLOSE)
        if meant:
            yield f"{name} is no setting; is {PREFIX}{meant[0].upper()} meant?"


def load_settings(**overrides: object) -> Settings:
    """Read the environment, overridden by `overrides` that are not None.

    Raises
    ------
    UnsafeSettings
        With one sentence per problem, suitable for the operator.
    """
    try:
        given = {name: value for name, value in overrides.items() if value is not None}
        return Settings(**given)  # type: ignore[arg-type]  # checked by pydantic itself
    except ValidationError as error:
        sentences = []
        for item in error.errors():
            where = ".".join(str(part) for part in item["loc"])
            message = item["msg"].removeprefix("Value error, ")
            sentences.append(f"MORPHID_{where.upper()}: {message}" if where else message)
        raise UnsafeSettings("\n".join(sentences)) from None


def settings_or_exit(**overrides: object) -> Settings:
    """Read the settings of a process started by an operator; exit with a message if they are refused."""
    try:
        return load_settings(**overrides)
    except UnsafeSettings as error:
        raise SystemExit(f"error: {error}") from None
