"""Telescoping spans: surfaces that slide along their own span out of the mouth of an inner panel."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
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

    @property
    def cl_max(self) -> float | None:
        """Upper limit of its sections' lift coefficient."""

    @property
    def cl_min(self) -> float | None:
        """Lower limit."""

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


def telescoping(surfaces: Iterable[Any]) -> list[str]:
    """Return the names of the surfaces that telescope, of an aircraft's document."""
    return [surface.name for surface in surfaces if mouth_m(surface) is not None]


def inner_panel_faults(surfaces: Sequence[Any]) -> Iterator[Fault]:
    """Check that no inner panel bends: the panel that slides out of it would not follow its tip.

    surfaces : documents of all; a panel whose tip is within half its root chord of a mouth holds that.
    """
    for surface in surfaces:
        if mouth_m(surface) is None:
            continue
        mouth = surface.all_hinges[-1].position_m
        for number, other in enumerate(surfaces):
            if other is surface or other.side != surface.side or not other.flexible:
                continue
            length = other.span_m / math.cos(other.sweep_rad)
            line = span_line_B(other)
            tip = [root + length * along for root, along in zip(other.root_m, line, strict=True)]
            if math.dist(tip, mouth) < 0.5 * other.root_and_tip_chord_m[0]:
                yield Fault(
                    "not_supported",
                    f"{other.name!r} bends, and {surface.name!r}, which slides out of it, does not follow.",
                    f"/surfaces/{number}/flexible",
                    "Give the inner panel flexible: false.",
                )


def unsupported_faults(
    names: Sequence[str],
    *,
    apparent_mass: bool = False,
    lattice_shape: str = "undeformed",
    moving_air: bool = False,
    channels: Sequence[str] = (),
    flexible: bool = False,
) -> Iterator[Fault]:
    """Check that nothing is requested that does not follow the visible span of telescoping surfaces.

    Parameters
    ----------
    names : sequence of str
        Of the surfaces that telescope.
    apparent_mass, lattice_shape : of the flight, and of the lattice. moving_air : a gust or turbulence.
    channels : that are requested. flexible : of the flexible model.
    """
    requested = [
        (
            "Apparent mass",
            apparent_mass,
            "/flight/apparent_mass",
            "Leave it out; it matters for light wings.",
        ),
        (
            "A trimmed shape of the lattice",
            lattice_shape == "trimmed",
            "/model/lattice/shape",
            'Use "undeformed".',
        ),
        ("A gust or turbulence", moving_air, "/environment", "Leave them out; steady wind is possible."),
    ]
    for number, channel in enumerate(channels):
        per_strip, force = channel.startswith("section_"), channel == "drive_force" and flexible
        hint = "Simulate the rigid or the equivalent model." if force else "Request loads of whole surfaces."
        requested.append((f"The channel {channel}", per_strip or force, f"/channels/{number}", hint))
    for what, given, pointer, hint in requested:
        if given and names:
            yield Fault(
                "not_supported",
                f"{what} is not supported for {names[0]!r}, which telescopes.",
                pointer,
                hint,
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
    for field in ("cl_max", "cl_min"):
        if getattr(surface, field) is not None:
            yield Fault(
                "not_supported",
                f"A limit {field} of a panel that telescopes is not supported.",
                f"/{field}",
                "Leave it out: limits of the inner panel, a surface of its own, are possible.",
            )
