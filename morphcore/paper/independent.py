"""The stage "independent": flights of another program, predicted with nominal properties and nothing fitted.

The trim is our own, both laws of the vortex core are flown (for the reason see DECISIONS 9), and only the
measured sweep is taken from the files.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Generator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from morphcore.frames import wrap_angle
from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.paper.settings import PaperSettings
from morphcore.paper.stages import Progress, Results, Work
from morphcore.simulate.flight import Simulation, flight_steps
from morphcore.simulate.trajectory import Trajectory, load_trajectory
from morphdata.aircraft import load_aircraft
from morphdata.flight import load_flight
from morphdata.lattice import CORE_LAWS, CoreLaw, Lattice, VortexCore
from morphdata.measurement import ANGLES

Document = dict[str, Any]

PATTERN = "*.csv"
NOTES, WALL = "samples.json", "flexible_model_wall_s"
TIP = "tip_left_z"
SILENT_RAD = 1e-6  # an angle that stays below this does not move, and has no range to compare with


def sample_digests(folder: Path | None) -> dict[str, str]:
    """The digest of every file of the other program's flights, an input of the comparison."""
    files = [] if folder is None else [*folder.glob("*.json"), *_flights(folder)]
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in sorted(files)}


def compare_independent(settings: PaperSettings, _results: Results, _checkpoint: bytes | None) -> Work:
    """Fly every sample in our flexible model; empty if there are no samples."""
    if settings.samples is None:
        return {"available": False, "laws": []}
    craft = Aircraft.of(load_aircraft(settings.samples / "aircraft.json"))
    condition = Flight.of(load_flight(settings.samples / "flight.json"))
    samples = [load_trajectory(path) for path in _flights(settings.samples)]
    laws = []
    for number, law in enumerate(CORE_LAWS):
        done = number / len(CORE_LAWS)
        flown = yield from _flown(settings, craft, condition, samples, law, done)
        laws.append({"core": law, "trim": flown[0][0], "flights": [row for _, row in flown]})
    start = condition.start
    return {
        "available": True,
        "laws": laws,
        "theirs": {
            "alpha_rad": None if start is None else start.alpha_rad,
            "tip_z_m": _first_tip(samples),
            "wall_s": _their_wall_s(settings.samples),
        },
        "samples": [_history(sample) for sample in samples],
    }


def _flown(
    settings: PaperSettings,
    craft: Aircraft,
    condition: Flight,
    samples: Sequence[Trajectory],
    law: CoreLaw,
    done: float,
) -> Generator[Progress, None, list[tuple[Document, Document]]]:
    """Trim and comparison of every sample, with one law of the core."""
    rows = []
    for number, sample in enumerate(samples):
        for step in flight_steps(
            craft, condition, sample, model="flexible", elements=settings.elements,
            step_s=settings.effort.flexible_step_s, lattice=Lattice(core=VortexCore(law=law)),
        ):  # fmt: skip
            share = (number + step.fraction) / len(samples) / len(CORE_LAWS)
            yield Progress(done + share, f"{sample.name}, core {law}")
            if step.simulation is not None:
                rows.append((_trim(step.simulation), _compared(sample, step.simulation)))
    return rows


def _compared(sample: Trajectory, ours: Simulation) -> Document:
    errors = wrap_angle(ours.trajectory.euler - sample.euler)
    span = np.ptp(sample.euler, axis=0)
    rms, largest = np.sqrt(np.mean(errors**2, axis=0)), np.abs(errors).max(axis=0)

    def per_angle(values: Any) -> dict[str, float]:
        return {angle: float(value) for angle, value in zip(ANGLES, values, strict=True)}

    return {
        "sample": sample.name,
        "rms_rad": per_angle(rms),
        "max_abs_rad": per_angle(largest),
        "range_rad": per_angle(span),
        # of the sample's range; None for an angle that does not move
        "worst_share": {
            angle: float(maximum / wide) if wide > SILENT_RAD else None
            for angle, maximum, wide in zip(ANGLES, largest, span, strict=True)
        },
        "ours": _angles(ours.trajectory),
    }


def _trim(ours: Simulation) -> Document:
    return {"alpha_rad": float(ours.trim.alpha[0]), "tip_z_m": float(ours.trajectory.extra[TIP][0])}


def _history(sample: Trajectory) -> Document:
    return {"name": sample.name, "time_s": sample.time_s.tolist(), **_angles(sample)}


def _angles(trajectory: Trajectory) -> dict[str, list[float]]:
    return {f"{angle}_rad": column.tolist() for angle, column in zip(ANGLES, trajectory.euler.T, strict=True)}


def _first_tip(samples: Sequence[Trajectory]) -> float | None:
    """The samples' tip at the start, m below the root; None if they do not contain it."""
    tips = [float(sample.extra[TIP][0]) for sample in samples if TIP in sample.extra]
    return tips[0] if tips else None


def _their_wall_s(folder: Path) -> dict[str, float]:
    """Durations of the other program's flights as it recorded them, s; empty if it did not."""
    path = folder / NOTES
    notes = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
    return {name: float(note[WALL]) for name, note in notes.items() if WALL in note}


def _flights(folder: Path) -> list[Path]:
    return sorted(folder.glob(PATTERN))
