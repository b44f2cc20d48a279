"""Dependencies of endpoints: database, settings, the caller and its permissions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from fastapi import Depends, Request, Security
from fastapi.security import HTTPAuthorizationCredentials, HTTPBearer, SecurityScopes
from starlette.types import Scope as AsgiScope

from app.background_writer import BackgroundWriter
from app.database import Database
from app.errors import MissingScope, Unauthorized
from app.health.service import Health
from app.jobs.queue import Publisher
from app.jobs.waiting import QueueView
from app.jobs.watch import JobWatcher
from app.keys.keyring import KeyRing
from app.keys.records import Quota, Scope
from app.keys.watch import KeyInUse, KeyWatch
from app.owner_turns import OwnerLimit, OwnerTurns
from app.parsing.pool import ParserPool
from app.settings import Settings
from app.webhooks.addresses import AddressPolicy

CALLER = "morphid.caller"  # key of the caller in a request's scope, set by the gate
BEARER = HTTPBearer(
    scheme_name="api_key",
    description="`Authorization: Bearer mid_...`; the operator makes keys with `morphid keys create`.",
    auto_error=False,  # the gate has checked the key; this only documents it in OpenAPI
)


@dataclass(frozen=True, slots=True)
class Service:
    """The parts of one running API process."""

    settings: Settings
    database: Database
    publisher: Publisher
    watcher: JobWatcher
    queue: QueueView
    keys: KeyRing
    key_watch: KeyWatch
    background: BackgroundWriter
    parsers: ParserPool
    webhook_policy: AddressPolicy
    health: Health
    reads: OwnerTurns  # of the database, for clients that follow jobs
    streams: OwnerLimit  # of events
    waits: OwnerLimit  # requests with `Prefer: wait`


@dataclass(frozen=True, slots=True)
class Caller:
    """The caller of the current request."""

    owner: str  # the request may see the data of all keys of this owner
    key_id: str | None  # None if no keys are required
    scopes: frozenset[Scope]
    request_id: str
    address: str
    quota: Quota
    key: KeyInUse


async def current_service(request: Request) -> Service:
    """Return the parts of the process that serves `request`."""
    service: Service = request.app.state.service
    return service


def caller_of(scope: AsgiScope) -> Caller | None:
    """Return the caller of a request; None on public paths, and if the gate has refused the request."""
    caller: Caller | None = scope.get(CALLER)
    return caller


async def current_caller(request: Request) -> Caller:
    """Return the caller of the request.

    Raises
    ------
    Unauthorized
        The path is public or there is no gate; or the key was revoked or has expired while the body arrived.
    """
    caller = caller_of(request.scope)
    if caller is None:
        raise Unauthorized
    caller.key.require_valid()
    return caller


CallerDep = Annotated[Caller, Depends(current_caller)]


async def _allowed(
    caller: CallerDep,
    needed: SecurityScopes,
    _bearer: Annotated[HTTPAuthorizationCredentials | None, Security(BEARER)],
) -> None:
    missing = [name for name in needed.scopes if name not in caller.scopes]
    if missing:
        raise MissingScope(missing, needed.scopes)


def demands(*scopes: Scope) -> Any:
    """Make a route demand these scopes of its caller: ``dependencies=[demands(Scope.JOBS_READ)]``.

    Without a scope any valid key is sufficient.
    """
    return Security(_allowed, scopes=[scope.value for scope in scopes])


async def current_owner(caller: CallerDep) -> str:
    """Return the owner for whom the request acts."""
    return caller.owner


ServiceDep = Annotated[Service, Depends(current_service)]
OwnerDep = Annotated[str, Depends(current_owner)]
