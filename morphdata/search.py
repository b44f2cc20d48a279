"""What the requests of all searches say alike."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from morphdata.base import Document, Identifier
from morphdata.parameters import GivenParameters

MAX_SEED = 2**53 - 1  # every JSON reader keeps integers up to here
WEEK_S = 7 * 86_400.0


class WarmStart(Document):
    """The model that a search begins from: of an earlier job, an identified one, or its parameters."""

    job_id: Identifier | None = Field(
        default=None,
        description="An identification or a study of yours; the best so far of one that did not end will do.",
        examples=["job_01k0c3v9fh8x2m4n6p8q0r2s4t"],
    )
    model_id: Identifier | None = Field(
        default=None,
        description="An identified model of yours.",
        examples=["model_01k0c3v9fh8x2m4n6p8q0r2s4t"],
    )
    parameters: GivenParameters | None = None


class SwarmSearch(Document):
    """The swarm's pulls and the seed; how large the swarm may be is each search's own."""

    c1: Annotated[float, Field(ge=0.0, le=4.0)] | None = Field(
        default=None, description="Pull to a particle's best."
    )
    c2: Annotated[float, Field(ge=0.0, le=4.0)] | None = Field(
        default=None, description="Pull to the swarm's best."
    )
    inertia: Annotated[float, Field(ge=0.0, le=1.5)] | None = None
    seed: int = Field(default=1, ge=0, le=MAX_SEED, description="The same seed gives the same result.")
