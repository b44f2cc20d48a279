"""``morphid identify``: build the request, run it here or at a service, save what comes out."""

from __future__ import annotations

import json
import signal
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType
from typing import Any

from cli.exits import CommandError, Exit
from cli.screen import Meter, exit_for
from cli.service import Service

Document = dict[str, Any]


@dataclass(frozen=True)
class Inputs:
    """The files and choices of one identification.

    Parameters
    ----------
    aircraft, flight : JSON files.
    samples, held_out : sample files to fit, and to predict only.
    model, search : those parts of the request that the user chose.
    """

    aircraft: Path
    flight: Path
    samples: Sequence[Path]
    held_out: Sequence[Path]
    model: Document = field(default_factory=dict)
    search: Document = field(default_factory=dict)

    def documents(self) -> Document:
        """Give the request without its samples."""
        return {
            "aircraft": read_json(self.aircraft),
            "flight": read_json(self.flight),
            "model": self.model,
            "search": self.search,
        }

    def roles(self) -> Iterator[tuple[Path, str]]:
        """Give each sample file with its role."""
        yield from ((path, "train") for path in self.samples)
        yield from ((path, "held_out") for path in self.held_out)


@dataclass(frozen=True)
class Answer:
    """What an identification gave.

    Parameters
    ----------
    exit : how it ended.
    result : the result document, None when there is none.
    files : plots and curves, by name.
    error : why it failed, in the service's words.
    """

    exit: Exit
    result: Document | None
    files: Mapping[str, bytes] = field(default_factory=dict)
    error: Document | None = None


def identify_here(inputs: Inputs, meter: Meter) -> Answer:
    """Identify in this process; the first Ctrl-C ends it with the best so far."""
    from worker import numerics

    numerics.prepare_environment(numerics.usable_cores())
    from worker.operations import WorkInterrupted, WorkRefused
    from worker.operations.identification import begin
    from worker.progress import Pace

    request = inputs.documents()
    try:
        request["samples"] = [sample_document(path, role) for path, role in inputs.roles()]
        work = begin(request, numerics.usable_cores())
        pace, checkpoint = Pace(time.monotonic), None
        with _first_interrupt() as interrupted:
            try:
                for step in work.steps(None, interrupted):
                    checkpoint = step.checkpoint
                    meter.show(pace.progress(step))
            except WorkInterrupted:
                if checkpoint is None:
                    return Answer(exit=Exit.INTERRUPTED, result=None)
                best = work.best_so_far(checkpoint)
                return Answer(
                    exit=Exit.INTERRUPTED, result={**best.document, "partial": True}, files=best.artifacts
                )
            if checkpoint is None:
                raise CommandError("the identification ended without a step")
            outcome = work.outcome(checkpoint)
        return Answer(exit=Exit.OK, result=outcome.document, files=outcome.artifacts)
    except WorkRefused as error:
        raise CommandError(
            error.detail, code=Exit.INVALID_INPUT, hint=error.hint, pointer=error.pointer
        ) from None


def identify_there(inputs: Inputs, service: Service, meter: Meter) -> Answer:
    """Identify at a service: upload the samples, post the job, watch it; Ctrl-C cancels it."""
    request = inputs.documents()
    request["samples"] = [
        {"name": path.stem, "role": role, "trajectory_id": service.upload(path)["id"]}
        for path, role in inputs.roles()
    ]
    job = service.submit("identify", request)
    with _first_interrupt() as interrupted:
        cancelled = False
        for seen in service.watch(job["id"]):
            job = seen
            meter.show(job.get("progress"), job["status"])
            if interrupted() and not cancelled:
                service.cancel(job["id"])
                cancelled = True
    result = service.result(job["id"]) if job["status"] == "succeeded" or job.get("partial") else None
    return Answer(
        exit=Exit.INTERRUPTED if cancelled else exit_for(job["status"]),
        result=result,
        files=service.artifacts(job["id"]),
        error=job.get("error"),
    )


def sample_document(path: Path, role: str) -> Document:
    """Read a sample file and give it as it stands inline in a request."""
    from morphcore import load_trajectory
    from morphcore.errors import MorphError

    _must_exist(path)
    try:
        trajectory = load_trajectory(path)
    except MorphError as error:
        raise CommandError(error.message, code=Exit.INVALID_INPUT, hint=error.hint) from None
    return {
        "name": path.stem,
        "role": role,
        "time_s": trajectory.time_s.tolist(),
        "sweep_left_rad": trajectory.sweep_left.tolist(),
        "sweep_right_rad": trajectory.sweep_right.tolist(),
        "phi_rad": trajectory.phi.tolist(),
        "theta_rad": trajectory.theta.tolist(),
        "psi_rad": trajectory.psi.tolist(),
    }


def read_json(path: Path) -> Any:
    """Read a JSON file.

    Raises
    ------
    CommandError : it is missing or is not JSON; the sentence names the file.
    """
    _must_exist(path)
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise CommandError(f"{path} cannot be read: {error}", code=Exit.INVALID_INPUT) from None
    except json.JSONDecodeError as error:
        raise CommandError(
            f"{path} is not JSON: {error.msg} in line {error.lineno}", code=Exit.INVALID_INPUT
        ) from None


def save_files(files: Mapping[str, bytes], folder: Path) -> list[Path]:
    """Write plots and curves into a folder and give their paths."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        saved = []
        for name, content in files.items():
            target = folder / Path(name).name
            target.write_bytes(content)
            saved.append(target)
    except OSError as error:
        raise CommandError(f"{folder} cannot be written: {error.strerror}", code=Exit.ENVIRONMENT) from None
    return saved


def _must_exist(path: Path) -> None:
    if not path.is_file():
        raise CommandError(
            f"there is no file {path}", code=Exit.INVALID_INPUT, hint=f"looked in {Path.cwd()}"
        )


class _Interrupt:
    def __init__(self) -> None:
        self.seen = False

    def __call__(self) -> bool:
        return self.seen


@contextmanager
def _first_interrupt() -> Iterator[_Interrupt]:
    """Note the first Ctrl-C instead of dying of it; the second one kills as ever."""
    interrupt = _Interrupt()
    before = signal.getsignal(signal.SIGINT)

    def note(_number: int, _frame: FrameType | None) -> None:
        interrupt.seen = True
        signal.signal(signal.SIGINT, before)

    signal.signal(signal.SIGINT, note)
    try:
        yield interrupt
    finally:
        signal.signal(signal.SIGINT, before)
