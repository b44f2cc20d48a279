"""``morphid bench``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from morphid.commands import options
from morphid.exits import CommandError, Exit
from morphid.interrupt import first_interrupt
from morphid.screen import print_json, reports_errors, stdout


@reports_errors
def bench(
    quick: Annotated[bool, typer.Option("--quick", help="A minute or two instead of several.")] = False,
    only: Annotated[
        list[str] | None, typer.Option(help="Measure this alone, such as batch, mujoco, memory; repeat.")
    ] = None,
    samples: Annotated[
        Path | None, typer.Option(help="Folder with aircraft.json, flight.json and the example flights.")
    ] = None,
    as_json: options.AsJson = False,
) -> None:
    """Benchmark this machine and compare each figure with its requirement."""
    from worker import numerics

    _require_checkout()
    numerics.prepare_environment(numerics.usable_cores())
    from benchmarks.run import run_benchmarks
    from benchmarks.table import benchmark_table
    from morphcore.errors import MorphError
    from morphcore.stopping import Interrupted, stoppable

    try:
        with first_interrupt() as interrupted, stoppable(interrupted):
            figures: dict[str, Any] = run_benchmarks(quick, samples_dir=samples, sections=only or None)
    except (Interrupted, KeyboardInterrupt):  # the second: pressed twice
        raise CommandError(
            "stopped",
            code=Exit.INTERRUPTED,
            hint="there are no figures yet: compared figures are measured in alternation",
        ) from None
    except MorphError as error:
        raise CommandError(error.message, code=Exit.INVALID_INPUT, hint=error.hint) from None
    if as_json:
        print_json(figures)
        return
    for what, value, must in benchmark_table(figures):
        stdout().print(f"{what:<78} {value:<26} {must}".rstrip(), markup=False, soft_wrap=True)


def _require_checkout() -> None:
    """Make the folder `benchmarks` of a checkout importable; the installed package has none."""
    root = Path(__file__).resolve().parents[2]
    if not (root / "benchmarks" / "run.py").is_file():
        raise CommandError(
            "the benchmarks are not part of the installed package",
            code=Exit.ENVIRONMENT,
            hint="run `make bench` in a checkout of MorphID's source",
        )
    if str(root) not in sys.path:
        sys.path.append(str(root))
