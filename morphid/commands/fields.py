"""Options of a command, built from the fields of its request: type, choices, default and help.

Values are validated by the request only; the command line just parses them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from inspect import Parameter, get_annotations
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, get_args, get_origin

import typer
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from morphdata.options import Option
from morphid.exits import CommandError, Exit
from morphid.files import read_json

MAX_SHOWN = 10_000  # larger limits are not worth showing


@dataclass(frozen=True)
class FieldOption:
    """An option of a command, and the field that it sets.

    Parameters
    ----------
    pointer : JSON pointer of the field.
    flag : as the user writes it.
    parameter : of the command's function.
    read : converts the text of the command line to the field's value.
    """

    pointer: str
    flag: str
    parameter: Parameter
    read: Callable[[Any], Any]


class Form(NamedTuple):
    """How a field is written on the command line.

    Parameters
    ----------
    kind : type returned by the command line's parser.
    metavar : placeholder of the value in the help; None for the type's name.
    read : converts it to the field's value.
    remark : for the help.
    """

    kind: Any
    metavar: str | None
    read: Callable[[Any], Any]
    remark: str = ""


def field_options(request: type[BaseModel]) -> list[FieldOption]:
    """Find the fields of a request that are options; if several have the same flag, the first gets it."""
    found: dict[str, FieldOption] = {}
    for option in _options(request, ""):
        found.setdefault(option.flag, option)
    return list(found.values())


def _options(model: type[BaseModel], pointer: str) -> Iterator[FieldOption]:
    own = get_annotations(model)
    # fields that a request adds to its base come first
    for name, field in sorted(model.model_fields.items(), key=lambda item: item[0] not in own):
        at = f"{pointer}/{name}"
        mark = next((item for item in field.metadata if isinstance(item, Option)), None)
        if mark is not None:
            yield _field_option(mark, at, field)
            continue
        for kind in _kinds(field.annotation):
            if isinstance(kind, type) and issubclass(kind, BaseModel):
                yield from _options(kind, at)


def _kinds(annotation: Any) -> list[Any]:
    """List the possible types of a field, from unions and annotations, without None."""
    origin = get_origin(annotation)
    if origin is Annotated:
        return _kinds(get_args(annotation)[0])
    if origin in (None, list, dict, Literal):
        return [] if annotation is type(None) else [annotation]
    return [kind for part in get_args(annotation) for kind in _kinds(part)]


def _field_option(mark: Option, pointer: str, field: FieldInfo) -> FieldOption:
    form = _form(mark.flag, field)
    word = mark.flag.removeprefix("--")
    # a flag that is on, or that is decided from the data, can be switched off
    both = field.default is True or (form.kind is bool and field.default is None)
    declared = f"{mark.flag}/--no-{word}" if both else mark.flag
    option = typer.Option(
        declared,
        help=f"{field.description or ''} {form.remark}".replace("`", "").strip(),
        rich_help_panel=mark.group,
        metavar=form.metavar,
        show_default=_shown_default(field.default),
    )
    required = field.is_required()
    parameter = Parameter(
        word.replace("-", "_"),
        Parameter.KEYWORD_ONLY,
        default=Parameter.empty if required else None,
        annotation=Annotated[form.kind if required else form.kind | None, option],
    )
    return FieldOption(pointer, mark.flag, parameter, form.read)


def _shown_default(default: Any) -> str | bool:
    if isinstance(default, list):
        return ",".join(str(item) for item in default)
    if isinstance(default, BaseModel):
        return ",".join(f"{value:g}" for value in default.model_dump().values())
    return str(default) if isinstance(default, int | float | str) and not isinstance(default, bool) else False


def _form(flag: str, field: FieldInfo) -> Form:
    kind, *others = _kinds(field.annotation)
    if get_origin(kind) is Literal:
        choices = get_args(kind)
        remark = f"One of {', '.join(choices)}." if len(choices) > 1 else ""
        return Form(str, choices[0] if len(choices) == 1 else "NAME", str, remark)
    if kind in (bool, int, float, str):
        words = [word for other in others if get_origin(other) is Literal for word in get_args(other)]
        by_name = any(get_origin(other) is dict for other in others)
        plain = _number_or_word(words) if words else Form(kind, _limits(field) if kind is int else None, kind)
        return _number_or_names(flag, plain) if by_name else plain
    if get_origin(kind) is list:
        return _list_form(flag, get_args(kind)[0])
    fields = {} if get_origin(kind) is dict else kind.model_fields
    names = list(fields)
    members = {member for inner in fields.values() for member in _kinds(inner.annotation)}
    if members == {float}:
        example = ",".join("1" for _ in names)

        def read(text: str) -> dict[str, float]:
            return dict(zip(names, _numbers(flag, text, float, example), strict=True))

        return Form(str, ",".join(names), read)
    if members and all(get_origin(member) is list for member in members):
        return Form(list[str], "NAME=LOW:HIGH", lambda texts: _ranges(flag, texts))
    return Form(Path, "FILE", read_json)


def _number_or_word(words: Sequence[str]) -> Form:
    """Read ``3`` as a whole number, and anything else as it is written."""
    return Form(str, "|".join(["N", *words]), lambda text: int(text) if text.isdecimal() else text)


def _number_or_names(flag: str, plain: Form) -> Form:
    """Read ``wing=4,tail=1`` as numbers by name, and what has no name in the plain form."""

    def read(text: str) -> Any:
        if "=" not in text:
            return plain.read(text)
        pairs = [part.rpartition("=") for part in text.split(",")]
        if not all(name.strip() and number.strip().isdecimal() for name, _, number in pairs):
            hint = f"write {flag} wing=4,tail=1"
            raise CommandError(f"{flag} {text}: not of the form NAME=N,NAME=N", code=Exit.USAGE, hint=hint)
        return {name.strip(): int(number) for name, _, number in pairs}

    return Form(str, f"{plain.metavar}|NAME=N,...", read)


def _numbers_or_names(flag: str, text: str) -> list[Any]:
    """Read ``1,2,wing=4+tail=1``: numbers, and numbers by name."""
    words = text.split(",")
    plain = [word for word in words if "=" not in word]
    numbers = iter(_numbers(flag, ",".join(plain), int, "1,2,3") if plain else [])
    named = _number_or_names(flag, Form(str, None, str)).read
    return [named(word.replace("+", ",")) if "=" in word else next(numbers) for word in words]


def _list_form(flag: str, item: Any) -> Form:
    if get_origin(item) is Literal:
        remark = f"Any of {', '.join(get_args(item))}."
        return Form(str, "NAME,NAME,...", lambda text: [word.strip() for word in text.split(",")], remark)
    if _kinds(item) == [str]:
        return Form(str, "NAME,NAME,...", lambda text: [word.strip() for word in text.split(",")])
    if any(get_origin(kind) is dict for kind in _kinds(item)):
        return Form(str, "N,N,NAME=N+NAME=N,...", lambda text: _numbers_or_names(flag, text))
    if float in _kinds(item):

        def read(text: str) -> list[float]:
            return _numbers(flag, text, float, ",".join("1" for _ in text.split(",")))

        return Form(str, "S,S,...", read)
    if isinstance(item, type) and issubclass(item, BaseModel):
        return Form(Path, "FILE", read_json)
    return Form(str, "N,N,...", lambda text: _numbers(flag, text, int, "1,2,3"))


def _limits(field: FieldInfo) -> str | None:
    """Show the smallest and the largest integer that a field accepts, if both are known."""
    low, high = (
        next((getattr(item, name) for item in field.metadata if hasattr(item, name)), None)
        for name in ("ge", "le")
    )
    return None if low is None or high is None or high > MAX_SHOWN else f"{low}..{high}"


def _numbers(flag: str, text: str, kind: Callable[[str], Any], example: str) -> list[Any]:
    """Parse comma-separated numbers; ``example`` has the required number of them, or any."""
    try:
        found = [kind(word) for word in text.split(",")]
    except ValueError:
        found = []
    if not found or (kind is float and len(found) != len(example.split(","))):
        what = "whole numbers" if kind is int else f"{len(example.split(','))} numbers"
        raise CommandError(
            f"{flag} {text}: not {what} with commas between", code=Exit.USAGE, hint=f"write {flag} {example}"
        )
    return found


def _ranges(flag: str, texts: Sequence[str]) -> dict[str, list[float]]:
    """Read ``lift_factor=0.8:1.2``."""
    found = {}
    for text in texts:
        name, _, pair = text.partition("=")
        low, _, high = pair.partition(":")
        try:
            found[name] = [float(low), float(high)]
        except ValueError:
            raise CommandError(
                f"{flag} {text}: not of the form NAME=LOW:HIGH",
                code=Exit.USAGE,
                hint=f"write {flag} lift_factor=0.8:1.2; repeat it for further parameters",
            ) from None
    return found
