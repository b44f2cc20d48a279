"""The identification stages: the study (Table 1), our search and the paper's swarm (figures 4 to 9)."""

from __future__ import annotations

from collections.abc import Generator
from typing import Any

from morphcore.identify.identification import Identification
from morphcore.identify.settings import SearchSettings
from morphcore.identify.study import Study
from morphcore.optimise import ScheduleOptimisation
from morphcore.paper.scenario import LINKS, aircraft, flight
from morphcore.paper.settings import PaperSettings
from morphcore.paper.stages import Progress, Results, Work
from morphcore.paper.truth import samples_of
from morphdata.identify import EquivalentModel

Document = dict[str, Any]


def searched(
    search: Identification | Study | ScheduleOptimisation, checkpoint: bytes | None
) -> Generator[Progress, None, bytes]:
    """Run a search to its end and return the checkpoint of its last step."""
    last = checkpoint or b""
    for step in search.steps(checkpoint):
        last = step.checkpoint
        yield Progress(step.fraction, step.message, last)
    return last


def study_links(settings: PaperSettings, results: Results, checkpoint: bytes | None) -> Work:
    """Models of several sizes, identified from three flights and judged on the other three."""
    study = Study(
        aircraft(),
        flight(),
        samples_of(results["truth"]),
        links=settings.effort.links,
        model=EquivalentModel(lattice=settings.lattice),
        search=settings.search,
    )
    last = yield from searched(study, checkpoint)
    return study.result(last).to_document()


def identify_model(settings: PaperSettings, results: Results, checkpoint: bytes | None) -> Work:
    """The model of three links by our search."""
    return (yield from _identified(settings, settings.search, results, checkpoint))


def identify_by_swarm(settings: PaperSettings, results: Results, checkpoint: bytes | None) -> Work:
    """The same by the paper's swarm."""
    return (yield from _identified(settings, settings.swarm_search, results, checkpoint))


def _identified(
    settings: PaperSettings, search: SearchSettings, results: Results, checkpoint: bytes | None
) -> Work:
    run = Identification(
        aircraft(),
        flight(),
        samples_of(results["truth"]),
        EquivalentModel(links_per_wing=LINKS, lattice=settings.lattice),
        search,
    )
    last = yield from searched(run, checkpoint)
    found = run.result(last)
    return found.to_document() | {"curves": found.curves()["samples"]}
