"""What ``morphid identify`` shows."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from morphid.commands.operation import Particulars
from morphid.model_table import at_bound_line, model_table
from morphid.screen import fit_table, stdout
from morphid.verdict import verdict

USE = "Fly the model with morphid simulate --parameters, or find a morph for it with morphid optimize."


def show_model(result: Mapping[str, Any]) -> None:
    """Print what came out and whether it may be believed, for people."""
    show_fit(result)
    fits = result["fit"]
    # results of earlier versions do not say how much moves in a sample
    if result.get("model") is not None and fits and all("range_rad" in fit for fit in fits):
        show_verdict(result, USE)


def show_fit(result: Mapping[str, Any]) -> None:
    """Print how well the samples are met, and the model."""
    stdout().print(fit_table(result))
    if result.get("model") is None:
        stdout().print("No model: no candidate flew the fitted samples.")
        return
    stdout().print(model_table(result))
    line = at_bound_line(result)
    if line:
        stdout().print(line, markup=False, soft_wrap=True)


def show_verdict(result: Mapping[str, Any], use: str) -> None:
    """Print the verdict on an identification, and what to do next.

    Parameters
    ----------
    use : what to do with a model that is not poor.
    """
    found, console = verdict(result, use), stdout()
    console.print(f"Verdict: {found.grade}", style="bold")
    for reason in found.reasons:
        console.print(f"  {reason}", markup=False, soft_wrap=True)
    console.print("What to do next", style="bold")
    for step in found.next_steps:
        console.print(f"  {step}", markup=False, soft_wrap=True)


IDENTIFY = Particulars(show_model)
