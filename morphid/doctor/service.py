"""Internal checks of the service on this machine: settings, database, broker, workers, jobs, port."""

from __future__ import annotations

import os
import stat
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from morphid.doctor.findings import Finding, fail, ok, warn

SKEW_S = 2.0  # s; leases use the database's clock, so this only makes times in logs hard to compare
STUCK_S = 600.0  # s that a job may wait while a slot is free
ORPHANED_S = 120.0  # s; a lease that expired longer ago has not been reaped
DELIVERY_LATE_S = 3600.0
MIN_BROKER = (6, 2)
OTHERS_MAY = stat.S_IROTH | stat.S_IWOTH
LARGE_DATABASE = 2 * 2**30  # bytes; the pages of a larger database are not all read


def unsafe(settings: Any) -> Iterator[Finding]:
    """Check that the settings do not expose the service."""
    from app.loopback import is_loopback

    beyond = not is_loopback(settings.host)
    if beyond and not settings.demands_keys:
        yield warn(
            "settings",
            f"anyone who can reach {settings.host}:{settings.port} may use and read everything",
            "leave out MORPHID_ALLOW_OPEN and MORPHID_AUTH=off; make keys with `morphid keys create`",
        )
    elif settings.webhook_allow_private:
        yield warn(
            "settings",
            "webhooks may go to private addresses",
            "leave out MORPHID_WEBHOOK_ALLOW_PRIVATE if others can post jobs",
        )
    else:
        keys = "demanded" if settings.demands_keys else "not required: only this machine has access"
        yield ok("settings", f"API keys are {keys}")


def database(settings: Any) -> Iterator[Finding]:
    """Check that the database is reachable, migrated, sound and durable, with the same clock as ours."""
    from sqlalchemy.exc import SQLAlchemyError

    from app.database import database_time, schema_revision
    from app.observability.logs import masked
    from migrations import HEAD

    url = masked(settings.database_url)
    if settings.uses_sqlite and not _sqlite_file(settings.database_url).exists():
        yield warn("database", f"{url} is not there yet", "`morphid serve` or `morphid db upgrade` makes it")
        return
    exposed = settings.uses_sqlite and _sqlite_file(settings.database_url).stat().st_mode & OTHERS_MAY
    try:
        with _reading(settings) as session:
            revision = schema_revision(session)
            skew_s = float(session.scalar(database_time().select()) or 0.0) - time.time()
            sound = list(_sqlite(session, settings) if settings.uses_sqlite else _postgres(session))
    except SQLAlchemyError as error:
        sentence = str(getattr(error, "orig", None) or error).splitlines()[0]
        remedy = "start it, or correct MORPHID_DATABASE_URL; a damaged file: `morphid db restore`"
        yield fail("database", f"{url}: {masked(sentence)}", remedy)
        return
    if revision != HEAD:
        remedy = "morphid db upgrade" if revision is None or revision < HEAD else "run the newer MorphID"
        yield fail("database", f"{url} is at revision {revision}, this version needs {HEAD}", remedy)
        return
    yield ok("database", f"{url}, revision {revision}")
    yield from sound
    if exposed:
        yield _exposed(_sqlite_file(settings.database_url))
    if abs(skew_s) > SKEW_S:
        yield warn(
            "clock", f"the database's clock is {skew_s:+.1f} s off this machine's", "synchronise both by NTP"
        )
    else:
        yield ok("clock", "the database's and this machine's agree")


@contextmanager
def _reading(settings: Any) -> Iterator[Any]:
    """Open a session on the service's database."""
    from app.database import Database

    store = Database(settings.database_url)
    try:
        with store.read() as session:
            yield session
    finally:
        store.dispose()


def _sqlite_file(url: str) -> Path:
    from sqlalchemy import make_url

    return Path(make_url(url).database or "")


def _sqlite(session: Any, settings: Any) -> Iterator[Finding]:
    file = _sqlite_file(settings.database_url)
    small = file.stat().st_size < LARGE_DATABASE
    pragma = "PRAGMA integrity_check(5)" if small else "PRAGMA quick_check(5)"
    faults = [row[0] for row in session.exec_driver_sql(pragma)]
    if faults == ["ok"]:
        yield ok("integrity", f"{pragma.removeprefix('PRAGMA ').partition('(')[0]} finds nothing wrong")
    else:
        yield fail(
            "integrity", "; ".join(map(str, faults)), "stop the service; `morphid db restore` a backup"
        )
    mode = session.exec_driver_sql("PRAGMA journal_mode").scalar()
    if mode != "wal":
        yield fail(
            "journal", f"journal_mode is {mode}: readers and writers block each other", "use a local disk"
        )
    else:
        yield ok("journal", "write-ahead")


def _exposed(file: Path) -> Finding:
    """Report a database that others could read; opening our own makes it private."""
    if file.stat().st_mode & OTHERS_MAY:
        sentence = f"{file} can be read by every user of this machine"
        return warn("permissions", sentence, f"chmod 700 {file.parent}")
    sentence = f"{file} could be read by every user of this machine; it no longer can"
    return warn("permissions", sentence, f"chmod 700 {file.parent} keeps others from the whole folder")


def _postgres(session: Any) -> Iterator[Finding]:
    def shown(name: str) -> str:
        return str(session.exec_driver_sql(f"SHOW {name}").scalar())

    if shown("fsync") != "on":
        yield fail("durability", "fsync is off: a power cut spoils the database", "set fsync = on")
    elif shown("synchronous_commit") == "off":
        yield warn(
            "durability",
            "synchronous_commit is off: a power cut loses jobs that were accepted",
            "set synchronous_commit = on",
        )
    else:
        yield ok("durability", "a commit is on disk")


