"""A real Celery worker whose only operation is a random walk: faults without numerics."""

from __future__ import annotations

from collections.abc import Mapping

from tests.worker.conftest import Walk
from worker import numerics, operations


def begin(request: operations.Document, _threads: int) -> Walk:
    """Begin a walk."""
    return Walk(request)


def no_kernels(_threads: int) -> None:
    """Compile nothing: a walk needs no kernels."""


walks: Mapping[str, str] = {"walk": "tests.faults.walk_worker:begin"}
operations.OPERATIONS = walks
numerics.warm_up_library = no_kernels

from worker.celery_app import app  # noqa: E402 - after the operation is in place

__all__ = ["app", "begin"]
