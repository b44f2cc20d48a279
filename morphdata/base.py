"""Base class and building blocks of the documents: strict, bounded, without NaN or unknown fields."""

from __future__ import annotations

import html
import json
import reprlib
from collections.abc import Iterator
from functools import cache
from numbers import Integral
from pathlib import Path
from typing import Annotated, Any, Self, get_args

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    FailFast,
    Field,
    GetJsonSchemaHandler,
    ValidationError,
    model_validator,
)
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, PydanticCustomError

from morphdata.faults import Fault, InvalidInput
from morphdata.refusals import FAULTS, HALF_TURN_RAD, faults_of
from morphdata.renamed import FORMER_NOTE, RENAMED
from morphdata.samplefiles.channel_columns import LARGEST_VALUE
from morphdata.samplefiles.flight import MAX_ROWS, MIN_ROWS, from_first_row

SAMPLE_NAME_PATTERN = r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$"  # becomes part of file names
SHOWN_ITEMS = 4  # items of a list shown at a prompt
LATEST_DATE_S = 1e11  # s since 1970: clocks of loggers may count from there


class Result(BaseModel):
    """Base of results of operations, which may contain further fields.

    Pydantic makes the validator on first use; the library, which only creates results, never needs it.
    """

    model_config = ConfigDict(extra="allow", defer_build=True)


