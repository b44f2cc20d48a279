"""The whole report out of the stages' results: one HTML file, its figures as JSON, the flights as CSV."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from matplotlib.figure import Figure

from morphcore.export.figure import rendered
from morphcore.export.paper_plots import (
    front_figure,
    independent_figure,
    search_figure,
    truth_figure,
    verification_figure,
)
from morphcore.export.schedule_plots import departure_figure, schedule_figure
from morphcore.export.study_plots import study_figure
from morphcore.paper import asked, scenario
from morphcore.paper.asked import Asked, asked_figures, held_out_ratios, ratio
from morphcore.paper.report import facts, numbers
from morphcore.paper.settings import PaperSettings
from morphcore.paper.stages import Finished
from morphcore.paper.truth import samples_of
from morphcore.simulate.flight import write_trajectory_csv
from morphcore.simulate.plan import STEP_S

Document = dict[str, Any]

REPORT, SUMMARY, FLIGHTS = "report.html", "summary.json", "flights"
HEADLINE = "Equivalent modelling of a sweep-morphing aircraft, reproduced"
COMMON_FLIGHT = "rate_0.5"  # also among the independent program's
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
PLOTS = SimpleNamespace(
    departure_figure=departure_figure,
    front_figure=front_figure,
    independent_figure=independent_figure,
    schedule_figure=schedule_figure,
    search_figure=search_figure,
    study_figure=study_figure,
    truth_figure=truth_figure,
    verification_figure=verification_figure,
)


def templates() -> Environment:
    """The templates, with what they format and compute by."""
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
        "milliseconds": numbers.milliseconds,
        "minutes": numbers.minutes,
        "mrad": numbers.mrad,
        "negated": lambda value: None if value is None else -value,
        "number": numbers.number,
        "percent": numbers.percent,
        "prettified": numbers.prettified,
        "ratio": ratio,
        "signed_percent": numbers.signed_percent,
    }
    found.globals |= {
        "COMMON_FLIGHT": COMMON_FLIGHT,
        "STEP_S": STEP_S,
        "asked": asked,
        "facts": facts,
        "nothing": numbers.NOTHING,
        "picture": _picture,
        "plots": PLOTS,
        "scenario": scenario,
    }
    return found


def _max_or_none(values: Iterable[float | None]) -> float | None:
    return max((value for value in values if value is not None), default=None)


def _picture(anchor: str, caption: str, drawn: Figure) -> Markup:
    svg = rendered(anchor, drawn, ("svg",))[f"{anchor}.svg"]
    return Markup(numbers.inline_svg(svg, anchor, caption))  # noqa: S704 - drawn here, its texts escaped


def report_page(settings: PaperSettings, finished: Mapping[str, Finished]) -> str:
    """The report as HTML without references to anything outside.

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
            asked_figures=asked_of(settings, finished),
            held_out=held_out_ratios(results["identification"]).values(),
        )
    )


def total_s(finished: Mapping[str, Finished]) -> float:
    """Wall time of all stages, s."""
    return sum(done.wall_s for done in finished.values())


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
