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
from morphcore.simulate.request import simulation_from_document
from morphdata.aircraft import EXAMPLE_AIRCRAFT, EXAMPLE_MATERIAL
from morphdata.faults import InvalidInput
from morphdata.parameters import EXAMPLE_PARAMETERS
from morphdata.simulate import EXAMPLE_SIMULATION
from tests.app.running_service import DEAD_BROKER, RunningService, running_service
from tests.morphdata.mutations import mutated

Document = dict[str, Any]

SPLINE = {"kind": "spline", "knot_time_s": [0.0, 1.0, 2.0], "knot_angle_rad": [0.0, 0.5, 1.0]}
TABLE = {"kind": "tabulated", "time_s": [0.0, 1.0, 2.0], "angle_rad": [0.0, 0.5, 1.0]}
AIR = {
    "gust": {"amplitude_m_s": 3.0, "gradient_m": 30.0, "start_s": 0.5, "direction_n": [0.0, 0.0, -1.0]},
    "turbulence": {"wind_20ft_m_s": 7.7, "sigma_high_m_s": 1.5},
    "seed": 4,
}
TAIL = {
    "name": "tail",
    "side": "right",
    "span_m": 1.0,
    "root_chord_m": 0.3,
    "tip_chord_m": 0.2,
    "thickness_m": 0.03,
    "material": EXAMPLE_MATERIAL,
    "section": {
        "ei_flap_n_m2": 5e4,
        "ei_lag_n_m2": 5e5,
        "gj_n_m2": 3e4,
        "mass_per_length_kg_m": 15.0,
        "inertia_per_length_kg_m": [0.1, 0.2, 0.1],
    },
    "position_m": [-2.2, 0.0, 0.0],
    "flexible": False,
}
BODY = {"mass_kg": 875.0, "inertia_kg_m2": [[60.0, 0.0, -1.0], [0.0, 1800.0, 0.0], [-1.0, 0.0, 1850.0]]}
AS_IDENTIFIED = {"lattice": {"chordwise": 2, "spanwise": 6}, "step_s": 0.005, "start": "given"}

EXAMPLES: dict[str, tuple[Document, ...]] = {
    "simulate": (
        EXAMPLE_SIMULATION,
        EXAMPLE_SIMULATION
        | {
            "model": {"kind": "equivalent", "parameters": EXAMPLE_PARAMETERS | AS_IDENTIFIED},
            "schedules": {"left": SPLINE, "right": TABLE},
        },
        EXAMPLE_SIMULATION
        | {
            "aircraft": {"fuselage": BODY, "surfaces": [*EXAMPLE_AIRCRAFT["surfaces"], TAIL]},
            "flight": {"airspeed_m_s": 150.0, "mach": "auto", "wind_n_m_s": [1.0, 0.0, 0.0]},
            "model": {"kind": "flexible", "elements": 4, "step_s": 0.002},
            "output_step_s": 0.02,
            "environment": AIR,
        },
        EXAMPLE_SIMULATION
        | {
            "model": {
                "kind": "equivalent",
                "parameters": {"model": EXAMPLE_PARAMETERS, "fit": [{"role": "train", "J_identified": 0.1}]},
            }
        },
    )
}
READERS: dict[str, Callable[[Document], object]] = {"simulate": simulation_from_document}


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
