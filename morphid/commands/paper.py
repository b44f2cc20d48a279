"""``morphid paper``."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.table import Table

from morphid.commands import options
from morphid.exits import CommandError, Exit
from morphid.files import writing
from morphid.interrupt import first_interrupt
from morphid.screen import meter, new_table, print_json, reports_errors, short, stdout

if TYPE_CHECKING:
    from morphcore.paper import StageRunner

VERDICTS = {True: "[green]met[/]", False: "[red]missed[/]", None: ""}


@reports_errors
def paper(
    out: Annotated[Path, typer.Option(help="Folder of the report; a stopped run continues there.")],
    quick: Annotated[bool, typer.Option("--quick", help="Everything at reduced size, in minutes.")] = False,
    seed: Annotated[
        int, typer.Option(min=0, help="Seed of all searches. The same seed gives the same figures.")
    ] = 1,
    core: Annotated[
        options.Core, typer.Option(help="Core of the vortices in all models.")
    ] = options.Core.LINE,
    samples: Annotated[
        Path | None,
        typer.Option(help="Folder with another program's flights; default: the examples, if available."),
    ] = None,
    threads: Annotated[int | None, typer.Option(min=1, help="Threads of the kernels.")] = None,
    as_json: options.AsJson = False,
) -> None:
    """Reproduce every table and figure of the paper, as one HTML report."""
    from worker import numerics

    count = threads or numerics.usable_cores()
    numerics.prepare_environment(count)
    from morphcore.errors import MorphError
    from morphcore.paper import PaperSettings, paper_runner, summary_document, write_report
    from morphcore.threads import use_threads

    use_threads(count)
    try:
        settings = PaperSettings(seed, quick, core.value, _samples(samples))
        with writing(out):
            runner = paper_runner(settings, out)
            _work_off(runner)
            report = write_report(settings, runner.finished, out)
    except MorphError as error:
        raise CommandError(
            error.message, code=Exit.INVALID_INPUT, hint=error.hint, pointer=error.pointer
        ) from None
    summary = summary_document(settings, runner.finished) | {"report": str(report)}
    if as_json:
        print_json(summary)
        return
    stdout().print(requirements_table(summary))
    stdout().print(f"report: {report}", markup=False, soft_wrap=True)


def _work_off(runner: StageRunner) -> None:
    """Run all stages under a progress bar; Ctrl-C keeps finished stages."""
    try:
        with meter() as bar, first_interrupt() as interrupted, closing(runner.steps()) as steps:
            for stage, progress in steps:
                bar.show({"fraction": progress.fraction, "phase": stage.title, "message": progress.message})
                if interrupted():
                    break
            else:
                return
    except KeyboardInterrupt:  # the second Ctrl-C, which does not wait for the end of the step
        pass
    raise CommandError(
        "stopped",
        code=Exit.INTERRUPTED,
        hint=f"run the same command again to continue; stages are in {runner.folder}",
    )


def _samples(folder: Path | None) -> Path | None:
    """The folder of another program's flights: as given, or that of the source tree's example flights."""
    if folder is None:
        folder = Path(__file__).resolve().parents[2] / "examples"
        return folder if (folder / "aircraft.json").is_file() else None
    if not (folder / "aircraft.json").is_file() or not (folder / "flight.json").is_file():
        raise CommandError(
            f"--samples {folder}: no aircraft.json and flight.json in it",
            code=Exit.INVALID_INPUT,
            hint="give a folder like examples/",
        )
    return folder


def requirements_table(summary: dict[str, Any]) -> Table:
    """Show every requirement next to what was measured."""
    title = f"Required and measured, seed {summary['seed']}, {summary['total_s']:.0f} s of work"
    table = new_table("figure", "required", "measured", "", title=title, wrapped=("figure",))
    for each in summary["asked"]:
        relation = "≥" if each["at_least"] else "≤"
        table.add_row(
            each["what"],
            f"{relation} {each['limit']:g} {each['unit']}".strip(),
            f"{short(each['value'])} {each['unit']}".strip(),
            VERDICTS[each["met"]],
        )
    return table
