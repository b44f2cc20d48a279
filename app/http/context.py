"""What endpoints are handed: database, settings, the caller, the messages to workers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from fastapi import Depends, Request

from app.database import Database
from app.jobs.queue import Publisher
from app.jobs.watch import JobWatcher
from app.keys.records import EVERY_SCOPE, NO_QUOTA, Quota, Scope
from app.settings import Settings

LOCAL_OWNER = "local"  # everyone, where no keys are demanded


@dataclass(frozen=True, slots=True)
class Service:
    """The parts of one running API process."""

    settings: Settings
    database: Database
    publisher: Publisher
    watcher: JobWatcher


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
    """

    owner: str
    key_id: str | None
    scopes: frozenset[Scope]
    request_id: str
    address: str
    quota: Quota


def current_service(request: Request) -> Service:
    """Return the parts of the process that serves `request`."""
    service: Service = request.app.state.service
    return service


def current_caller(request: Request) -> Caller:
    """Tell who makes the request."""
    address = request.client.host if request.client else ""
    return Caller(LOCAL_OWNER, None, EVERY_SCOPE, "", address, NO_QUOTA)


CallerDep = Annotated[Caller, Depends(current_caller)]


def current_owner(caller: CallerDep) -> str:
    """Name the owner that the request acts for."""
    return caller.owner


ServiceDep = Annotated[Service, Depends(current_service)]
OwnerDep = Annotated[str, Depends(current_owner)]
