"""Celery's connection to the broker: kombu's Redis transport with the address parsed by redis-py.

`celery_broker` configures this for the API, the workers and the beat.
"""

from __future__ import annotations

import os
from contextlib import nullcontext
from typing import Any

from celery.utils import imports
from kombu.transport import redis
from redis import Connection, UnixDomainSocketConnection
from redis.connection import parse_url

from app.broker import canonical, is_redis

CONNECT_TIMEOUT_S = 0.5  # s; a broker on the same network answers in a millisecond, or is unavailable
SOCKET_TIMEOUT_S = 2.0
# Celery prefers these to its settings; if they are set, they are meant for another application
CELERY_VARIABLES = ("BROKER_URL", "BROKER_READ_URL", "BROKER_WRITE_URL", "RESULT_BACKEND", "LOADER")


def celery_broker(url: str, transport: str = "app.jobs.transport:Transport") -> dict[str, Any]:
    """Return Celery's settings of a broker; Celery's own variables (`CELERY_BROKER_URL`) are then ignored.

    ``transport`` is the import path of the transport for Redis and Valkey.
    """
    # Celery puts the working folder first on the import path while it loads its own modules; imports by
    # another thread at that moment would come from there
    imports.cwd_in_path = nullcontext
    for name in CELERY_VARIABLES:
        os.environ.pop(f"CELERY_{name}", None)
    settings: dict[str, Any] = {
        "broker_url": url,
        "broker_connection_timeout": CONNECT_TIMEOUT_S,
        "broker_transport_options": {
            "socket_connect_timeout": CONNECT_TIMEOUT_S,
            "socket_timeout": SOCKET_TIMEOUT_S,
            "max_retries": 0,
        },
        "task_ignore_result": True,  # results belong in our tables
        "task_publish_retry": False,  # a lost message is repeated, so there is no need to wait for a broker
    }
    if is_redis(url):
        settings |= {"broker_url": canonical(url), "broker_transport": transport}
        # a hint is gone once taken: jobs are rows, and hints that are not kept cannot come back
        settings["broker_transport_options"]["ack_emulation"] = False
    return settings


class Channel(redis.Channel):
    """A channel to the server at the address as parsed by redis-py."""

    def _connparams(self, asynchronous: bool = False) -> dict[str, Any]:  # noqa: FBT001, FBT002 - kombu's
        given: dict[str, Any] = dict(parse_url(self.connection.client.hostname))  # type: ignore[no-untyped-call]
        self.connection_class = given.pop("connection_class", Connection)
        parameters: dict[str, Any] = super()._connparams(asynchronous)  # type: ignore[no-untyped-call]
        parameters |= given
        if issubclass(self.connection_class, UnixDomainSocketConnection):
            for name in ("socket_keepalive", "socket_keepalive_options"):
                parameters.pop(name, None)
        return parameters

    def _queue_bind(self, *_binding: Any) -> None:
        """Write no bindings table: each message names its queue, and a full server refuses writes."""


class Transport(redis.Transport):
    """Kombu's Redis transport, given the whole address."""

    Channel = Channel
    can_parse_url = True
