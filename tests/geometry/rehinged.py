"""Surfaces on other hinges than their documents give them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from morphcore.geometry.hinge import Hinge
from morphcore.geometry.surface import Surface
from morphdata.drives import Hinge as HingeDocument


def rehinged(surface: Surface, axis: str, position_m: Sequence[float] | None = None) -> Surface:
    """The surface on one hinge about a lettered axis, where its last hinge is if no other place is given."""
    place = list(surface.hinges[-1].position_m if position_m is None else position_m)
    document = HingeDocument.parse({"axis": axis, "position_m": place})
    return replace(surface, hinges=(Hinge.of(document, surface.side),))


def fixed(surface: Surface) -> Surface:
    """The surface without hinges."""
    return replace(surface, hinges=())
