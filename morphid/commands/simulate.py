"""Additions of ``morphid simulate`` to its request: model, schedule, the written flight, the table."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.table import Table

from morphdata.drive_keys import shown_names
from morphdata.drives import BOTH
from morphdata.faults import InvalidInput
from morphdata.options import SCHEDULE
from morphdata.schedules import load_schedules
from morphid.commands import options
from morphid.commands.operation import Particulars, Values
from morphid.exits import CommandError, Exit
from morphid.files import require_file, write_bytes
from morphid.request import Request, aircraft_drives
from morphid.screen import new_table, short, stdout

if TYPE_CHECKING:
    from morphid.running import Answer

schedule_option = partial(typer.Option, rich_help_panel=SCHEDULE)

FLIGHT_FILE = "flight.csv"  # among the files of a simulation


class Model(StrEnum):
    """The model to fly."""

    RIGID = "rigid"
    EQUIVALENT = "equivalent"
    FLEXIBLE = "flexible"


def _fill(request: Request, values: Values) -> None:
    parameters, model_id = values["parameters"], values["model_id"]
    known = parameters is not None or model_id is not None
    kind = values["model"] or (Model.EQUIVALENT if known else Model.RIGID)
    request.put("/model/kind", kind, "--model")
    if known or kind is Model.EQUIVALENT:
        options.put_known_model(request, parameters, model_id, values["url"])
    _put_schedules(request, *(values[name] for name in ("schedule", "rate", "final", "drive", "duration")))


def _save(answer: Answer, path: Path) -> None:
    from morphid.running import wrote

    write_bytes(answer.files[FLIGHT_FILE], path)
    wrote(path)


def _put_schedules(
    request: Request,
    table: Path | None,
    rate: float | None,
    final: float | None,
    drive: str | None,
    duration: float | None,
) -> None:
    """Fill in the schedules of the drives and the duration of the flight."""
    if table is not None and rate is None and final is None and drive is None:
        end_s = _put_table(request, table)
    elif table is None and rate is not None and final is not None:
        end_s = _put_rate(request, rate, final, drive)
    else:
        raise CommandError(
            "there is no schedule for the drives"
            if table is None
            else "--schedule excludes --rate, --final and --drive",
            code=Exit.USAGE,
            hint="give either --schedule S.csv, or both --rate and --final",
        )
    if duration is None:
        request.put(
            "/duration_s", end_s, f"--schedule {table}, whose end is" if table else "--rate, which ends at"
        )
    else:
        request.put("/duration_s", duration, "--duration")


def _put_table(request: Request, path: Path) -> float:
    require_file(path)
    drives = aircraft_drives(request)
    try:
        schedules = load_schedules(path)
        histories = schedules.given if drives is None else schedules.by_drive(drives)
    except InvalidInput as error:
        raise CommandError(
            error.message, code=Exit.INVALID_INPUT, hint=error.hint, given_by=f"--schedule {path}"
        ) from None
    end_s = 0.0
    for drive, history in histories.items():
        document = history.model_dump()
        request.put(f"/schedules/{drive}", document, f"--schedule {path}")
        end_s = document["time_s"][-1]
    return end_s


def _put_rate(request: Request, rate: float, final: float, drive: str | None) -> float:
    if not rate > 0.0 or final == 0.0:
        raise CommandError(
            f"--rate {rate:g} --final {final:g}: these values do not define a morph",
            code=Exit.INVALID_INPUT,
            hint="give a positive rate in rad/s and a final angle in rad (m/s and m if it slides), not 0",
        )
    drives = aircraft_drives(request) or {}
    words = list(dict.fromkeys(each.word for each in drives.values()))
    if drive is None and len(words) > 1:
        raise CommandError(
            f"--rate does not say which drive moves, and the aircraft has {', '.join(words)}",
            code=Exit.INVALID_INPUT,
            hint=f"name it: --drive {words[0]}; to choose from: {shown_names(drives)}",
        )
    moved = [each for each in drives.values() if drive in (None, each.name, each.word)]
    unit = moved[0].unit if moved else "rad"
    document = {"kind": "constant_rate", f"final_{unit}": final, f"rate_{unit}_s": rate}
    given = f"--rate {rate:g} --final {final:g}"
    request.put(
        f"/schedules/{drive or BOTH}", document, given if drive is None else f"{given} --drive {drive}"
    )
    return abs(final) / rate


def show_flight(result: Mapping[str, Any]) -> None:
    """Print the result in readable form."""
    stdout().print(flight_table(result))


def flight_table(result: Mapping[str, Any]) -> Table:
    """Show the start of a flight, the range of its attitude, and its cost."""
    trim, summary, cost = (result.get(part) or {} for part in ("trim", "summary", "cost"))
    tips, largest = trim.get("tip_z_m") or {}, summary.get("max_abs_rad") or {}
    table = new_table("what", "value", title=f"Flight of the {result['model']['kind']} model")
    table.show_header = False
    table.add_row("angle of attack at the start, rad", short(trim.get("alpha_rad")))
    if trim.get("bank_rad"):
        table.add_row("bank angle at the start, rad", short(trim["bank_rad"]))
    for name, angle in (trim.get("drives_rad") or {}).items():
        table.add_row(f"{name} in trim, rad", short(angle))
    for side in ("left", "right"):
        if tips.get(side) is not None:
            table.add_row(f"{side} tip at the start, m up", short(0.0 - tips[side]))
    for angle, letter in (("phi", "φ"), ("theta", "θ"), ("psi", "ψ")):
        table.add_row(f"largest departure of {letter}, rad", short(largest.get(angle)))
    table.add_row("variation of the attitude, rad²", short(summary.get("variation_rad2")))
    table.add_row("computed in, s", short(cost.get("wall_s")))
    table.add_row("times faster than real time", short(cost.get("real_time_factor")))
    return table


SIMULATE = Particulars(
    show_flight,
    options={
        "model": Annotated[
            Model | None,
            options.model_option(
                "--model", help="The model to fly.", show_default="equivalent with --parameters, else rigid"
            ),
        ],
        "schedule": Annotated[
            Path | None,
            schedule_option(
                "--schedule",
                help="Angles over time: a file with t and a column for each drive that moves (sweep_left, "
                "fold_left_deg, or fold for both sides).",
            ),
        ],
        "rate": Annotated[
            float | None,
            schedule_option(
                "--rate",
                help="Instead of --schedule: move both wings at this mean rate, rad/s (m/s if they slide).",
            ),
        ],
        "final": Annotated[
            float | None,
            schedule_option("--final", help="With --rate: angle at the end, rad (or extension, m)."),
        ],
        "drive": Annotated[
            str | None,
            schedule_option(
                "--drive",
                help="With --rate: the drive that moves, fold_left, or fold for both sides; needed if the "
                "aircraft has several kinds.",
            ),
        ],
        "duration": Annotated[
            float | None,
            schedule_option("--duration", help="Time to fly, s.", show_default="to the end of the schedule"),
        ],
    },
    fill=_fill,
    fills=options.KNOWN_MODEL,
    out="Write the flight as CSV, with the columns of samples.",
    save=_save,
)
