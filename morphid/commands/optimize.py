"""``morphid optimize``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.box import SIMPLE_HEAD
from rich.table import Table

from morphid.commands import options
from morphid.exits import CommandError, Exit
from morphid.files import require_place, writing
from morphid.screen import reports_errors, short, stdout

MODELS = ("rigid", "equivalent", "flexible")
SCHEDULES = {"constant": "constant rate", "rigid_optimum": "rigid optimum", "optimum": "optimum"}
REACHED = {"max_rate_rad_s": "rad/s", "max_accel_rad_s2": "rad/s²", "max_hinge_torque_nm": "N m"}
ROW_STEP_S = 0.01  # of the written schedule, as the example flights

morph_option = partial(typer.Option, rich_help_panel="Morph")
limit_option = partial(typer.Option, rich_help_panel="Limits")


class Goal(StrEnum):
    """What is sought."""

    VARIATION = "variation"
    MINIMUM_TIME = "minimum_time"
    PARETO = "pareto"


class Verify(StrEnum):
    """In which model the schedules are flown again."""

    FLEXIBLE = "flexible"
    NONE = "none"


class Preset(StrEnum):
    """Search settings under one name."""

    PAPER = "paper"


@reports_errors
def optimize(
    aircraft: options.AircraftFile,
    flight: options.FlightFile,
    final: Annotated[float, morph_option(help="Sweep at the end of the morph, rad.")],
    duration: Annotated[float, morph_option(help="Time that the morph takes, s.")],
    parameters: options.Parameters = None,
    model_id: options.ModelId = None,
    initial: Annotated[
        float | None, morph_option(help="Sweep before the morph, rad.", show_default="0")
    ] = None,
    knots: Annotated[
        int | None, morph_option(help="Knots of the spline, ends included.", show_default="6")
    ] = None,
    free_values: Annotated[
        bool | None, morph_option("--free-values", help="Seek the knots' angles too, not only their times.")
    ] = None,
    settle: Annotated[
        float | None, morph_option(help="Time after the morph that counts too, s.", show_default="2")
    ] = None,
    goal: Annotated[
        Goal | None,
        morph_option(help="Least variation, least time, or the front of both.", show_default="variation"),
    ] = None,
    max_variation: Annotated[
        float | None, morph_option(help="Largest variation of --goal minimum_time, rad^2.")
    ] = None,
    front_points: Annotated[int | None, morph_option(help="Durations of --goal pareto.")] = None,
    weights: Annotated[
        str | None, morph_option(help="Weights of roll, pitch, yaw in the variation.", show_default="1,1,1")
    ] = None,
    rate_limit: Annotated[float | None, limit_option(help="Fastest sweep rate, rad/s.")] = None,
    accel_limit: Annotated[float | None, limit_option(help="Largest sweep acceleration, rad/s^2.")] = None,
    torque_limit: Annotated[float | None, limit_option(help="Largest hinge torque, N m.")] = None,
    monotonic: Annotated[
        bool | None, limit_option(help="Never sweep back on the way.", show_default="monotonic")
    ] = None,
    method: Annotated[str | None, options.search_option(help="hybrid or pso.")] = None,
    preset: Annotated[
        Preset | None, options.search_option(help="paper: the swarm of the 2021 paper.")
    ] = None,
    particles: options.Particles = None,
    generations: options.Generations = None,
    seed: options.Seed = None,
    max_seconds: options.MaxSeconds = None,
    verify: Annotated[
        Verify | None,
        options.model_option(help="Fly the schedules again in this model.", show_default="flexible"),
    ] = None,
    elements: options.Elements = None,
    start: options.StartAt = None,
    chordwise: options.Chordwise = None,
    spanwise: options.Spanwise = None,
    core: options.VortexCore = None,
    out: Annotated[
        Path | None,
        options.answer_option(help="Write the schedule, CSV; `morphid simulate --schedule` flies it."),
    ] = None,
    url: options.AtUrl = None,
    api_key: options.AtUrlKey = None,
    json_out: options.JsonFile = None,
    plots: options.Plots = None,
) -> None:
    """Find the morph schedule that disturbs the attitude least, within the drive's limits."""
    from morphid.running import hand_over, run

    require_place(json_out, "--json")
    require_place(out, "--out")
    request = options.flight_request("optimize", aircraft, flight)
    options.put_known_model(request, parameters, model_id, url)
    request.put("/model/start", start, "--start")
    options.put_lattice(request, "/model/lattice", chordwise=chordwise, spanwise=spanwise, core=core)
    request.put("/morph/initial_rad", initial, "--initial")
    request.put("/morph/final_rad", final, "--final")
    request.put("/morph/duration_s", duration, "--duration")
    request.put("/morph/knots", knots, "--knots")
    request.put("/morph/free_values", free_values, "--free-values")
    request.put("/morph/settle_s", settle, "--settle")
    request.put("/morph/goal", goal, "--goal")
    request.put("/morph/max_variation_rad2", max_variation, "--max-variation")
    request.put("/morph/front_points", front_points, "--front-points")
    request.put("/limits/monotonic", monotonic, "--monotonic")
    request.put("/limits/max_rate_rad_s", rate_limit, "--rate-limit")
    request.put("/limits/max_accel_rad_s2", accel_limit, "--accel-limit")
    request.put("/limits/max_hinge_torque_nm", torque_limit, "--torque-limit")
    request.put("/weights", _weights(weights), f"--weights {weights}")
    options.put_search(
        request,
        method=method,
        preset=preset,
        particles=particles,
        generations=generations,
        seed=seed,
        max_seconds=max_seconds,
    )
    request.put("/verify", verify, "--verify")
    request.put("/flexible/elements", elements, "--elements")
    answer = run(request, url, api_key)
    if out is not None and answer.result is not None and answer.result["schedule"] is not None:
        _write_schedule(answer.result, out)
    hand_over(answer, show_schedule, json_out=json_out, plots=plots)


