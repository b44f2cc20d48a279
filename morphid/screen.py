"""Terminal output: tables, progress, errors. Progress and errors go to stderr, results to stdout."""

from __future__ import annotations

import functools
import json
import sys
import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, Literal, ParamSpec, TextIO, TypeVar

import typer
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Table

from morphid.exits import CommandError, Exit
from morphid.streams import Terminal, prepare_streams, silence

Document = Mapping[str, Any]
P = ParamSpec("P")
R = TypeVar("R")

LINE_EVERY_S = 5.0
LETTERS = {"phi": "φ", "theta": "θ", "psi": "ψ"}
STATUS_COLOURS = {
    "queued": "yellow",
    "running": "cyan",
    "cancelling": "yellow",
    "succeeded": "green",
    "failed": "red",
    "cancelled": "magenta",
    "expired": "red",
}


def stdout() -> Console:
    """Return the console for results."""
    prepare_streams()
    return Terminal(highlight=False)


def stderr() -> Console:
    """Return the console for progress and errors."""
    prepare_streams()
    return Terminal(stderr=True, highlight=False)


def print_json(document: object) -> None:
    """Print a document as JSON."""
    _write(sys.stdout, json.dumps(document, indent=1) + "\n")


def print_json_line(document: object) -> bool:
    """Print one of several documents as a JSON line, at once; False if the reader has left."""
    return _write(sys.stdout, json.dumps(document) + "\n")


def _write(stream: TextIO, text: str) -> bool:
    try:
        stream.write(text)
        stream.flush()
    except BrokenPipeError:
        silence(stream)
        return False
    return True


def reports_errors(command: Callable[P, R]) -> Callable[P, R]:
    """Print a command's error as a sentence (as JSON if the result would be JSON) and exit with its code."""

    @functools.wraps(command)
    def wrapped(*args: P.args, **kwargs: P.kwargs) -> R:
        try:
            return command(*args, **kwargs)
        except CommandError as error:
            refusal = error
        except ModuleNotFoundError as error:
            package = (error.name or "").partition(".")[0]
            refusal = CommandError(
                f"this command needs the package {package}, which is not installed",
                code=Exit.ENVIRONMENT,
                hint="pip install 'morphid[server]' brings all that the service and its tools need",
            )
        if kwargs.get("as_json") or str(kwargs.get("json_out")) == "-":
            _write(sys.stderr, json.dumps(refusal.to_document()) + "\n")
        else:
            _print_error(refusal)
        raise typer.Exit(int(refusal.code))

    return wrapped


def _print_error(error: CommandError) -> None:
    console = stderr()
    where = f"{error.pointer}: " if error.pointer else ""
    console.print(f"error: {where}{error.message}", style="red", markup=False, soft_wrap=True)
    for line in error.hint.splitlines():
        console.print(f"       {line}", markup=False, soft_wrap=True)
    if error.given_by:
        console.print(f"       given by {error.given_by}", markup=False, soft_wrap=True)


def print_job_error(error: Document, given_by: str = "") -> None:
    """Print why a job failed, and the option or file at fault if known."""
    where = f"{error['pointer']}: " if error.get("pointer") else ""
    detail = error.get("detail") or error.get("message") or ""
    hint = f" ({error['hint']})" if error.get("hint") else ""
    console = stderr()
    line = f"error {error.get('code', '')}: {where}{detail}{hint}"
    console.print(line, style="red", markup=False, soft_wrap=True)
    if given_by:
        console.print(f"       given by {given_by}", markup=False, soft_wrap=True)


def print_warnings(result: Document) -> None:
    """Print the warnings of a result with their hints."""
    for warning in result.get("warnings") or ():
        where = f"{warning['pointer']}: " if warning.get("pointer") else ""
        hint = f" ({warning['hint']})" if warning.get("hint") else ""
        line = f"warning {warning.get('code', '')}: {where}{warning.get('message', '')}{hint}"
        stderr().print(line, style="yellow", markup=False, soft_wrap=True)


class Meter:
    """A progress bar for a job's progress documents; without a terminal, an occasional line."""

    def __init__(self, progress: Progress) -> None:
        self._progress = progress
        self._task = progress.add_task("waiting", total=1.0, detail="")
        self._next_line_at = 0.0
        self._last_line = ""

    def note(self, message: str) -> None:
        """Show the current activity when there is no progress to show."""
        self._progress.update(self._task, description="preparing", detail=message)
        self._print("preparing", message)

    def show(self, progress: Document | None, status: str = "running") -> None:
        """Show one progress document."""
        if progress is None:
            self._progress.update(self._task, description=status)
            return
        fraction, phase = float(progress.get("fraction") or 0.0), str(progress.get("phase") or status)
        self._progress.update(
            self._task, completed=fraction, description=phase, detail=progress_detail(progress)
        )
        self._print(phase, f"{100.0 * fraction:3.0f} %  {progress_detail(progress)}")

    def _print(self, phase: str, detail: str) -> None:
        """Print an occasional line if there is no terminal."""
        line, console = f"{phase:<10} {detail}", self._progress.console
        if not console.is_terminal and line != self._last_line and time.monotonic() >= self._next_line_at:
            console.print(line, markup=False, soft_wrap=True)
            self._last_line = line
            self._next_line_at = time.monotonic() + LINE_EVERY_S


