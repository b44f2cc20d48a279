"""Requests as documents: defaults, presets, and errors that point at the field."""

from __future__ import annotations

from typing import Any

import pytest

from morphcore.errors import InvalidInput
from morphcore.models.equivalent import chain_model, physical_guess
from morphcore.models.parameters_document import parameters_document
from morphcore.optimise import optimisation_from_request
from morphcore.optimise.settings import schedule_search
from morphdata.optimize import Limits, OptimizeRequest, ScheduleSearch, Weights
from tests.identification_request import identification
from tests.identify.flights import reference_aircraft, reference_flight
from tests.optimise.morphs import last


def request(**changes: Any) -> dict[str, Any]:
    """The body of POST /optimize for a short morph."""
    example = identification("train_rate_0.8")
    parameters = parameters_document(physical_guess(chain_model(reference_aircraft(), reference_flight(), 2)))
    return {
        "aircraft": example["aircraft"],
        "flight": example["flight"],
        "model": {"parameters": parameters},
        "morph": {"final_rad": 0.4, "duration_s": 0.8, "settle_s": 0.2},
        "limits": {"max_rate_rad_s": 0.9},
        "search": {"particles": 3, "generations": 1, "seed": 5},
        "verify": "none",
        **changes,
    }


def test_a_request_runs() -> None:
    """The body of POST /optimize becomes a result with the names that clients rely on."""
    run = optimisation_from_request(OptimizeRequest.parse(request()))
    document = run.result(last(run).checkpoint).to_document()
    assert {"schedule", "limits", "variation", "reduction_percent", "search", "partial"} <= set(document)
    assert set(document["variation"]) == {"constant", "rigid_optimum", "optimum"}
    assert set(document["variation"]["optimum"]) == {"rigid", "equivalent", "flexible"}
    assert document["variation"]["optimum"]["flexible"] is None
    assert len(document["schedule"]["knot_time_s"]) == 6
    assert not document["partial"]


def test_defaults_are_the_documented_ones() -> None:
    """What a request leaves out: six knots, two seconds of settling, no turning back, weights of one."""
    document = request(morph={"final_rad": 0.4, "duration_s": 0.8})
    for name in ("limits", "search", "verify"):
        del document[name]
    run = optimisation_from_request(OptimizeRequest.parse(document))
    assert (run.morph.initial_rad, run.morph.knots, run.morph.settle_s) == (0.0, 6, 2.0)
    assert (run.morph.free_values, run.morph.goal) == (False, "variation")
    assert run.limits == Limits(monotonic=True, max_hinge_torque_nm=None)
    assert run.weights == Weights(phi=1.0, theta=1.0, psi=1.0)
    assert (run.search.method, run.search.seed, run.verify) == ("hybrid", 1, "flexible")
    assert (run.flexible.elements, run.flexible.lattice) == (10, None)


def test_the_papers_preset_is_its_swarm() -> None:
    """``preset: paper`` means 50 particles with c1 = c2 = 1; generations are free."""
    search = schedule_search(ScheduleSearch(preset="paper", generations=20))
    assert search.method == "pso"
    swarm = search.swarm
    assert (swarm.particles, swarm.c1, swarm.c2, swarm.generations) == (50, 1.0, 1.0, 20)


def test_particles_and_generations_steer_the_hybrid_too() -> None:
    """Of the default method they are the schedules screened and the iterations of the descent."""
    search = schedule_search(ScheduleSearch(particles=7, generations=3))
    assert (search.method, search.screen, search.iterations) == ("hybrid", 7, 3)


@pytest.mark.parametrize(
    ("change", "pointer"),
    [
        ({"morph": {"duration_s": 1.0}}, "/morph/final_rad"),
        ({"morph": {"final_rad": 0.4, "duration_s": 0.0}}, "/morph/duration_s"),
        ({"morph": {"final_rad": 0.4, "duration_s": 0.8, "knots": 2}}, "/morph/knots"),
        ({"morph": {"final_rad": 0.4, "duration_s": 0.8, "goal": "speed"}}, "/morph/goal"),
        ({"morph": {"final_rad": 1.4, "duration_s": 3.0}}, "/morph/final_rad"),
        ({"morph": {"final_rad": 0.4, "duration_s": 0.2}}, "/morph/duration_s"),
        (
            {"morph": {"final_rad": 0.4, "duration_s": 0.8, "goal": "minimum_time"}},
            "/morph/max_variation_rad2",
        ),
        ({"limits": {"max_rate": 1.0}}, "/limits/max_rate"),
        ({"limits": {"max_accel_rad_s2": -1.0}}, "/limits/max_accel_rad_s2"),
        ({"weights": {"phi": 0, "theta": 0, "psi": 0}}, "/weights"),
        ({"search": {"method": "least_squares"}}, "/search/method"),
        ({"verify": "maybe"}, "/verify"),
        ({"flexible": {"elements": 0}}, "/flexible/elements"),
        ({"flexible": {"lattice": {"chordwise": 0}}}, "/flexible/lattice/chordwise"),
        ({"model": {}}, "/model/parameters"),
        ({"thing": 1}, "/thing"),
    ],
)
def test_bad_requests_name_the_field(change: dict[str, Any], pointer: str) -> None:
    """What is wrong in a request is said with a pointer to it and a hint."""
    with pytest.raises(InvalidInput) as caught:
        optimisation_from_request(OptimizeRequest.parse(request(**change)))
    assert caught.value.pointer == pointer
    assert caught.value.hint


def test_a_start_as_given_needs_one() -> None:
    """``start: given`` without a start in the flight is an error at the flight."""
    document = request()
    document["flight"] = {key: value for key, value in document["flight"].items() if key != "start"}
    document["model"] = document["model"] | {"start": "given"}
    with pytest.raises(InvalidInput) as caught:
        optimisation_from_request(OptimizeRequest.parse(document))
    assert caught.value.pointer == "/flight/start"
