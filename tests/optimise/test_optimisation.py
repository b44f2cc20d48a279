"""Optimisation from start to end: limits, resumption, interruption, goals, torque, verification."""

from __future__ import annotations

import itertools
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from morphcore.errors import FlightDiverged, InvalidInput
from morphcore.models.equivalent import chain_model, physical_guess
from morphcore.optimise import (
    Interrupted,
    Limits,
    Morph,
    Step,
    Weights,
    optimise_schedule,
)
from morphcore.optimise import verification as module
from morphcore.optimise.feasible import reached
from morphcore.optimise.flights import MorphFlights
from morphcore.optimise.settings import ScheduleSettings
from morphcore.search.checkpoint import UnreadableCheckpoint
from morphcore.search.swarm import SwarmSettings
from morphcore.simulate.flight import FlightStep
from morphcore.simulate.schedule import Spline
from morphcore.simulate.step_choice import choose_step
from tests.identify.flights import EXAMPLES, reference_aircraft, reference_documents, reference_flight
from tests.optimise.morphs import QUICK, SHORT, last, optimisation, sampled
from tests.simulate.flights import fly

SWARM = ScheduleSettings(method="pso", seed=3, swarm=SwarmSettings(particles=6, generations=3))
TORQUE = Limits(max_rate_rad_s=0.9, max_hinge_torque_nm=560.0)  # the centre of the limits needs more


def without_times(document: dict[str, Any]) -> dict[str, Any]:
    """A result document without what a clock put into it."""
    search = {k: v for k, v in document["search"].items() if k not in ("wall_s", "search_s", "verify_s")}
    return {**document, "search": search}


def by_simulation(schedule: Any, model: Any, end_s: float) -> np.ndarray:
    """Departures (k, 3) of a schedule flown by `simulate`."""
    flown = fly(
        reference_aircraft(),
        reference_flight(),
        {"left": schedule, "right": schedule},
        model=model,
        duration_s=end_s,
    ).trajectory
    return flown.euler - flown.euler[0]


def test_the_papers_problem_is_solved_20_per_cent_below_constant_rate() -> None:
    """A radian in two seconds at no more than 1 rad/s, two seconds of settling: a fifth less at least.

    Found by a search of three starts with two links; the limits hold in 20,000 samples of the schedule.
    """
    run = optimisation(
        Morph(final_rad=1.0, duration_s=2.0),
        Limits(max_rate_rad_s=1.0),
        links=2,
        search=ScheduleSettings(screen=2, starts=2, iterations=3),
    )
    result = run.result(last(run).checkpoint)
    reduction, model = result.reduction()
    assert model == "equivalent"
    assert reduction is not None
    assert reduction > 20.0
    angle, rate, _ = sampled(result.schedule)
    assert rate.max() <= 1.0
    assert rate.min() >= -1e-12
    assert angle[-1] == pytest.approx(1.0, abs=1e-15)


