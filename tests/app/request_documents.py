"""Request documents for tests: the example flights as a client would send them."""

from __future__ import annotations

import copy
import csv
import json
from functools import lru_cache
from pathlib import Path
from typing import Any

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
SAMPLE_NAMES = ("train_rate_0.2", "train_rate_0.5", "train_rate_0.8", "train_asymmetric")

Document = dict[str, Any]


def sample_document(name: str) -> Document:
    """Build the inline sample of one example file."""
    with (EXAMPLES / f"{name}.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))

    def column(title: str) -> list[float]:
        return [float(row[title]) for row in rows]

    return {
        "name": name,
        "role": "train",
        "time_s": column("t"),
        "sweep_left_rad": column("sweep_left"),
        "sweep_right_rad": column("sweep_right"),
        "phi_rad": column("phi"),
        "theta_rad": column("theta"),
        "psi_rad": column("psi"),
    }


@lru_cache(maxsize=1)
def _example() -> Document:
    return {
        "aircraft": json.loads((EXAMPLES / "aircraft.json").read_text(encoding="utf-8")),
        "flight": json.loads((EXAMPLES / "flight.json").read_text(encoding="utf-8")),
        "samples": [sample_document(name) for name in SAMPLE_NAMES],
        "model": {"links_per_wing": 3},
        "search": {"seed": 1},
    }


def identify_document() -> Document:
    """Build a valid request of four samples; the caller may change it."""
    return copy.deepcopy(_example())


RESULT: Document = {
    "model": {
        "links_per_wing": 2,
        "division": [0.5, 0.5],
        "stiffness_nm_rad": [[1.0, 2.0, 3.0]],
        "damping_nms_rad": [[0.1, 0.2, 0.3]],
        "aero": {"lift_factor": 1.0, "centre_shift_m": 0.0, "profile_drag": 0.01, "lag_s": 0.0},
    },
    "fit": [
        {
            "sample": "train_rate_0.5",
            "role": "train",
            "J_rigid": 0.11,
            "J_initial": 0.05,
            "J_identified": 1e-4,
            "rms_rad": {"phi": 0.0, "theta": 5e-4, "psi": 0.0},
            "max_abs_rad": {"phi": 0.0, "theta": 1e-3, "psi": 0.0},
        }
    ],
    "uncertainty": {"standard_error": {}, "correlation": [[1.0]], "unidentifiable": []},
    "search": {
        "method": "hybrid",
        "seed": 1,
        "flights": 10,
        "generations": 2,
        "wall_s": 1.0,
        "history": [{"generation": 1, "best_cost": 1.0}],
    },
    "cost": {"rigid_flight_s": 0.1, "equivalent_flight_s": 0.2, "flexible_flight_s": None},
}
