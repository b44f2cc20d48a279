"""Information on the caller's own key. Keys are made and revoked on the command line only."""

from __future__ import annotations

from fastapi import APIRouter

from app.http.context import CallerDep, ServiceDep, demands
from app.keys import quota, repository
from app.keys.schemas import KeyAbout, Me, Quotas

router = APIRouter(tags=["keys"])


@router.get("/me", operation_id="get_me", summary="Who am I, and what may I do?", dependencies=[demands()])
def get_me(app: ServiceDep, caller: CallerDep) -> Me:
    """Return the caller's owner, and the scopes, quotas and use of its key."""
    scopes = sorted(caller.scopes)
    if caller.key_id is None:
        return Me(owner=caller.owner, scopes=scopes, key=None, quotas=None)
    with app.database.read() as session:
        key = repository.key_by_id(session, caller.key_id)
        used = quota.usage(session, caller.key_id)
    return Me(
        owner=caller.owner,
        scopes=scopes,
        key=KeyAbout(id=key.id, name=key.name, prefix=key.prefix, expires_at=key.expires_at),
        quotas=Quotas.of(used, key.quota),
    )
