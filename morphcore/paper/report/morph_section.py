"""The section on the optimised morph: Table 3, figures 10 and 11, and what goes beyond the paper."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from morphcore.export.paper_plots import front_figure
from morphcore.export.schedule_plots import departure_figure, schedule_figure
from morphcore.paper.morphing import departures, variation_until
from morphcore.paper.report.html import (
    NOTHING,
    Column,
    Section,
    figure,
    heading,
    minutes,
    number,
    paragraph,
    section,
    signed_percent,
    table,
    words,
)
from morphcore.paper.scenario import (
    MORPH_S,
    PAPER_OPTIMUM,
    PAPER_RIGID_OPTIMUM,
    RATE_LIMIT_RAD_S,
    SETTLE_S,
)
from morphcore.paper.stages import Results

Document = dict[str, Any]

OTHERS = {
    "swarm_morph": "optimum, the paper's swarm of 50",
    "free_morph": "optimum, angles at the knots sought too",
    "unsettled_morph": "optimum sought without a settling window",
}


def morph_section(results: Results) -> Section:
    """Table 3, figures 10 and 11; settling window, shortest morph, front."""
    found = results["morph"]
    return section(
        "morph",
        "Table 3, figures 10 and 11: the optimised morph",
        paragraph(
            f"From 0 to 1 rad in {MORPH_S:g} s at no more than {RATE_LIMIT_RAD_S:g} rad/s: the knot times of "
            "a clamped cubic spline are sought so that the attitude departs least from its start, over the "
            f"morph and {SETTLE_S:g} s after it. Flown in the flexible model the optimum varies "
            f"{signed_percent(change(results, 'optimum'))} against constant rate (the paper: "
            f"{signed_percent(PAPER_OPTIMUM)}), the rigid model's optimum "
            f"{signed_percent(change(results, 'rigid_optimum'))} (the paper: "
            f"{signed_percent(PAPER_RIGID_OPTIMUM)})."
        ),
        _table_3(results),
        *_pictures(found),
        heading("Without a settling window, as in the paper"),
        *_unsettled(results),
        heading("Beyond the paper: duration against variation"),
        *_front(results),
    )


def change(results: Results, schedule: str) -> float | None:
    """Change of a schedule's variation against constant rate in the flexible model, per cent."""
    variation = results["morph"]["variation"]
    ours, constant = variation[schedule]["flexible"], variation["constant"]["flexible"]
    return None if ours is None or not constant else 100.0 * (ours / constant - 1.0)


def _table_3(results: Results) -> str:
    found = results["morph"]
    named = {
        "constant": ("constant rate", NOTHING, NOTHING),
        "rigid_optimum": ("optimum of the rigid model", signed_percent(PAPER_RIGID_OPTIMUM), NOTHING),
        "optimum": (
            "optimum of the equivalent model",
            signed_percent(PAPER_OPTIMUM),
            minutes(found["search"]["search_s"]),
        ),
    }
    rows = []
    for name, (label, papers, seconds) in named.items():
        variation, reached = found["variation"][name], found["reached"][name] or {}
        changed = signed_percent(change(results, name)) if name != "constant" else NOTHING
        rows.append(_row(label, variation, changed, papers, reached.get("max_rate_rad_s"), seconds))
    rows += [_other_row(results, name, label) for name, label in OTHERS.items() if name in results]
    headings = ("rigid", "equivalent", "flexible", "change", "paper", "rate, rad/s", "found in")
    return table(
        "Table 3",
        "Attitude variation (sum of squared departures over 10 ms samples, rad²) in the three models; change "
        "against constant rate in the flexible model.",
        [words("schedule"), *(Column(name) for name in headings)],
        rows,
        strong=[2],
        note="The time of a search is that of both its parts, with the equivalent and with the rigid model. "
        f"All rows: morph of {MORPH_S:g} s, attitudes over {MORPH_S + SETTLE_S:g} s.",
    )


def _row(
    label: str, variation: Document, changed: str, papers: str, rate: float | None, seconds: str
) -> tuple[str, ...]:
    values = (number(variation[model], 4) for model in ("rigid", "equivalent", "flexible"))
    return (label, *values, changed, papers, number(rate, 4), seconds)


