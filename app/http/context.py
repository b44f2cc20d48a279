"""What endpoints are handed: database, settings, the caller and what the caller may do."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from fastapi import Depends, Request, Security
from fastapi.security import HTTPAuthorizationCredentials, HTTPBearer, SecurityScopes
from starlette.types import Scope as AsgiScope

from app.background_writer import BackgroundWriter
from app.database import Database
from app.errors import MissingScope, Unauthorized
from app.jobs.queue import Publisher
from app.jobs.waiting import QueueView
from app.jobs.watch import JobWatcher
from app.keys.keyring import KeyRing
from app.keys.records import Quota, Scope
from app.keys.watch import KeyInUse, KeyWatch
from app.owner_limit import OwnerLimit
from app.owner_turns import OwnerTurns
from app.parsing.pool import ParserPool
from app.settings import Settings
from app.webhooks.addresses import AddressPolicy

LOCAL_OWNER = "local"  # everyone, where no keys are demanded
CALLER = "morphid.caller"  # where the gate leaves the caller in a request's scope
BEARER = HTTPBearer(
    scheme_name="api_key",
    description="`Authorization: Bearer mid_...`; the operator makes keys with `morphid keys create`.",
    auto_error=False,  # the gate has checked the key; this is how the OpenAPI document knows of it
)


@dataclass(frozen=True, slots=True)
class Service:
    """The parts of one running API process.

    Attributes
    ----------
    reads : OwnerTurns
        Reads of the database for clients that follow jobs.
    streams, waits : OwnerLimit
        Event streams and waiting requests.
    """

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
    reads: OwnerTurns
    streams: OwnerLimit
    waits: OwnerLimit


@dataclass(frozen=True, slots=True)
class Caller:
    """Who makes the request that is being served.

    Attributes
    ----------
    owner : str
        Whose things the request may see: those of every key of this owner.
    key_id : str or None
        None where no keys are demanded.
    scopes : frozenset of Scope
        What it may do.
    request_id : str
        Of this request.
    address : str
        Of the other end.
    quota : Quota
        How much it may use.
    key : KeyInUse
        Tells whether its key still opens.
    """

    owner: str
    key_id: str | None
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
    """Return who makes a request; None on public paths and for whom the gate has refused."""
    caller: Caller | None = scope.get(CALLER)
    return caller


async def current_caller(request: Request) -> Caller:
    """Return who makes the request.

    Raises
    ------
    Unauthorized
        Nobody known: the path is a public one, or there is no gate. Or the key was revoked or has expired
        while the body arrived.
    """
    caller = caller_of(request.scope)
    if caller is None:
        raise Unauthorized
    caller.key.must_open()
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

    Without a scope any valid key will do.
    """
    return Security(_allowed, scopes=[scope.value for scope in scopes])


async def current_owner(caller: CallerDep) -> str:
    """Name the owner that the request acts for."""
    return caller.owner


ServiceDep = Annotated[Service, Depends(current_service)]
OwnerDep = Annotated[str, Depends(current_owner)]
