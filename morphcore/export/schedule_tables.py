"""An optimised morph as CSV tables: the schedules that were compared, and the attitude flown with them."""

from __future__ import annotations

import io
import math
from collections.abc import Iterator, Mapping, Sequence

from morphcore.export.curves import SWEEPS, Document
from morphdata.samplefiles.csv_table import write_table

Column = Sequence[float | None]
ANGLES = ("phi_rad", "theta_rad", "psi_rad")


def schedule_tables(curves: Document) -> dict[str, bytes]:
    """Write the time histories of an optimisation.

    Parameters
    ----------
    curves : ``{"time_s", "drives": [names], "schedules": {name: {"sweep_rad", "rate_rad_s",
        "acceleration_rad_s2"}}, "flights": {model: {name: {"phi_rad", "theta_rad", "psi_rad"}}}}``, these
        as departures from the start.

    Returns
    -------
    File name -> UTF-8 text: ``schedule.csv``, the optimum with the columns of a schedule file (t and the
    drives that move; s, rad), which the simulation flies; ``schedules.csv``, angle, rate and acceleration of
    all; ``departures.csv``, ``<schedule>_in_<model>_<angle>`` of all flights.
    """
    time_s, schedules = curves["time_s"], curves["schedules"]
    all_schedules = {
        f"{name}_{quantity}": values
        for name, motion in schedules.items()
        for quantity, values in motion.items()
    }
    departures = {
        f"{name}_in_{model}_{angle}": flown[angle]
        for model, flights in curves["flights"].items()
        for name, flown in flights.items()
        for angle in ANGLES
    }
    optimum = dict.fromkeys(sorted(curves.get("drives", SWEEPS)), schedules["optimum"]["sweep_rad"])
    return {
        "schedule.csv": _table({"t": time_s, **optimum}),
        "schedules.csv": _table({"time_s": time_s, **all_schedules}),
        "departures.csv": _table({"time_s": time_s, **departures}),
    }


def _table(columns: Mapping[str, Column]) -> bytes:
    text = io.StringIO()
    write_table(text, columns, (_cells(row) for row in zip(*columns.values(), strict=True)))
    return text.getvalue().encode()


def _cells(row: Sequence[float | None]) -> Iterator[str]:
    # twelve digits: a schedule's second differences stay right when it is flown from the file
    return ("" if value is None or not math.isfinite(value) else f"{value:.12g}" for value in row)
