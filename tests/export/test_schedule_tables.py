"""Tables of an optimised morph: what stands in which file."""

from __future__ import annotations

import csv
import io

from morphcore.export.curves import schedule_tables

MOTION = {"sweep_rad": [0.0, 0.1], "rate_rad_s": [0.0, 0.2], "acceleration_rad_s2": [1.0, 1.0 / 3.0]}
FLOWN = {"phi_rad": [0.0, 0.0], "theta_rad": [0.0, -0.01], "psi_rad": [0.0, float("nan")]}


def rows(table: bytes) -> list[dict[str, str]]:
    """Read a table back."""
    return list(csv.DictReader(io.StringIO(table.decode())))


def test_each_quantity_has_its_column() -> None:
    """The optimum as a schedule file, all schedules, all flights; twelve digits, none where one diverged."""
    tables = schedule_tables(
        {
            "time_s": [0.0, 0.01],
            "schedules": {"constant": MOTION, "optimum": MOTION},
            "flights": {"rigid": {"optimum": FLOWN}, "flexible": {}},
        }
    )
    assert rows(tables["schedule.csv"])[1] == {"t": "0.01", "sweep_left": "0.1", "sweep_right": "0.1"}
    schedules = rows(tables["schedules.csv"])[1]
    assert (
        schedules["optimum_acceleration_rad_s2"]
        == schedules["constant_acceleration_rad_s2"]
        == "0.333333333333"
    )
    departures = rows(tables["departures.csv"])[1]
    assert set(departures) == {"time_s", *(f"optimum_in_rigid_{angle}" for angle in FLOWN)}
    assert (departures["optimum_in_rigid_theta_rad"], departures["optimum_in_rigid_psi_rad"]) == ("-0.01", "")
