"""``morphid jobs``: manage the jobs of a service."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

from morphid.commands import options
from morphid.commands.operations import particulars_of
from morphid.connections import DEFAULT_URL
from morphid.exits import Exit
from morphid.screen import (
    exit_for,
    jobs_table,
    meter,
    print_job_error,
    print_json,
    print_json_line,
    progress_detail,
    reports_errors,
    stdout,
)

if TYPE_CHECKING:
    from morphid.service import Service

JobId = Annotated[str, typer.Argument(metavar="JOB", help="Id of the job.")]

jobs = typer.Typer(help="Manage the jobs of a service.", no_args_is_help=True, epilog=options.EXIT_CODES)


@jobs.command("ls")
@reports_errors
def list_jobs(
    status: Annotated[str | None, typer.Option(help="Only jobs in this state.")] = None,
    limit: Annotated[int, typer.Option(min=1, max=100, help="Maximum number shown.")] = 20,
    url: options.Url = DEFAULT_URL,
    api_key: options.ApiKey = None,
    as_json: options.AsJson = False,
) -> None:
    """List jobs, the newest first."""
    from morphid.service import Service

    with Service(url, api_key) as service:
        found = service.jobs(status=status, limit=limit)
    if as_json:
        print_json(found)
    else:
        stdout().print(jobs_table(found))


@jobs.command("show")
@reports_errors
def show_job(
    job: JobId,
    url: options.Url = DEFAULT_URL,
    api_key: options.ApiKey = None,
    as_json: options.AsJson = False,
) -> None:
    """Show one job, and its result if there is one."""
    from morphid.service import Service

    with Service(url, api_key) as service:
        found = service.job(job)
        has_result = found["status"] == "succeeded" or found.get("partial")
        result = service.result(job) if has_result else None
    if as_json:
        print_json({**found, "result": result})
        return
    stdout().print(jobs_table([found]))
    detail = progress_detail(found.get("progress") or {})
    if detail:
        stdout().print(detail, markup=False)
    if found.get("error"):
        print_job_error(found["error"])
    if result is not None:
        particulars_of(found["operation"]).show(result)


@jobs.command("watch")
@reports_errors
def watch_job(
    job: JobId,
    url: options.Url = DEFAULT_URL,
    api_key: options.ApiKey = None,
    as_json: options.AsJson = False,
) -> None:
    """Follow a job to its end; the exit code is that of its outcome. With --json, one line per change."""
    from morphid.service import Service

    with Service(url, api_key) as service:
        _follow(service, job, as_json=as_json)


def _follow(service: Service, job: str, *, as_json: bool) -> NoReturn:
    """Show a job until it has ended, and exit with the code of its outcome."""
    last: dict[str, Any] = {}
    with meter() as bar:
        for seen in service.watch(job):
            if as_json:
                if seen != last and not print_json_line(seen):
                    raise typer.Exit(int(Exit.OK))  # the reader has left, as with `| head`
            else:
                bar.show(seen.get("progress"), seen["status"])
            last = seen
    if not as_json:
        stdout().print(jobs_table([last]))
        if last.get("error"):
            print_job_error(last["error"])
    raise typer.Exit(int(exit_for(last["status"])))


@jobs.command("rerun")
@reports_errors
def rerun_job(
    job: JobId,
    changes: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="POINTER=VALUE",
            help="Change a value of the request: `--set /search/seed=2`; repeatable. VALUE is JSON, or text.",
        ),
    ] = None,
    watch: Annotated[bool, typer.Option("--watch", help="Follow the new job to its end.")] = False,
    url: options.Url = DEFAULT_URL,
    api_key: options.ApiKey = None,
    as_json: options.AsJson = False,
) -> None:
    """Post a job's request again, unchanged or with changes, and print the new job's id."""
    from morphid.request import changed
    from morphid.service import Service

    with Service(url, api_key) as service:
        operation = service.job(job)["operation"]
        request = changed(service.request(job), changes or [])
        made = service.submit(operation, request)
        if as_json and not watch:
            print_json(made)
        elif not as_json:
            stdout().print(made["id"], markup=False)
        if watch:
            _follow(service, made["id"], as_json=as_json)


@jobs.command("cancel")
@reports_errors
def cancel_job(
    job: JobId,
    url: options.Url = DEFAULT_URL,
    api_key: options.ApiKey = None,
    as_json: options.AsJson = False,
) -> None:
    """Cancel a job; its best result so far is kept."""
    from morphid.service import Service

    with Service(url, api_key) as service:
        found = service.cancel(job)
    if as_json:
        print_json(found)
    else:
        stdout().print(jobs_table([found]))
