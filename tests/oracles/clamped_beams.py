"""Clamped chains of beam elements: statics under loads, natural modes, sections one at a time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import eigh

from morphcore.frames import skew
from morphcore.multibody.beam import (
    Beams,
    BeamWorkspace,
    NodePoses,
    Sections,
    expand_solution,
    factor,
    node_forces,
    reduce_right,
)
from morphcore.multibody.kernels.beam import beam_tangents

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]

MAX_ITERATIONS = 60
STATIC_TOLERANCE = 1e-11  # rad and m, of the last Newton step


class StaticsNotFound(Exception):
    """Newton's iteration for a beam at rest did not arrive."""


def sections_of(
    beams: Beams, work: BeamWorkspace, poses: NodePoses, V: Array, elements: IntArray, fractions: Array
) -> tuple[NodePoses, Array]:
    """Poses and twists (k, 6) of `Sections`, for the strains of the last `node_forces`."""
    sections = Sections(beams, elements, fractions)
    return sections.place(work, poses), sections.twists(V)


def subtract_section_forces(
    beams: Beams, work: BeamWorkspace, elements: IntArray, fractions: Array, forces: Array, out: Array
) -> None:
    """Subtract from out (n, 6) the nodes' share of force vectors (k, 6) on `Sections`, in section axes."""
    sections = Sections(beams, elements, fractions)
    at_origin = NodePoses(np.zeros((beams.nodes, 3, 3)), np.zeros((beams.nodes, 3)))
    sections.place(work, at_origin)  # the maps depend on the strains alone
    sections.subtract(forces, out)


@dataclass(frozen=True)
class DeadLoad:
    """A force vector on a node that keeps its direction in N: moment (3,) N m, force (3,) N."""

    node: int
    moment_N: tuple[float, float, float] = (0.0, 0.0, 0.0)
    force_N: tuple[float, float, float] = (0.0, 0.0, 0.0)


def clamped_equilibrium(
    beams: Beams,
    poses: NodePoses,
    loads: Sequence[DeadLoad] = (),
    *,
    follower: Array | None = None,
    gravity_N: ArrayLike = (0.0, 0.0, 0.0),
    increments: int = 1,
) -> NodePoses:
    """Poses at rest of chains whose roots (nodes that are no element's outer end) are clamped.

    Parameters
    ----------
    poses : where Newton's iteration starts. loads : dead loads; follower : (n, 6) loads in node axes.
    increments : equal steps in which the loads are applied.

    Raises
    ------
    StaticsNotFound : the iteration did not arrive. BeamTurnedTooFar.
    """
    now, work = poses.copy(), BeamWorkspace(beams)
    rest = np.zeros((beams.nodes, 6))
    gravity = np.asarray(gravity_N, dtype=np.float64)
    roots = np.setdiff1d(np.arange(beams.nodes), beams.ends[:, 1])
    right: Array = rest
    for part in np.linspace(0.0, 1.0, increments + 1)[1:]:
        for _ in range(MAX_ITERATIONS):
            right = -node_forces(beams, work, now, rest, rest, part * gravity)
            if follower is not None:
                right += part * follower
            turning = np.zeros((beams.nodes, 6, 6))  # a dead load's components change as its node turns
            for load in loads:
                for rows, vector_N in ((slice(3), load.moment_N), (slice(3, 6), load.force_N)):
                    vector = part * now.R[load.node].T @ vector_N
                    right[load.node, rows] += vector
                    turning[load.node, rows, :3] -= skew(vector)
            factor(beams, work, 0.0, 0.0, 1.0, turning)
            reduce_right(beams, work, right)
            right[roots] = 0.0
            expand_solution(beams, work, right)
            now.move(right * min(1.0, 0.3 / max(float(np.abs(right[:, :3]).max()), 1e-300)))
            if np.abs(right).max() < STATIC_TOLERANCE:
                break
        else:
            raise StaticsNotFound(
                f"the last step was {np.abs(right).max():.2g}: apply the load in more increments"
            )
    return now


def clamped_modes(beams: Beams, count: int) -> tuple[Array, Array]:
    """Lowest natural frequencies (count,), Hz, and shapes (count, n, 6) of clamped chains at rest."""
    work = BeamWorkspace(beams)
    work.strains[:] = beams.rest
    size = 6 * beams.nodes
    stiffness, mass = np.zeros((size, size)), np.zeros((size, size))
    for matrix, weights in ((mass, (1.0, 0.0, 0.0)), (stiffness, (0.0, 0.0, 1.0))):
        beam_tangents(
            beams.rest, beams.stiffness, beams.damping, beams.mass12, work.strains, work.rates,
            *weights, work.v, work.m, work.tangents,
        )  # fmt: skip
        for (a, b), block in zip(beams.ends, work.tangents, strict=True):
            index = np.concatenate([6 * a + np.arange(6), 6 * b + np.arange(6)])
            matrix[np.ix_(index, index)] += block
    for node, inertia in zip(beams.bodies, beams.inertia, strict=True):
        own = slice(6 * node, 6 * node + 6)
        mass[own, own] += inertia
    free = (6 * np.sort(beams.ends[:, 1])[:, None] + np.arange(6)).ravel()
    omega2, vectors = eigh(stiffness[np.ix_(free, free)], mass[np.ix_(free, free)])
    shapes = np.zeros((count, size))
    shapes[:, free] = vectors.T[:count]
    return np.sqrt(omega2[:count]) / (2.0 * np.pi), shapes.reshape(count, beams.nodes, 6)
