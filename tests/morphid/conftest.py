"""Fixtures of the command line's tests."""

from __future__ import annotations

from typing import Any

import httpx
import pytest

from morphid import service
from tests.morphid.played_service import Play, PlayedService


@pytest.fixture
def play(monkeypatch: pytest.MonkeyPatch) -> Play:
    """Put a played service in the place of the network."""

    def install(played: PlayedService) -> PlayedService:
        client = httpx.Client

        def with_transport(**kwargs: Any) -> httpx.Client:
            return client(**{**kwargs, "transport": httpx.MockTransport(played)})

        monkeypatch.setattr(service.httpx, "Client", with_transport)
        monkeypatch.setattr(service.time, "sleep", lambda _seconds: None)
        return played

    return install
