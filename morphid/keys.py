"""What ``morphid keys`` does on the service's database."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.markup import escape
from rich.table import Table

from app.database import Database
from app.keys import repository, service
from app.keys.records import EVERY_SCOPE, USUAL_SCOPES, ApiKey, Quota, Scope
from app.keys.service import KeyRefused, NewKey
from morphid.exits import CommandError, Exit
from morphid.migrate import configured_url, upgrade_to

AFTER = re.compile(r"(\d{1,5})\s*([dh])")
STATE_COLOURS = {"active": "green", "expired": "yellow", "revoked": "red"}


@contextmanager
def service_database(data_dir: Path | None) -> Iterator[Database]:
    """Open the database of a service, migrated.

    Raises
    ------
    CommandError : it cannot be reached.
    """
    url = configured_url(data_dir)
    upgrade_to(url)
    database = Database(url)
    try:
        yield database
    finally:
        database.dispose()


def create(
    data_dir: Path | None,
    *,
    owner: str,
    name: str,
    scopes: Sequence[Scope],
    quota: Quota,
    expires_at: float | None,
) -> NewKey:
    """Make a key."""
    with service_database(data_dir) as database, _sentences(), database.write() as session:
        return service.create_key(
            session, owner=owner, name=name, scopes=scopes, quota=quota, expires_at=expires_at
        )


def revoke(data_dir: Path | None, name: str) -> ApiKey:
    """Revoke the key with this prefix or id."""
    with service_database(data_dir) as database, _sentences(), database.write() as session:
        return service.revoke_key(session, name)


def listed(data_dir: Path | None, owner: str | None) -> list[ApiKey]:
    """Read all keys, or those of one owner."""
    with service_database(data_dir) as database, database.read() as session:
        return repository.list_keys(session, owner=owner)


@contextmanager
def _sentences() -> Iterator[None]:
    try:
        yield
    except KeyRefused as error:
        raise CommandError(str(error), code=Exit.INVALID_INPUT, hint="see `morphid keys ls`") from None


def scopes_of(names: Sequence[str]) -> list[Scope]:
    """Turn names into scopes; the usual ones when there are none.

    Raises
    ------
    CommandError : there is no such scope.
    """
    if not names:
        return sorted(USUAL_SCOPES)
    known = {scope.value for scope in Scope}
    unknown = [name for name in names if name not in known]
    if unknown:
        raise CommandError(
            f"there is no scope {unknown[0]!r}", code=Exit.USAGE, hint=f"one of {', '.join(sorted(known))}"
        )
    return sorted({Scope(name) for name in names})


def moment_of(text: str) -> float:
    """Read ``90d``, ``12h`` or a date (UTC unless it says otherwise), s since 1970 UTC.

    Raises
    ------
    CommandError : it is neither, or it has passed.
    """
    now = datetime.now(UTC)
    after = AFTER.fullmatch(text.strip())
    try:
        if after is not None:
            unit = timedelta(days=1) if after[2] == "d" else timedelta(hours=1)
            moment = now + int(after[1]) * unit
        else:
            moment = datetime.fromisoformat(text.strip())
            moment = moment if moment.tzinfo is not None else moment.replace(tzinfo=UTC)
    except (ValueError, OverflowError):
        raise CommandError(
            f"{text!r} is no time", code=Exit.USAGE, hint="say `90d`, `12h` or `2027-01-31`"
        ) from None
    if moment <= now:
        raise CommandError(f"{text!r} has passed", code=Exit.USAGE, hint="a key needs a future")
    return moment.timestamp()


def document(key: ApiKey) -> dict[str, Any]:
    """Give a key as JSON, without its secret, which nobody knows."""
    return {
        "id": key.id,
        "owner": key.owner,
        "name": key.name,
        "prefix": key.prefix,
        "state": key.state,
        "scopes": sorted(key.scopes),
        "max_jobs_in_flight": key.quota.max_jobs_in_flight,
        "max_flights_per_day": key.quota.max_flights_per_day,
        "max_stored_bytes": key.quota.max_stored_bytes,
        "created_at": _iso(key.created_at),
        "expires_at": _iso(key.expires_at),
        "revoked_at": _iso(key.revoked_at),
        "last_used_at": _iso(key.last_used_at),
    }


def _iso(moment: datetime | None) -> str | None:
    return None if moment is None else moment.isoformat(timespec="seconds")


def table(found: Sequence[ApiKey]) -> Table:
    """Give keys as a table."""
    made = Table(box=SIMPLE_HEAD, pad_edge=False)
    for title in ("prefix", "owner", "name", "state", "scopes", "last use UTC", "expires UTC"):
        made.add_column(title, no_wrap=title != "scopes", overflow="fold")
    for key in found:
        colour = STATE_COLOURS[key.state]
        made.add_row(
            key.prefix,
            key.owner,
            escape(key.name),
            f"[{colour}]{key.state}[/]",
            _scopes_text(key),
            short_time(key.last_used_at) or "never",
            short_time(key.expires_at) or "never",
        )
    return made


def _scopes_text(key: ApiKey) -> str:
    if key.scopes == EVERY_SCOPE:
        return "all"
    return "all but metrics" if key.scopes == USUAL_SCOPES else " ".join(sorted(key.scopes))


def short_time(moment: datetime | None) -> str:
    """Give a time to the minute, nothing for None."""
    return "" if moment is None else f"{moment:%y-%m-%d %H:%M}"
