"""Curves of an identification, made up."""

from __future__ import annotations

from typing import Any

import numpy as np

MODELS = {"measured": 0.0, "rigid": 0.02, "initial": 0.01, "identified": 1e-4}


def flown_sample(name: str, *, diverges: bool = False, symmetric: bool = False) -> dict[str, Any]:
    """One sample's curves: smooth angles, each model off by a share; None where a flight diverged."""
    t = np.linspace(0.0, 2.0, 41)
    shapes = {"phi_rad": 0.1 * np.sin(2 * t), "theta_rad": 0.06 - 0.1 * t, "psi_rad": -0.02 * t**2}
    if symmetric:
        shapes |= {"phi_rad": 1e-9 * np.sin(300 * t), "psi_rad": 1e-13 * np.cos(200 * t)}
    sample: dict[str, Any] = {
        "name": name,
        "role": "held_out" if diverges else "train",
        "time_s": t.tolist(),
        "sweep_left_rad": (0.4 * t).tolist(),
        "sweep_right_rad": (0.5 * t).tolist(),
    }
    for model, error in MODELS.items():
        off = {key: values * (1.0 + error) for key, values in shapes.items()}
        sample[model] = {key: values.tolist() for key, values in off.items()}
    if diverges:
        for values in sample["initial"].values():
            values[20:] = [None] * 21
    return sample
