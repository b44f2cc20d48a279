"""The ``morphid`` command. Every command imports what it needs when it runs, so `jobs ls` loads no numba.

Exit codes: 0 done; 1 the job failed; 2 wrong usage; 3 an input is missing or refused; 4 the job was
cancelled or ran out of time (a partial result may be there); 5 no service answers; 6 this machine lacks
a port, a program or a writable directory; 130 Ctrl-C.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from cli.exits import CommandError, Exit
from cli.screen import (
    exit_for,
    fit_table,
    jobs_table,
    meter,
    model_table,
    print_json,
    reports_errors,
    stderr,
    stdout,
)

EXIT_CODES = (
    "Exit codes: 0 done, 1 failed, 2 wrong usage, 3 input refused, 4 cancelled or out of time, 5 no service, "
    "6 machine not ready, 130 Ctrl-C."
)

app = typer.Typer(
    name="morphid",
    help="Fast equivalent models of sweep-morphing flexible aircraft, identified from sample flights.",
    epilog=EXIT_CODES,
    no_args_is_help=True,
    pretty_exceptions_show_locals=False,
)
jobs = typer.Typer(help="Look after the jobs of a service.", no_args_is_help=True, epilog=EXIT_CODES)
database = typer.Typer(help="Migrate the database.", no_args_is_help=True)
app.add_typer(jobs, name="jobs")
app.add_typer(database, name="db")

DEFAULT_URL = "http://127.0.0.1:8000"
Url = Annotated[str, typer.Option(envvar="MORPHID_URL", help="Address of the service.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON for machines.")]
JobId = Annotated[str, typer.Argument(metavar="JOB", help="Id of the job.")]


@app.command(epilog=EXIT_CODES)
@reports_errors
def serve(
    host: Annotated[str, typer.Option(help="Address the API listens on.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port of the API; 0 takes a free one.")] = 8000,
    workers: Annotated[int, typer.Option(min=1, max=64, help="Jobs that run at once.")] = 1,
    data_dir: Annotated[Path, typer.Option(help="Database, queue and logs.")] = Path("var"),
    as_json: AsJson = False,
) -> None:
    """Run API, worker and broker on this machine until Ctrl-C."""
    from cli.serve import ServeOptions
    from cli.serve import serve as run

    run(ServeOptions(host=host, port=port, workers=workers, data_dir=data_dir, json_events=as_json))


@app.command(epilog=EXIT_CODES)
@reports_errors
def identify(
    aircraft: Annotated[Path, typer.Option(help="Aircraft, JSON.")],
    flight: Annotated[Path, typer.Option(help="Flight condition, JSON.")],
    sample: Annotated[list[Path], typer.Option(help="Sample flight to fit, CSV; repeat.")],
    held_out: Annotated[
        list[Path] | None, typer.Option(help="Sample flight to predict, not to fit; repeat.")
    ] = None,
    links: Annotated[int, typer.Option(min=1, max=8, help="Links per wing.")] = 3,
    method: Annotated[str | None, typer.Option(help="hybrid, pso or least_squares.")] = None,
    seed: Annotated[int | None, typer.Option(min=0, help="Same seed, same answer.")] = None,
    particles: Annotated[int | None, typer.Option(min=2, help="Swarm size.")] = None,
    generations: Annotated[int | None, typer.Option(min=1, help="Swarm generations.")] = None,
    max_seconds: Annotated[
        float | None, typer.Option(min=1.0, help="Stop searching after this long.")
    ] = None,
    url: Annotated[
        str | None, typer.Option(help="Identify at this service instead of in this process.")
    ] = None,
    json_out: Annotated[
        Path | None, typer.Option("--json", help="Write the result to this file; `-` prints it.")
    ] = None,
    plots: Annotated[Path | None, typer.Option(help="Write plots and curves into this folder.")] = None,
) -> None:
    """Identify an equivalent model from sample flights."""
    from cli.identification import Inputs, identify_here, identify_there, save_files

    search = {
        "method": method,
        "seed": seed,
        "particles": particles,
        "generations": generations,
        "max_seconds": max_seconds,
    }
    inputs = Inputs(
        aircraft=aircraft,
        flight=flight,
        samples=sample,
        held_out=held_out or [],
        model={"links_per_wing": links},
        search={key: value for key, value in search.items() if value is not None},
    )
    with meter() as bar:
        if url is None:
            answer = identify_here(inputs, bar)
        else:
            from cli.service import Service

            with Service(url) as service:
                answer = identify_there(inputs, service, bar)
    if answer.error is not None:
        _print_error(answer.error)
    if answer.result is not None:
        _show_result(answer.result, json_out)
    if plots is not None:
        for path in save_files(answer.files, plots):
            stderr().print(f"wrote {path}", markup=False)
    raise typer.Exit(int(answer.exit))


@app.command()
@reports_errors
def bench(
    quick: Annotated[bool, typer.Option("--quick", help="Half a minute instead of some.")] = False,
    samples: Annotated[
        Path | None, typer.Option(help="Folder with aircraft.json, flight.json and the example flights.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Measure this machine: speed of the batch, of the lattice, of the identification."""
    from worker import numerics

    numerics.prepare_environment(numerics.usable_cores())
    from morphcore.bench import benchmark_table, run_benchmarks
    from morphcore.errors import MorphError

    try:
        figures: dict[str, Any] = run_benchmarks(quick, samples_dir=samples)
    except MorphError as error:
        raise CommandError(error.message, code=Exit.INVALID_INPUT, hint=error.hint) from None
    if as_json:
        print_json(figures)
        return
    for what, value in benchmark_table(figures):
        stdout().print(f"{what:<60} {value}", markup=False)


