"""The law of the one contract: what the service accepts the library accepts, and refuses at the same place.

The requests of every operation are spoilt in one to three places; the service judges each through
``POST /validate/...``, the library by reading it and, where it accepts, beginning the work. Neither may raise
anything but its refusal.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings

from app.settings import Settings
from morphdata.aircraft import EXAMPLE_AIRCRAFT, EXAMPLE_MATERIAL
from morphdata.faults import InvalidInput, MorphError
from morphdata.identify import EXAMPLE_REQUEST
from morphdata.operations import operation_named
from morphdata.optimize import EXAMPLE_OPTIMIZATION
from morphdata.parameters import EXAMPLE_PARAMETERS
from morphdata.samples import EXAMPLE_SAMPLE
from morphdata.simulate import EXAMPLE_SIMULATION
from morphdata.study import EXAMPLE_STUDY
from tests.app.running_service import DEAD_BROKER, RunningService, running_service
from tests.morphdata.mutations import mutated
from worker.operations import find_operation

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
        "ei_edge_n_m2": 5e5,
        "gj_n_m2": 3e4,
        "mass_per_length_kg_m": 15.0,
        "inertia_per_length_kg_m": [0.1, 0.2, 0.1],
    },
    "position_m": [-2.2, 0.0, 0.0],
    "flexible": False,
}
FOLDING: Document = {  # wings that sweep and fold, one hinge about a skew axis, one on a side alone
    "fuselage": EXAMPLE_AIRCRAFT["fuselage"],
    "surfaces": [
        {
            **{name: value for name, value in wing.items() if name != "hinge"},
            "position_m": [0.0, 0.5 if wing["side"] == "right" else -0.5, 0.0],
            "hinges": [
                wing["hinge"],
                {"position_m": [0.0, 0.5, 0.0], "axis": "x", "angle_rad": 0.1, "max_rad": 1.0},
                {"position_m": [0.1, 0.5, 0.0], "axis": [0.1, 2.0, 0.0], "name": "cant"},
            ][: 3 if wing["side"] == "left" else 2],
        }
        for wing in EXAMPLE_AIRCRAFT["surfaces"]
    ],
}
FOLD_SAMPLE: Document = {
    **{name: value for name, value in EXAMPLE_SAMPLE.items() if not name.startswith("sweep")},
    "fold_rad": [0.0, 0.0, 0.1, 0.2],
    "sweep_left_deg": [0.0, 0.0, 1.0, 2.0],
    "sweep_right_rad": [0.0, 0.0, 0.01, 0.02],
    "vx_m_s": [150.0] * 4,
    "p_deg_s": [0.0, None, 1.0, 2.0],
}
TURNED_SAMPLE: Document = {  # a quaternion in other axes, and a channel that turns with them
    **{name: values for name, values in EXAMPLE_SAMPLE.items() if name[:3] not in ("phi", "the", "psi")},
    **dict(zip(("qw", "qx", "qy", "qz"), ([0.6] * 4, [0.0] * 4, [0.0] * 4, [0.8] * 4), strict=True)),
    "frames": {"earth": "ENU", "body": "FLU"},
    "q_rad_s": [0.0, None, 0.1, 0.2],
}
BODY = {"mass_kg": 875.0, "inertia_kg_m2": [[60.0, 0.0, -1.0], [0.0, 1800.0, 0.0], [-1.0, 0.0, 1850.0]]}
AS_IDENTIFIED = {"lattice": {"chordwise": 2, "spanwise": 6}, "step_s": 0.005, "start": "given"}

RICH_IDENTIFICATION: Document = {
    **EXAMPLE_REQUEST,
    "samples": [EXAMPLE_SAMPLE, {**EXAMPLE_SAMPLE, "name": "other", "role": "held_out"}],
    "model": {
        "links_per_wing": 2,
        "separate_wings": True,
        "aero_coefficients": ["lift_factor", "lag_s"],
        "bounds": {"division": [0.2, 0.7], "stiffness_nm_rad": [1e3, 1e6], "lag_s": [1e-4, 0.1]},
        "lattice": {"chordwise": 1, "spanwise": 4},
        "step_s": 0.005,
    },
    "search": {
        "method": "cma",
        "particles": 8,
        "max_seconds": 60.0,
        "warm_start": {"parameters": EXAMPLE_PARAMETERS},
    },
    "execution": {"mode": "distributed", "chunks": 4},
}
RICH_OPTIMIZATION: Document = {
    **EXAMPLE_OPTIMIZATION,
    "model": {"parameters": EXAMPLE_PARAMETERS, "lattice": {"chordwise": 1, "spanwise": 4}, "step_s": 0.005},
    "morph": {
        "final_rad": 1.0,
        "duration_s": 2.0,
        "knots": 5,
        "goal": "minimum_time",
        "max_variation_rad2": 0.5,
        "free_values": True,
    },
    "limits": {"max_rate_rad_s": 1.0, "max_accel_rad_s2": 8.0, "monotonic": False},
    "weights": {"phi": 1.0, "theta": 0.5, "psi": 0.0},
    "search": {"method": "pso", "particles": 20, "generations": 5, "seed": 3},
    "flexible": {"elements": 4},
}
EXAMPLES: dict[str, tuple[Document, ...]] = {
    "identify": (
        EXAMPLE_REQUEST,
        RICH_IDENTIFICATION,
        {**EXAMPLE_REQUEST, "aircraft": FOLDING, "samples": [FOLD_SAMPLE]},
        {**EXAMPLE_REQUEST, "samples": [TURNED_SAMPLE]},
    ),
    "study": (EXAMPLE_STUDY, {**RICH_IDENTIFICATION, "model": {"links_per_wing": [1, 2]}, "search": {}}),
    "simulate": (
        EXAMPLE_SIMULATION,
        EXAMPLE_SIMULATION
        | {
            "model": {"kind": "equivalent", "parameters": EXAMPLE_PARAMETERS | AS_IDENTIFIED},
            "schedules": {"left": SPLINE, "right": TABLE},
        },
        EXAMPLE_SIMULATION
        | {"aircraft": FOLDING, "schedules": {"sweep": SPLINE, "fold_left": TABLE, "cant": {"kind": "hold"}}},
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
    ),
    "optimize": (
        EXAMPLE_OPTIMIZATION,
        RICH_OPTIMIZATION,
        {
            **EXAMPLE_OPTIMIZATION,
            "aircraft": FOLDING,
            "morph": {**EXAMPLE_OPTIMIZATION["morph"], "drive": "fold"},
        },
    ),
}
# what takes more than the request to see: whether a spline keeps the limits, the library finds by computing
COMPUTED = ("/limits/max_rate_rad_s", "/limits/max_accel_rad_s2")


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningService]:
    """A running service."""
    database = tmp_path_factory.mktemp("contract") / "service.sqlite3"
    with running_service(Settings(database_url=f"sqlite:///{database}", broker_url=DEAD_BROKER)) as running:
        yield running


def refused_by_library(operation: str, document: Document) -> list[str]:
    """Pointers to what the library refuses; none where it accepts."""
    try:
        operation_named(operation).request.parse(document)
    except InvalidInput as error:
        return [fault.pointer for fault in error.faults]
    try:
        find_operation(operation)(document, 1)
    except MorphError as error:
        if error.code == InvalidInput.code and error.pointer not in COMPUTED:
            return [error.pointer]
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