class Document(BaseModel):
    """Base of all input documents: unknown fields are errors, and text is not accepted as a number.

    Invalid input raises `InvalidInput` with all faults, whether the document is parsed or constructed in
    Python.
    """

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False, frozen=True)

    def __init__(self, /, **fields: Any) -> None:
        try:
            super().__init__(**fields)
        except ValidationError as error:
            raise _refused(error, fields, type(self)) from None

    # pydantic would call our own __init__ for every nested object, too, and lose the location of errors
    __init__.__pydantic_base_init__ = True  # type: ignore[attr-defined]

    @classmethod
    def parse(cls, value: Any, pointer: str = "") -> Self:
        """Build the document from parsed JSON.

        Parameters
        ----------
        value : object
            Parsed JSON; nested objects may already be documents.
        pointer : str
            Its JSON pointer in a larger document, for errors.

        Raises
        ------
        InvalidInput
            Lists every fault.
        """
        try:
            return cls.model_validate(value)
        except ValidationError as error:
            raise _refused(error, value, cls, pointer) from None

    @classmethod
    def load(cls, path: str | Path, pointer: str = "") -> Self:
        """Read the document from a JSON file.

        Raises
        ------
        InvalidInput
            The file cannot be read, or the document is invalid; lists every fault.
        """
        try:
            document = json.loads(Path(path).read_text(encoding="utf-8"))
        except FileNotFoundError:
            raise InvalidInput(f"{path} does not exist", hint="check the path") from None
        except OSError as error:
            raise InvalidInput(f"{path} cannot be read: {error.strerror}", hint="check the path") from None
        except (
            ValueError,
            RecursionError,
        ) as error:  # also for bytes that are not text, and for huge numbers
            raise InvalidInput(f"{path} is not JSON: {error}", hint="see the examples") from None
        if not isinstance(document, dict):
            raise InvalidInput(f"{path} holds no JSON object", hint="see the examples")
        return cls.parse(document, pointer)

    def faults(self) -> Iterator[Fault]:
        """Yield faults that concern several fields, with pointers relative to this object.

        It is called only if each field is valid by itself.
        """
        return iter(())

    def __repr__(self) -> str:
        """A short form: names instead of objects, only the ends of long lists."""
        return "\n  ".join([type(self).__name__, *(f"{name} = {_brief(value)}" for name, value in self)])

    def _repr_html_(self) -> str:
        return f"<pre>{html.escape(repr(self))}</pre>"

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        found = tuple(self.faults())
        if found:
            raise PydanticCustomError(FAULTS, "the fields contradict each other", {FAULTS: found})
        return self

    @model_validator(mode="before")
    @classmethod
    def _plain_values(cls, given: Any) -> Any:
        """Accept 3.0 for an integer, as JSON Schema does, and tuples and arrays for lists."""
        if not isinstance(given, dict):
            return given
        whole = _whole_fields(cls)
        listed = {
            name: _whole(_listed(value)) if name in whole else _listed(value) for name, value in given.items()
        }
        return _under_current_names(listed, _renamed_fields(cls))

    @classmethod
    def __get_pydantic_json_schema__(
        cls, core_schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        """Include the old names of renamed fields, marked as deprecated."""
        schema = handler(core_schema)
        described = handler.resolve_ref_schema(schema)
        if handler.mode == "validation":
            for former, name in _renamed_fields(cls).items():
                _describe_former(described, former, name)
        return schema


def _brief(value: Any) -> str:
    if isinstance(value, Document):
        return str(getattr(value, "name", type(value).__name__))
    if isinstance(value, list) and len(value) > SHOWN_ITEMS:
        return f"{len(value)} items from {_brief(value[0])} to {_brief(value[-1])}"
    if isinstance(value, list):
        return f"[{', '.join(map(_brief, value))}]"
    return reprlib.repr(value)


def _refused(error: ValidationError, value: Any, model: type[BaseModel], pointer: str = "") -> InvalidInput:
    return InvalidInput.of(faults_of(error.errors(include_url=False), value, model, pointer))


@cache
def _whole_fields(model: type[BaseModel]) -> tuple[str, ...]:
    """Names of the fields whose numbers are all integers."""
    kinds = {name: set(_kinds(field.annotation)) for name, field in model.model_fields.items()}
    return tuple(name for name, found in kinds.items() if int in found and float not in found)


@cache
def _renamed_fields(model: type[BaseModel]) -> dict[str, str]:
    """Current names of a model's fields by their old names."""
    return {former: name for former, name in RENAMED.items() if name in model.model_fields}


def _under_current_names(given: dict[str, Any], renamed: dict[str, str]) -> dict[str, Any]:
    """Rename fields given by their old names; results, which contain both, are accepted unchanged."""
    for former, name in renamed.items():
        if former in given and name in given and given[former] != given[name]:
            fault = Fault(
                "given_twice",
                f"{name} and {former} are both given, with different values.",
                f"/{former}",
                f"Leave {former} out: it is the former name of {name}.",
            )
            raise PydanticCustomError(FAULTS, "a field is given twice", {FAULTS: (fault,)})
    return {
        renamed.get(name, name): value
        for name, value in given.items()
        if renamed.get(name, name) == name or renamed[name] not in given
    }


def _describe_former(schema: JsonSchemaValue, former: str, name: str) -> None:
    """Add a field's old name to a model's schema; then either name satisfies the requirement."""
    properties, required = schema["properties"], schema.get("required", [])
    properties[former] = {
        **properties[name],
        "title": former,
        "description": FORMER_NOTE.format(name=name),
        "deprecated": True,
    }
    properties[former].pop("default", None)
    if name in required:
        required.remove(name)


def _kinds(annotation: Any) -> Iterator[Any]:
    yield annotation
    for part in get_args(annotation):
        yield from _kinds(part)


def _listed(value: Any) -> Any:
    """Convert a tuple or a numpy array to a list."""
    return list(value) if isinstance(value, tuple) else value.tolist() if hasattr(value, "tolist") else value


def _whole(value: Any) -> Any:
    if isinstance(value, list):
        return [_whole(item) for item in value]
    if isinstance(value, float):
        return int(value) if value.is_integer() else value
    return value if isinstance(value, bool) or not isinstance(value, Integral) else int(value)  # numpy's own


Length = Annotated[float, Field(gt=0.0, le=1000.0)]
Angle = Annotated[float, Field(ge=-HALF_TURN_RAD, le=HALF_TURN_RAD)]
Vector3 = Annotated[list[Annotated[float, Field(ge=-1e9, le=1e9)]], Field(min_length=3, max_length=3)]
Position = Annotated[list[Annotated[float, Field(ge=-1000.0, le=1000.0)]], Field(min_length=3, max_length=3)]
SampleName = Annotated[str, Field(pattern=SAMPLE_NAME_PATTERN)]
Text = Annotated[str, Field(min_length=1, max_length=200, pattern=r"^[^\x00-\x1f\x7f]*$")]
Identifier = Annotated[str, Field(min_length=1, max_length=64, pattern=r"^[A-Za-z0-9_]+$")]

# FailFast: report one bad row, not a hundred thousand
TimeSeries = Annotated[
    list[Annotated[float, Field(ge=-LATEST_DATE_S, le=LATEST_DATE_S)]],
    FailFast(),
    Field(min_length=MIN_ROWS, max_length=MAX_ROWS),
    AfterValidator(from_first_row),
]
AngleSeries = Annotated[
    list[
        Annotated[float, Field(ge=-1e6, le=1e6)]
    ],  # impossible angles are reported by `samplefiles.flight` with a hint
    Field(fail_fast=True, min_length=MIN_ROWS, max_length=MAX_ROWS),
]
# a measured channel; null is a gap
ChannelSeries = Annotated[
    list[Annotated[float, Field(ge=-LARGEST_VALUE, le=LARGEST_VALUE)] | None],
    Field(fail_fast=True, min_length=MIN_ROWS, max_length=MAX_ROWS),
]
