"""All stages of the paper's tables and figures, in their order."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

from morphcore.paper.computation import computation_inputs, time_models
from morphcore.paper.identification import (
    identify_by_swarm,
    identify_model,
    search_inputs,
    study_inputs,
    study_links,
)
from morphcore.paper.independent import compare_independent, independent_inputs
from morphcore.paper.morphing import (
    FASTEST_MORPH,
    FREE_MORPH,
    MORPH,
    OTHER_SEARCHES,
    UNSETTLED_MORPH,
    fly_morphs,
    free_morph,
    front_inputs,
    morph_inputs,
    optimise_morph,
    our_search,
    paper_search,
    search_fastest,
    search_front,
    swarm_morph,
    unsettled_morph,
)
from morphcore.paper.provenance import code_digest, machine, versions
from morphcore.paper.scenario import AIRCRAFT, FLIGHT
from morphcore.paper.settings import PaperSettings
from morphcore.paper.stages import Results, Stage, StageRunner, Work
from morphcore.paper.truth import fly_truth, truth_inputs

Document = dict[str, Any]
Run = Callable[[PaperSettings, Results, bytes | None], Work]

STAGES_FOLDER = "stages"
# seconds that the stages take, full and quick, on the machine they were written on: for the progress shown
EXPECTED_S = {
    "truth": (45.0, 15.0),
    "study": (120.0, 20.0),
    "identification": (12.0, 12.0),
    "swarm": (400.0, 5.0),
    "computation": (220.0, 18.0),
    "morph": (30.0, 30.0),
    "swarm_morph": (60.0, 10.0),
    "free_morph": (8.0, 0.0),
    "unsettled_morph": (4.0, 4.0),
    "fastest_morph": (6.0, 6.0),
    "front": (30.0, 8.0),
    "flown_morphs": (70.0, 15.0),
    "independent": (50.0, 25.0),
}


def paper_stages(settings: PaperSettings) -> tuple[Stage, ...]:
    """The stages; the code and the scenario are inputs of each."""
    everywhere = {"code": code_digest(), "aircraft": AIRCRAFT, "flight": FLIGHT, "seed": settings.seed}
    return tuple(
        Stage(
            name=name,
            title=title,
            run=partial(run, settings),
            inputs=everywhere | inputs,
            needs=needs,
            expected_s=EXPECTED_S[name][1 if settings.quick else 0],
        )
        for name, title, run, inputs, needs in _planned(settings)
    )


def paper_runner(settings: PaperSettings, folder: Path) -> StageRunner:
    """The runner of all stages; results go to a folder in the report's folder."""
    where = {"machine": machine(), "versions": versions()}
    return StageRunner(paper_stages(settings), folder / STAGES_FOLDER, where=where)


def _planned(settings: PaperSettings) -> Iterator[tuple[str, str, Run, Document, tuple[str, ...]]]:
    """Name, title, work, inputs and needs of each stage."""
    ours, swarm = search_inputs(settings, settings.search), search_inputs(settings, settings.swarm_search)
    yield "truth", "six flexible flights", fly_truth, truth_inputs(settings), ()
    yield "study", "Table 1", study_links, study_inputs(settings), ("truth",)
    yield "identification", "figures 4 to 9", identify_model, ours, ("truth",)
    yield "swarm", "the paper's swarm", identify_by_swarm, swarm, ("truth",)
    yield "computation", "Table 2", time_models, computation_inputs(settings), ("identification",)
    yield from _planned_morphs(settings)
    yield "independent", "foreign flights", compare_independent, independent_inputs(settings), ()


def _planned_morphs(settings: PaperSettings) -> Iterator[tuple[str, str, Run, Document, tuple[str, ...]]]:
    """The same of Table 3."""
    model = ("identification",)
    main = morph_inputs(settings, MORPH, our_search)
    yield "morph", "Table 3", optimise_morph, main, model
    swarm = morph_inputs(settings, MORPH, paper_search)
    yield "swarm_morph", "Table 3, swarm", swarm_morph, swarm, model
    searches = ["swarm_morph", "unsettled_morph", "fastest_morph"]
    if settings.effort.free_values:
        free = morph_inputs(settings, FREE_MORPH, our_search)
        yield "free_morph", "Table 3, free angles", free_morph, free, model
        searches.append("free_morph")
    unsettled = morph_inputs(settings, UNSETTLED_MORPH, our_search)
    yield "unsettled_morph", "Table 3, no settling", unsettled_morph, unsettled, model
    fastest = morph_inputs(settings, FASTEST_MORPH, our_search)
    yield "fastest_morph", "shortest morph", search_fastest, fastest, (*model, "morph")
    yield "front", "Pareto front", search_front, front_inputs(settings), model
    flown = {"step_s": settings.effort.flexible_step_s, "elements": settings.elements}
    needs = tuple(name for name in OTHER_SEARCHES if name in searches)
    yield "flown_morphs", "morphs re-flown", fly_morphs, flown, (*needs, "front")
