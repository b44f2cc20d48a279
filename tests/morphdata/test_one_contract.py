"""The law of the one contract: what the service accepts the library accepts, and refuses at the same place.

The requests of every operation are spoilt in one to three places; the service judges each through
``POST /validate/...``, the library by reading it. Neither may raise anything but its refusal.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings

from app.settings import Settings
from morphdata.faults import InvalidInput
from morphdata.simulate import EXAMPLE_SIMULATION, SimulateRequest
from tests.app.running_service import DEAD_BROKER, RunningService, running_service
from tests.morphdata.mutations import mutated

Document = dict[str, Any]

EXAMPLES: dict[str, tuple[Document, ...]] = {"simulate": (EXAMPLE_SIMULATION,)}
READERS: dict[str, Callable[[Document], object]] = {"simulate": SimulateRequest.parse}


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningService]:
    """A running service."""
    database = tmp_path_factory.mktemp("contract") / "service.sqlite3"
    with running_service(Settings(database_url=f"sqlite:///{database}", broker_url=DEAD_BROKER)) as running:
        yield running


def refused_by_library(operation: str, document: Document) -> list[str]:
    """Pointers to what the library refuses; none where it accepts."""
    try:
        READERS[operation](document)
    except InvalidInput as error:
        return [fault.pointer for fault in error.faults]
    return []


def refused_by_service(service: RunningService, operation: str, document: Document) -> list[str]:
    """Pointers to what the service refuses; none where it accepts."""
    answer = service.client.post(f"/validate/{operation}", json=document)
    assert answer.status_code in (200, 422), answer.text
    return [fault["pointer"] for fault in answer.json().get("errors", ())]


def prove(service: RunningService, operation: str, examples: int) -> None:
    """Judge so many spoilt requests."""

    @settings(max_examples=examples, deadline=None, suppress_health_check=list(HealthCheck), database=None)
    @given(mutated(EXAMPLES[operation]))
    def agree(document: Document) -> None:
        assert refused_by_service(service, operation, document) == refused_by_library(operation, document)

    agree()


@pytest.mark.parametrize("operation", EXAMPLES)
def test_the_service_and_the_library_agree(service: RunningService, operation: str) -> None:
    """On acceptance, and on every pointer in its order."""
    prove(service, operation, 60)


@pytest.mark.slow
@pytest.mark.parametrize("operation", EXAMPLES)
def test_they_agree_on_a_thousand(service: RunningService, operation: str) -> None:
    """The same of a thousand requests for each operation."""
    prove(service, operation, 1000)
