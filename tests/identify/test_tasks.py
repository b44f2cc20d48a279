"""A generation flown in parts: the same costs, the same steps, the same result, to the bit."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from morphcore.identify import Identification, SearchSettings
from morphcore.lanes import TOGETHER
from morphcore.search.evolution import EvolutionSettings
from morphcore.search.solver import Batch
from morphcore.search.swarm import SwarmSettings
from morphdata.identify import EquivalentModel
from tests.identify.flights import example, reference_aircraft, reference_flight, shortened
from tests.search.problems import content

SWARM = SearchSettings(method="pso", seed=5, swarm=SwarmSettings(particles=75, generations=3))
EVOLUTION = SearchSettings(method="cma", seed=5, evolution=EvolutionSettings(particles=35, generations=3))


def search(settings: SearchSettings = SWARM) -> Identification:
    """Two links, a second of one flight."""
    samples = [shortened(example("rate_0.8"), 60), shortened(example("asymmetric"), 40)]
    return Identification(
        reference_aircraft(), reference_flight(), samples, EquivalentModel(links_per_wing=2), settings
    )


@pytest.mark.parametrize("particles", [1, 15, 16, 17, 75, 160])
@pytest.mark.parametrize("maximum", [1, 2, 7, 100])
def test_parts_are_whole_blocks_and_make_up_the_task(particles: int, maximum: int) -> None:
    """Parts come in order, are whole blocks of lanes but for the end, and are never empty or too many."""
    points = np.arange(3.0 * particles).reshape(particles, 3)
    parts = Batch(points).parts(maximum)
    np.testing.assert_array_equal(np.concatenate(parts), points)
    assert len(parts) == min(maximum, -(-particles // TOGETHER))
    assert all(part.shape[0] % TOGETHER == 0 for part in parts[:-1])
    assert all(part.shape[0] > 0 for part in parts)


def test_a_cost_does_not_depend_on_its_part() -> None:
    """Flown in parts of any number, each model costs what it costs among all, to the bit."""
    run = search()
    first = next(iter(run.steps()))
    task = run.task(first.checkpoint)
    assert task is not None
    whole = run.task_costs(task.points)
    for maximum in (2, 3, 5):
        parts = [run.task_costs(part) for part in task.parts(maximum)]
        np.testing.assert_array_equal(np.concatenate(parts), whole)


@pytest.mark.parametrize("settings", [SWARM, EVOLUTION], ids=lambda settings: settings.method)
def test_tasks_flown_elsewhere_give_the_search_itself(settings: SearchSettings) -> None:
    """A search whose generations are flown in parts by other processes goes through the same states."""
    steps = list(search(settings).steps())
    run, others = search(settings), [search(settings) for _ in range(2)]  # processes with plans of their own
    step = steps[0]
    for expected in steps[1:]:
        task = search(settings).task(step.checkpoint)
        assert task is not None
        costs = [others[i % 2].task_costs(part) for i, part in enumerate(task.parts(4))]
        step = run.tell(step.checkpoint, np.concatenate(costs), wall_s=1.0)
        assert content(run.state(step.checkpoint)) == content(run.state(expected.checkpoint))
        assert replace(step, checkpoint=b"") == replace(expected, checkpoint=b"")
    assert run.task(step.checkpoint) is None, "the search is over"
    assert run.state(step.checkpoint).wall_s >= len(steps) - 1


def test_descents_are_not_flown_in_parts() -> None:
    """A descent needs more than costs, the screening does not; costs that answer no task are refused."""
    run = search(SearchSettings(screen=16, starts=2, iterations=2))
    steps = list(run.steps())
    for step, after in itertools.pairwise(steps):
        assert (run.task(step.checkpoint) is not None) == (after.phase == "screen")
    assert run.task(steps[-1].checkpoint) is None
    step = steps[0]
    with pytest.raises(ValueError, match="do not answer"):
        run.tell(step.checkpoint, np.ones(16))
    swarm = search()
    first = next(iter(swarm.steps()))
    with pytest.raises(ValueError, match="do not answer"):
        swarm.tell(first.checkpoint, np.ones(74))


def test_the_time_of_the_flights_counts() -> None:
    """What others took to fly a generation is time of the search: its budget ends it."""
    settings = SearchSettings(method="pso", seed=5, max_seconds=100.0, swarm=SWARM.swarm)
    run = search(settings)
    first = next(iter(run.steps()))
    assert run.tell(first.checkpoint, np.ones(75), wall_s=1.0).fraction < 1.0
    assert run.tell(first.checkpoint, np.ones(75), wall_s=100.0).fraction == 1.0
