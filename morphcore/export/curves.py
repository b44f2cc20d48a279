"""Time histories of an identification as CSV tables, and file names for its samples."""

from __future__ import annotations

import io
import math
import re
from collections.abc import Iterable, Sequence
from typing import Any

from morphdata.samplefiles.csv_table import write_table

Document = dict[str, Any]

ANGLES = ("phi_rad", "theta_rad", "psi_rad")
SWEEPS = ("sweep_left", "sweep_right")  # of samples that do not name their drives
MODELS = ("measured", "rigid", "initial", "identified")
LONGEST_STEM = 100  # characters: with prefix and ending a file name stays below the limits of file systems
DEFAULT_STEM = "sample"


def file_stems(names: Iterable[str]) -> list[str]:
    """Parts of file names for samples: letters, digits, dots, dashes and underscores, all different.

    Names that are plain already stay as they are, so that curves and plots are found under the sample's name.
    """
    stems: list[str] = []
    taken: set[str] = set()
    for name in names:
        plain = re.sub(r"[^A-Za-z0-9._-]+", "_", name).strip("._-")[:LONGEST_STEM] or DEFAULT_STEM
        stem, number = plain, 2
        while stem.lower() in taken:  # some file systems take Sample and sample for one
            stem, number = f"{plain}-{number}", number + 1
        taken.add(stem.lower())
        stems.append(stem)
    return stems


def curve_tables(curves: Document) -> dict[str, bytes]:
    """Write each sample's time histories as CSV.

    Parameters
    ----------
    curves : ``{"samples": [{"name", "time_s", "drives": ["sweep_left", "sweep_right"], "sweep_left_rad",
        "sweep_right_rad", "measured": {"phi_rad", "theta_rad", "psi_rad"}, "rigid": {...}, "initial": {...},
        "identified": {...}}]}``; the drives' columns bear their names.

    Returns
    -------
    File name ``curves_<sample>.csv`` -> UTF-8 text: time_s, the drives, then ``<model>_<angle>_rad``. Where
    a flight diverged its cells are empty.
    """
    samples = curves["samples"]
    stems = file_stems(str(sample["name"]) for sample in samples)
    return {
        f"curves_{stem}.csv": curve_table(sample).encode()
        for stem, sample in zip(stems, samples, strict=True)
    }


def curve_table(sample: Document) -> str:
    """One sample's time histories as CSV text; see `curve_tables`."""
    columns: dict[str, Sequence[float | None]] = {"time_s": sample["time_s"]}
    columns |= {name: sample[name] for name in drive_columns(sample)}
    columns |= {
        f"{model}_{angle}": sample[model][angle] for model in MODELS if sample.get(model) for angle in ANGLES
    }
    text = io.StringIO()
    write_table(
        text, columns, ([_cell(value) for value in row] for row in zip(*columns.values(), strict=True))
    )
    return text.getvalue()


def drive_columns(document: Document) -> list[str]:
    """Names of the columns of a sample's or a flight's drives, those of which there are any."""
    names = (f"{drive}_rad" for drive in document.get("drives", SWEEPS))
    return [name for name in names if name in document]


def _cell(value: float | None) -> str:
    # nine digits: a nanoradian of an attitude of one radian
    return "" if value is None or not math.isfinite(value) else f"{value:.9g}"
