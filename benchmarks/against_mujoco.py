"""MuJoCo on the same tree without air, at equal error: cost of one flight in both programs."""

from __future__ import annotations

import statistics
from collections.abc import Callable
from contextlib import ExitStack

from benchmarks.forced_tree import (
    DURATION_S,
    OUTPUT_S,
    TREE_LINKS,
    airless_model,
    at_output_times,
    attitude_error,
    fly_in_lanes,
    plan_in_steps,
    start,
)
from benchmarks.setting import Array, Bench, Figures
from morphcore.models.equivalent import ChainModel, ParameterBatch, physical_guess
from morphcore.paper.computation import benchmark_swarm
from morphcore.threads import use_threads

ERROR_RAD = 1e-4  # of attitude, of each against its own converged flight
MODELS = 512  # of a batch on one core
JUDGED = 32  # models of the batch whose error is looked at: two blocks of lanes
# steps in OUTPUT_S of the references: errors below 1e-6 rad of ours, and MuJoCo's Runge-Kutta at round-off
CONVERGED, CONVERGED_MUJOCO = 400, 1000
MAX_STEPS = 4000  # in OUTPUT_S; a scheme that needs more is left out


def against_mujoco(bench: Bench) -> Figures:
    """Time of one flight in MuJoCo's best integrator over ours, alone and in a batch, on one core.

    Each program and integrator uses the longest step that keeps its attitude within ERROR_RAD. MuJoCo's model
    is compiled beforehand and only its calls to ``mj_step`` are timed; our time includes laying out the
    parameters. ``agreement_rad`` : difference between both converged flights.
    """
    try:
        from benchmarks.mujoco_tree import INTEGRATORS, ForcedMujoco, quiet
    except ImportError:
        return {"skipped": "MuJoCo is not installed: it comes with the extra `oracles`"}
    model = airless_model(bench)
    guess, swarm = physical_guess(model), benchmark_swarm(model, MODELS)
    reference = _attitudes(model, guess, CONVERGED)
    with ExitStack() as stack:
        stack.enter_context(quiet())
        flights = {name: ForcedMujoco(model, guess, name) for name in INTEGRATORS}
        converged = flights["rk4"].attitudes(OUTPUT_S / CONVERGED_MUJOCO)
        steps = {
            name: min_steps(
                lambda n, flight=flight: attitude_error(flight.attitudes(OUTPUT_S / n), converged)  # type: ignore[misc]
            )
            for name, flight in flights.items()
        }
    able = {name: OUTPUT_S / n for name, n in steps.items() if n is not None}
    judged = swarm.select(slice(0, JUDGED))
    judged_reference = _attitudes(model, judged, CONVERGED)
    alone = min_steps(lambda n: attitude_error(_attitudes(model, guess, n), reference))
    together = min_steps(lambda n: attitude_error(_attitudes(model, judged, n), judged_reference))
    if alone is None or together is None or not able:
        raise RuntimeError("a scheme does not meet the tolerance with any step")
    ours = {"single": (guess, OUTPUT_S / alone), "batch": (swarm, OUTPUT_S / together)}
    times: dict[str, list[float]] = {name: [] for name in (*able, *ours)}
    use_threads(1)
    for _ in range(bench.effort.rounds):
        for name, step_s in able.items():
            flights[name].reset(step_s)
            times[name].append(bench.timed(lambda: flights[name].fly(step_s)))  # noqa: B023 - called at once
        for name, (batch, step_s) in ours.items():
            plan, state = plan_in_steps(model, step_s), start(model, batch.particles)
            whole = bench.timed(lambda: fly_in_lanes(model, batch, plan, state))  # noqa: B023
            times[name].append(whole / batch.particles)
    median = {name: statistics.median(values) for name, values in times.items()}
    best = min(able, key=lambda name: median[name])
    ratios = {
        name: statistics.median(m / o for m, o in zip(times[best], times[name], strict=True)) for name in ours
    }
    return {
        "links_per_wing": TREE_LINKS,
        "flight_s": DURATION_S,
        "models": MODELS,
        "error_rad": ERROR_RAD,
        "agreement_rad": attitude_error(reference[..., 0], converged),
        "step_s": {**able, **{name: step for name, (_, step) in ours.items()}},
        "flight_cost_s": median,
        "best_integrator": best,
        "batch_ratio": ratios["batch"],
        "single_ratio": ratios["single"],
    }


def min_steps(error: Callable[[int], float]) -> int | None:
    """Smallest number of steps in OUTPUT_S whose error is below ERROR_RAD; None if there is none.

    Doubles until the error holds and halves the interval then; an error that is no number does not hold.
    """
    high = 1
    while not error(high) < ERROR_RAD:
        high *= 2
        if high > MAX_STEPS:
            return None
    low = high // 2  # does not hold, or is zero
    while high - low > 1:
        middle = (low + high) // 2
        if error(middle) < ERROR_RAD:
            high = middle
        else:
            low = middle
    return high


def _attitudes(model: ChainModel, batch: ParameterBatch, steps: int) -> Array:
    """Quaternions (k, 4, p) at the output times."""
    plan = plan_in_steps(model, OUTPUT_S / steps)
    return at_output_times(fly_in_lanes(model, batch, plan, start(model, batch.particles)))
