"""A request for an identification from the example flights, small or large."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

EXAMPLES = Path(__file__).resolve().parent.parent / "examples"
COLUMNS = {
    "time_s": "t",
    "sweep_left_rad": "sweep_left",
    "sweep_right_rad": "sweep_right",
    "phi_rad": "phi",
    "theta_rad": "theta",
    "psi_rad": "psi",
}
QUICK_SEARCH = {"method": "pso", "particles": 16, "generations": 3, "seed": 1}


def sample(name: str, role: str = "train") -> dict[str, Any]:
    """Read an example flight as it stands in a request (s, rad)."""
    with (EXAMPLES / f"{name}.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    return {
        "name": name,
        "role": role,
        **{key: [float(row[c]) for row in rows] for key, c in COLUMNS.items()},
    }


def identification(
    *names: str, links: int = 3, search: dict[str, Any] | None = None, held_out: tuple[str, ...] = ()
) -> dict[str, Any]:
    """Make a request for an identification from the named example flights."""
    return {
        "aircraft": json.loads((EXAMPLES / "aircraft.json").read_text()),
        "flight": json.loads((EXAMPLES / "flight.json").read_text()),
        "samples": [sample(name) for name in names] + [sample(name, "held_out") for name in held_out],
        "model": {"links_per_wing": links},
        "search": QUICK_SEARCH if search is None else search,
    }
