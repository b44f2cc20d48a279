"""What ``morphid identify`` shows."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from morphid.commands.operation import Particulars
from morphid.model_table import at_bound_line, model_table
from morphid.screen import fit_table, statistics_table, stdout

USE = "Fly the model with morphid simulate --parameters, or find a morph for it with morphid optimize."
GRADE_COLOURS = {"good": "green", "usable": "yellow", "poor": "red", "failed": "red"}


def show_model(result: Mapping[str, Any]) -> None:
    """Print what came out and whether it may be believed, for people."""
    show_fit(result)
    show_verdict(result, USE)


def show_fit(result: Mapping[str, Any]) -> None:
    """Print how well the samples are met, and the model."""
    console = stdout()
    console.print(fit_table(result))
    table = statistics_table(result)
    if table is not None:
        console.print(table)
    if result.get("model") is None:
        console.print("No model: no candidate flew the fitted samples.")
        return
    console.print(model_table(result))
    line = at_bound_line(result)
    if line:
        console.print(line, markup=False, soft_wrap=True)


def show_verdict(result: Mapping[str, Any], use: str) -> None:
    """Print the verdict on an identification, and what to do next.

    Parameters
    ----------
    result : of an identification; those of earlier versions have no verdict.
    use : what to do with a model that is not poor.
    """
    found, console = result.get("verdict"), stdout()
    if not found:
        return
    grade = found["grade"]
    console.print(f"Verdict: {grade}", style=f"bold {GRADE_COLOURS.get(grade, '')}".strip())
    for reason in found["reasons"]:
        console.print(f"  {reason}", markup=False, soft_wrap=True)
    usable = grade in ("good", "usable")
    steps = [*([use] if usable else []), *(found.get("next_steps") or ())]
    if steps:
        console.print("What to do next", style="bold")
    for step in steps:
        console.print(f"  {step}", markup=False, soft_wrap=True)


IDENTIFY = Particulars(show_model)