@jobs.command("ls")
@reports_errors
def list_jobs(
    status: Annotated[str | None, typer.Option(help="Only jobs in this state.")] = None,
    limit: Annotated[int, typer.Option(min=1, max=100, help="At most so many.")] = 20,
    url: Url = DEFAULT_URL,
    as_json: AsJson = False,
) -> None:
    """List jobs, the newest first."""
    from cli.service import Service

    with Service(url) as service:
        found = service.jobs(status=status, limit=limit)
    if as_json:
        print_json(found)
    else:
        stdout().print(jobs_table(found))


@jobs.command("show")
@reports_errors
def show_job(job: JobId, url: Url = DEFAULT_URL, as_json: AsJson = False) -> None:
    """Show one job, and its result when there is one."""
    from cli.service import Service

    with Service(url) as service:
        found = service.job(job)
        has_result = found["status"] == "succeeded" or found.get("partial")
        result = service.result(job) if has_result else None
    if as_json:
        print_json({**found, "result": result})
        return
    stdout().print(jobs_table([found]))
    if found.get("error"):
        _print_error(found["error"])
    if result is not None and "fit" in result:
        stdout().print(fit_table(result))


@jobs.command("watch")
@reports_errors
def watch_job(job: JobId, url: Url = DEFAULT_URL, as_json: AsJson = False) -> None:
    """Follow a job to its end; the exit code tells how it ended. With --json, one line per change."""
    import json

    from cli.service import Service

    last: dict[str, Any] = {}
    with Service(url) as service, meter() as bar:
        for seen in service.watch(job):
            if as_json and seen != last:
                stdout().print(json.dumps(seen), markup=False, soft_wrap=True)
            elif not as_json:
                bar.show(seen.get("progress"), seen["status"])
            last = seen
    if not as_json:
        stdout().print(jobs_table([last]))
        if last.get("error"):
            _print_error(last["error"])
    raise typer.Exit(int(exit_for(last["status"])))


@jobs.command("cancel")
@reports_errors
def cancel_job(job: JobId, url: Url = DEFAULT_URL, as_json: AsJson = False) -> None:
    """Ask for a job's end; what it found so far is kept."""
    from cli.service import Service

    with Service(url) as service:
        found = service.cancel(job)
    if as_json:
        print_json(found)
    else:
        stdout().print(jobs_table([found]))


@database.command("upgrade")
@reports_errors
def upgrade_database(revision: Annotated[str, typer.Argument()] = "head") -> None:
    """Migrate the database (MORPHID_DATABASE_URL) up."""
    from cli.migrate import configured_url, upgrade_to

    upgrade_to(configured_url(), revision)


@database.command("downgrade")
@reports_errors
def downgrade_database(revision: Annotated[str, typer.Argument(help="`base` empties the database.")]) -> None:
    """Migrate the database (MORPHID_DATABASE_URL) down."""
    from cli.migrate import configured_url, downgrade_to

    downgrade_to(configured_url(), revision)


def _show_result(result: dict[str, Any], json_out: Path | None) -> None:
    import json

    if json_out is not None and str(json_out) == "-":
        print_json(result)
        return
    if json_out is not None:
        try:
            json_out.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
        except OSError as error:
            raise CommandError(
                f"{json_out} cannot be written: {error.strerror}", code=Exit.ENVIRONMENT
            ) from None
        stderr().print(f"wrote {json_out}", markup=False)
    stdout().print(fit_table(result))
    stdout().print(model_table(result))


def _print_error(error: dict[str, Any]) -> None:
    where = f"{error['pointer']}: " if error.get("pointer") else ""
    detail = error.get("detail") or error.get("message") or ""
    hint = f" ({error['hint']})" if error.get("hint") else ""
    stderr().print(
        f"error {error.get('code', '')}: {where}{detail}{hint}", style="red", markup=False, soft_wrap=True
    )


if __name__ == "__main__":
    app()