def _other_row(results: Results, name: str, label: str) -> tuple[str, ...]:
    found = results[name]
    flexible = _flown(results)[name]["variation_rad2"]
    constant = results["morph"]["variation"]["constant"]["flexible"]
    variation = dict(found["variation"]["optimum"])
    if found["morph"]["settle_s"] != SETTLE_S:
        variation = dict.fromkeys(variation)  # sought, and summed, over another window
    changed = None if not constant else 100.0 * (flexible / constant - 1.0)
    return _row(
        label,
        variation | {"flexible": flexible},
        signed_percent(changed),
        NOTHING,
        found["reached"]["optimum"]["max_rate_rad_s"],
        minutes(found["search"]["search_s"]),
    )


def _pictures(found: Document) -> list[str]:
    return [
        figure(
            "figure-10",
            "Figure 10",
            "The schedules: sweep, rate with its limit, and acceleration; dots are the optimum's knots.",
            schedule_figure(found, found["curves"]),
        ),
        figure(
            "figure-11",
            "Figure 11",
            "Departure of the attitude from its start, flown in the flexible model; the morph is shaded.",
            departure_figure(found, found["curves"]),
        ),
    ]


def _unsettled(results: Results) -> list[str]:
    flown = _flown(results)["unsettled_morph"]
    curves = results["morph"]["curves"]
    names = ("constant", "optimum")
    alone = {
        name: variation_until(departures(curves, "flexible", name), MORPH_S)
        for name in names
        if name in curves["flights"]["flexible"]
    }
    alone["unsettled"] = flown["variation_of_morph_rad2"]
    whole = {name: results["morph"]["variation"][name]["flexible"] for name in names}
    whole["unsettled"] = flown["variation_rad2"]
    labels = {
        "constant": "constant rate",
        "optimum": f"optimum over the morph and {SETTLE_S:g} s after it",
        "unsettled": "optimum over the morph alone",
    }
    rows = [
        (
            label,
            number(alone.get(name), 4),
            _against(alone, name),
            number(whole[name], 4),
            _against(whole, name),
        )
        for name, label in labels.items()
    ]
    return [
        paragraph(
            "The paper sums over the morph alone. Without a limit of the rate the best morph is then to wait "
            "and to snap at the end, when nothing counts any more; with the limit it stays a morph. The "
            "table shows what each optimum is worth over either window, flown in the flexible model."
        ),
        table(
            "",
            "Attitude variation in the flexible model, rad², over the morph alone and with what follows.",
            [
                words("schedule"),
                Column("morph alone"),
                Column("change"),
                Column("with settling"),
                Column("change"),
            ],
            rows,
        ),
    ]


def _front(results: Results) -> list[str]:
    front, flown, fastest = results["front"], _flown(results), results["fastest_morph"]
    points = [
        point | {"flown_rad2": flown[f"front_{point['duration_s']:.2f}_s"]["variation_rad2"]}
        for point in front["points"]
    ]
    rows = [
        (
            number(point["duration_s"]),
            number(point["constant_rad2"], 4),
            number(point["optimum_rad2"], 4),
            signed_percent(100.0 * (point["optimum_rad2"] / point["constant_rad2"] - 1.0)),
            number(point["flown_rad2"], 4),
        )
        for point in points
    ]
    quickest = flown["fastest_morph"]
    headings = ("morph, s", "constant rate", "optimum", "change", "optimum, flexible model")
    return [
        paragraph(
            "Every duration is optimised by itself and judged over the same "
            f"{front['window_s']:g} s from the start, the rest of them settling. The shortest morph that the "
            f"rate limit allows and that varies no more than constant rate in {MORPH_S:g} s takes "
            f"{fastest['duration_s']:.2f} s ({number(quickest['variation_rad2'], 4)} rad² in the flexible "
            "model, over the same window)."
        ),
        table(
            "",
            "Least attitude variation against the duration of the morph, rad²; equivalent model unless said.",
            [Column(name) for name in headings],
            rows,
        ),
        figure(
            "front",
            "",
            "Duration against variation: constant rate, and the optimum of every duration.",
            front_figure(points),
        ),
    ]


def _flown(results: Results) -> dict[str, Document]:
    return {row["name"]: row for row in results["flown_morphs"]["flown"]}


def _against(values: Mapping[str, float | None], name: str) -> str:
    value, constant = values.get(name), values.get("constant")
    if name == "constant" or value is None or not constant:
        return NOTHING
    return signed_percent(100.0 * (value / constant - 1.0))
