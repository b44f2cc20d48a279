"""How a job is run: fields common to all operations that do not affect any results."""

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
    """How the job is run; this does not affect the result."""

    priority: int = Field(
        default=0,
        ge=-MAX_PRIORITY,
        le=MAX_PRIORITY,
        description="Among your own jobs the highest runs first; turns between owners are not affected.",
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
    """How an identification is run: on one worker, or with its generations spread over several."""

    mode: Literal["single", "distributed"] = Field(
        default="single",
        description="`distributed`: all available workers fly each generation together.",
    )
    chunks: int = Field(
        default=16, ge=1, le=MAX_CHUNKS, description="Parts of a generation in the mode `distributed`."
    )


class Request(Document):
    """Base of all requests for jobs."""

    execution: Execution = Execution()

    def document(self) -> dict[str, Any]:
        """Build the JSON document of this request, with today's defaults written out.

        Parsed again, even by a later version, it gives the same request. Aircraft and flight are included as
        received, because they are the user's own documents.
        """
        own = {"aircraft", "flight"} & type(self).model_fields.keys()
        return {
            **self.model_dump(exclude_none=True, exclude_unset=True, include=own),
            **self.model_dump(exclude_none=True, exclude=own),
        }
