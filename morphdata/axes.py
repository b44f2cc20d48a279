"""Samples inline whose attitude is a quaternion, or which are given in other axes than NED and FRD."""

from __future__ import annotations

from array import array
from collections.abc import Mapping
from typing import Any

from pydantic import Field
from pydantic_core import PydanticCustomError

from morphdata.base import AngleSeries, Document
from morphdata.channels import channel_field, document_name
from morphdata.faults import Fault, InvalidInput
from morphdata.refusals import FAULTS
from morphdata.samplefiles.channel_columns import LARGEST_VALUE, with_gaps, without_gaps
from morphdata.samplefiles.declared import declared
from morphdata.samplefiles.fault import as_sentence
from morphdata.samplefiles.flight import angle_fault
from morphdata.samplefiles.frames import (
    HERE,
    QUATERNION,
    Body,
    Earth,
    Frames,
    channels_in_here,
    euler_in_ned,
    euler_of_quaternions,
    quaternion_fault,
)

ATTITUDE_FIELDS = ("phi_rad", "theta_rad", "psi_rad")
QuaternionSeries = AngleSeries | None


class Axes(Document):
    """Axes in which a sample's attitude and channels are given."""

    earth: Earth = Field(default="NED", description="North, east, down; or east, north, up.")
    body: Body = Field(default="FRD", description="Forward, right, down; or forward, left, up.")


def in_axes_of_here(given: Mapping[str, Any]) -> dict[str, Any]:
    """Return a sample's fields with attitude as Euler angles from FRD to NED, and channels in these axes.

    What is no sound column is left as it is: the fields of the document refuse it. Fields that are turned are
    given under other names, so no field is turned twice.
    """
    document = {name: _listed(value) for name, value in given.items()}
    quaternion = [name for name in QUATERNION if document.get(name) is not None]
    frames = _frames(document.get("frames"))
    if frames is None or (not quaternion and frames == HERE):
        # nothing to turn: what frames are left are those of here, or wrong
        return {name: value for name, value in document.items() if name != "frames" or frames is None}
    if quaternion:
        _require_whole_quaternion(document)
    columns = [_numbers(document.get(name)) for name in (QUATERNION if quaternion else ATTITUDE_FIELDS)]
    if any(column is None for column in columns) or len({len(column or ()) for column in columns}) != 1:
        return document
    rows = list(zip(*(column or () for column in columns), strict=True))
    turned = _euler(rows, frames, quaternion=bool(quaternion))
    attitude = {"frames", *QUATERNION, *ATTITUDE_FIELDS}
    rest = {name: value for name, value in document.items() if name not in attitude}
    return {**_channels(rest, frames), **dict(zip(ATTITUDE_FIELDS, map(list, turned), strict=True))}


def _listed(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value.tolist() if hasattr(value, "tolist") else value


def _frames(axes: Any) -> Frames | None:
    """The axes; None for what are none."""
    if axes is None:
        return HERE
    words = axes if isinstance(axes, Mapping) else getattr(axes, "__dict__", None)
    if words is None or not set(words) <= {"earth", "body"}:
        return None
    try:
        found = declared(**words).frames
    except (InvalidInput, TypeError, AttributeError):
        return None
    exact = all(getattr(found, name) == word for name, word in words.items())
    return found if exact else None


def _numbers(column: Any) -> list[float] | None:
    """A column that holds nothing but finite numbers; None for all else."""
    if not isinstance(column, list) or not column:
        return None
    return column if all(_is_number(item) and abs(item) < 1e6 for item in column) else None


def _is_number(item: Any) -> bool:
    return isinstance(item, (float, int)) and not isinstance(item, bool)


def _require_whole_quaternion(document: Mapping[str, Any]) -> None:
    """Refuse what no field would: a quaternion of three columns, of unequal ones, or beside angles."""
    for name in QUATERNION:
        if document.get(name) is None:
            detail = f"A quaternion has four columns: {name} is missing."
            raise _refusal(Fault("missing", detail, f"/{name}", "Give qw, qx, qy and qz."))
        if _numbers(document[name]) is None:
            detail = f"{name} is no list of finite numbers."
            raise _refusal(Fault("finite_number", detail, f"/{name}", "Give a number in every row."))
        if len(document[name]) != len(document[QUATERNION[0]]):
            detail = f"{name} has {len(document[name])} rows, {QUATERNION[0]} has others."
            raise _refusal(Fault("unequal_lengths", detail, f"/{name}", "Give equal lengths."))
    for name in ATTITUDE_FIELDS:
        if document.get(name) is not None:
            detail = f"The attitude is given twice: by {name} and by a quaternion."
            raise _refusal(Fault("given_twice", detail, f"/{name}", "Leave out one of them."))


def _euler(rows: list[Any], frames: Frames, *, quaternion: bool) -> tuple[Any, Any, Any]:
    if not quaternion:
        fault = angle_fault("theta", [row[1] for row in rows], "theta_rad")  # in all axes it is as steep
        if fault is not None:
            detail, hint = as_sentence(fault.detail), as_sentence(fault.hint)
            raise _refusal(Fault(fault.code, detail, f"/theta_rad/{fault.row}", hint))
        return euler_in_ned(rows, frames)
    for row, components in enumerate(rows):
        said = quaternion_fault(components)
        if said is not None:
            hint = "The squares of qw, qx, qy and qz add up to 1."
            raise _refusal(Fault("no_rotation", as_sentence(said), f"/qw/{row}", hint))
    return euler_of_quaternions(rows, frames)


def _channels(document: dict[str, Any], frames: Frames) -> dict[str, Any]:
    """The fields with those of channels turned, SI units; as they are where one of these is none."""
    kept, channels = {}, {}
    for name, values in document.items():
        meant = channel_field(name)
        if meant is None:
            kept[name] = values
            continue
        column, factor = meant
        if column in channels or not _is_channel(values):
            return document
        channels[column] = array("d", (factor * value for value in without_gaps(values)))
    turned = channels_in_here(channels, frames)
    return kept | {document_name(column): with_gaps(values) for column, values in turned.items()}


def _is_channel(values: Any) -> bool:
    return isinstance(values, list) and all(
        value is None or (_is_number(value) and abs(value) <= LARGEST_VALUE) for value in values
    )


def _refusal(fault: Fault) -> PydanticCustomError:
    return PydanticCustomError(FAULTS, "the attitude cannot be read", {FAULTS: (fault,)})
