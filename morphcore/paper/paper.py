"""All stages of the paper's tables and figures, in their order."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from morphcore.paper.computation import time_models
from morphcore.paper.identification import identify_by_swarm, identify_model, study_links
from morphcore.paper.independent import compare_independent, sample_digests
from morphcore.paper.morphing import (
    fly_morphs,
    free_morph,
    optimise_morph,
    search_fastest,
    search_front,
    swarm_morph,
    unsettled_morph,
)
from morphcore.paper.provenance import code_digest, machine, versions
from morphcore.paper.settings import PaperSettings
from morphcore.paper.stages import Results, Stage, StageRunner, Work
from morphcore.paper.truth import fly_truth

Document = dict[str, Any]
Run = Callable[[PaperSettings, Results, bytes | None], Work]

STAGES_FOLDER = "stages"

# name, title, work, needs, and typical seconds, full and quick (for the displayed progress)
PLAN: tuple[tuple[str, str, Run, tuple[str, ...], tuple[float, float]], ...] = (
    ("truth", "six flexible flights", fly_truth, (), (45.0, 15.0)),
    ("study", "Table 1", study_links, ("truth",), (120.0, 20.0)),
    ("identification", "figures 4 to 9", identify_model, ("truth",), (12.0, 12.0)),
    ("swarm", "the paper's swarm", identify_by_swarm, ("truth",), (400.0, 5.0)),
    ("computation", "Table 2", time_models, ("identification",), (220.0, 18.0)),
    ("morph", "Table 3", optimise_morph, ("identification",), (30.0, 30.0)),
    ("swarm_morph", "Table 3, swarm", swarm_morph, ("identification",), (60.0, 10.0)),
    ("free_morph", "Table 3, free angles", free_morph, ("identification",), (8.0, 0.0)),
    ("unsettled_morph", "Table 3, no settling", unsettled_morph, ("identification",), (4.0, 4.0)),
    ("fastest_morph", "shortest morph", search_fastest, ("identification", "morph"), (6.0, 6.0)),
    ("front", "Pareto front", search_front, ("identification",), (30.0, 8.0)),
    (
        "flown_morphs",
        "morphs re-flown",
        fly_morphs,
        ("swarm_morph", "free_morph", "unsettled_morph", "fastest_morph", "front"),
        (70.0, 15.0),
    ),
    ("independent", "foreign flights", compare_independent, (), (50.0, 25.0)),
)


def paper_stages(settings: PaperSettings) -> tuple[Stage, ...]:
    """The stages; the code, including the scenario, and the settings are inputs of each."""
    inputs: Document = {
        "code": code_digest(),
        "seed": settings.seed,
        "quick": settings.quick,
        "core": settings.core,
    }
    own_inputs = {"independent": {"files": sample_digests(settings.samples)}}
    left_out = () if settings.effort.free_values else ("free_morph",)
    return tuple(
        Stage(
            name=name,
            title=title,
            run=partial(run, settings),
            inputs=inputs | own_inputs.get(name, {}),
            needs=tuple(need for need in needs if need not in left_out),
            expected_s=quick_s if settings.quick else full_s,
        )
        for name, title, run, needs, (full_s, quick_s) in PLAN
        if name not in left_out
    )


def paper_runner(settings: PaperSettings, folder: Path) -> StageRunner:
    """The runner of all stages; their results go to a subfolder of the report's folder."""
    where = {"machine": machine(), "versions": versions()}
    return StageRunner(paper_stages(settings), folder / STAGES_FOLDER, where=where)
