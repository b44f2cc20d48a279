"""``morphid study``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from rich.box import SIMPLE_HEAD
from rich.table import Table

from morphid.commands import options
from morphid.exits import CommandError, Exit
from morphid.files import require_place
from morphid.screen import reports_errors, short, stdout


@reports_errors
def study(
    aircraft: options.AircraftFile,
    flight: options.FlightFile,
    sample: options.Samples,
    held_out: options.HeldOut = None,
    links: Annotated[
        str, options.model_option(help="Numbers of links per wing to compare, with commas between.")
    ] = "1,2,3,4,5,6",
    start: options.StartAt = None,
    chordwise: options.Chordwise = None,
    spanwise: options.Spanwise = None,
    core: options.VortexCore = None,
    method: options.Method = None,
    seed: options.Seed = None,
    particles: options.Particles = None,
    generations: options.Generations = None,
    max_seconds: options.MaxSeconds = None,
    url: options.AtUrl = None,
    api_key: options.AtUrlKey = None,
    json_out: options.JsonFile = None,
    plots: options.Plots = None,
) -> None:
    """Identify models of several sizes, compare accuracy and cost, recommend one."""
    from morphid.running import hand_over, run

    require_place(json_out, "--json")
    request = options.sample_request("study", aircraft, flight, sample, held_out or [])
    request.put("/model/links_per_wing", _whole_numbers(links), f"--links {links}")
    request.put("/model/start", start, "--start")
    options.put_lattice(request, "/model/lattice", chordwise=chordwise, spanwise=spanwise, core=core)
    options.put_search(
        request,
        method=method,
        seed=seed,
        particles=particles,
        generations=generations,
        max_seconds=max_seconds,
    )
    hand_over(run(request, url, api_key), show_study, json_out=json_out, plots=plots)


def _whole_numbers(text: str) -> list[int]:
    try:
        return [int(word) for word in text.split(",")]
    except ValueError:
        raise CommandError(
            f"--links {text}: not whole numbers with commas between",
            code=Exit.USAGE,
            hint="write --links 1,2,3",
        ) from None


def show_study(result: Mapping[str, Any]) -> None:
    """Print what came out, for people."""
    stdout().print(study_table(result))
    recommended = result.get("recommended") or {}
    if recommended.get("reason"):
        stdout().print(f"Recommended: {recommended['reason']}", markup=False)


def study_table(result: Mapping[str, Any]) -> Table:
    """Show accuracy and cost per number of links, below those of the rigid model."""
    table = Table(
        title="Study: J in rad², fitted and held out; RMS of φ, θ, ψ in mrad; flight in ms",
        caption="* recommended; flight: wall time of one of 2 s on one core",
        box=SIMPLE_HEAD,
        padding=(0, 1),
        collapse_padding=True,
        pad_edge=False,
    )
    for name in ("links", "bodies", "unknowns", "J fit", "J held", "φ", "θ", "ψ", "flight", "search"):
        table.add_column(name, justify="right", no_wrap=True)
    rigid = {**(result.get("rigid") or {}), "links_per_wing": "rigid"}
    recommended = (result.get("recommended") or {}).get("links_per_wing")
    for row in (rigid, *result["rows"]):
        mark = "* " if row["links_per_wing"] == recommended else ""
        rms = row.get("rms_rad") or {}
        table.add_row(
            f"{mark}{row['links_per_wing']}",
            str(row.get("bodies", "")),
            str(row.get("parameters", "")),
            short(row.get("J_train")),
            short(row.get("J_held_out")),
            *("" if rms.get(a) is None else f"{1e3 * rms[a]:.2f}" for a in ("phi", "theta", "psi")),
            "" if row.get("flight_s") is None else f"{1e3 * row['flight_s']:.3g}",
            "" if row.get("identify_s") is None else f"{row['identify_s']:.1f} s",
        )
    return table
