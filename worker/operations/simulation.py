"""The operation ``simulate``: one flight of one model."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

from morphcore.export.flight_plots import flight_plots
from morphcore.simulate.flight import write_trajectory_csv
from morphcore.simulate.request import SimulationRun, simulation_from_document
from morphcore.simulate.trajectory import Trajectory
from worker.operations import Document, Outcome, Step, Stop
from worker.operations.library_work import library_errors, result_file

NOTHING_TO_GO_ON_FROM = b""


class SimulationWork:
    """A flight as the runner sees it.

    It takes seconds and keeps no checkpoint: begun again it flies from the start, to the same trajectory.

    Parameters
    ----------
    run : the library's flight.
    """

    def __init__(self, run: SimulationRun) -> None:
        self._run = run

    def steps(self, checkpoint: bytes | None, stop: Stop) -> Iterator[Step]:
        """Fly from the start, whatever an earlier attempt has left."""
        again = "" if checkpoint is None else ", restarted from the beginning"
        with library_errors():
            for step in self._run.steps(stop=stop):
                yield Step(
                    progress={
                        "fraction": step.fraction,
                        "phase": "flight",
                        "message": f"{step.message}{again}",
                    },
                    checkpoint=NOTHING_TO_GO_ON_FROM,
                )

    def outcome(self, checkpoint: bytes) -> Outcome:  # noqa: ARG002 - the flight is in the run
        """Give the flight with its table and its picture."""
        with library_errors():
            result = self._run.result()
        document = result.to_document()
        return Outcome(
            document,
            {
                **result_file(document),
                "flight.csv": _table(result.trajectory),
                **flight_plots(document),
            },
        )

    def best_so_far(self, checkpoint: bytes) -> None:  # noqa: ARG002 - as above
        """Give nothing: half a flight is no result."""
        return


def begin(request: Document, threads: int) -> SimulationWork:
    """Check the request and prepare the flight.

    Raises
    ------
    WorkRefused : the request cannot be flown.
    """
    with library_errors():
        return SimulationWork(simulation_from_document(request, threads=threads))


def _table(flown: Trajectory) -> bytes:
    """The flight as CSV with the columns of a sample, so that it can be one."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "flight.csv"
        write_trajectory_csv(flown, path)
        return path.read_bytes()
