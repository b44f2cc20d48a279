"""SQL of API keys, for authentication and the operator's command line; no endpoint makes or lists keys."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from sqlalchemy import Row, insert, or_, select, update

from app.database import Session, database_time
from app.identifiers import new_identifier
from app.jobs.records import moment, optional_moment
from app.keys.records import ApiKey, Quota, Scope
from app.keys.secret import KeyText
from app.tables import api_keys

IDS_IN_ONE_QUERY = 500
USE_NOTED_EVERY_S = 60.0  # s; the last use only serves to find unused keys: a minute is precise enough

COLUMNS = (
    *(column for column in api_keys.c if column.name != "secret_sha256"),
    (database_time() >= api_keys.c.expires_at).label("expired"),
)
USE_IS_DUE = or_(
    api_keys.c.last_used_at.is_(None), api_keys.c.last_used_at < database_time() - USE_NOTED_EVERY_S
)


@dataclass(slots=True)
class StoredKey:
    """A key with the data needed to check it."""

    key: ApiKey
    secret_sha256: str
    use_is_due: bool  # the noted last use is older than `USE_NOTED_EVERY_S`
    read_at: float = -math.inf  # when it was read, by the clock of the reader


def _key(row: Row[*tuple[Any, ...]]) -> ApiKey:
    return ApiKey(
        id=row.id,
        owner=row.owner,
        name=row.name,
        prefix=row.prefix,
        # a later version may have stored unknown scopes
        scopes=frozenset(scope for scope in Scope if scope.value in row.scopes),
        quota=Quota(row.max_jobs_in_flight, row.max_flights_per_day, row.max_stored_bytes),
        created_at=moment(row.created_at),
        expires_at=optional_moment(row.expires_at),
        revoked_at=optional_moment(row.revoked_at),
        last_used_at=optional_moment(row.last_used_at),
        expired=bool(row.expired),
    )


def insert_key(session: Session, text: KeyText, quota: Quota, **columns: Any) -> ApiKey:
    """Store a key: its prefix, and a digest of its secret."""
    key_id = new_identifier("key")
    session.execute(
        insert(api_keys).values(
            id=key_id,
            prefix=text.prefix,
            secret_sha256=text.digest(),
            created_at=database_time(),
            **asdict(quota),
            **columns,
        )
    )
    return key_by_id(session, key_id)


def find_key(session: Session, prefix: str) -> StoredKey | None:
    """Find the key with this prefix, whatever its state."""
    columns = (*COLUMNS, api_keys.c.secret_sha256, USE_IS_DUE.label("use_is_due"))
    row = session.execute(select(*columns).where(api_keys.c.prefix == prefix)).one_or_none()
    return None if row is None else StoredKey(_key(row), row.secret_sha256, bool(row.use_is_due))


def key_by_id(session: Session, key_id: str) -> ApiKey:
    """Read one key that is known to exist."""
    return _key(session.execute(select(*COLUMNS).where(api_keys.c.id == key_id)).one())


def keys_by_id(session: Session, ids: Sequence[str]) -> Iterator[ApiKey]:
    """Read several keys as they are now; those that are gone are left out."""
    for start in range(0, len(ids), IDS_IN_ONE_QUERY):
        chosen = api_keys.c.id.in_(ids[start : start + IDS_IN_ONE_QUERY])
        yield from map(_key, session.execute(select(*COLUMNS).where(chosen)))


def list_keys(session: Session, *, owner: str | None = None) -> list[ApiKey]:
    """List all keys, or those of one owner, oldest first."""
    query = select(*COLUMNS).order_by(api_keys.c.id)
    if owner is not None:
        query = query.where(api_keys.c.owner == owner)
    return [_key(row) for row in session.execute(query)]


def revoke_key(session: Session, name: str) -> ApiKey | None:
    """Revoke the key with this id or prefix, unless already revoked. None if there is none."""
    chosen = or_(api_keys.c.id == name, api_keys.c.prefix == name)
    session.execute(
        update(api_keys).where(chosen, api_keys.c.revoked_at.is_(None)).values(revoked_at=database_time())
    )
    row = session.execute(select(*COLUMNS).where(chosen)).one_or_none()
    return None if row is None else _key(row)


def note_use(session: Session, key_id: str) -> None:
    """Record that the key is in use, unless another process just did."""
    used = update(api_keys).where(api_keys.c.id == key_id, USE_IS_DUE)
    session.execute(used.values(last_used_at=database_time()))
