"""Beams by their strains: poses compose exponentials, loads do the work of the nodes' forces."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from morphcore.multibody.beam import (
    BeamTurnedTooFar,
    BeamWorkspace,
    NodePoses,
    Section,
    make_beams,
    node_forces,
)
from morphcore.multibody.strain_poses import StrainPoses

Array = NDArray[np.float64]

SECTION = Section(np.diag([2.0, 3.0, 50.0, 400.0, 1e5, 300.0]), np.diag([0.1, 0.2, 0.3, 1.0, 1.0, 1.0]))
ROOTS, TIPS = np.array([1, 5, 6]), np.array([4, 5, 8])  # three elements, a rigid surface, two elements


def chains() -> tuple[StrainPoses, NodePoses]:
    """Two chains of unlike length with a rigid surface between them, and their roots' random poses."""
    ends = [[1, 2], [2, 3], [3, 4], [6, 7], [7, 8]]
    rest = [[0.0, 0.0, 0.0, 0.1, 0.7, 0.0]] * 3 + [[0.0, 0.0, 0.1, 0.0, -0.5, 0.1]] * 2
    beams = make_beams(ends, rest, [[SECTION] * 3] * 5, 0.0, nodes=9)
    rng = np.random.default_rng(3)
    poses = NodePoses(np.tile(np.eye(3), (9, 1, 1)), np.zeros((9, 3)))
    poses.move(rng.normal(size=(9, 6)))
    return StrainPoses(beams, ROOTS, TIPS), poses


def test_logarithms_are_those_that_were_placed() -> None:
    """The kernel that computes an element's logarithm from its nodes' poses finds the given one: 1e-13."""
    strains, poses = chains()
    d = strains.beams.rest + np.random.default_rng(1).normal(scale=0.3, size=(5, 6))
    before = poses.copy()
    strains.place(d, poses)
    work = BeamWorkspace(strains.beams)
    still = np.zeros((9, 6))
    node_forces(strains.beams, work, poses, still, still, np.zeros(3))
    np.testing.assert_allclose(work.strains, d, rtol=0.0, atol=1e-13)
    for node in (0, *ROOTS):
        np.testing.assert_array_equal(poses.R[node], before.R[node])
        np.testing.assert_array_equal(poses.x[node], before.x[node])


@pytest.mark.parametrize("size", [0.0, 1e-3, 0.3, 0.5])
def test_loads_do_the_work_of_the_forces(size: float) -> None:
    """Virtual work by finite differences of the nodes' poses: central differences of 1e-6, to 1e-8."""
    strains, poses = chains()
    rng = np.random.default_rng(2)
    d = strains.beams.rest + rng.normal(scale=size, size=(5, 6))
    forces = rng.normal(size=(9, 6))
    strains.place(d, poses)
    loads = strains.conjugate(d, poses, forces)
    for e in range(5):
        for k in range(6):
            ends = []
            for step in (1e-6, -1e-6):
                moved, there = d.copy(), poses.copy()
                moved[e, k] += step
                strains.place(moved, there)
                ends.append(there)
            change = 5e5 * (ends[0].x - ends[1].x)
            turning = 5e5 * (ends[0].R - ends[1].R)
            work = 0.0
            for n in range(9):
                spin = poses.R[n].T @ turning[n]
                omega = 0.5 * np.array(
                    [spin[2, 1] - spin[1, 2], spin[0, 2] - spin[2, 0], spin[1, 0] - spin[0, 1]]
                )
                work += forces[n, :3] @ omega + forces[n, 3:] @ poses.R[n].T @ change[n]
            assert loads[e, k] == pytest.approx(work, rel=1e-7, abs=1e-8)


def test_internal_forces_alone_are_the_stiffness() -> None:
    """The loads of the forces that strain requires at the nodes are K (d - rest), element by element."""
    strains, poses = chains()
    beams = strains.beams
    d = beams.rest + np.random.default_rng(4).normal(scale=0.2, size=(5, 6))
    strains.place(d, poses)
    still = np.zeros((9, 6))
    forces = node_forces(beams, BeamWorkspace(beams), poses, still, still, np.zeros(3))
    expected = np.einsum("eij,ej->ei", beams.stiffness, d - beams.rest)
    scale = np.abs(expected).max()
    np.testing.assert_allclose(strains.conjugate(d, poses, forces), expected, rtol=0.0, atol=1e-11 * scale)


def test_an_element_that_turns_too_far_is_refused() -> None:
    """Beyond 1.5 rad the logarithm of the poses would no longer be the given one."""
    strains, poses = chains()
    d = strains.beams.rest.copy()
    d[3, 1] = 1.6
    with pytest.raises(BeamTurnedTooFar, match="element 3"):
        strains.place(d, poses)
