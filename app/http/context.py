"""What endpoints are handed: database, settings, the caller, the messages to workers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from fastapi import Depends, Request

from app.database import Database
from app.jobs.queue import Publisher
from app.jobs.watch import JobWatcher
from app.settings import Settings

LOCAL_OWNER = "local"  # everyone, until there are API keys


@dataclass(frozen=True, slots=True)
class Service:
    """The parts of one running API process."""

    settings: Settings
    database: Database
    publisher: Publisher
    watcher: JobWatcher


def current_service(request: Request) -> Service:
    """Return the parts of the process that serves `request`."""
    service: Service = request.app.state.service
    return service


def current_owner() -> str:
    """Name the owner that the request acts for."""
    return LOCAL_OWNER


ServiceDep = Annotated[Service, Depends(current_service)]
OwnerDep = Annotated[str, Depends(current_owner)]