@contextmanager
def meter() -> Iterator[Meter]:
    """Show a progress bar on stderr while the block runs."""
    columns = (
        SpinnerColumn(),
        TextColumn("{task.description:<10}"),
        BarColumn(bar_width=24),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeElapsedColumn(),
        TextColumn("{task.fields[detail]}"),
    )
    with Progress(*columns, console=stderr(), transient=True) as progress:
        yield Meter(progress)


def new_table(
    *columns: str, title: str = "", caption: str | None = None, left: int = 1, wrapped: Collection[str] = ()
) -> Table:
    """Make a table without rows.

    Parameters
    ----------
    columns : their titles.
    left : number of left-aligned text columns; the others hold numbers and are right-aligned.
    wrapped : columns whose cells may take several lines.
    """
    table = Table(
        title=title or None,
        caption=caption,
        box=SIMPLE_HEAD,
        padding=(0, 1),
        collapse_padding=True,
        pad_edge=False,
    )
    for number, name in enumerate(columns):
        justify: Literal["left", "right"] = "left" if number < left else "right"
        table.add_column(name, justify=justify, no_wrap=name not in wrapped, overflow="fold")
    return table


def fit_table(result: Document) -> Table:
    """Show how well each sample is matched: cost J (rad^2) and RMS of the Euler angles (mrad)."""
    title = "Fit: J in rad² (rigid, first guess, identified); RMS of φ, θ, ψ in mrad"
    held_out = any(row["role"] != "train" for row in result["fit"])
    caption = "* held out: not fitted" if held_out else None
    columns = ("sample", "rigid", "guess", "identified", "ratio", "φ", "θ", "ψ")
    table = new_table(*columns, title=title, caption=caption)
    for row in result["fit"]:
        rms = row["rms_rad"]
        ratio = (
            row["J_identified"] / row["J_rigid"]
            if row["J_rigid"] and row["J_identified"] is not None
            else None
        )
        table.add_row(
            str(row["sample"]) + ("" if row["role"] == "train" else " *"),
            *(short(row[key]) for key in ("J_rigid", "J_initial", "J_identified")),
            "" if ratio is None else f"{ratio:.1e}",
            *("" if rms[angle] is None else f"{1e3 * rms[angle]:.2f}" for angle in ("phi", "theta", "psi")),
        )
    return table


def statistics_table(result: Document) -> Table | None:
    """Show Theil's coefficient with its parts, and what the residuals are like; None where nobody counted."""
    rows = [
        (fit, angle, found)
        for fit in result["fit"]
        for angle, found in (fit.get("statistics") or {}).items()
        if found.get("theil") is not None
    ]
    if not rows:
        return None
    table = new_table(
        *("sample", "angle", "U", "bias", "var", "cov", "lag 1", "white", "drives"),
        title="Residuals: Theil's U, its parts in %, correlations with the row before and the drives",
        left=2,
    )
    last = None
    for fit, angle, found in rows:
        parts = (found.get(f"theil_{part}") for part in ("bias", "variance", "covariance"))
        white = found.get("white")
        table.add_row(
            "" if fit is last else str(fit["sample"]),
            LETTERS.get(angle, angle),
            f"{found['theil']:.4f}",
            *("" if part is None else f"{100.0 * part:.0f}" for part in parts),
            "" if found.get("lag_1") is None else f"{found['lag_1']:.2f}",
            "" if white is None else "yes" if white else "no",
            "" if found.get("drive_correlation") is None else f"{found['drive_correlation']:.2f}",
        )
        last = fit
    return table


def jobs_table(jobs: Sequence[Document]) -> Table:
    """Show jobs, one per line; ids are shown in full on 80 columns, so that they can be copied."""
    columns = ("job", "operation", "status", "done", "try", "created UTC")
    table = new_table(*columns, left=len(columns))
    for job in jobs:
        fraction = (job.get("progress") or {}).get("fraction")
        status = str(job["status"])
        table.add_row(
            str(job["id"]),
            str(job.get("operation", "")),
            f"[{STATUS_COLOURS.get(status, 'white')}]{status}[/]",
            "" if fraction is None else f"{100.0 * fraction:.0f} %",
            str(job.get("attempt", "")),
            str(job.get("created_at", ""))[len("2026-") : len("2026-01-01T00:00")].replace("T", " "),
        )
    return table


def exit_for(status: str) -> Exit:
    """Return the exit code for a job's final status."""
    return {"succeeded": Exit.OK, "cancelled": Exit.STOPPED, "expired": Exit.STOPPED}.get(status, Exit.FAILED)


def progress_detail(progress: Document) -> str:
    """Return the details of a job's progress besides its fraction."""
    parts = []
    if progress.get("best_cost") is not None:
        parts.append(f"cost {short(progress['best_cost'])}")
    if progress.get("flights"):
        parts.append(f"{progress['flights']:,} flights")
    if progress.get("flights_per_s"):
        parts.append(f"{progress['flights_per_s']:,.0f}/s")
    if progress.get("eta_s"):
        parts.append(f"{progress['eta_s']:.0f} s left")
    if not parts and progress.get("message"):
        parts.append(str(progress["message"]))
    return ", ".join(parts)


def short(value: float | None) -> str:
    """Format a number with three digits, thousands in full, None as empty text."""
    if value is None:
        return ""
    return f"{value:.0f}" if 1e3 <= abs(value) < 1e4 else f"{value:.3g}"
