"""The stage "truth": six flights of the flexible model, and their convergence."""

from __future__ import annotations

import time
from collections.abc import Generator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from morphcore.frames import wrap_angle
from morphcore.paper.scenario import PaperFlight, aircraft, flight, paper_flights
from morphcore.paper.settings import PaperSettings
from morphcore.paper.stages import Progress, Results, Work
from morphcore.simulate.flight import Simulation, flight_steps
from morphcore.simulate.trajectory import Trajectory
from morphdata.lattice import Lattice
from morphdata.measurement import ANGLES
from morphdata.samples import InlineSample

Document = dict[str, Any]

CONVERGENCE_FLIGHT = "rate_0.5"


@dataclass(frozen=True)
class Resolution:
    """Resolution of a flight of the flexible model."""

    what: str
    elements: int
    step_s: float
    lattice: Lattice

    def to_document(self) -> Document:
        """JSON form."""
        return {**vars(self), "lattice": self.lattice.to_document()}


def resolutions(settings: PaperSettings) -> tuple[Resolution, ...]:
    """The resolution of the truth, then finer ones, each refined in one respect."""
    used = Resolution("as flown", settings.elements, settings.effort.flexible_step_s, settings.lattice)
    finer = [
        replace(used, what="elements doubled", elements=2 * used.elements),
        replace(used, what="step halved", step_s=0.5 * used.step_s),
    ]
    if settings.effort.finer_lattice:
        coarse = used.lattice
        lattice = Lattice(chordwise=2 * coarse.chordwise, spanwise=2 * coarse.spanwise, core=coarse.core)
        finer.append(replace(used, what="lattice doubled in both directions", lattice=lattice))
    return (used, *finer)


def fly_truth(settings: PaperSettings, _results: Results, _checkpoint: bytes | None) -> Work:
    """Fly all six flights, then one of them at finer resolutions."""
    used, *finer = resolutions(settings)
    flights = paper_flights()
    total = sum(each.duration_s for each in flights) + 3.0 * len(finer)
    flown: list[Document] = []
    known: dict[str, Trajectory] = {}
    done = 0.0
    for each in flights:
        begin = time.perf_counter()
        simulation = yield from flown_flexible(each, used, done / total, each.duration_s / total)
        done += each.duration_s
        known[each.name] = simulation.trajectory
        flown.append(_flight_document(each, simulation, time.perf_counter() - begin))
    chosen = next(each for each in flights if each.name == CONVERGENCE_FLIGHT)
    rows: list[Document] = []
    for resolution in finer:
        simulation = yield from flown_flexible(chosen, resolution, done / total, 3.0 / total)
        done += 3.0
        moved = np.abs(wrap_angle(simulation.trajectory.euler - known[chosen.name].euler)).max(axis=0)
        rows.append(
            resolution.to_document() | {"max_abs_rad": dict(zip(ANGLES, moved.tolist(), strict=True))}
        )
    return {
        "resolution": used.to_document(),
        "flights": flown,
        "convergence": {"flight": chosen.name, "rows": rows},
    }


def flown_flexible(
    each: PaperFlight, resolution: Resolution, done: float, share: float
) -> Generator[Progress, None, Simulation]:
    """Fly one flight of the flexible model; report progress from ``done`` over ``share`` of the stage."""
    for step in flight_steps(
        aircraft(), flight(), each.schedules(), model="flexible", duration_s=each.duration_s,
        step_s=resolution.step_s, lattice=resolution.lattice, elements=resolution.elements,
    ):  # fmt: skip
        yield Progress(done + share * step.fraction, f"{each.label}, {resolution.what}")
        if step.simulation is not None:
            return step.simulation
    raise AssertionError("a flight ends with its simulation")


def samples_of(truth: Document) -> list[Trajectory]:
    """The truth's flights as samples, with their roles."""
    return [
        Trajectory.of(InlineSample.parse(flown["sample"], f"/flights/{i}/sample"))
        for i, flown in enumerate(truth["flights"])
    ]


def _flight_document(each: PaperFlight, simulation: Simulation, wall_s: float) -> Document:
    trajectory, trim = simulation.trajectory, simulation.trim
    columns = {
        "time_s": trajectory.time_s,
        "sweep_left_rad": trajectory.sweep_left,
        "sweep_right_rad": trajectory.sweep_right,
        "phi_rad": trajectory.phi,
        "theta_rad": trajectory.theta,
        "psi_rad": trajectory.psi,
    }
    tips = {f"tip_{side}_z_m": trajectory.extra[f"tip_{side}_z"].tolist() for side in ("left", "right")}
    return {
        "label": each.label,
        "sample": {
            "name": each.name,
            "role": each.role,
            **{name: column.tolist() for name, column in columns.items()},
        },
        **tips,
        "altitude_m": (-trajectory.extra["z"]).tolist(),
        "trim": {"alpha_rad": float(trim.alpha[0]), "tip_z_m": tips["tip_left_z_m"][0]},
        "wall_s": wall_s,
    }
