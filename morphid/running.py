"""Runs an operation in this process or at a service, and outputs its result.

All operations follow the same pattern: a request document goes in, progress is shown, the first Ctrl-C
requests the best result so far, a result and its files come out.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NoReturn

import typer

from morphdata.drives import Drive
from morphdata.faults import InvalidInput, MorphError
from morphdata.operations import operation_named
from morphdata.samplefiles.declared import NOTHING, Declared, declared
from morphdata.samples import Role, load_sample
from morphid.connections import at_service_of_environment
from morphid.exits import CommandError, Exit
from morphid.files import STANDARD_OUTPUT, require_file, save_files, write_json
from morphid.interrupt import first_interrupt
from morphid.request import Document, Request, aircraft_drives
from morphid.screen import Meter, exit_for, meter, print_job_error, print_json, print_warnings, stderr
from morphid.service import Service


@dataclass(frozen=True)
class Answer:
    """The outcome of an operation.

    Parameters
    ----------
    exit : how it ended.
    result : the result document; None if there is none.
    files : plots and curves, by name.
    error : the error document of a failure.
    """

    exit: Exit
    result: Document | None
    files: Mapping[str, bytes] = field(default_factory=dict)
    error: Document | None = None


def run(request: Request, url: str | None, api_key: str | None = None, *, files: bool) -> Answer:
    """Run the operation, at the service of this address or in this process; print errors on the way.

    An error names the option at fault. ``files``: whether plots and curves are wanted; they take seconds.
    """
    if at_service_of_environment(url):
        stderr().print(f"at {url} (MORPHID_URL)", markup=False, soft_wrap=True)
    try:
        with meter() as bar:
            if url is None:
                answer = run_here(request, bar, files=files)
            else:
                with Service(url, api_key) as service:
                    answer = run_there(request, service, bar, files=files)
    except CommandError as error:
        error.given_by = error.given_by or request.option_at(error.pointer)
        raise
    if answer.error is not None:
        print_job_error(answer.error, request.option_at(str(answer.error.get("pointer") or "")))
    return answer


def run_here(request: Request, bar: Meter, *, files: bool) -> Answer:
    """Run in this process; the first Ctrl-C ends it with the best result so far."""
    from worker import numerics

    drives = aircraft_drives(request)
    said = declared(**request.said)
    body = request.body(lambda path, role: sample_document(path, role, drives, said))
    require_valid(request.operation, body)  # before the library is loaded, which takes seconds
    bar.note("loading the library")
    threads = numerics.usable_cores()
    numerics.prepare_environment(threads)
    from morphcore.stopping import Interrupted, listening
    from worker.operations import find_operation
    from worker.progress import Pace

    checkpoint: bytes | None = None
    pace = Pace(time.monotonic)
    try:
        work = find_operation(request.operation)(body, threads)
        with first_interrupt() as interrupted, listening(bar.note):
            try:
                for step in work.steps(None, interrupted):
                    checkpoint = step.checkpoint
                    bar.show(pace.progress(step))
            except Interrupted:
                best = None if checkpoint is None else work.best_so_far(checkpoint)
                if best is None:
                    return Answer(exit=Exit.INTERRUPTED, result=None)
                partial = {**best.document, "partial": True}
                return Answer(exit=Exit.INTERRUPTED, result=partial, files=best.artifacts)
            if checkpoint is None:
                raise CommandError(f"{request.operation} ended without a step")
            outcome = work.outcome(checkpoint, files=files)
        return Answer(exit=Exit.OK, result=outcome.document, files=outcome.artifacts)
    except MorphError as error:
        raise CommandError(
            error.message, code=Exit.INVALID_INPUT, hint=error.hint, pointer=error.pointer
        ) from None


def require_valid(operation: str, body: Document) -> None:
    """Refuse an invalid request, with its first fault and one line for each further fault."""
    try:
        operation_named(operation).request.parse(body)
    except InvalidInput as error:
        first, *others = error.faults
        hint = "\n".join([first.hint, *(f"{f.pointer}: {f.detail} ({f.hint})" for f in others)])
        raise CommandError(
            first.detail, code=Exit.INVALID_INPUT, hint=hint.strip(), pointer=first.pointer
        ) from None


def run_there(request: Request, service: Service, bar: Meter, *, files: bool) -> Answer:
    """Run at a service: upload the samples, post the job, watch it; Ctrl-C cancels it."""

    def uploaded(path: Path, role: Role) -> Document:
        require_file(path)
        try:
            flight = service.upload(path, request.said)
        except CommandError as error:
            error.given_by = str(path)
            raise
        return {"name": path.stem, "role": role, "trajectory_id": flight["id"]}

    job = service.submit(request.operation, request.body(uploaded))
    with first_interrupt() as interrupted:
        cancelled = False
        for seen in service.watch(job["id"]):
            job = seen
            bar.show(job.get("progress"), job["status"])
            if interrupted() and not cancelled:
                service.cancel(job["id"])
                cancelled = True
    result = service.result(job["id"]) if job["status"] == "succeeded" or job.get("partial") else None
    return Answer(
        exit=Exit.INTERRUPTED if cancelled else exit_for(job["status"]),
        result=result,
        files=service.artifacts(job["id"]) if files else {},
        error=job.get("error"),
    )


def hand_over(
    answer: Answer, show: Callable[[Mapping[str, Any]], None], *, json_out: Path | None, plots: Path | None
) -> NoReturn:
    """Save the result and its files as requested, show the result, and exit with the answer's code.

    Parameters
    ----------
    show : prints a result in readable form.
    json_out : file of the result; ``-`` prints it instead of the tables.
    plots : folder of plots and curves.
    """
    if answer.result is not None:
        if answer.result.get("partial"):
            stderr().print("stopped early: this is the best result so far")
        if json_out == STANDARD_OUTPUT:
            print_json(answer.result)
        else:
            if json_out is not None:
                write_json(answer.result, json_out)
                wrote(json_out)
            show(answer.result)
        print_warnings(answer.result)
    if plots is not None:
        for path in save_files(answer.files, plots):
            wrote(path)
    raise typer.Exit(int(answer.exit))


def wrote(path: Path) -> None:
    """Report a written file."""
    stderr().print(f"wrote {path}", markup=False, soft_wrap=True)


def sample_document(
    path: Path, role: Role, drives: Mapping[str, Drive] | None = None, said: Declared = NOTHING
) -> Document:
    """Read a sample file and give it as it stands inline in a request.

    Parameters
    ----------
    drives : of the aircraft, where it is one.
    said : what the user declares about sample files.
    """
    require_file(path)
    try:
        return load_sample(path, role, drives, said).model_dump(exclude_defaults=True) | {"role": role}
    except InvalidInput as error:
        raise CommandError(error.message, code=Exit.INVALID_INPUT, hint=error.hint) from None
