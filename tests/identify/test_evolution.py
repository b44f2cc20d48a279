"""CMA-ES as a search for a model: it arrives, survives diverged flights, and is asked for in documents."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from morphcore.errors import InvalidInput
from morphcore.identify import Identification, SearchSettings
from morphcore.identify.settings import search_settings
from morphcore.search.evolution import EvolutionSettings
from morphdata.identify import Bounds, EquivalentModel, IdentifySearch
from tests.identify.flights import example, reference_aircraft, reference_flight, shortened

SMALL = EvolutionSettings(particles=16, generations=4)
SEARCH = SearchSettings(method="cma", seed=5, evolution=SMALL)


def search(settings: SearchSettings = SEARCH) -> Identification:
    """Two links, a second of one flight."""
    samples = [shortened(example("rate_0.8"), 60)]
    return Identification(
        reference_aircraft(), reference_flight(), samples, EquivalentModel(links_per_wing=2), settings
    )


def test_lowers_the_cost_of_the_physical_guess() -> None:
    """Within 20 generations of 16 models J falls below a tenth of the physical guess's."""
    steps = list(search(replace(SEARCH, evolution=EvolutionSettings(16, 20))).steps())
    assert steps[-1].best_cost < 0.1 * steps[0].best_cost
    assert len(steps) <= 21


def test_diverged_flights_do_not_stop_it() -> None:
    """With bounds so wide that many flights diverge every cost is finite and the best only gets better."""
    wild = EquivalentModel(
        links_per_wing=2,
        bounds=Bounds(stiffness_nm_rad=[1e-1, 1e6], lift_factor=[0.1, 10.0]),
    )
    run = Identification(
        reference_aircraft(), reference_flight(), [shortened(example("rate_0.8"), 60)], wild, SEARCH
    )
    best = []
    for step in run.steps():
        best.append(step.best_cost)
        evolved = run.state(step.checkpoint).solver
        assert np.all(np.isfinite(evolved.costs))
    assert best == sorted(best, reverse=True)
    assert evolved.costs.max() > 1.0, "no flight diverged: the test shows nothing"


def test_documents_say_how_many() -> None:
    """``particles`` and ``generations`` are the strategy's; fewer than four models are refused."""
    settings = search_settings(
        IdentifySearch.parse({"method": "cma", "particles": 24, "generations": 7, "seed": 2})
    )
    assert settings.evolution == EvolutionSettings(24, 7)
    assert search_settings(IdentifySearch.parse({"method": "cma"})).evolution == EvolutionSettings()
    with pytest.raises(InvalidInput) as error:
        IdentifySearch.parse({"method": "cma", "particles": 3}, "/search")
    assert error.value.pointer == "/search/particles"
