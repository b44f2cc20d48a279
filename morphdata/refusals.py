"""Pydantic's errors as faults: with JSON pointers, plain words and hints."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache
from typing import Any, Literal, get_args, get_origin, get_type_hints

from pydantic import BaseModel

from morphdata.faults import Fault
from morphdata.renamed import sent_name

MAX_FAULTS = 20
MAX_POINTER = 300  # characters: a field's name may be a megabyte
SHOWN_CHARACTERS = 60  # of an offending value
HALF_TURN_RAD = math.pi + 1e-9  # an angle written in degrees is rounded
FAULTS = "faults"  # type of the errors that carry what `Document.faults` found

HINTS = {
    "missing": "Add this field.",
    "finite_number": "Remove or repair the row: NaN and infinity are not numbers.",
    "float_type": "Give a number (not text) in the unit of the field's name.",
    "int_type": "Give a whole number.",
    "list_type": "Give a list.",
    "dict_type": "Give an object.",
    "model_type": "Give an object.",
    "model_attributes_type": "Give a JSON object.",
    "bool_type": "Give true or false.",
    "string_type": "Use a string.",
    "string_pattern_mismatch": "Use letters, digits, . - and _, starting with a letter or digit.",
    "too_short": "Give more items.",
    "too_long": "Give fewer items: leave out rows (10 ms steps are enough) or split the flight.",
}
HALF_TURNS = (HALF_TURN_RAD, -HALF_TURN_RAD)  # bounds of angles
BOUNDS = {"ge": "at least", "gt": "more than", "le": "at most", "lt": "less than"}


def escaped(part: object) -> str:
    """Return one token of a JSON pointer (RFC 6901)."""
    return str(part).replace("~", "~0").replace("/", "~1")


def faults_of(
    errors: Sequence[Mapping[str, Any]], document: Any, model: type[BaseModel], pointer: str = ""
) -> list[Fault]:
    """Translate pydantic's errors, one per field, the first `MAX_FAULTS`.

    A misspelt field comes before the field that is missing in its stead.

    Parameters
    ----------
    errors : sequence of mapping
        From `ValidationError.errors()`.
    document : object
        What was validated.
    model : type of BaseModel
        As which it was validated.
    pointer : str
        Where the document stands in a larger one.
    """
    found: dict[str, Fault] = {}
    for error in sorted(errors, key=lambda error: bool(error["type"] != "extra_forbidden")):
        for fault in _faults(error, document, model):
            found.setdefault(fault.pointer, fault.under(pointer))
        if len(found) >= MAX_FAULTS:
            break
    return list(found.values())[:MAX_FAULTS]


def _faults(error: Mapping[str, Any], document: Any, model: type[BaseModel]) -> Iterator[Fault]:
    kind, context = error["type"], error.get("ctx") or {}
    pointer = _pointer(error["loc"], document, named=kind in ("missing", "extra_forbidden"))
    if kind == FAULTS:
        for fault in context[FAULTS]:
            under = fault.under(pointer)
            yield replace(under, pointer=_as_sent(under.pointer, document))
    elif kind == "extra_forbidden":
        yield Fault("unknown_field", "There is no such field.", pointer, _unknown_hint(error["loc"], model))
    else:
        bound = kind.startswith(("greater", "less"))
        shown = "" if kind == "missing" or bound else _shown(error.get("input"))
        yield Fault(kind, f"{_sentence(error, pointer)}{shown}.", pointer, _hint(kind, context))


def _pointer(location: Sequence[str | int], document: Any, *, named: bool) -> str:
    """Turn pydantic's location into a JSON pointer, leaving out the names of union members.

    Parameters
    ----------
    named : bool
        The last part is a field's name, whether the document has it or not.
    """
    value = document
    tokens: list[str] = []
    for position, part in enumerate(location):
        if isinstance(value, dict) and isinstance(part, str):
            part = sent_name(part, value)  # noqa: PLW2901 - an old name is named as it was sent
        inside_list = isinstance(value, list) and isinstance(part, int) and part < len(value)
        if inside_list or (isinstance(value, dict) and part in value):
            value = value[part]
        elif not (named and position == len(location) - 1):
            continue  # a tag such as "inline" or "float": not part of the document
        tokens.append(f"/{escaped(part)}")
    return "".join(tokens)[:MAX_POINTER]


def _as_sent(pointer: str, document: Any) -> str:
    """Name renamed fields of a JSON pointer as the document does."""
    value, tokens = document, []
    for token in pointer.split("/")[1:]:
        name = sent_name(token, value) if isinstance(value, dict) else token
        tokens.append(f"/{name}")
        if isinstance(value, dict):
            value = value.get(name)
        elif isinstance(value, list) and token.isdecimal() and int(token) < len(value):
            value = value[int(token)]
        else:
            value = None
    return "".join(tokens)


def _shown(value: Any) -> str:
    if isinstance(value, dict | list | BaseModel):
        return ""
    text = repr(value)
    return f" (got {text[:SHOWN_CHARACTERS]}{'…' if len(text) > SHOWN_CHARACTERS else ''})"


def _sentence(error: Mapping[str, Any], pointer: str) -> str:
    context, kind = error.get("ctx") or {}, str(error["type"])
    if kind == "too_long" and context.get("actual_length") is not None:
        return f"{context['actual_length']} items are too many: at most {context['max_length']}"
    if kind == "too_short":
        return f"{context['actual_length']} items are too few: at least {context['min_length']}"
    if kind.startswith(("greater", "less")):
        names = [part for part in pointer.split("/") if not part.isdecimal()]
        row = f" at row {error['loc'][-1]}" if isinstance(error["loc"][-1], int) else ""
        value = error["input"]
        number = f"{value:g}" if isinstance(value, float) else str(value)[:SHOWN_CHARACTERS]
        return f"{names[-1]} is {number}{row}"
    return str(error["msg"]).removeprefix("Value error, ")


def _hint(kind: str, context: Mapping[str, Any]) -> str:
    for key, words in BOUNDS.items():
        if key in context and kind.startswith(("greater", "less")):
            degrees = " Is it in degrees?" if context[key] in HALF_TURNS else ""
            return f"It must be {words} {context[key]:g}.{degrees}"
    if kind.startswith("union_tag"):
        tags = context.get("expected_tags")
        return f"Give {context.get('discriminator', 'a kind')}: {tags or 'one of the documented kinds'}."
    if kind == "literal_error":
        return f"Use {context.get('expected', 'one of the documented values')}."
    return HINTS.get(kind, "See the documentation of this field at /docs.")


def _unknown_hint(location: Sequence[str | int], model: type[BaseModel]) -> str:
    *path, last = location
    name = str(last)[:SHOWN_CHARACTERS]
    here, within = _names(_models_at(path, model)), _names(_models_within(model))
    if name in here:
        return "It does not go with the other fields: leave it or them out."
    if near := difflib.get_close_matches(name, here, n=1):
        return f"Did you mean {near[0]!r}? Otherwise leave it out."
    if name in within:
        return "This field belongs to another object; remove it here."
    if near := difflib.get_close_matches(name, within, n=1):
        return f"Did you mean {near[0]!r}, which belongs to another object? Otherwise leave it out."
    return f"Leave it out. Known fields: {', '.join(here)}."


def _names(models: Iterable[type[BaseModel]]) -> list[str]:
    return list(dict.fromkeys(name for model in models for name in model.model_fields))


def _models_at(path: Sequence[str | int], model: type[BaseModel]) -> list[type[BaseModel]]:
    """Models that an object at pydantic's location may be of; several in a union without a tag."""
    models = [model]
    for part in path:
        fields = [each.model_fields[part] for each in models if part in each.model_fields]
        tagged = [each for each in models if part in _tags(each)]
        if fields:
            models = [inner for field in fields for inner in _models_in(field.annotation)]
        elif tagged:  # the tag of a union
            models = tagged
        elif isinstance(part, str):  # a key of a mapping
            models = [inner for each in models for inner in _models_in(_further(each))] or models
    return models


def _models_in(annotation: Any) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and get_origin(annotation) is None:
        return [annotation] if issubclass(annotation, BaseModel) else []
    return [model for part in get_args(annotation) for model in _models_in(part)]


@cache
def _further(model: type[BaseModel]) -> Any:
    """Annotation of what a model takes beside its fields; None where it takes nothing, or no models."""
    if model.model_config.get("extra") != "allow":
        return None
    return get_type_hints(model, include_extras=True)["__pydantic_extra__"]


@cache
def _models_within(model: type[BaseModel]) -> tuple[type[BaseModel], ...]:
    """The model and all that its fields hold, at any depth."""
    found = {model: None}
    for field in model.model_fields.values():
        for inner in _models_in(field.annotation):
            found.update(dict.fromkeys(_models_within(inner)))
    return tuple(found)


def _tags(model: type[BaseModel]) -> Iterator[Any]:
    """Values of a model's fields that can have no other."""
    for field in model.model_fields.values():
        if get_origin(field.annotation) is Literal:
            yield from get_args(field.annotation)
