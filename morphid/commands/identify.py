"""``morphid identify``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from morphid.commands import options
from morphid.files import require_place
from morphid.model_table import at_bound_line, model_table
from morphid.screen import fit_table, reports_errors, stdout


@reports_errors
def identify(
    aircraft: options.AircraftFile,
    flight: options.FlightFile,
    sample: options.Samples,
    held_out: options.HeldOut = None,
    links: Annotated[int, options.model_option(min=1, max=8, help="Links per wing.")] = 3,
    start: options.StartAt = None,
    chordwise: options.Chordwise = None,
    spanwise: options.Spanwise = None,
    core: options.VortexCore = None,
    method: options.Method = None,
    seed: options.Seed = None,
    particles: options.Particles = None,
    generations: options.Generations = None,
    max_seconds: options.MaxSeconds = None,
    warm_start: options.WarmStart = None,
    url: options.AtUrl = None,
    api_key: options.AtUrlKey = None,
    json_out: options.JsonFile = None,
    plots: options.Plots = None,
) -> None:
    """Identify an equivalent model from sample flights."""
    from morphid.running import hand_over, run

    require_place(json_out, "--json")
    request = options.sample_request("identify", aircraft, flight, sample, held_out or [])
    request.put("/model/links_per_wing", links, "--links")
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
    if warm_start is not None:
        request.put_file("/search/warm_start/parameters", warm_start, "--warm-start")
    hand_over(run(request, url, api_key), show_model, json_out=json_out, plots=plots)


def show_model(result: Mapping[str, Any]) -> None:
    """Print what came out, for people."""
    stdout().print(fit_table(result))
    if result.get("model") is None:
        stdout().print("No model: nothing that was tried has flown the samples to fit.")
        return
    stdout().print(model_table(result))
    line = at_bound_line(result)
    if line:
        stdout().print(line, markup=False, soft_wrap=True)
