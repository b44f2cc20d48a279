"""The section on the truth: its flights, its convergence, and another program's flights."""

from __future__ import annotations

from typing import Any

from morphcore.export.paper_plots import independent_figure, truth_figure
from morphcore.paper.asked import ELEMENTS_MRAD, STEP_MRAD, THEIR_CORE
from morphcore.paper.report.html import (
    Column,
    Section,
    figure,
    heading,
    mrad,
    number,
    paragraph,
    percent,
    section,
    table,
    words,
)
from morphcore.paper.stages import Results

Document = dict[str, Any]

ANGLES = ("phi", "theta", "psi")


def truth_section(results: Results) -> Section:
    """Flights, convergence, prediction of another program's flights."""
    return section(
        "truth",
        "The truth: flexible flights",
        *_flights(results["truth"]),
        _convergence(results["truth"]),
        heading("Another program's flights, predicted"),
        *_independent(results["independent"]),
    )


def _flights(truth: Document) -> list[str]:
    trim = truth["flights"][0]["trim"]
    return [
        paragraph(
            f"Trimmed level flight has an angle of attack of {number(trim['alpha_rad'])} rad and the wing "
            f"tips {number(-trim['tip_z_m'])} m above their roots. As the wings sweep back the lift moves "
            "aft, the aircraft pitches down and flies on without control: what has to be predicted is this "
            "free motion."
        ),
        figure(
            "truth-flights",
            "",
            "The six flights of the flexible model. Solid: identified on; dashed: held out.",
            truth_figure(truth["flights"]),
        ),
    ]


def _convergence(truth: Document) -> str:
    limits = {"elements doubled": ELEMENTS_MRAD, "step halved": STEP_MRAD}
    rows = [
        (
            row["what"],
            str(row["elements"]),
            f"{1e3 * row['step_s']:g} ms",
            f"{row['lattice']['chordwise']} × {row['lattice']['spanwise']}",
            *(mrad(row["max_abs_rad"][angle]) for angle in ANGLES),
            number(limits.get(row["what"])),
        )
        for row in truth["convergence"]["rows"]
    ]
    used = truth["resolution"]
    return table(
        "",
        "Convergence of the truth: largest change of attitude, mrad, on the flight at 0.5 rad/s.",
        [
            words("refined"),
            *(Column(name) for name in ("elements", "step", "panels", "φ", "θ", "ψ", "asked below")),
        ],
        rows,
        note=(
            f"As flown: {used['elements']} elements a wing, {1e3 * used['step_s']:g} ms, "
            f"{used['lattice']['chordwise']} × {used['lattice']['spanwise']} panels. The lattice is part of "
            "all three models alike: its own resolution does not enter their comparison."
        ),
    )


def _independent(found: Document) -> list[str]:
    if not found["available"]:
        return [
            paragraph(
                "The independent program's sample flights were not at hand; name their folder with --samples."
            )
        ]
    theirs = found["theirs"]
    return [
        paragraph(
            "The sample flights of an independent program (geometrically exact beams, vortex lattice), with "
            "nominal properties, trimmed by ourselves, nothing fitted. The laws of the vortex core differ: "
            f"with the core “{THEIR_CORE}” our lattice damps each ring's influence on itself as theirs does, "
            "as the angle of attack tells; the core “line” keeps the lift of an undisturbed lattice, and "
            "with it a larger angle of attack for the same weight (DECISIONS 9)."
        ),
        _trims(found, theirs),
        _errors(found),
        figure(
            "independent-flights",
            "",
            "Left: the independent program's attitude and ours; right: ours less theirs.",
            independent_figure(found["samples"], found["laws"]),
        ),
    ]


def _trims(found: Document, theirs: Document) -> str:
    rows = [("theirs", number(theirs["alpha_rad"]), _up(theirs["tip_z_m"]), "", "")]
    for law in found["laws"]:
        trim = law["trim"]
        rows.append(
            (
                f"ours, core “{law['core']}”",
                number(trim["alpha_rad"]),
                _up(trim["tip_z_m"]),
                percent(_off(trim["alpha_rad"], theirs["alpha_rad"])),
                percent(_off(trim["tip_z_m"], theirs["tip_z_m"])),
            )
        )
    return table(
        "",
        "Trim of the independent program's aircraft.",
        [
            words("trim"),
            Column("angle of attack, rad"),
            Column("tip above root, m"),
            Column("α off"),
            Column("tip off"),
        ],
        rows,
    )


def _errors(found: Document) -> str:
    rows = []
    for law in found["laws"]:
        for flown in law["flights"]:
            shares = [share for share in flown["worst_share"].values() if share is not None]
            rows.append(
                (
                    flown["sample"],
                    law["core"],
                    *(mrad(flown["rms_rad"][angle]) for angle in ANGLES),
                    mrad(max(flown["max_abs_rad"].values())),
                    percent(max(shares)) if shares else "",
                )
            )
    return table(
        "",
        "Errors of the prediction: RMS per angle and the largest of all, mrad; the worst angle of its range.",
        [
            words("flight"),
            words("our core"),
            *(Column(name) for name in ("φ", "θ", "ψ", "largest", "of range")),
        ],
        rows,
    )


def _up(tip_z_m: float | None) -> str:
    return number(None if tip_z_m is None else -tip_z_m)


def _off(ours: float, theirs: float | None) -> float | None:
    return abs(ours / theirs - 1.0) if theirs else None
