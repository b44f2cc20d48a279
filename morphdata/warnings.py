"""Warnings that every result carries."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, Field


class ResultWarning(BaseModel):
    """A part of a result that is outside the validity of its method."""

    code: str = Field(
        description="Stable, for programs: `at_bound`, `large_error`, `large_alpha`, `compressible`, "
        "`steep_pitch`, `surfaces_overlap`, `large_bending`, `large_deflection`, `apparent_mass_left_out`, "
        "`constant_trim_moment`, `surface_in_wake`, `diverged` (a flight on which the result does not "
        "depend), `verification_failed`, `not_flyable` (in a partial result: nothing has flown yet). Of "
        "samples: "
        "`looks_like_degrees`, `flipped_sign`, `swapped_sides`, `late`, `clipped_column`, `frozen_column`, "
        "`wrong_aircraft`, `start_off_trim`, `repeated_rows`, `gap`.",
        examples=["at_bound"],
    )
    message: str = Field(description="What was seen.")
    hint: str = Field(description="What to do about it.")
    pointer: str = Field(description="JSON pointer into the request.", examples=["/model/bounds/lag_s"])


Warnings = Annotated[
    list[ResultWarning], Field(description="Reasons to doubt the result; empty if there are none.")
]
