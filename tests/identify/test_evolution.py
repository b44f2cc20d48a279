"""CMA-ES as a search: it arrives, resumes, keeps the box and leaves numpy's generator alone."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from morphcore.errors import InvalidInput
from morphcore.search.evolution import Evolution, EvolutionSettings, EvolutionState, first_evolution
from morphcore.identify import Identification, ModelSettings, SearchSettings
from morphcore.identify.settings import search_settings
from morphcore.identify.state import decode
from tests.identify.flights import example, reference_aircraft, reference_flight, shortened

Array = NDArray[np.float64]
SMALL = EvolutionSettings(particles=16, generations=4)
SEARCH = SearchSettings(method="cma", seed=5, evolution=SMALL)


def ellipsoid(points: Array) -> Array:
    """A stretched bowl whose least point is inside of the box but for the last coordinate."""
    centre = np.full(points.shape[1], 0.8)
    centre[-1] = 1.2
    return np.asarray(((points - centre) ** 2 * 10 ** np.linspace(0, 3, points.shape[1])).sum(axis=1))


def searched(evolution: Evolution, settings: EvolutionSettings) -> tuple[EvolutionState, Array]:
    """The state after all generations, and all points that were asked for."""
    state, seen = first_evolution(settings), []
    for _ in range(settings.generations):
        points = evolution.points(state)
        seen.append(points)
        state = evolution.moved(state, ellipsoid(points))
    return state, np.concatenate(seen)


def search(settings: SearchSettings = SEARCH) -> Identification:
    """Two links, a second of one flight."""
    samples = [shortened(example("rate_0.8"), 60)]
    return Identification(
        reference_aircraft(), reference_flight(), samples, ModelSettings(links_per_wing=2), settings
    )


@pytest.mark.parametrize("d", [1, 2, 10])
def test_reaches_the_least_point_of_the_box_and_never_leaves_it(d: int) -> None:
    """On a bowl stretched a thousandfold it ends at the constrained minimum; every point is in the cube."""
    settings = EvolutionSettings(particles=16, generations=150)
    _, seen = searched(Evolution(settings, np.full(d, 0.3), 7), settings)
    assert seen.min() >= 0.0
    assert seen.max() <= 1.0
    least = np.full(d, 0.8)
    least[-1] = 1.0
    np.testing.assert_allclose(seen[np.argmin(ellipsoid(seen))], least, atol=1e-3)


def test_goes_on_from_what_it_was_told() -> None:
    """Another strategy, told the same costs, asks for the same points; so does one told otherwise between."""
    settings = EvolutionSettings(particles=12, generations=9)
    first, other = (Evolution(settings, np.full(6, 0.4), 3) for _ in range(2))
    state, _ = searched(first, settings)
    expected = first.points(state)
    np.testing.assert_array_equal(other.points(state), expected)
    other.moved(state, np.zeros(12))
    np.testing.assert_array_equal(other.points(state), expected)
    assert not np.array_equal(Evolution(settings, np.full(6, 0.4), 4).points(state), expected)


def test_leaves_no_trace(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """It does not depend on numpy's global generator nor move it, writes no file and prints nothing."""
    monkeypatch.chdir(tmp_path)
    found = []
    for seed in (1, 2):
        np.random.seed(seed)  # noqa: NPY002
        before = str(np.random.get_state(legacy=True))  # noqa: NPY002
        state, _ = searched(Evolution(SMALL, np.full(5, 0.4), 3), SMALL)
        assert str(np.random.get_state(legacy=True)) == before  # noqa: NPY002
        found.append(state.told)
    np.testing.assert_array_equal(*found)
    assert not list(tmp_path.iterdir())
    assert capfd.readouterr() == ("", "")


def test_generations_flown_elsewhere_are_the_search_itself() -> None:
    """Asked and told, each time by an identification that knows only the bytes, it ends in the same state."""
    *_, whole = search().steps()
    step = next(iter(search().steps()))
    while (task := search().generation_task(step.checkpoint)) is not None:
        run = search()
        costs = [run.task_costs(part) for part in task.parts(2)]
        step = run.told(step.checkpoint, np.concatenate(costs))
    expected, found = decode(whole.checkpoint), decode(step.checkpoint)
    assert (found.phase, found.best_cost, found.flights, found.history) == (
        "done",
        expected.best_cost,
        expected.flights,
        expected.history,
    )
    assert found.best.tobytes() == expected.best.tobytes()


def test_lowers_the_cost_of_the_physical_guess() -> None:
    """Within 20 generations of 16 models J falls below a tenth of the physical guess's."""
    steps = list(search(replace(SEARCH, evolution=EvolutionSettings(16, 20))).steps())
    assert steps[-1].best_cost < 0.1 * steps[0].best_cost
    assert len(steps) <= 21


def test_diverged_flights_do_not_stop_it() -> None:
    """With bounds so wide that many flights diverge every cost is finite and the best only gets better."""
    wild = ModelSettings(
        links_per_wing=2,
        bounds={"stiffness_nm_rad": (1e-1, 1e6), "lift_factor": (0.1, 30.0)},
    )
    run = Identification(
        reference_aircraft(), reference_flight(), [shortened(example("rate_0.8"), 60)], wild, SEARCH
    )
    best = []
    for step in run.steps():
        best.append(step.best_cost)
        evolved = decode(step.checkpoint).evolution
        assert evolved is None or np.all(np.isfinite(evolved.told))
    assert best == sorted(best, reverse=True)
    assert evolved is not None
    assert evolved.told.max() > 1.0, "no flight diverged: the test shows nothing"


def test_documents_say_how_many() -> None:
    """``particles`` and ``generations`` are the strategy's; fewer than four models are refused."""
    settings = search_settings({"method": "cma", "particles": 24, "generations": 7, "seed": 2})
    assert settings.evolution == EvolutionSettings(24, 7)
    assert search_settings({"method": "cma"}).evolution == EvolutionSettings()
    with pytest.raises(InvalidInput) as error:
        search_settings({"method": "cma", "particles": 3})
    assert error.value.pointer == "/search/particles"
