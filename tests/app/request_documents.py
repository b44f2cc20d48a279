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


def channel_columns(name: str) -> Document:
    """The channels of one example file, as fields of a document."""
    with (EXAMPLES / f"{name}.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    units = {"p": "rad_s", "q": "rad_s", "r": "rad_s", "vx": "m_s", "vy": "m_s", "vz": "m_s"}
    six = ("t", "sweep_left", "sweep_right", "phi", "theta", "psi")
    return {
        f"{title}_{units.get(title, 'm')}": [float(row[title]) for row in rows]
        for title in rows[0]
        if title not in six
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


def study_document() -> Document:
    """Build a valid request for a study."""
    document = identify_document()
    document["model"] = {"links_per_wing": [1, 2, 3]}
    return document


def _vehicle() -> Document:
    document = identify_document()
    return {"aircraft": document["aircraft"], "flight": document["flight"]}


def simulate_document() -> Document:
    """Build a valid request for a simulation."""
    morph = {"kind": "constant_rate", "final_rad": 1.0, "duration_s": 2.0, "start_s": 0.2}
    return {
        **_vehicle(),
        "model": {"kind": "rigid"},
        "schedules": {"both": morph},
        "duration_s": 2.5,
    }


def optimize_document() -> Document:
    """Build a valid request for an optimisation."""
    return {
        **_vehicle(),
        "model": {"parameters": copy.deepcopy(RESULT["model"])},
        "morph": {"final_rad": 1.0, "duration_s": 2.0},
        "limits": {"max_rate_rad_s": 1.0},
        "search": {"seed": 1},
        "verify": "none",
    }


def export_document() -> Document:
    """Build a valid request for an export."""
    return {**_vehicle(), "model": {"parameters": copy.deepcopy(RESULT["model"])}, "format": "npz"}


RESULT: Document = {
    "model": {
        "links_per_wing": 2,
        "division": [0.5, 0.5],
        "stiffness_nm_rad": [[1.0, 2.0, 3.0]],
        "damping_nms_rad": [[0.1, 0.2, 0.3]],
        "aero": {
            "lift_factor": 1.0,
            "ac_offset_m": 0.0,
            "profile_drag": 0.01,
            "lag_s": 0.0,
            "zero_lift_rad": 0.0,
            "cm0": 0.0,
        },
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

EXPORT_RESULT: Document = {
    "format": "npz",
    "file": "model.npz",
    "media_type": "application/x-npz",
    "size_bytes": 8000,
    "sha256": "0" * 64,
}

STUDY_RESULT: Document = {
    "rows": [
        {
            "links_per_wing": links,
            "bodies": 2 * links + 1,
            "parameters": 7 * (links - 1) + 4,
            "J_train": 0.1 / 10**links,
            "J_held_out": None,
            "rms_rad": {"phi": 0.0, "theta": 5e-3 / links, "psi": 0.0},
            "flight_s": 0.02,
            "identify_s": 1.0,
            "flights": 100,
            "fit": RESULT["fit"],
            "model": {**RESULT["model"], "links_per_wing": links},
        }
        for links in (1, 2, 3)
    ],
    "rigid": {"J_train": 0.11, "J_held_out": None, "flight_s": 0.01},
    "recommended": {"links_per_wing": 2, "reason": "2 links per wing: a link more does not halve the error."},
    "search": {"method": "hybrid", "seed": 1, "wall_s": 3.0},
}

SIMULATE_RESULT: Document = {
    "model": {"kind": "rigid"},
    "trim": {
        "alpha_rad": 0.07,
        "force_b_n": [341.0, 0.0, 25.0],
        "moment_b_n_m": [0.0, -720.0, 0.0],
        "tip_z_m": {"left": -0.27, "right": -0.27},
    },
    "trajectory": {
        "time_s": [0.0, 0.01, 0.02],
        "sweep_left_rad": [0.0, 0.1, 0.2],
        "sweep_right_rad": [0.0, 0.1, 0.2],
        "phi_rad": [0.0, 0.0, 0.0],
        "theta_rad": [0.07, 0.06, 0.05],
        "psi_rad": [0.0, 0.0, 0.0],
    },
    "summary": {"max_abs_rad": {"phi": 0.0, "theta": 0.02, "psi": 0.0}, "variation_rad2": 5e-4},
    "cost": {"wall_s": 0.5, "real_time_factor": 4.0},
}

OPTIMIZE_RESULT: Document = {
    "schedule": {"knot_time_s": [0.0, 0.5, 2.0], "knot_sweep_rad": [0.0, 0.5, 1.0]},
    "limits": {"max_rate_rad_s": 1.0, "max_accel_rad_s2": None},
    "variation": {
        "constant": {"rigid": 0.9, "equivalent": 0.8, "flexible": None},
        "rigid_optimum": {"rigid": 0.7, "equivalent": 0.75, "flexible": None},
        "optimum": {"rigid": 0.72, "equivalent": 0.6, "flexible": None},
    },
    "reduction_percent": 25.0,
    "search": {"method": "hybrid", "seed": 1},
}


def in_both_spellings(model: Document) -> Document:
    """A model as the service returns it: renamed corrections under both names, and what it lacks."""
    shared = {"centre_shift_m": model["aero"]["ac_offset_m"], "lift_factors": None}
    return {**model, "aero": {**shared, **model["aero"]}}
