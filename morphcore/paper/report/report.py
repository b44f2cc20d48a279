"""The whole report out of the stages' results: one HTML file, its figures as JSON, the flights as CSV."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from morphcore.paper.asked import Asked, asked_figures
from morphcore.paper.report.html import minutes
from morphcore.paper.report.model_sections import computation_section, study_section, verification_section
from morphcore.paper.report.morph_section import morph_section
from morphcore.paper.report.page import page
from morphcore.paper.report.scenario_section import scenario_section
from morphcore.paper.report.summary_sections import (
    differences_section,
    provenance_section,
    summary_section,
    total_s,
)
from morphcore.paper.report.truth_section import truth_section
from morphcore.paper.scenario import DOI, TITLE
from morphcore.paper.settings import PaperSettings
from morphcore.paper.stages import Finished
from morphcore.paper.truth import samples_of
from morphcore.simulate.flight import write_trajectory_csv

Document = dict[str, Any]

REPORT, SUMMARY, FLIGHTS = "report.html", "summary.json", "flights"
HEADLINE = "Equivalent modelling of a sweep-morphing aircraft, reproduced"


def report_page(settings: PaperSettings, finished: Mapping[str, Finished]) -> str:
    """The report as HTML without references to anything outside.

    Parameters
    ----------
    finished : every stage's result.
    """
    results = {name: done.result for name, done in finished.items()}
    sections = [
        summary_section(results, asked_of(settings, finished)),
        scenario_section(settings, results),
        truth_section(results),
        study_section(results),
        verification_section(results),
        computation_section(results),
        morph_section(results),
        differences_section(settings, results),
        provenance_section(settings, finished),
    ]
    last = max(done.finished_at for done in finished.values())
    form = "quick form" if settings.quick else "full form"
    subtitle = (
        f"Every table and figure of “{TITLE}” (Science Progress 2021, doi {DOI}), with our own flexible "
        f"model as the truth. {form.capitalize()}, seed {settings.seed}, {minutes(total_s(finished))} of "
        f"computation, finished {last[:10]}."
    )
    return page(HEADLINE, subtitle, sections)


def asked_of(settings: PaperSettings, finished: Mapping[str, Finished]) -> list[Asked]:
    """The asked figures of a finished run."""
    results = {name: done.result for name, done in finished.items()}
    return asked_figures(results, total_s=total_s(finished), quick=settings.quick)


def summary_document(settings: PaperSettings, finished: Mapping[str, Finished]) -> Document:
    """The run for machines: settings, machine, asked figures, seconds of each stage."""
    where = list(finished.values())[-1].where
    return {
        "quick": settings.quick,
        "seed": settings.seed,
        "core": settings.core,
        **where,
        "asked": [each.to_document() for each in asked_of(settings, finished)],
        "stages_s": {name: done.wall_s for name, done in finished.items()},
        "total_s": total_s(finished),
    }


def write_report(settings: PaperSettings, finished: Mapping[str, Finished], folder: Path) -> Path:
    """Write the report, what it says for machines, and the truth's flights as samples; gives its path."""
    flights = folder / FLIGHTS
    flights.mkdir(parents=True, exist_ok=True)
    for sample in samples_of(finished["truth"].result):
        write_trajectory_csv(sample, flights / f"{sample.name}.csv")
    summary = json.dumps(summary_document(settings, finished), indent=1, allow_nan=False)
    (folder / SUMMARY).write_text(summary + "\n", encoding="utf-8")
    path = folder / REPORT
    path.write_text(report_page(settings, finished), encoding="utf-8")
    return path
