"""Values that the report's templates show and that are derived from the stages' results."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from morphcore.geometry.section import SectionProperties
from morphcore.geometry.surface import Surface
from morphcore.paper.morphing import departures, variation_until
from morphcore.paper.report.numbers import number
from morphcore.paper.scenario import MORPH_S, PAPER_OPTIMUM, PAPER_RIGID_OPTIMUM, SETTLE_S
from morphcore.paper.stages import Results

Document = dict[str, Any]

MIN_PLAIN = 1e-4  # smaller limits are written with a power of ten
ALIKE_RAD = 0.05  # rad; schedules closer than this are called nearly identical
OTHER_MORPHS = {
    "swarm_morph": "optimum, the paper's swarm of 50",
    "free_morph": "optimum, with free angles at the knots",
    "unsettled_morph": "optimum searched without a settling window",
}


def limit(value: float) -> str:
    """A limit as set."""
    return f"{value:g}" if value >= MIN_PLAIN else number(value)


def mid_span(surface: Surface) -> SectionProperties:
    """The cross-section at half the span."""
    return surface.section_at(np.array([0.5 * surface.span_m]))


def deviation(ours: float, theirs: float | None) -> float | None:
    """Deviation of our value from theirs as a share of theirs."""
    return abs(ours / theirs - 1.0) if theirs else None


def percent_change(value: float | None, reference: float | None) -> float | None:
    """Change of a value relative to a reference, per cent; None if one of them is missing."""
    return None if value is None or not reference else 100.0 * (value / reference - 1.0)


def change(results: Results, schedule: str) -> float | None:
    """Change of a schedule's variation relative to constant rate in the flexible model, per cent."""
    variation = results["morph"]["variation"]
    return percent_change(variation[schedule]["flexible"], variation["constant"]["flexible"])


def flown(results: Results) -> dict[str, Document]:
    """The morphs that were flown in the flexible model, by name."""
    return {row["name"]: row for row in results["flown_morphs"]["flown"]}


def schedules(results: Results) -> list[Document]:
    """The rows of Table 3."""
    found = results["morph"]
    search_s = found["search"]["search_s"]
    rows = [
        {
            "name": name,
            "label": label,
            "variation": found["variation"][name],
            "change": None if name == "constant" else change(results, name),
            "paper": papers,
            "max_rate_rad_s": (found["reached"][name] or {}).get("max_rate_rad_s"),
            "search_s": search_s if name == "optimum" else None,
        }
        for name, label, papers in (
            ("constant", "constant rate", None),
            ("rigid_optimum", "optimum of the rigid model", PAPER_RIGID_OPTIMUM),
            ("optimum", "optimum of the equivalent model", PAPER_OPTIMUM),
        )
    ]
    constant = found["variation"]["constant"]["flexible"]
    for name, label in OTHER_MORPHS.items():
        if name not in results:
            continue
        other, flexible = results[name], flown(results)[name]["variation_rad2"]
        variation = dict(other["variation"]["optimum"])
        if other["morph"]["settle_s"] != SETTLE_S:
            variation = dict.fromkeys(variation)  # searched and summed over another window
        rows.append(
            {
                "name": name,
                "label": label,
                "variation": variation | {"flexible": flexible},
                "change": percent_change(flexible, constant),
                "paper": None,
                "max_rate_rad_s": other["reached"]["optimum"]["max_rate_rad_s"],
                "search_s": other["search"]["search_s"],
            }
        )
    return rows


def windows(results: Results) -> list[Document]:
    """Variation of three schedules in the flexible model, rad^2, over the morph and with the settling."""
    unsettled, curves = flown(results)["unsettled_morph"], results["morph"]["curves"]
    labels = {
        "constant": "constant rate",
        "optimum": f"optimum over the morph and {SETTLE_S:g} s after it",
        "unsettled": "optimum over the morph alone",
    }
    alone: dict[str, float] = {"unsettled": unsettled["variation_of_morph_rad2"]}
    whole: dict[str, float | None] = {"unsettled": unsettled["variation_rad2"]}
    for name in ("constant", "optimum"):
        whole[name] = results["morph"]["variation"][name]["flexible"]
        if name in curves["flights"]["flexible"]:
            alone[name] = variation_until(departures(curves, "flexible", name), MORPH_S)

    def against(values: Mapping[str, float | None], name: str) -> float | None:
        return None if name == "constant" else percent_change(values.get(name), values.get("constant"))

    return [
        {
            "label": label,
            "alone": alone.get(name),
            "alone_change": against(alone, name),
            "whole": whole[name],
            "whole_change": against(whole, name),
        }
        for name, label in labels.items()
    ]


def front_points(results: Results) -> list[Document]:
    """The front's points, each with its variation as flown in the flexible model."""
    all_flown = flown(results)
    return [
        point | {"flown_rad2": all_flown[f"front_{point['duration_s']:.2f}_s"]["variation_rad2"]}
        for point in results["front"]["points"]
    ]


def schedules_apart_rad(results: Results) -> float:
    """Largest distance of the optima of the equivalent and of the rigid model, rad."""
    curves = results["morph"]["curves"]["schedules"]
    apart = np.subtract(curves["optimum"]["sweep_rad"], curves["rigid_optimum"]["sweep_rad"])
    return float(np.abs(apart).max())
