"""Output of ``morphid study``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rich.table import Table

from morphdata.links import LinksPerWing, shown_links
from morphid.commands.operation import Particulars
from morphid.screen import new_table, short, stdout


def show_study(result: Mapping[str, Any]) -> None:
    """Print the result in readable form."""
    stdout().print(study_table(result))
    grades = [(row["links_per_wing"], (row.get("verdict") or {}).get("grade")) for row in result["rows"]]
    if any(grade for _, grade in grades):
        shown = ", ".join(f"{_links(links)}: {grade}" for links, grade in grades if grade)
        stdout().print(f"Verdict by number of links: {shown}", markup=False, soft_wrap=True)
    recommended = result.get("recommended") or {}
    if recommended.get("reason"):
        stdout().print(f"Recommended: {recommended['reason']}", markup=False)


def study_table(result: Mapping[str, Any]) -> Table:
    """Show accuracy and cost per number of links, below those of the rigid model."""
    table = new_table(
        *("links", "bodies", "unknowns", "J fit", "J held", "φ", "θ", "ψ", "flight", "search"),
        title="Study: J in rad², fitted and held out; RMS of φ, θ, ψ in mrad; flight in ms",
        caption="* recommended; flight: wall time of one of 2 s on one core",
        left=0,
    )
    rigid = {**(result.get("rigid") or {}), "links_per_wing": "rigid"}
    recommended = (result.get("recommended") or {}).get("links_per_wing")
    for row in (rigid, *result["rows"]):
        mark = "* " if row["links_per_wing"] == recommended else ""
        rms = row.get("rms_rad") or {}
        table.add_row(
            f"{mark}{_links(row['links_per_wing'])}",
            str(row.get("bodies", "")),
            str(row.get("parameters", "")),
            short(row.get("J_train")),
            short(row.get("J_held_out")),
            *("" if rms.get(a) is None else f"{1e3 * rms[a]:.2f}" for a in ("phi", "theta", "psi")),
            "" if row.get("flight_s") is None else f"{1e3 * row['flight_s']:.3g}",
            "" if row.get("identify_s") is None else f"{row['identify_s']:.1f} s",
        )
    return table


def _links(links: LinksPerWing | str) -> str:
    return shown_links(links) if isinstance(links, dict) else str(links)


STUDY = Particulars(show_study)
