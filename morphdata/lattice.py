"""Settings of aerodynamics and start, common to all models."""

from __future__ import annotations

from typing import Annotated, Any, Literal, get_args

from pydantic import Field

from morphdata.base import Document
from morphdata.options import MODEL, Option

# Core radius of "line" as a fraction of the smaller side of a panel (2.5 per cent of the chord at four rows).
# Control points lie half a panel from their own ring's edges: Vatistas's factor there is
# 1 - (0.1 / 0.5)^4 / 2, so it moves the self-influence by less than 1e-3, while a leg that strikes a control
# point induces no more than gamma / (2 sqrt(2) pi core).
LINE_CORE = 0.1
# Cut-off of "smoothed" as a fraction of the surface's mean chord, as is common in programs with this law. A
# panel of 1/4 chord has its control point 2.5 cut-offs from its edges: the self-influence is damped, and the
# lift comes out too high (docs/physics.md has the figure).
SMOOTHED_CORE = 0.05

CoreLaw = Literal["line", "smoothed"]
CORE_LAWS: tuple[CoreLaw, ...] = get_args(CoreLaw)


LatticeShape = Literal["undeformed", "trimmed"]


class VortexCore(Document):
    """Law that keeps the velocity of a vortex finite: a factor of the distance, or a cut-off."""

    law: Annotated[CoreLaw, Option("--core", MODEL)] = Field(
        default="line", description="Core of the lattice's vortices."
    )
    fraction: Annotated[float, Field(gt=0.0, le=0.5)] | None = Field(
        default=None,
        description="Core radius over the smaller side of a panel (line, default 0.1) or over the mean "
        "chord of the surface (smoothed, default 0.05).",
    )

    @property
    def radius_fraction(self) -> float:
        """The effective fraction, given or default."""
        if self.fraction is not None:
            return self.fraction
        return LINE_CORE if self.law == "line" else SMOOTHED_CORE


class Lattice(Document):
    """Panels of each wing's vortex lattice, and the core of its vortices."""

    chordwise: Annotated[int, Option("--chordwise", MODEL)] = Field(
        default=4, ge=1, le=8, description="Lattice panels along the chord."
    )
    spanwise: Annotated[int, Option("--spanwise", MODEL)] = Field(
        default=10, ge=4, le=20, description="Lattice panels along the span."
    )
    core: VortexCore = VortexCore()
    shape: Annotated[LatticeShape, Option("--lattice-shape", MODEL)] = Field(
        default="undeformed",
        description="Wings on which the lattice of rigid and equivalent models is tabulated: undeformed, or "
        "bent as in trim, for slender wings. That of the flexible model follows its wings.",
    )

    def to_document(self) -> dict[str, Any]:
        """Return the JSON form, with the effective core fraction."""
        core = {"law": self.core.law, "fraction": self.core.radius_fraction}
        return {
            "chordwise": self.chordwise,
            "spanwise": self.spanwise,
            "core": core,
            "shape": self.shape,
        }


DEFAULT_CORE = VortexCore()
DEFAULT_LATTICE = Lattice()
CHOSEN = "Default: the longest of 10, 5 and 2.5 ms that keeps the attitude error within 5e-5 rad."
OWN_OR_CHOSEN = f"That of the identification, if known. {CHOSEN}"
StepS = Annotated[float, Field(ge=0.0005, le=0.01)]  # of a search
FlightStepS = Annotated[float, Field(ge=1e-5, le=0.02)]  # of one flight, which may be arbitrarily exact
Start = Literal["trim", "given"]