def _weights(text: str | None) -> dict[str, float] | None:
    if text is None:
        return None
    try:
        phi, theta, psi = (float(word) for word in text.split(","))
    except ValueError:
        raise CommandError(
            f"--weights {text}: not three numbers with commas between",
            code=Exit.USAGE,
            hint="write --weights 1,1,1 for roll, pitch and yaw alike",
        ) from None
    return {"phi": phi, "theta": theta, "psi": psi}


def _write_schedule(result: Mapping[str, Any], path: Path) -> None:
    """Write the schedule, from the start of the morph to the end of the settling."""
    import numpy as np

    from morphcore.simulate.schedule import Spline
    from morphcore.simulate.schedule_table import write_schedule_csv
    from morphid.running import wrote

    found = result["schedule"]
    spline = Spline(np.array(found["knot_time_s"]), np.array(found["knot_sweep_rad"]))
    end_s = found["knot_time_s"][-1] + result["morph"]["settle_s"]
    times = ROW_STEP_S * np.arange(int(np.ceil(end_s / ROW_STEP_S - 1e-9)) + 1, dtype=np.float64)
    with writing(path):
        write_schedule_csv({"left": spline, "right": spline}, times, path)
    wrote(path)


def show_schedule(result: Mapping[str, Any]) -> None:
    """Print what came out, for people."""
    stdout().print(variation_table(result))
    if result.get("pareto"):
        stdout().print(front_table(result["pareto"]))
    if result["schedule"] is None:
        stdout().print("No schedule: nothing that was tried has flown to its end.")
    else:
        stdout().print(knot_table(result["schedule"]))
    for note in result.get("notes", ()):
        stdout().print(note, markup=False)


def variation_table(result: Mapping[str, Any]) -> Table:
    """Compare the schedules: attitude variation (rad^2) in the models that flew them, and what they reach."""
    reduction, model = result.get("reduction_percent"), result.get("reduction_model")
    table = Table(
        title="Attitude variation in rad²; largest rate, acceleration, torque",
        caption=None
        if reduction is None
        else f"optimum: {reduction:.1f} % below constant rate ({model} model)",
        box=SIMPLE_HEAD,
        padding=(0, 1),
        collapse_padding=True,
        pad_edge=False,
    )
    table.add_column("schedule", no_wrap=True)
    for title in (*MODELS, *REACHED.values()):
        table.add_column(title, justify="right", no_wrap=True)
    for name, title in SCHEDULES.items():
        flown = result["variation"].get(name) or {}
        reached = (result.get("reached") or {}).get(name) or {}
        table.add_row(
            title, *(short(flown.get(m)) for m in MODELS), *(short(reached.get(r)) for r in REACHED)
        )
    return table


def front_table(front: Sequence[Mapping[str, Any]]) -> Table:
    """Show the front of duration (s) against variation (rad^2)."""
    table = Table(title="Front: no schedule is both shorter and calmer", box=SIMPLE_HEAD)
    for title in ("duration, s", "variation, rad²", "at constant rate"):
        table.add_column(title, justify="right")
    for point in front:
        variations = (short(point["variation_rad2"]), short(point.get("constant_rad2")))
        table.add_row(f"{point['duration_s']:.2f}", *variations)
    return table


def knot_table(schedule: Mapping[str, Sequence[float]]) -> Table:
    """Show the knots of the schedule's clamped cubic spline."""
    table = Table(title="Knots of the spline", box=SIMPLE_HEAD)
    table.add_column("time, s", justify="right")
    table.add_column("sweep, rad", justify="right")
    for time_s, sweep_rad in zip(schedule["knot_time_s"], schedule["knot_sweep_rad"], strict=True):
        table.add_row(f"{time_s:.4f}", f"{sweep_rad:.4f}")
    return table
