"""Creates and revokes keys for the operator's command line, recorded in the audit log."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from app.audit import repository as audit
from app.audit.records import Action
from app.database import Session
from app.keys import repository
from app.keys.records import ApiKey, Quota, Scope
from app.keys.secret import KeyText

OWNER_FORM = re.compile(r"[A-Za-z0-9][A-Za-z0-9._@-]{0,63}")
NAME_LENGTH = 64


class KeyRefused(ValueError):
    """The key cannot be created; the message gives the reason."""


@dataclass(frozen=True, slots=True)
class NewKey:
    """A newly created key; `text` is shown only once."""

    key: ApiKey
    text: str


def create_key(
    session: Session,
    *,
    owner: str,
    name: str,
    scopes: Sequence[Scope],
    quota: Quota,
    expires_at: float | None,
) -> NewKey:
    """Make a key for `owner`; it expires at a time in s since 1970 UTC, or never.

    Keys of one owner see the same jobs, flights and models. Without keys everyone is ``local``.

    Raises
    ------
    KeyRefused
        The owner's or the key's name cannot be stored, or there is no scope.
    """
    if not OWNER_FORM.fullmatch(owner):
        raise KeyRefused(f"the owner {owner!r} is not 1 to 64 letters, digits and . _ @ -")
    if not name.strip() or len(name) > NAME_LENGTH or not name.isprintable():
        raise KeyRefused(f"the name {name!r} is not 1 to {NAME_LENGTH} printable characters")
    if not scopes:
        raise KeyRefused("a key needs at least one scope")
    text = KeyText.new()
    named = sorted(scope.value for scope in scopes)
    key = repository.insert_key(
        session, text, quota, owner=owner, name=name, scopes=named, expires_at=expires_at
    )
    detail = {"prefix": key.prefix, "name": name, "scopes": named}
    audit.insert_entry(session, Action.KEY_CREATE, owner=owner, target=key.id, detail=detail)
    return NewKey(key, text.text())


def revoke_key(session: Session, name: str) -> ApiKey:
    """Revoke a key by its id or prefix; running services refuse it within `app.keys.keyring.FRESH_S`."""
    key = repository.revoke_key(session, name)
    if key is None:
        raise KeyRefused(f"there is no key {name!r}")
    detail = {"prefix": key.prefix}
    audit.insert_entry(session, Action.KEY_REVOKE, owner=key.owner, target=key.id, detail=detail)
    return key
