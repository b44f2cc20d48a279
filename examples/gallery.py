"""Aircraft of several kinds, each identified from flights of its flexible model. Run by ``make gallery``.

Each folder in ``aircraft/`` has an aircraft, a flight condition, the morphs that are flown (``morphs.json``),
the sample flights that the flexible model made of them, and a picture. Without arguments the flights are
read and an equivalent model is identified for each aircraft, its number of links chosen from the flights;
the held-out flight judges it. With ``--fly`` flights and pictures are made anew.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from rich.console import Console
from rich.table import Table

from morphcore import identify, load_aircraft, load_flight, load_trajectory, simulate
from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.models.flexible import FlexibleModel, flexible_model
from morphcore.simulate.flexible import FlexibleFlight
from morphcore.simulate.flexible_start import start_flexible
from morphcore.simulate.flight import write_trajectory_csv
from morphcore.simulate.schedule import Hold
from morphcore.simulate.time_grid import TimeGrid
from morphdata.schedules import Schedules

FOLDER = Path(__file__).resolve().parent / "aircraft"


def morphs(folder: Path) -> dict[str, dict[str, Any]]:
    """Read the morphs of an aircraft, by role and name."""
    return dict(json.loads((folder / "morphs.json").read_text("utf-8")))


def fly(folder: Path) -> None:
    """Fly the morphs of an aircraft with its flexible model, and draw its trimmed shape."""
    aircraft, flight = load_aircraft(folder / "aircraft.json"), load_flight(folder / "flight.json")
    for flights in morphs(folder).values():
        for name, given in flights.items():
            flown = simulate(
                aircraft,
                flight,
                Schedules.parse(given["schedules"]),
                model="flexible",
                duration_s=given["duration_s"],
                output_step_s=given["duration_s"] / 150,
                channels=["tip_z"],
            )
            write_trajectory_csv(flown.trajectory, folder / f"{name}.csv")
            for warning in flown.warnings:
                print(f"  {folder.name}, {name}: {warning.message}")
    draw(Aircraft.of(aircraft), Flight.of(flight), folder / "picture.svg")


def outlines(model: FlexibleModel) -> list[np.ndarray[Any, Any]]:
    """Corners (rows, strips, 3) of each surface's lattice in trim, in B, m."""
    flown = FlexibleFlight(model)
    held = [Hold(part.angle_rad) for part in model.aircraft.moved_parts]
    _, found = start_flexible(flown, held, TimeGrid(0.0, 0.01, 1, None), model.flight.wind_N, "trim")
    state = found.state
    flown.structure(state.poses, state.V, state.A)
    flown.place_lattice(state.poses, model.flight.wind_N, state.V)
    corners, first = flown.lattice.at.corners, 0
    shapes = []
    for part in model.lattice.lattices:
        shape = part.ring_corners_W.shape
        count = shape[0] * shape[1]
        shapes.append(corners[first : first + count].reshape(shape).copy())
        first += count
    return shapes


def draw(aircraft: Aircraft, flight: Flight, path: Path) -> None:
    """Draw the trimmed aircraft from above and from the front."""
    model = flexible_model(aircraft, flight)
    figure = Figure(figsize=(7.0, 5.0))
    above, front = figure.subplots(2, 1, gridspec_kw={"height_ratios": [2, 1]})
    for shape in outlines(model):
        edge = np.concatenate([shape[0], shape[::-1, -1][:1], shape[-1, ::-1], shape[:1, 0]])
        above.fill(edge[:, 1], edge[:, 0], alpha=0.3, color="#0072B2")
        above.plot(edge[:, 1], edge[:, 0], color="#0072B2", linewidth=0.8)
        front.plot(shape[0, :, 1], -shape[0, :, 2], color="#0072B2", linewidth=1.2)
    for axes, label in ((above, "forward, m"), (front, "up, m")):
        axes.set_aspect("equal", adjustable="datalim")
        axes.set_ylabel(label, fontsize=9)
        axes.grid(visible=True, linewidth=0.4, color="0.88")
    front.set_xlabel("to the right, m", fontsize=9)
    above.set_title(f"{aircraft.name}, trimmed", fontsize=10)
    FigureCanvasSVG(figure).print_svg(path, metadata={"Date": None})


def judged(folder: Path) -> list[str]:
    """Identify a model of one aircraft; give its row of the table."""
    begun = time.monotonic()
    aircraft, flight = load_aircraft(folder / "aircraft.json"), load_flight(folder / "flight.json")
    samples = [
        load_trajectory(folder / f"{name}.csv", role=role)  # type: ignore[arg-type]
        for role, flights in morphs(folder).items()
        for name in flights
    ]
    result = identify(aircraft, flight, samples, links_per_wing="auto").to_document()
    held_out = [fit for fit in result["fit"] if fit["role"] == "held_out"]
    worst = max(fit["J_identified"] / fit["J_rigid"] for fit in held_out)
    largest = max(max(fit["max_abs_rad"].values()) for fit in held_out)
    return [
        folder.name,
        str(result["model"]["links_per_wing"]),
        f"{worst:.1e}",
        f"{1e3 * largest:.2f}",
        result["verdict"]["grade"],
        f"{time.monotonic() - begun:.0f}",
    ]


def main() -> int:
    """Fly or judge all aircraft, or those named on the command line."""
    names = [word for word in sys.argv[1:] if word != "--fly"]
    folders = [FOLDER / name for name in names] or sorted(
        path.parent for path in FOLDER.glob("*/aircraft.json")
    )
    if "--fly" in sys.argv:
        for folder in folders:
            fly(folder)
        return 0
    table = Table(title="Equivalent models judged by the flights held out")
    for title in ("aircraft", "links", "J / J rigid", "largest error, mrad", "verdict", "s"):
        table.add_column(title, justify="left" if title in ("aircraft", "verdict") else "right")
    for folder in folders:
        table.add_row(*judged(folder))
    Console().print(table)
    return 0


if __name__ == "__main__":
    sys.exit(main())