@pytest.mark.parametrize(
    ("search", "limits"),
    [
        (QUICK, Limits(max_rate_rad_s=0.9, max_accel_rad_s2=4.0)),
        (SWARM, TORQUE),
        (QUICK, Limits(max_accel_rad_s2=5.0, monotonic=False)),
    ],
)
def test_every_flown_candidate_keeps_the_limits(
    search: ScheduleSettings, limits: Limits, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing is flown in a search, probes and particles alike, that breaks rate, acceleration or sign."""
    flown: list[Spline] = []
    fly = MorphFlights.fly

    def spy(self: MorphFlights, schedules: Any, **options: Any) -> Any:
        flown.extend(s for s in schedules if isinstance(s, Spline))
        return fly(self, schedules, **options)

    monkeypatch.setattr(MorphFlights, "fly", spy)
    run = optimisation(
        SHORT.model_copy(update={"free_values": limits.max_accel_rad_s2 == 5.0}), limits, search=search
    )
    result = run.result(last(run).checkpoint)
    assert len(flown) > 20
    for schedule in flown:
        extremes = reached(schedule)
        assert extremes.max_rate_rad_s <= (limits.max_rate_rad_s or np.inf)
        assert extremes.max_accel_rad_s2 <= (limits.max_accel_rad_s2 or np.inf)
        assert extremes.monotonic or not limits.monotonic
    if limits.max_hinge_torque_nm is not None:
        torque = result.to_document()["reached"]["optimum"]["max_hinge_torque_nm"]
        assert torque <= limits.max_hinge_torque_nm


@pytest.mark.parametrize(
    ("search", "limits", "cuts"),
    [
        (QUICK, Limits(max_rate_rad_s=0.9), (0.0, 0.5, 0.8)),
        (SWARM, Limits(max_rate_rad_s=0.9), (0.0, 0.5)),
        pytest.param(QUICK, TORQUE, (0.15,), marks=pytest.mark.slow),
    ],
)
def test_resumes_from_any_step_to_the_identical_result(
    search: ScheduleSettings, limits: Limits, cuts: tuple[float, ...]
) -> None:
    """A search cut off after any step and begun again from its bytes ends as the undisturbed one."""
    steps = list(optimisation(limits=limits, search=search).steps())
    run = optimisation(limits=limits, search=search)
    whole = without_times(run.result(steps[-1].checkpoint).to_document())
    for cut in cuts:
        resumed = optimisation(limits=limits, search=search)
        ended = last(resumed, steps[int(cut * len(steps))].checkpoint)
        assert without_times(resumed.result(ended.checkpoint).to_document()) == whole


def test_every_step_has_a_result() -> None:
    """From the first step on there is a best so far; its cost never rises, and the fraction rises to one."""
    run = optimisation()
    steps = list(run.steps())
    best = [step.best_cost for step in steps]
    assert all(after <= before for before, after in itertools.pairwise(best))
    fractions = [step.fraction for step in steps]
    assert fractions == sorted(fractions)
    assert fractions[-1] == 1.0
    assert [step.flights for step in steps] == sorted(step.flights for step in steps)
    first = run.best_so_far(steps[0].checkpoint).to_document()
    assert first["partial"]
    assert first["variation"]["rigid_optimum"] == dict.fromkeys(("rigid", "equivalent", "flexible"))
    assert first["variation"]["optimum"]["equivalent"] == pytest.approx(steps[0].best_cost)
    assert json.loads(json.dumps(first, allow_nan=False)) == first
    ended = run.result(steps[-1].checkpoint).to_document()
    assert not ended["partial"]
    assert ended["search"]["finished"]
    assert ended["search"]["best_cost"] == steps[-1].best_cost
    assert json.loads(json.dumps(ended, allow_nan=False)) == ended


def test_the_result_flies_as_it_says() -> None:
    """Variation and curves of every schedule are those that the simulator gives for it, in both models.

    Another table of the lattice: 1e-4 of the variation.
    """
    run = optimisation(links=2)
    result = run.result(last(run).checkpoint)
    models: dict[str, Any] = {"rigid": "rigid", "equivalent": run.parameters}
    curves = result.curves()
    for name, model in models.items():
        for schedule, flown in result.flights[name].items():
            moved = result.schedules[schedule]
            assert flown is not None
            assert moved is not None
            departure = by_simulation(moved, model, 1.0)
            assert flown.variation == pytest.approx(np.sum(departure**2), rel=1e-4)
            shown = curves["flights"][name][schedule]["theta_rad"]
            np.testing.assert_allclose(shown, departure[:, 1], atol=1e-6)
    np.testing.assert_allclose(curves["time_s"], 0.01 * np.arange(101), atol=1e-12)
    assert curves["schedules"]["optimum"]["sweep_rad"][-1] == pytest.approx(0.4)


def test_weights_steer_the_search_and_not_the_variation() -> None:
    """The cost is weighted, the variation that is compared is not."""
    run = optimisation(weights=Weights(theta=4.0))
    step = last(run)
    document = run.result(step.checkpoint).to_document()
    assert step.best_cost == pytest.approx(4.0 * document["variation"]["optimum"]["equivalent"])


def test_stop_interrupts_between_flights() -> None:
    """A stop that turns true within a step ends the search there; earlier steps stay valid."""
    requested = 0

    def stop() -> bool:
        nonlocal requested
        requested += 1
        return requested > 8

    done: list[Step] = []
    with pytest.raises(Interrupted):
        done.extend(optimisation().steps(stop=stop))
    assert requested == 9


def test_time_budget_is_shared_between_the_searches() -> None:
    """When their parts of ``max_seconds`` are used up both searches end with their best."""
    ticks = itertools.count(0, 30)
    run = optimisation(
        search=replace(QUICK, max_seconds=100.0), clock=lambda: float(next(ticks)), verify="none"
    )
    steps = list(run.steps())
    assert len(steps) < len(list(optimisation().steps()))
    document = run.result(steps[-1].checkpoint).to_document()
    assert document["variation"]["rigid_optimum"]["rigid"] is not None
    assert document["search"]["finished"]


@pytest.mark.slow
def test_free_values_are_no_worse_than_fixed_ones() -> None:
    """With the angles at the knots free too, the best schedule disturbs less."""
    limits = Limits(max_rate_rad_s=0.9, max_accel_rad_s2=6.0)
    search = ScheduleSettings(seed=1, screen=2, starts=2, iterations=5)
    fixed, free = (
        last(optimisation(SHORT.model_copy(update={"free_values": free}), limits, search=search)).best_cost
        for free in (False, True)
    )
    assert free < fixed


def test_a_torque_that_no_schedule_keeps_is_an_error_with_a_way_out() -> None:
    """An impossible torque limit is named with the least torque found, and what a longer morph would do."""
    run = optimisation(limits=TORQUE.model_copy(update={"max_hinge_torque_nm": 430.0}))
    with pytest.raises(InvalidInput) as caught:
        last(run)
    assert caught.value.pointer == "/limits/max_hinge_torque_nm"
    reported = float(caught.value.message.split("bear ")[1].split()[0])
    longer = float(caught.value.hint.split("about ")[1].split(",")[0])
    assert reported > 430.0
    assert longer > SHORT.duration_s
    last(
        optimisation(
            SHORT.model_copy(update={"duration_s": longer}),
            TORQUE.model_copy(update={"max_hinge_torque_nm": 430.0}),
        )
    )


def test_minimum_time_agrees_with_the_front() -> None:
    """The shortest morph below a variation of the front is that point of it, or a shorter one."""
    limits = Limits(max_rate_rad_s=0.9, max_accel_rad_s2=6.0)
    front_run = optimisation(SHORT.model_copy(update={"goal": "pareto", "front_points": 2}), limits)
    front = front_run.result(last(front_run).checkpoint).to_document()
    times = [point["duration_s"] for point in front["searched"]]
    assert times[0] >= front_run.space(0.8).quickest[0]
    assert times[-1] == 0.8
    for before, after in itertools.pairwise(front["pareto"]):
        assert before["duration_s"] < after["duration_s"]
        assert before["variation_rad2"] > after["variation_rad2"]
    for point in front["searched"]:
        beaten = any(
            other["duration_s"] < point["duration_s"] and other["variation_rad2"] <= point["variation_rad2"]
            for other in front["searched"]
        )
        assert point["beaten"] == beaten
        assert point["constant_rad2"] > 0.0
    point = front["pareto"][-1]
    morph = SHORT.model_copy(
        update={"goal": "minimum_time", "max_variation_rad2": 1.001 * point["variation_rad2"]}
    )
    quickest = optimisation(morph, limits)
    document = quickest.result(last(quickest).checkpoint).to_document()
    assert document["duration_s"] <= point["duration_s"] + 1e-9
    assert document["variation"]["optimum"]["equivalent"] <= morph.max_variation_rad2
    assert document["schedule"]["knot_time_s"][-1] == document["duration_s"]


class FlexibleDouble:
    """Stands for the flexible model: the rigid model's flight in four steps, each flight counted."""

    def __init__(self) -> None:
        self.flights = 0
        self.diverges = False

    def __call__(  # noqa: D102 - see the class
        self, *args: Any, model: str, elements: int, stop: Any, **options: Any
    ) -> Iterator[Any]:
        assert (model, elements) == ("flexible", 10)
        self.flights += 1
        for quarter in range(1, 4):
            if stop is not None and stop():
                raise Interrupted
            yield FlightStep(quarter / 4)
        if self.diverges:
            raise FlightDiverged(time_s=0.3)
        yield FlightStep(1.0, fly(*args, model="rigid", **options))


@pytest.fixture
def flexible(monkeypatch: pytest.MonkeyPatch) -> FlexibleDouble:
    """Flexible flights that take no time."""
    double = FlexibleDouble()
    monkeypatch.setattr(module, "flight_steps", double)
    return double


def test_flexible_flights_are_steps_of_their_own(flexible: FlexibleDouble) -> None:
    """Each of the three is checkpointed when it is flown, and tells its progress; resuming flies the rest."""
    run = optimisation(verify="flexible")
    steps = list(run.steps())
    assert flexible.flights == 3
    verify = [step for step in steps if step.phase == "verify"]
    assert len(verify) == 3 * 4
    assert [step.fraction for step in steps] == sorted(step.fraction for step in steps)
    whole = run.result(steps[-1].checkpoint).to_document()
    assert whole["reduction_model"] == "flexible"
    for name in ("constant", "rigid_optimum", "optimum"):
        assert whole["variation"][name]["flexible"] is not None
    after_first = next(step for step in verify if len(run.state(step.checkpoint).verified) == 1)
    assert run.best_so_far(after_first.checkpoint).to_document()["partial"]
    resumed = optimisation(verify="flexible")
    ended = last(resumed, after_first.checkpoint)
    assert flexible.flights == 3 + 2
    assert without_times(resumed.result(ended.checkpoint).to_document()) == without_times(whole)


def test_a_flexible_flight_can_be_cancelled(flexible: FlexibleDouble) -> None:
    """A stop within a flexible flight ends it; what was found stays in the last step's bytes."""
    run = optimisation(verify="flexible")
    done: list[Step] = []
    steps = run.steps(stop=lambda: bool(done) and done[-1].phase == "verify")
    with pytest.raises(Interrupted):
        done.extend(steps)
    assert flexible.flights == 1
    document = run.best_so_far(done[-1].checkpoint).to_document()
    assert document["variation"]["optimum"]["equivalent"] is not None
    assert document["variation"]["optimum"]["flexible"] is None


def test_a_flexible_flight_that_fails_is_reported(flexible: FlexibleDouble) -> None:
    """What cannot be flown in the flexible model leaves its cell empty, and says why."""
    flexible.diverges = True
    run = optimisation(verify="flexible")
    document = run.result(last(run).checkpoint).to_document()
    assert document["variation"]["optimum"]["flexible"] is None
    assert document["reduction_model"] == "equivalent"
    assert len(document["notes"]) == 3
    assert "diverged" in document["notes"][0]


def test_a_damaged_checkpoint_is_refused() -> None:
    """Bytes that are no checkpoint give an error of the library."""
    good = next(iter(optimisation().steps())).checkpoint
    for bad in (b"", b"nonsense", good[: len(good) // 2]):
        with pytest.raises(UnreadableCheckpoint):
            optimisation().best_so_far(bad)


def test_one_parameter_set_is_needed() -> None:
    """A batch of several models is not one model to optimise with."""
    guess = physical_guess(chain_model(reference_aircraft(), reference_flight(), 2))
    with pytest.raises(InvalidInput) as caught:
        optimise_schedule(*reference_documents(), guess.select(np.array([0, 0])), morph=SHORT)
    assert caught.value.pointer == "/model/parameters"


@pytest.mark.slow
def test_the_number_of_threads_does_not_change_the_answer() -> None:
    """One or two threads, of kernels and of linear algebra, give the same result, to the bit."""
    code = (
        "import json;"
        "from tests.optimise.test_settings import request;"
        "from morphcore.optimise import optimisation_from_request as begin;"
        "from morphdata.optimize import OptimizeRequest;"
        "run = begin(OptimizeRequest.parse(request()), {threads}); *_, step = run.steps();"
        "found = run.result(step.checkpoint).to_document();"
        "print(json.dumps([found['schedule'], found['variation']]))"
    )
    answers = [
        subprocess.run(
            [sys.executable, "-c", code.replace("{threads}", threads)],
            cwd=EXAMPLES.parent,
            env=os.environ
            | {
                "OPENBLAS_NUM_THREADS": threads,
                "NUMBA_NUM_THREADS": threads,
                "PYTHONPATH": str(EXAMPLES.parent),
            },
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for threads in ("1", "2")
    ]
    assert answers[0] == answers[1]


@pytest.mark.slow
def test_the_papers_problem_in_the_flexible_model() -> None:
    """With three links the default search ends a quarter below constant rate in the flexible model too."""
    parameters = physical_guess(chain_model(reference_aircraft(), reference_flight(), 3))
    limits = Limits(max_rate_rad_s=1.0)
    morph = Morph(final_rad=1.0, duration_s=2.0)
    result = optimise_schedule(*reference_documents(), parameters, morph=morph, limits=limits)
    reduction, model = result.reduction()
    assert model == "flexible"
    assert reduction is not None
    assert reduction > 25.0
    assert reached(result.schedule).max_rate_rad_s <= 1.0


@pytest.mark.slow
def test_the_default_search_is_no_worse_than_the_papers_swarm() -> None:
    """The paper's 50 particles, 20 generations of them, do not find better than the descent's few flights."""
    morph, limits = Morph(final_rad=1.0, duration_s=2.0), Limits(max_rate_rad_s=1.0)
    swarm = ScheduleSettings(method="pso", swarm=SwarmSettings(particles=50, generations=20))
    steps = {
        search.method: last(optimisation(morph, limits, links=2, search=search))
        for search in (ScheduleSettings(), swarm)
    }
    assert steps["hybrid"].best_cost <= steps["pso"].best_cost
    assert steps["pso"].best_cost < 1.03 * steps["hybrid"].best_cost
    assert steps["hybrid"].flights < 0.2 * steps["pso"].flights


def test_the_step_holds_for_both_models() -> None:
    """The step is the longest with which both models fly the constant rate well enough, or the given one."""
    jerk, limits = Morph(final_rad=1.0, duration_s=0.08, settle_s=0.2), Limits(max_rate_rad_s=40.0)
    run = optimisation(jerk, limits, links=2)
    flight = [run.constant(jerk.duration_s)] * len(run.aircraft.hinges), run.times_s
    alone = {}
    for name in ("rigid", "equivalent"):
        model, batch = run.chain(name)
        alone[name] = choose_step(model, [flight], batch).step_s
    assert alone["equivalent"] < alone["rigid"]
    assert run.step_s == alone["equivalent"]
    assert optimisation(jerk, limits, links=2, step_s=0.01).step_s == 0.01
