"""Command lines on the example data, and the small models that they fly."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
COARSE = ("--chordwise", "1", "--spanwise", "4")  # a lattice that is quick, not good
PARAMETERS: dict[str, Any] = {  # of the order of what the example flights give
    "links_per_wing": 2,
    "division": [0.42, 0.58],
    "stiffness_nm_rad": [[41000.0, 68000.0, 380000.0]],
    "damping_nms_rad": [[160.0, 270.0, 1500.0]],
    "aero": {"lift_factor": 1.06, "ac_offset_m": 0.002, "profile_drag": 0.011, "lag_s": 0.004},
    "lattice": {"chordwise": 1, "spanwise": 4},
}


def command(operation: str, *words: str | Path) -> list[str]:
    """Give the command line of an operation on the example aircraft."""
    vehicle = ("--aircraft", EXAMPLES / "aircraft.json", "--flight", EXAMPLES / "flight.json")
    return [operation, *(str(word) for word in (*vehicle, *words))]


def sample(name: str) -> str:
    """Give the path of an example flight."""
    return str(EXAMPLES / f"{name}.csv")


def parameters_file(folder: Path) -> str:
    """Write an identification's result, as far as it is looked at, and give its path."""
    path = folder / "identified.json"
    path.write_text(json.dumps({"model": PARAMETERS, "fit": []}))
    return str(path)
