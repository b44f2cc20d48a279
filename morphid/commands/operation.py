"""The command of an operation, built from its descriptor; additions of an operation have their own module."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from inspect import Parameter, Signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from morphdata.operations.descriptor import Operation
from morphdata.options import VEHICLE
from morphid.commands import options, sample_files
from morphid.commands.fields import FieldOption, field_options
from morphid.files import matching_files, require_place
from morphid.request import Request
from morphid.screen import print_json, reports_errors

if TYPE_CHECKING:
    from morphid.running import Answer

Values = Mapping[str, Any]

SAMPLES = {
    "sample": Annotated[
        list[Path],
        typer.Option(
            "--sample",
            help="Sample flights to fit: CSV, JSON, Parquet, MATLAB, ULog; several, or a pattern.",
            rich_help_panel=VEHICLE,
        ),
    ],
    "held_out": Annotated[
        list[Path] | None,
        typer.Option(
            "--held-out",
            help="Sample flights to predict, not to fit; several, or a pattern.",
            rich_help_panel=VEHICLE,
        ),
    ],
    **sample_files.OPTIONS,
}
RUNNING = {
    "url": options.AtUrl,
    "api_key": options.AtUrlKey,
    "json_out": options.JsonFile,
    "plots": options.Plots,
}


def nothing(*_given: Any) -> None:
    """Do nothing."""


@dataclass(frozen=True)
class Particulars:
    """Additions of a command to the fields of its request.

    Parameters
    ----------
    show : prints a result in readable form.
    options : its additional options, by the names of their values.
    fill : ``fill(request, values)`` puts the values of its additional options into the request, after
    aircraft and flight and before the other fields.
    fills : flags of the fields that `fill` sets itself.
    out : help of ``--out``, a file that `save` writes; "" if there is none.
    save : ``save(answer, path)`` writes it.
    """

    show: Callable[[Values], None] = print_json
    options: Mapping[str, Any] = field(default_factory=dict)
    fill: Callable[[Request, Values], None] = nothing
    fills: Collection[str] = ()
    out: str = ""
    save: Callable[[Answer, Path], None] = nothing


def command_of(operation: Operation[Any], own: Particulars) -> Callable[..., None]:
    """Make the function of a command for typer."""
    fields = field_options(operation.request)
    vehicle = [option for option in fields if option.pointer in ("/aircraft", "/flight")]
    others = [option for option in fields if option not in vehicle]
    has_samples = "samples" in operation.request.model_fields

    def command(**values: Any) -> None:
        from morphid.running import hand_over, run

        for name, flag in (("json_out", "--json"), ("out", "--out")):
            require_place(values.get(name), flag)
        request = Request(operation.name)
        if has_samples:
            request.add_samples(matching_files(values["sample"], "--sample"), "train", "--sample")
            held_out = matching_files(values["held_out"] or [], "--held-out")
            request.add_samples(held_out, "held_out", "--held-out")
            request.said = sample_files.said(values)
        for option in vehicle:  # first, for the aircraft says which drives there are
            _fill_field(request, option, values[option.parameter.name])
        own.fill(request, values)
        for option in (option for option in others if option.flag not in own.fills):
            _fill_field(request, option, values[option.parameter.name])
        files = values["plots"] is not None or values.get("out") is not None
        answer = run(request, values["url"], values["api_key"], files=files)
        if values.get("out") is not None and answer.result is not None:
            own.save(answer, values["out"])
        hand_over(answer, own.show, json_out=values["json_out"], plots=values["plots"])

    made = reports_errors(command)
    made.__name__ = operation.name
    made.__doc__ = f"{operation.title}."
    made.__signature__ = Signature(  # type: ignore[attr-defined]  # read by typer
        [
            *(option.parameter for option in vehicle),
            *_parameters(SAMPLES if has_samples else {}),
            *_parameters(own.options),
            *(option.parameter for option in others),
            *_parameters({"out": _out_option(own.out)} if own.out else {}),
            *_parameters(RUNNING),
        ]
    )
    return made


def _out_option(description: str) -> Any:
    return Annotated[Path | None, options.answer_option("--out", help=description)]


def _parameters(annotations: Mapping[str, Any]) -> list[Parameter]:
    return [
        Parameter(
            name,
            Parameter.KEYWORD_ONLY,
            default=Parameter.empty if name == "sample" else None,
            annotation=annotation,
        )
        for name, annotation in annotations.items()
    ]


def _fill_field(request: Request, option: FieldOption, given: Any) -> None:
    """Put the value of an option into its field, unless it was not given."""
    if given is None or given == []:
        return
    value = option.read(given)
    words = " ".join(given) if isinstance(given, list) else given
    request.put(
        option.pointer, value, f"{option.flag} {words}" if isinstance(value, dict | list) else option.flag
    )
