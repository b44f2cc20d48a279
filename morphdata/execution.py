"""How a job is run: what the requests of all operations say alike and no number depends on."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from morphdata.base import Document

MAX_PRIORITY = 100
MAX_LABEL = 100
MONTH_S = 31 * 86_400.0
MAX_ATTEMPTS = 10
MAX_CHUNKS = 256

Label = Annotated[str, Field(min_length=1, max_length=MAX_LABEL, pattern=r"^[^\x00-\x1f\x7f]+$")]


class Execution(Document):
    """How the job is run; the result is the same whatever stands here."""

    priority: int = Field(
        default=0,
        ge=-MAX_PRIORITY,
        le=MAX_PRIORITY,
        description="Among your own jobs the highest runs first; other owners take their turns all the same.",
    )
    label: Label | None = Field(
        default=None, description="Free text, to find the job again: `GET /jobs?label=`."
    )
    max_attempts: Annotated[int, Field(ge=1, le=MAX_ATTEMPTS)] | None = Field(
        default=None,
        description="Maximum number of attempts; a new one starts after a worker is lost; the service's own "
        "number when left out.",
    )
    expires_in_s: Annotated[float, Field(ge=1.0, le=MONTH_S)] | None = Field(
        default=None, description="A job that has not started by then will not start: it is `expired`."
    )


class SpreadExecution(Execution):
    """How an identification is run: on one worker, or its generations spread over several."""

    mode: Literal["single", "distributed"] = Field(
        default="single",
        description="`distributed`: all available workers fly each generation together.",
    )
    chunks: int = Field(
        default=16, ge=1, le=MAX_CHUNKS, description="Parts of a generation in the mode `distributed`."
    )


class Request(Document):
    """Base of the requests for long work."""

    execution: Execution = Execution()

    def document(self) -> dict[str, Any]:
        """Build the JSON document of this request; today's defaults are written out.

        Parsed again, by a later version too, it is the same request. Aircraft and flight stand in it as they
        came: they are documents of the user's own.
        """
        own = {"aircraft", "flight"} & type(self).model_fields.keys()
        return {
            **self.model_dump(exclude_none=True, exclude_unset=True, include=own),
            **self.model_dump(exclude_none=True, exclude=own),
        }
