"""The tests of this folder do not mind the rows of others."""

from __future__ import annotations

import pytest

from tests.app.running_service import RunningService


@pytest.fixture(scope="session")
def service(shared_service: RunningService) -> RunningService:
    """A running service on SQLite."""
    return shared_service
