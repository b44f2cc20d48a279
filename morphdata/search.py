"""Fields common to the requests of all searches."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any

from pydantic import Field

from morphdata.base import Document, Identifier
from morphdata.faults import Fault
from morphdata.options import SEARCH, Option
from morphdata.parameters import GivenParameters

MAX_SEED = 2**53 - 1  # every JSON reader preserves integers up to here
WEEK_S = 7 * 86_400.0


class WarmStart(Document):
    """The model from which a search starts: of an earlier job, an identified one, or its parameters."""

    job_id: Identifier | None = Field(
        default=None,
        description="An identification or a study of yours; the best result so far is accepted, too.",
        examples=["job_01k0c3v9fh8x2m4n6p8q0r2s4t"],
    )
    model_id: Identifier | None = Field(
        default=None,
        description="An identified model of yours.",
        examples=["model_01k0c3v9fh8x2m4n6p8q0r2s4t"],
    )
    parameters: Annotated[GivenParameters | None, Option("--warm-start", SEARCH)] = Field(
        default=None, description="The `model` of an earlier result, or the whole result."
    )

    def faults(self) -> Iterator[Fault]:
        """Check that there is exactly one model to start from."""
        ways = ("job_id", "model_id", "parameters")
        given = [name for name in ways if getattr(self, name) is not None]
        if len(given) != 1:
            yield Fault(
                "given_twice" if given else "missing",
                f"{' and '.join(given) or 'Nothing'} is given to start from; the search needs exactly one.",
                hint=f"Give one of {', '.join(ways)}.",
            )


class SwarmSearch(Document):
    """Method, swarm, seed and time budget; each search limits the size of its swarm."""

    c1: Annotated[float, Field(ge=0.0, le=4.0)] | None = Field(
        default=None, description="Weight of a particle's own best position (c1)."
    )
    c2: Annotated[float, Field(ge=0.0, le=4.0)] | None = Field(
        default=None, description="Weight of the swarm's best position (c2)."
    )
    inertia: Annotated[float, Field(ge=0.0, le=1.5)] | None = None
    seed: Annotated[int, Option("--seed", SEARCH)] = Field(
        default=1, ge=0, le=MAX_SEED, description="The same seed gives the same result."
    )
    max_seconds: Annotated[
        Annotated[float, Field(gt=0.0, le=WEEK_S)] | None, Option("--max-seconds", SEARCH)
    ] = Field(default=None, description="Time budget of the search; the best model so far is the result.")

    def swarm_settings(self) -> dict[str, Any]:
        """Collect the swarm's settings: size, generations, c1, c2, inertia."""
        names = {"particles", "generations", "c1", "c2", "inertia"}
        return self.model_dump(include=names, exclude_none=True)
