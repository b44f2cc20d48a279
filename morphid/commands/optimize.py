"""Additions of ``morphid optimize`` to its request: the known model, the written schedule, the tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.table import Table

from morphdata.drives import SWEEPS, label
from morphdata.extensions import knot_values
from morphid.commands import options
from morphid.commands.operation import Particulars, Values
from morphid.files import writing
from morphid.request import Request
from morphid.screen import new_table, short, stdout

if TYPE_CHECKING:
    from morphid.running import Answer

MODELS = ("rigid", "equivalent", "flexible")
SCHEDULES = {"constant": "constant rate", "rigid_optimum": "rigid optimum", "optimum": "optimum"}
REACHED = {"max_rate_rad_s": "rad/s", "max_accel_rad_s2": "rad/s²", "max_hinge_torque_nm": "N m"}
SLIDING = {"max_rate_m_s": "m/s", "max_accel_m_s2": "m/s²", "max_drive_force_n": "N"}
ROW_STEP_S = 0.01  # s between rows of the written schedule, as in the example flights


def _fill(request: Request, values: Values) -> None:
    options.put_known_model(request, values["parameters"], values["model_id"], values["url"])


def _save(answer: Answer, path: Path) -> None:
    if answer.result is not None and answer.result["schedule"] is not None:
        _write_schedule(answer.result, path)


def _write_schedule(result: Mapping[str, Any], path: Path) -> None:
    """Write the schedule, from the start of the morph to the end of the settling."""
    import numpy as np

    from morphcore.simulate.schedule import Spline
    from morphcore.simulate.schedule_table import write_schedule_csv
    from morphid.running import wrote

    found = result["schedule"]
    spline = Spline(np.array(found["knot_time_s"]), np.array(knot_values(found)))
    drives = sorted(result.get("drives", SWEEPS))  # the only one in results of earlier versions
    if "knot_extension_m" in found:
        drives = [f"{name}_m" for name in drives]
    end_s = found["knot_time_s"][-1] + result["morph"]["settle_s"]
    times = ROW_STEP_S * np.arange(int(np.ceil(end_s / ROW_STEP_S - 1e-9)) + 1, dtype=np.float64)
    with writing(path):
        write_schedule_csv(dict.fromkeys(drives, spline), times, path)
    wrote(path)


def show_schedule(result: Mapping[str, Any]) -> None:
    """Print the result in readable form."""
    stdout().print(variation_table(result))
    if result.get("pareto"):
        stdout().print(front_table(result["pareto"]))
    if result["schedule"] is None:
        stdout().print("No schedule: no candidate could be flown to the end.")
    else:
        stdout().print(knot_table(result["schedule"]))
    for note in result.get("notes", ()):
        stdout().print(note, markup=False)


def variation_table(result: Mapping[str, Any]) -> Table:
    """Compare the schedules: attitude variation (rad^2) by model; largest rate, acceleration and torque."""
    reduction, model = result.get("reduction_percent"), result.get("reduction_model")
    caption = None
    if reduction is not None:
        caption = f"optimum: {reduction:.1f} % below constant rate ({model} model)"
    title = "Attitude variation in rad²; largest rate, acceleration, torque"
    slides = result.get("morph", {}).get("final_m") is not None
    limits = SLIDING if slides else REACHED
    if slides:
        title = title.replace("torque", "force")
    table = new_table("schedule", *MODELS, *limits.values(), title=title, caption=caption)
    for name, title in SCHEDULES.items():
        flown = result["variation"].get(name) or {}
        reached = (result.get("reached") or {}).get(name) or {}
        table.add_row(title, *(short(flown.get(m)) for m in MODELS), *(short(reached.get(r)) for r in limits))
    return table


def front_table(front: Sequence[Mapping[str, Any]]) -> Table:
    """Show the front of duration (s) against variation (rad^2)."""
    columns = ("duration, s", "variation, rad²", "at constant rate")
    table = new_table(*columns, title="Pareto front of duration and variation", left=0)
    for point in front:
        variations = (short(point["variation_rad2"]), short(point.get("constant_rad2")))
        table.add_row(f"{point['duration_s']:.2f}", *variations)
    return table


def knot_table(schedule: Mapping[str, Any]) -> Table:
    """Show the knots of the schedule's clamped cubic spline."""
    drive = label(schedule.get("drive") or "sweep")
    unit = "m" if "knot_extension_m" in schedule else "rad"
    table = new_table("time, s", f"{drive}, {unit}", title="Knots of the spline", left=0)
    for time_s, value in zip(schedule["knot_time_s"], knot_values(schedule), strict=True):
        table.add_row(f"{time_s:.4f}", f"{value:.4f}")
    return table


OPTIMIZE = Particulars(
    show_schedule,
    fill=_fill,
    fills=options.KNOWN_MODEL,
    out="Write the schedule, CSV; `morphid simulate --schedule` flies it.",
    save=_save,
)
