"""Lattices on bent surfaces against the same lattices of surfaces that stand there."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from morphcore.aero.bent_shape import BentShape, BentSurface
from morphcore.aero.kernels.loads import OUTPUTS
from morphcore.aero.operator import aircraft_lattice, lattice_operator
from morphcore.geometry.aircraft import Aircraft
from morphdata.lattice import Lattice
from tests.aero.shaped import SHAPES, aircraft, pair
from tests.models.chains import example_aircraft, odd_aircraft

Array = NDArray[np.float64]

TRIMMED = Lattice(shape="trimmed")
SPAN_M, CHORD_M = 3.0, 0.3


def about_x(angle: float) -> Array:
    """A rotation (3, 3) about x, rad."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def bent(shape: Aircraft, turns: tuple[float, ...]) -> BentShape:
    """All surfaces of equal pieces, each turned up relative to the one before it, rad."""
    out = []
    for surface in shape.surfaces:
        edges, R, r = np.linspace(0.0, surface.length_m, len(turns) + 1), [], [np.zeros(3)]
        for angle in np.cumsum(turns):
            R.append(about_x(-surface.span_sign * angle))
            r.append(r[-1] + surface.span_sign * surface.length_m / len(turns) * R[-1][:, 1])
        out.append(BentSurface(edges, np.stack(R), np.stack(r[:-1]), surface.span_sign))
    return tuple(out)


@pytest.mark.parametrize("name", ["example", "odd", *SHAPES])
def test_straight_pieces_are_the_unbent_surface(name: str) -> None:
    """Pieces in line give the operator of the undeformed lattice to round-off, at any hinge angles."""
    rng = np.random.default_rng(0)
    shape = {"example": example_aircraft, "odd": lambda: odd_aircraft(rng)}.get(name, lambda: SHAPES[name])()
    lattice, angles = aircraft_lattice(shape, TRIMMED), rng.uniform(0.0, 0.6, len(shape.hinges))
    flat = lattice_operator(lattice, angles)
    found = lattice_operator(lattice, angles, shape=bent(shape, (0.0, 0.0, 0.0)))
    np.testing.assert_allclose(found.matrix, flat.matrix, rtol=0.0, atol=1e-11 * np.abs(flat.matrix).max())
    np.testing.assert_allclose(found.strips, flat.strips, rtol=0.0, atol=1e-12)


def test_one_piece_turned_up_is_dihedral() -> None:
    """A wing turned up at its root by its shape, or by its geometry: one operator, to round-off."""
    flat = aircraft(*pair("wing", SPAN_M, (CHORD_M, 0.6 * CHORD_M)))
    raised = aircraft(*pair("wing", SPAN_M, (CHORD_M, 0.6 * CHORD_M), dihedral_rad=0.3))
    found = lattice_operator(aircraft_lattice(flat, TRIMMED), (), shape=bent(flat, (0.3,))).matrix
    expected = lattice_operator(aircraft_lattice(raised, TRIMMED), ()).matrix
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-12 * np.abs(expected).max())


def test_a_wing_with_a_kink_is_two_surfaces() -> None:
    """The outer half turned up by 0.5 rad, as a shape or as surfaces of their own: the same circulation.

    Ten strips, or five on each surface, whose vortices are the same; to round-off for any velocities.
    """
    straight = aircraft(*pair("wing", SPAN_M, (CHORD_M, CHORD_M)))
    inner, outer = (
        pair("wing", 0.5 * SPAN_M, (CHORD_M, CHORD_M)),
        pair("tip", 0.5 * SPAN_M, (CHORD_M, CHORD_M)),
    )
    for wing, sign in zip(outer, (1.0, -1.0), strict=True):
        wing |= {"dihedral_rad": 0.5, "position_m": [0.0, 0.5 * sign * SPAN_M, 0.0]}
    parted = aircraft(inner[0], outer[0], inner[1], outer[1])
    whole = aircraft_lattice(straight, replaced(spanwise=10))
    halves = aircraft_lattice(parted, replaced(spanwise=5))
    inputs = np.random.default_rng(1).normal(size=2 * whole.strips)
    found, expected = (
        (matrix[:, : inputs.size] @ inputs)[: OUTPUTS * whole.strips : OUTPUTS]
        for matrix in (
            lattice_operator(whole, (), shape=bent(straight, (0.0, 0.5))).matrix,
            lattice_operator(halves, ()).matrix,
        )
    )
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-11 * np.abs(expected).max())


def replaced(spanwise: int) -> Lattice:
    """The lattice with a number of strips."""
    return TRIMMED.model_copy(update={"spanwise": spanwise})


def test_a_strip_across_a_joint_has_the_mean_of_both_axes() -> None:
    """Of three strips on two pieces the middle one is bent: its normal halves the angle of the pieces."""
    shape = aircraft(*pair("wing", SPAN_M, (CHORD_M, CHORD_M)))
    (right, _) = bent(shape, (0.0, 0.4))
    assert right is not None
    part = aircraft_lattice(shape, Lattice.model_construct(chordwise=1, spanwise=3)).lattices[0]
    ring_W, control_W, R_WS = right.placed(part, np.zeros(3))
    np.testing.assert_allclose(R_WS[1], about_x(-0.2), atol=1e-14)
    np.testing.assert_allclose(R_WS[2], about_x(-0.4), atol=1e-14)
    np.testing.assert_allclose(ring_W[0, -1], [ring_W[0, 0, 0], 1.5 + 1.5 * np.cos(0.4), -1.5 * np.sin(0.4)])
    np.testing.assert_allclose(control_W[0, 1, 1:], 0.5 * (ring_W[0, 1, 1:] + ring_W[0, 2, 1:]))
    np.testing.assert_allclose(right.tip_W, [0.0, 1.5 + 1.5 * np.cos(0.4), -1.5 * np.sin(0.4)])
