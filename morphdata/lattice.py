"""How a model's air is computed and where its flight starts: the same words for every model."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from morphdata.base import Document
from morphdata.options import MODEL, Option


class VortexCore(Document):
    """What keeps the velocity of a vortex finite: a factor of the distance from its line, or a cut-off."""

    law: Annotated[Literal["line", "smoothed"], Option("--core", MODEL)] = Field(
        default="line", description="Core of the lattice's vortices."
    )
    fraction: Annotated[float, Field(gt=0.0, le=0.5)] | None = Field(
        default=None,
        description="Core radius over the smaller side of a panel (line, 0.1 when left out) or over the mean "
        "chord of the surface (smoothed, 0.05 when left out).",
    )


class Lattice(Document):
    """Panels of each wing's vortex lattice, and the core of its vortices."""

    chordwise: Annotated[int, Option("--chordwise", MODEL)] = Field(
        default=4, ge=1, le=8, description="Lattice panels along the chord."
    )
    spanwise: Annotated[int, Option("--spanwise", MODEL)] = Field(
        default=10, ge=4, le=20, description="Lattice panels along the span."
    )
    core: VortexCore = VortexCore()


CHOSEN = "Left out: the longest of 10, 5 and 2.5 ms that holds the attitude to 5e-5 rad."
OWN_OR_CHOSEN = f"That of the identification, where it is known. {CHOSEN}"
StepS = Annotated[float, Field(ge=0.0005, le=0.01)]  # of a search
FlightStepS = Annotated[float, Field(ge=1e-5, le=0.02)]  # of one flight, which may be as exact as it likes
Start = Literal["trim", "given"]
