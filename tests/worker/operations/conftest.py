"""A real worker on a job store of its own."""

from __future__ import annotations

import pytest

from app.database import Database
from tests.worker.operations.jobs_of_the_library import RealWorker


@pytest.fixture
def worker(database: Database) -> RealWorker:
    """A worker of this process, without broker."""
    return RealWorker(database)