def broker(url: str) -> Iterator[Finding]:
    """Check that the broker accepts our password and keeps messages."""
    from app.health.broker import NOT_CHECKED, broker_client, broker_state
    from app.observability.logs import masked

    where, state = masked(url), broker_state(url)
    if state == NOT_CHECKED:
        yield ok("broker", f"{where}: {state}")
        return
    if state != "ok":
        yield fail(
            "broker", f"{where}: {state}", "start it, or correct MORPHID_BROKER_URL (with its password)"
        )
        return
    info: dict[str, Any] = broker_client(url).info()
    version = str(info.get("valkey_version") or info.get("redis_version"))
    if tuple(int(part) for part in version.split(".")[:2]) < MIN_BROKER:
        yield warn("broker", f"{where}: version {version} is old", "Valkey, or Redis 6.2 or newer")
    else:
        yield ok("broker", f"{where}: {info.get('server_name', 'redis')} {version}")
    if not int(info.get("aof_enabled", 0)):
        yield warn(
            "broker journal",
            "messages do not survive its restart: jobs then start a second later",
            "appendonly yes",
        )
    else:
        yield ok("broker journal", "appendonly")
    policy = str(info.get("maxmemory_policy", "noeviction"))
    if policy != "noeviction":
        yield fail(
            "broker memory", f"maxmemory-policy {policy} throws messages away", "maxmemory-policy noeviction"
        )
    else:
        yield ok("broker memory", "noeviction")


def work(settings: Any) -> Iterator[Finding]:
    """Check that there are workers and that jobs make progress."""
    from sqlalchemy import func, select
    from sqlalchemy.exc import SQLAlchemyError

    from app.database import database_time
    from app.health.repository import snapshot
    from app.jobs.records import HELD
    from app.tables import jobs, webhook_deliveries

    if settings.uses_sqlite and not _sqlite_file(settings.database_url).exists():
        return
    lost = jobs.c.status.in_(HELD), jobs.c.lease_until < database_time() - ORPHANED_S
    deliveries = webhook_deliveries.c
    overdue = deliveries.status == "waiting", deliveries.next_at < database_time() - DELIVERY_LATE_S
    try:
        with _reading(settings) as session:
            seen = snapshot(session, settings.worker_seen_every_s)
            orphaned = session.scalar(select(func.count()).where(*lost))
            late = session.scalar(select(func.count()).where(*overdue))
    except SQLAlchemyError:
        return  # the database has its own line
    workers = seen.workers
    if workers.stalled:
        yield fail(
            "workers",
            f"{workers.stalled} no longer take jobs, {workers.alive} do",
            "restart them; their logs say what they wait for",
        )
    elif not workers.alive:
        yield warn(
            "workers", "none: jobs wait", "`morphid serve`, or start a worker as docker-compose.yml does"
        )
    else:
        yield ok("workers", f"{workers.alive} with {workers.slots} slots, {workers.busy} busy")
    free = workers.slots - workers.busy
    if orphaned:
        yield fail(
            "jobs",
            f"{orphaned} jobs belong to lost workers",
            "start a beat process: the reaper is not running",
        )
    elif free > 0 and seen.oldest_queued_s > STUCK_S:
        yield fail(
            "jobs",
            f"the oldest has waited {seen.oldest_queued_s:.0f} s though {free} slots are free",
            "check that the workers use this database (MORPHID_DATABASE_URL), and see their logs",
        )
    else:
        yield ok("jobs", f"{seen.jobs['queued']} queued, {seen.jobs['running']} running")
    if late:
        yield warn("webhooks", f"{late} deliveries are an hour late", "is an API process running?")


def keys(settings: Any) -> Iterator[Finding]:
    """Check that there is a key if keys are required."""
    from sqlalchemy import func, or_, select
    from sqlalchemy.exc import SQLAlchemyError

    from app.database import database_time
    from app.tables import api_keys

    if not settings.demands_keys:
        return
    expires_at = api_keys.c.expires_at
    usable = api_keys.c.revoked_at.is_(None), or_(expires_at.is_(None), expires_at > database_time())
    try:
        with _reading(settings) as session:
            valid = session.scalar(select(func.count()).where(*usable))
    except SQLAlchemyError:
        return
    if not valid:
        yield warn(
            "keys", "keys are required but none exist: no one has access", "morphid keys create --help"
        )
    else:
        yield ok("keys", f"{valid} are valid")


def port(host: str, number: int) -> Iterator[Finding]:
    """Check that the port is free, or ours."""
    from morphid.broker import bound_port, in_url
    from morphid.connections import client_for
    from morphid.doctor.remote import TIMEOUT_S, served_version

    try:
        bound_port(host, number)
    except OSError as error:
        reason = os.strerror(error.errno or 0)
    else:
        yield ok("port", f"{host}:{number} is free")
        return
    with client_for(f"http://{in_url(host)}:{number}", direct=True, timeout=TIMEOUT_S) as client:
        version = served_version(client)
    if version is None:
        yield fail(
            "port",
            f"{host}:{number}: {reason}, by another program than MorphID",
            "choose another with --port",
        )
    else:
        yield ok("port", f"MorphID {version} serves {host}:{number}")
