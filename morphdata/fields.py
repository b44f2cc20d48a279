"""Bounded, strict building blocks of the request documents: no NaN, no infinity, no unknown field."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import Annotated, Any, get_args

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    FailFast,
    Field,
    model_validator,
)

from morphdata.samplefiles.flight import FEWEST_ROWS, MOST_ROWS, from_first_row

SAMPLE_NAME_PATTERN = r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$"  # becomes part of file names
MAX_ROWS = MOST_ROWS  # of one sample
MIN_ROWS = FEWEST_ROWS
LATEST_DATE_S = 1e11  # since 1970: clocks of loggers may count from there


class Strict(BaseModel):
    """Base of everything a client sends: a misspelt field is an error, text is not a number."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False, frozen=True)

    @model_validator(mode="before")
    @classmethod
    def _whole_numbers(cls, given: Any) -> Any:
        """Take 3.0 where a whole number is wanted: JSON Schema makes no difference."""
        if not isinstance(given, dict):
            return given
        return {**given, **{name: _whole(given[name]) for name in _whole_fields(cls) if name in given}}


@cache
def _whole_fields(model: type[BaseModel]) -> tuple[str, ...]:
    """Names of the fields whose only numbers are whole ones."""
    kinds = {name: set(_kinds(field.annotation)) for name, field in model.model_fields.items()}
    return tuple(name for name, found in kinds.items() if int in found and float not in found)


def _kinds(annotation: Any) -> Iterator[Any]:
    yield annotation
    for part in get_args(annotation):
        yield from _kinds(part)


def _whole(value: Any) -> Any:
    if isinstance(value, list):
        return [_whole(item) for item in value]
    return int(value) if isinstance(value, float) and value.is_integer() else value


Finite = Annotated[float, Field(allow_inf_nan=False)]
Length = Annotated[float, Field(gt=0.0, le=1000.0)]
Angle = Annotated[float, Field(ge=-3.2, le=3.2)]
Vector3 = Annotated[list[Annotated[float, Field(ge=-1e9, le=1e9)]], Field(min_length=3, max_length=3)]
Position = Annotated[list[Annotated[float, Field(ge=-1000.0, le=1000.0)]], Field(min_length=3, max_length=3)]
SampleName = Annotated[str, Field(pattern=SAMPLE_NAME_PATTERN)]
Text = Annotated[str, Field(min_length=1, max_length=200, pattern=r"^[^\x00-\x1f\x7f]*$")]
Identifier = Annotated[str, Field(min_length=1, max_length=64, pattern=r"^[A-Za-z0-9_]+$")]

# FailFast: one bad row is named, not a hundred thousand
TimeSeries = Annotated[
    list[Annotated[float, Field(ge=-LATEST_DATE_S, le=LATEST_DATE_S)]],
    FailFast(),
    Field(min_length=MIN_ROWS, max_length=MAX_ROWS),
    AfterValidator(from_first_row),
]
AngleSeries = Annotated[
    list[Annotated[float, Field(ge=-1e6, le=1e6)]],  # what is no angle, `samplefiles.flight` says with a hint
    FailFast(),
    Field(min_length=MIN_ROWS, max_length=MAX_ROWS),
]
