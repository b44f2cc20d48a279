"""Telescoping spans: surfaces that slide along their own span out of the mouth of an inner panel."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any, Protocol

from morphdata.drives import Hinge, Vector
from morphdata.faults import Fault

ALONG = 1e-9  # distance between the unit vectors of a slide and of a span that it follows
LEAST_VISIBLE = 0.05  # share of the panel that is always visible: strips cannot be thinner
AT_MOUTH = 1e-9  # m; roots this far outboard of the mouth are at it


class Sliding(Protocol):
    """The part of a surface that determines how it telescopes."""

    @property
    def side(self) -> Any:
        """Right or left."""

    @property
    def span_m(self) -> float:
        """Measured across the root chord."""

    @property
    def sweep_rad(self) -> float:
        """Of the mid-chord line."""

    @property
    def dihedral_rad(self) -> float:
        """Tip up."""

    @property
    def incidence_rad(self) -> float:
        """Nose up."""

    @property
    def root_m(self) -> Sequence[float]:
        """Mid-chord of the root, all hinges at rest."""

    @property
    def all_hinges(self) -> Sequence[Hinge]:
        """From the fuselage outward."""

    @property
    def all_controls(self) -> Sequence[Any]:
        """Its control surfaces."""

    def hinge_pointer(self, number: int) -> str:
        """JSON pointer of a hinge in the surface's document."""


def span_line_B(surface: Sliding) -> Vector:
    """Unit vector in body axes of a surface's mid-chord line from root to tip, all hinges at rest.

    Along it the rotation by dihedral (x), incidence (y) and sweep (z) takes the span's axis.
    """
    sign = 1.0 if surface.side == "right" else -1.0
    out, aft = math.cos(surface.sweep_rad), math.sin(surface.sweep_rad)
    forward, raised = -aft * math.cos(surface.incidence_rad), aft * math.sin(surface.incidence_rad)
    cosine, sine = math.cos(surface.dihedral_rad), math.sin(surface.dihedral_rad)
    return forward, sign * (out * cosine + raised * sine), raised * cosine - out * sine


def mouth_m(surface: Sliding) -> float | None:
    """Distance of the mouth from the root along the span at zero extension, m; None if nothing telescopes.

    A surface telescopes if its last hinge is prismatic and slides along its span. An extension subtracts
    from the distance; what is inboard of the mouth is hidden.
    """
    if not surface.all_hinges or not surface.all_hinges[-1].is_prismatic:
        return None
    hinge, line = surface.all_hinges[-1], span_line_B(surface)
    if math.dist(hinge.axis_B(surface.side, line), line) > ALONG:
        return None
    return sum(
        (mouth - root) * along
        for mouth, root, along in zip(hinge.position_m, surface.root_m, line, strict=True)
    )


def apparent_mass_fault(name: str) -> Fault:
    """Return the fault of a flight whose apparent mass would have to follow the visible span of a surface."""
    return Fault(
        "not_supported",
        f"The apparent mass of {name!r}, which telescopes, is not supported.",
        "/flight/apparent_mass",
        "Leave it out; it matters for light wings.",
    )


def telescope_faults(surface: Sliding) -> Iterator[Fault]:
    """Check that a telescoping surface stays in its mouth, keeps a visible part, and bears no controls."""
    mouth = mouth_m(surface)
    if mouth is None:
        return
    last = len(surface.all_hinges) - 1
    hinge, at = surface.all_hinges[last], surface.hinge_pointer(last)
    length = surface.span_m / math.cos(surface.sweep_rad)
    if hinge.high > mouth + AT_MOUTH:
        yield Fault(
            "leaves_its_mouth",
            f"At {hinge.high:g} m the root of the panel is {hinge.high - mouth:g} m outboard of the mouth.",
            f"{at}/max_m",
            f"Give at most {mouth:g} m, or move the root further inboard: position_m of the surface is its "
            "root, that of the hinge the mouth.",
        )
    visible = length - mouth + hinge.low
    if visible < LEAST_VISIBLE * length:
        yield Fault(
            "nothing_visible",
            f"At {hinge.low:g} m, {max(visible, 0.0):g} m of the {length:g} m are outboard of the mouth.",
            f"{at}/min_m",
            f"Leave {LEAST_VISIBLE:.0%} of it visible: give at least "
            f"{mouth - (1.0 - LEAST_VISIBLE) * length:g} m, or move mouth or root.",
        )
    if surface.all_controls:
        yield Fault(
            "not_supported",
            "A control surface on a panel that telescopes is not supported.",
            "/controls",
            "Put it on the inner panel, a surface of its own.",
        )
