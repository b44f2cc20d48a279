"""The operation ``simulate``: one flight of one model."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

from morphcore.export.flight_plots import flight_plots
from morphcore.export.shape_files import shape_files
from morphcore.simulate.flight import write_trajectory_csv
from morphcore.simulate.request import SimulationRun, simulation_from_document
from morphcore.simulate.trajectory import Trajectory
from worker.operations import Document, Outcome, Step, Stop
from worker.operations.library_work import result_file

NO_CHECKPOINT = b""


class SimulationWork:
    """A flight as work. It takes seconds and keeps no checkpoint; a restart gives the same trajectory."""

    def __init__(self, run: SimulationRun) -> None:
        self._run = run

    def steps(self, checkpoint: bytes | None, stop: Stop) -> Iterator[Step]:
        """Fly from the start, regardless of earlier attempts."""
        again = "" if checkpoint is None else ", restarted from the beginning"
        for step in self._run.steps(stop=stop):
            progress = {"fraction": step.fraction, "phase": "flight", "message": f"{step.message}{again}"}
            yield Step(progress, NO_CHECKPOINT)

    def outcome(
        self,
        checkpoint: bytes,  # noqa: ARG002 - the flight is in the run
        *,
        files: bool = True,
    ) -> Outcome:
        """Return the flight, with its tables and its plot if wanted."""
        result = self._run.result()
        document = result.to_document()
        if not files:
            return Outcome(document, result_file(document))
        shape = result.simulation.shape
        written = {"flight.csv": _table(result.trajectory), **flight_plots(document)}
        written |= {} if shape is None else shape_files(shape)
        return Outcome(document, {**result_file(document), **written})

    def best_so_far(self, checkpoint: bytes) -> None:  # noqa: ARG002 - as above
        """Return None: half a flight is not a result."""
        return


def begin(request: Document, threads: int) -> SimulationWork:
    """Check the request and prepare the flight."""
    return SimulationWork(simulation_from_document(request, threads=threads))


def _table(flown: Trajectory) -> bytes:
    """Return the flight as CSV with the columns of a sample, so that it can be used as one."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "flight.csv"
        write_trajectory_csv(flown, path)
        return path.read_bytes()
