"""Places of links and tips against the poses of the separately built tree."""

from __future__ import annotations

import numpy as np
import pytest

from morphcore.models.kinematics import gimbal_rotation, link_poses, tip_positions
from tests.models.chains import (
    example_flight,
    instant,
    motion_of,
    odd_aircraft,
    random_batch,
    random_hinges,
    random_state,
    small_model,
)
from tests.oracles.chain_tree import chain_tree, link_bodies
from tests.oracles.dynamics import body_poses


@pytest.mark.parametrize("links", [1, 2, 5])
def test_links_are_where_the_tree_has_them(links):
    """Poses in B of every link, hinges and gimbals turned at random, are the tree's."""
    rng = np.random.default_rng(links)
    model = small_model(odd_aircraft(rng), example_flight(), links)
    batch, hinges = random_batch(rng, model, 3), random_hinges(rng, model)
    state = random_state(rng, model, 3)
    state[:, :4], state[:, 10:13] = [1.0, 0.0, 0.0, 0.0], 0.0
    rows = instant(model, hinges).hinges[0]
    R_BL, r_B = link_poses(model, batch, rows, state[:, 13 : 13 + model.coordinates])
    tips = tip_positions(model, batch, rows, state[:, 13 : 13 + model.coordinates])
    bodies, origins = link_bodies(model)
    for p in range(3):
        R_NX, r_N = body_poses(chain_tree(model, batch, p), motion_of(model, hinges, state[p]))
        np.testing.assert_allclose(R_BL[p], R_NX[bodies], atol=1e-13)
        places = r_N[bodies] + np.einsum("kab,kb->ka", R_NX[bodies], origins)
        np.testing.assert_allclose(r_B[p], places, atol=1e-13)
        for s, surface in enumerate(model.aircraft.surfaces):
            first, count = model.surfaces[s, :2]
            # walk out along the links: the tip is the span away along them
            at = places[first].copy()
            for k in range(first, first + count):
                length = np.linalg.norm(places[k + 1] - places[k]) if k + 1 < first + count else None
                if length is None:
                    walked = sum(
                        np.linalg.norm(places[i + 1] - places[i]) for i in range(first, first + count - 1)
                    )
                    length = surface.span_m - walked
                at = at + R_NX[bodies[k]][:, 1] * surface.span_sign * length
            np.testing.assert_allclose(tips[p, s], at - places[first], atol=1e-12)


def test_small_angles_commute():
    """Flap, torsion and edgewise of a gimbal are rotations about x, y, z: to first order a cross product."""
    angles = 1e-6 * np.array([1.0, -2.0, 3.0])
    expected = np.eye(3) + np.array(
        [[0.0, -angles[2], angles[1]], [angles[2], 0.0, -angles[0]], [-angles[1], angles[0], 0.0]]
    )
    np.testing.assert_allclose(gimbal_rotation(angles), expected, atol=1e-11)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_each_axis_alone_is_its_plane_rotation(axis):
    """One angle alone turns the two other axes, right-handed."""
    angles = np.zeros(3)
    angles[axis] = 0.7
    turned = gimbal_rotation(angles)[:, (axis + 1) % 3]
    assert turned[(axis + 1) % 3] == pytest.approx(np.cos(0.7))
    assert turned[(axis + 2) % 3] == pytest.approx(np.sin(0.7))
