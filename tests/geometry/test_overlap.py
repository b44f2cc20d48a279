"""Surfaces that lie in each other: against a dense net of points, and pairs that everybody can judge."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from morphcore.geometry.aircraft import Aircraft
from morphcore.geometry.lattice import surface_pose
from morphcore.geometry.overlap import DEPTH_CHORDS, overlapping_surfaces
from morphcore.geometry.surface import Surface
from tests.geometry.rehinged import fixed, rehinged
from tests.models.chains import example_aircraft

POINTS = 61  # of the net, along each side


def pair(first: Surface, **changes: Any) -> Aircraft:
    """The right wing of the example, and another surface made from it."""
    return replace(example_aircraft(), surfaces=(first, replace(first, **{"name": "other", **changes})))


def overlap(aircraft: Aircraft, *angles: float) -> bool:
    """Whether the two surfaces of an aircraft overlap at these hinge angles."""
    return bool(overlapping_surfaces(aircraft, np.array([angles])))


def net(surface: Surface, angle: float) -> np.ndarray:
    """Points (n, 3) all over a surface's mid-plane in B."""
    R_BW, r_B = surface_pose(surface, [angle])
    along, across = np.meshgrid(np.linspace(0, surface.span_m, POINTS), np.linspace(-0.5, 0.5, POINTS))
    points = [across * surface.chord_at(along), surface.span_sign * along, 0 * along]
    return np.stack([part.ravel() for part in points], axis=1) @ R_BW.T + r_B


def depth_seen(one: Surface, other: Surface, angles: tuple[float, float]) -> float:
    """How deep any point of the other surface's net lies within the first's outline and thickness, m."""
    R_BW, r_B = surface_pose(one, [angles[0]])
    x, y, z = ((net(other, angles[1]) - r_B) @ R_BW).T
    out = one.span_sign * y
    half = 0.5 * one.chord_at(out)
    inside = np.minimum(np.minimum(out, one.span_m - out), half - np.abs(x))
    return float(inside[np.abs(z) < 0.5 * (one.thickness_m + other.thickness_m)].max(initial=-1.0))


def test_the_example_never_overlaps() -> None:
    """No sweep of the example's wings brings them into each other."""
    sweeps = np.linspace(-1.3, 1.3, 9)
    assert overlapping_surfaces(example_aircraft(), np.stack([sweeps, sweeps], axis=1)) == []


def test_surfaces_in_one_plane_against_a_net_of_points() -> None:
    """Random pairs in one plane or nearly overlap where points of one lie in the other.

    Near the tolerance, and where corners alone meet, the net is too coarse to judge: those are left out.
    """
    rng = np.random.default_rng(4)
    wing = example_aircraft().surfaces[0]
    seen = {True: 0, False: 0}
    for _ in range(150):
        place = (rng.uniform(-0.6, 0.6), 0.35 + rng.uniform(-3.5, 3.5), rng.choice([0.0, 0.04, 0.3]))
        aircraft = pair(
            wing,
            position_m=place,
            span_m=rng.uniform(0.5, 3.0),
            hinges=rehinged(wing, "z", place).hinges,
        )
        one, other = aircraft.surfaces
        angles = (float(rng.uniform(-1, 1)), float(rng.uniform(-1, 1)))
        depth = max(depth_seen(one, other, angles), depth_seen(other, one, angles[::-1]))
        limit = DEPTH_CHORDS * 0.3
        if depth > 6.0 * limit:
            assert overlap(aircraft, *angles)
            seen[True] += 1
        elif depth < -0.5:
            assert not overlap(aircraft, *angles)
            seen[False] += 1
    assert min(seen.values()) > 20


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({}, True),  # a copy that was forgotten
        ({"position_m": (-0.15, 0.35, 0.0)}, True),  # half a chord behind
        ({"position_m": (-0.3, 0.35, 0.0)}, False),  # edge to edge
        ({"position_m": (-0.1, 0.35, -0.06)}, True),  # 6 cm above, both 10 cm thick
        ({"position_m": (-0.1, 0.35, -0.2)}, False),  # a biplane
        ({"side": "left", "position_m": (0.0, 0.35, 0.0)}, False),  # root to root
    ],
)
def test_pairs_that_everybody_can_judge(changes: dict[str, Any], expected: bool) -> None:  # noqa: FBT001
    """Copies, neighbours, biplanes and two halves of one wing, all of them fixed."""
    wing = fixed(example_aircraft().surfaces[0])
    assert overlap(pair(wing, **changes)) is expected


def test_a_wing_folded_through_a_tail_crosses_it() -> None:
    """A surface folded up by 80 degrees cuts another one above it, and meets none at its own root."""
    wing = example_aircraft().surfaces[0]
    folding = rehinged(wing, "x")
    above = pair(folding, position_m=(0.0, 0.35, -1.0), hinges=())
    assert overlap(above, 1.4)
    assert not overlap(above, 0.0)
    side_by_side = pair(folding, position_m=(0.0, 0.35, 0.0), hinges=(), side="left")
    assert not overlap(side_by_side, 1.4)


def test_the_row_of_a_sweep_is_reported() -> None:
    """Of a sweep that runs into another surface, a row at which it has arrived there is given."""
    wing = example_aircraft().surfaces[0]
    tail = {"position_m": (-1.5, 1.5, 0.0), "hinges": (), "span_m": 1.0}
    angles = np.linspace(0.0, 1.2, 50)[:, None]
    ((first, second, row),) = overlapping_surfaces(pair(wing, **tail), angles)
    assert (first, second) == (0, 1)
    assert not overlap(pair(wing, **tail), 0.0)
    assert overlap(pair(wing, **tail), float(angles[row, 0]))
