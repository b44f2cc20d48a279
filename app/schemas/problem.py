"""Problem details (RFC 9457): the shape of every error answer."""

from __future__ import annotations

from pydantic import BaseModel, Field


class ProblemFault(BaseModel):
    """One fault of the request."""

    code: str = Field(description="Stable, for programs.", examples=["sweep_out_of_range"])
    detail: str = Field(description="For people.")
    pointer: str = Field(
        description="JSON pointer into the body, or `#header/...`, `#query/...`, `#path/...`; empty: all.",
        examples=["/samples/0/sweep_left_rad/57"],
    )
    hint: str = Field(description="What to do about it.")


class QuotaUse(BaseModel):
    """The exhausted quota."""

    name: str = Field(examples=["jobs_in_flight"])
    limit: int
    used: int
    asked: int = Field(description="Additional use by this request.")


class Problem(BaseModel):
    """What went wrong, where, and how to fix it."""

    type: str = Field(
        description="Identifies the kind of problem.", examples=["urn:morphid:problem:invalid_request"]
    )
    title: str
    status: int
    detail: str
    code: str = Field(description="Stable, for programs.", examples=["invalid_request"])
    instance: str = Field(description="Path of the request.")
    request_id: str = Field(
        default="",
        description="As in the header `X-Request-ID`; identifies the request in the log.",
    )
    pointer: str = Field(default="", description="The first field at fault, as in `errors`.")
    hint: str = Field(default="", description="What to do about it.")
    errors: list[ProblemFault] = Field(default=[], description="Every fault that was found, at most 20.")
    quota: QuotaUse | None = Field(default=None, description="With the code `quota_exceeded`.")
