"""Results as CSV tables, UTF-8 text by file name: time histories of flights and schedules, a study."""

from __future__ import annotations

import io
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from morphdata.links import shown_links
from morphdata.measurement import ANGLE_COLUMNS
from morphdata.samplefiles.csv_table import write_table

Document = dict[str, Any]

SWEEPS = ("sweep_left", "sweep_right")  # drives of documents that do not name them
MODELS = ("measured", "rigid", "initial", "identified")
LONGEST_STEM = (
    100  # characters: with prefix and extension a file name stays within the limits of file systems
)
DEFAULT_STEM = "sample"
CURVE_DIGITS = 9  # a nanoradian of an attitude of one radian
SCHEDULE_DIGITS = 12  # keeps a schedule's second differences accurate when it is flown from the file
STUDY_COLUMNS = (
    "links_per_wing",
    "bodies",
    "parameters",
    "J_train",
    "J_held_out",
    "flight_s",
    "identify_s",
    "flights",
)


def file_stems(names: Iterable[str]) -> list[str]:
    """File name stems for samples: letters, digits, dots, dashes and underscores, all different.

    Names that are already plain are kept, so that curves and plots are found under the sample's name.
    """
    stems: list[str] = []
    taken: set[str] = set()
    for name in names:
        plain = re.sub(r"[^A-Za-z0-9._-]+", "_", name).strip("._-")[:LONGEST_STEM] or DEFAULT_STEM
        stem, number = plain, 2
        while stem.lower() in taken:  # some file systems do not distinguish Sample from sample
            stem, number = f"{plain}-{number}", number + 1
        taken.add(stem.lower())
        stems.append(stem)
    return stems


def curve_tables(curves: Document) -> dict[str, bytes]:
    """Write the time histories of an identification, ``curves_<sample>.csv`` for each sample.

    Parameters
    ----------
    curves : ``{"samples": [{"name", "time_s", "drives": ["sweep_left", "sweep_right"], "sweep_left_rad",
        "sweep_right_rad", "measured": {"phi_rad", "theta_rad", "psi_rad"}, "rigid": {...}, "initial": {...},
        "identified": {...}}]}``; the drives' columns bear their names.

    Returns
    -------
    Columns time_s, the drives, then ``<model>_<angle>_rad``. Cells after a divergence are empty.
    """
    samples = curves["samples"]
    stems = file_stems(str(sample["name"]) for sample in samples)
    return {f"curves_{stem}.csv": curve_table(sample) for stem, sample in zip(stems, samples, strict=True)}


def curve_table(sample: Document) -> bytes:
    """Write one sample's time histories; see `curve_tables`."""
    columns = {name: sample[name] for name in ("time_s", *drive_columns(sample))}
    columns |= {
        f"{model}_{angle}": sample[model][angle]
        for model in MODELS
        if sample.get(model)
        for angle in ANGLE_COLUMNS
    }
    return _table(columns, CURVE_DIGITS)


def schedule_tables(curves: Document) -> dict[str, bytes]:
    """Write the time histories of an optimisation.

    Parameters
    ----------
    curves : ``{"time_s", "drives": [names], "schedules": {name: {"sweep_rad", "rate_rad_s",
        "acceleration_rad_s2"}}, "flights": {model: {name: {"phi_rad", "theta_rad", "psi_rad"}}}}``, these
        as departures from the start.

    Returns
    -------
    ``schedule.csv``, the optimum with the columns of a schedule file (t and the drives that move; s, rad),
    which the simulation flies; ``schedules.csv``, angle, rate and acceleration of all; ``departures.csv``,
    ``<schedule>_in_<model>_<angle>`` of all flights.
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
        for angle in ANGLE_COLUMNS
    }
    slides = "extension_m" in schedules["optimum"]
    names = [f"{name}_m" if slides else name for name in sorted(curves.get("drives", SWEEPS))]
    optimum = dict.fromkeys(names, schedules["optimum"]["extension_m" if slides else "sweep_rad"])
    return {
        "schedule.csv": _table({"t": time_s, **optimum}, SCHEDULE_DIGITS),
        "schedules.csv": _table({"time_s": time_s, **all_schedules}, SCHEDULE_DIGITS),
        "departures.csv": _table({"time_s": time_s, **departures}, SCHEDULE_DIGITS),
    }


def drive_columns(document: Document) -> list[str]:
    """Names of the columns of a sample's or a flight's drives, as far as they exist."""
    names = (f"{drive}_{unit}" for drive in document.get("drives", SWEEPS) for unit in ("rad", "m"))
    return [name for name in names if name in document]


def study_table(document: Document) -> bytes:
    """Write a study's rows with the units of the document; unknown values are empty."""
    rows = document["rows"]
    recommended = (document.get("recommended") or {}).get("links_per_wing")
    columns = {name: [row.get(name) for row in rows] for name in STUDY_COLUMNS}
    columns["links_per_wing"] = [
        links if isinstance(links := row["links_per_wing"], int) else shown_links(links) for row in rows
    ]
    for angle in ("phi", "theta", "psi"):
        columns[f"rms_{angle}_rad"] = [(row.get("rms_rad") or {}).get(angle) for row in rows]
    columns["recommended"] = ["yes" if row["links_per_wing"] == recommended else "" for row in rows]
    return _table(columns, CURVE_DIGITS)


def _table(columns: Mapping[str, Sequence[float | str | None]], digits: int) -> bytes:
    def cell(value: float | str | None) -> str:
        if value is None or isinstance(value, str):
            return value or ""
        return f"{value:.{digits}g}" if math.isfinite(value) else ""

    text = io.StringIO()
    write_table(text, columns, (map(cell, row) for row in zip(*columns.values(), strict=True)))
    return text.getvalue().encode()
