"""A Postgres server, as the service's own tests have it."""

from __future__ import annotations

from tests.app.conftest import postgres_server

__all__ = ["postgres_server"]
