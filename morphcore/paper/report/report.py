"""The whole report from the stages' results: one HTML file, its figures as JSON, the flights as CSV."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from matplotlib.figure import Figure

from morphcore.export import paper_plots, schedule_plots, study_plots
from morphcore.export.figure import rendered
from morphcore.paper import requirements, scenario
from morphcore.paper.report import facts, numbers
from morphcore.paper.requirements import Requirement, held_out_ratios, judged_requirements, ratio
from morphcore.paper.settings import PaperSettings
from morphcore.paper.stages import Finished
from morphcore.paper.truth import samples_of
from morphcore.simulate.flight import write_trajectory_csv
from morphcore.simulate.time_grid import STEP_S

Document = dict[str, Any]

REPORT, SUMMARY, FLIGHTS = "report.html", "summary.json", "flights"
HEADLINE = "Equivalent modelling of a sweep-morphing aircraft, reproduced"
COMMON_FLIGHT = "rate_0.5"  # also among the independent program's flights
SECTIONS = {  # templates and their headings
    "summary": "What came out",
    "setup": "Set-up",
    "truth": "The truth: flexible flights",
    "links": "Table 1: the number of links",
    "verification": "Figures 4 to 9: the equivalent model against the flexible one",
    "computation": "Table 2: computation",
    "morph": "Table 3, figures 10 and 11: the optimised morph",
    "differences": "What differs from the paper, and why",
    "provenance": "How this report was made",
}
FORMATS = ("milliseconds", "minutes", "mrad", "number", "percent", "prettified", "signed_percent")


def templates() -> Environment:
    """The templates with their filters and functions."""
    found = Environment(
        loader=PackageLoader("morphcore.paper.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    labels = {each.name: each.label for each in scenario.paper_flights()}
    found.filters |= {
        "flight_label": lambda name: labels.get(name, name),
        "fmt": format,
        "max_or_none": _max_or_none,
        "negated": lambda value: None if value is None else -value,
        "ratio": ratio,
        **{name: getattr(numbers, name) for name in FORMATS},
    }
    found.globals |= {
        "COMMON_FLIGHT": COMMON_FLIGHT,
        "STEP_S": STEP_S,
        "requirements": requirements,
        "facts": facts,
        "nothing": numbers.NOTHING,
        "paper_plots": paper_plots,
        "picture": _picture,
        "scenario": scenario,
        "schedule_plots": schedule_plots,
        "study_plots": study_plots,
    }
    return found


def _max_or_none(values: Iterable[float | None]) -> float | None:
    return max((value for value in values if value is not None), default=None)


def _picture(anchor: str, caption: str, drawn: Figure) -> Markup:
    svg = rendered(anchor, drawn, ("svg",))[f"{anchor}.svg"]
    return Markup(numbers.inline_svg(svg, anchor, caption))  # noqa: S704 - drawn here, with escaped texts


def report_page(settings: PaperSettings, finished: Mapping[str, Finished]) -> str:
    """The report as self-contained HTML.

    Parameters
    ----------
    finished : every stage's result.
    """
    results = {name: done.result for name, done in finished.items()}
    return (
        templates()
        .get_template("page.html")
        .render(
            title=HEADLINE,
            sections=SECTIONS,
            settings=settings,
            finished=finished,
            results=results,
            total_s=total_s(finished),
            judged_requirements=requirements_of(settings, finished),
            held_out=held_out_ratios(results["identification"]).values(),
        )
    )


def total_s(finished: Mapping[str, Finished]) -> float:
    """Wall time of all stages, s."""
    return sum(done.wall_s for done in finished.values())


def requirements_of(settings: PaperSettings, finished: Mapping[str, Finished]) -> list[Requirement]:
    """The requirements of a finished run."""
    results = {name: done.result for name, done in finished.items()}
    return judged_requirements(results, total_s=total_s(finished), quick=settings.quick)


def summary_document(settings: PaperSettings, finished: Mapping[str, Finished]) -> Document:
    """The run in machine-readable form: settings, machine, requirements, seconds of each stage."""
    where = list(finished.values())[-1].where
    return {
        "quick": settings.quick,
        "seed": settings.seed,
        "core": settings.core,
        **where,
        "asked": [each.to_document() for each in requirements_of(settings, finished)],
        "stages_s": {name: done.wall_s for name, done in finished.items()},
        "total_s": total_s(finished),
    }


def write_report(settings: PaperSettings, finished: Mapping[str, Finished], folder: Path) -> Path:
    """Write the report, its machine-readable summary, and the truth's flights as samples; return its path."""
    flights = folder / FLIGHTS
    flights.mkdir(parents=True, exist_ok=True)
    for sample in samples_of(finished["truth"].result):
        write_trajectory_csv(sample, flights / f"{sample.name}.csv")
    summary = json.dumps(summary_document(settings, finished), indent=1, allow_nan=False)
    (folder / SUMMARY).write_text(summary + "\n", encoding="utf-8")
    path = folder / REPORT
    path.write_text(report_page(settings, finished), encoding="utf-8")
    return path
