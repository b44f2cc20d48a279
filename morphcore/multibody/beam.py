"""Chains of geometrically exact beam elements with bodies at their nodes: forces and solves.

The mechanics are in kernels/beam.py; this module is their typed interface. Nodes have poses R (n, 3, 3), node
axes to N, and x (n, 3) in N; twists and their rates (n, 6) [omega; v] in node axes. Forces are force vectors
[n; f] (n, 6), N m and N, in node axes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from morphcore.errors import MorphError
from morphcore.frames import skew
from morphcore.multibody.kernels.beam import (
    MATRIX_SCRATCH,
    VECTOR_SCRATCH,
    beam_forces,
    beam_tangents,
    body_forces,
    condense,
    eliminate,
    place_sections,
    section_twists,
    substitute,
    subtract_forces,
)
from morphcore.multibody.kernels.helix import helix_series
from morphcore.multibody.kernels.poses import move_poses

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]

# Gauss points of an element's inertia: the helix is of second degree, its kinetic energy of fourth degree
_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(3)
GAUSS, GAUSS_WEIGHTS = 0.5 * (1.0 + _POINTS), 0.5 * _WEIGHTS
GAUSS_SERIES = helix_series(GAUSS)


class BeamTurnedTooFar(MorphError):
    """An element's rotation exceeds the range of its logarithm; more elements are needed."""

    code = "beam_turned_too_far"


@dataclass(frozen=True)
class Section:
    """Stiffness and mass of a cross-section in node axes, [rotation; translation].

    stiffness : (6, 6), of moments (N m) to curvatures and twist (rad/m) and of forces (N) to strains.
    mass : (6, 6) spatial inertia per length about the node axes, kg m, kg and kg/m.
    """

    stiffness: Array
    mass: Array


@dataclass(frozen=True)
class Beams:
    """Elements of one or more open chains, each numbered from its root (e elements, n nodes, g points).

    ends : (e, 2) inner and outer node. rest : (e, 6) logarithm of the unstrained relative pose. stiffness :
    (e, 6, 6) conjugate to it. damping : (e,) s, of stiffness-proportional damping. mass : (e, g, 6, 6).
    mass12 : (e, 12, 12) consistent mass matrix at rest. bodies, inertia : (k,), (k, 6, 6) rigid bodies and
    the nodes they sit on. nodes : n.
    """

    ends: IntArray
    rest: Array
    stiffness: Array
    damping: Array
    mass: Array
    mass12: Array
    bodies: IntArray
    inertia: Array
    nodes: int

    @property
    def elements(self) -> int:
        """Number of elements."""
        return int(self.ends.shape[0])


@dataclass
class NodePoses:
    """Poses of the nodes: R (n, 3, 3), node axes to N; x (n, 3) m. Scratch that changes in time."""

    R: Array
    x: Array

    def copy(self) -> NodePoses:
        """Return a copy."""
        return NodePoses(self.R.copy(), self.x.copy())

    def move(self, increments: Array) -> None:
        """Move every node by the exponential of its increment (n, 6) in node axes, rad and m."""
        move_poses(increments, self.R, self.x, np.empty((7, 3)))


def carried(poses: NodePoses, leader: int, motion: Array, nodes: slice) -> Array:
    """A motion vector (6,) of node ``leader``, carried rigidly to ``nodes``: (m, 6), in their axes."""
    R = poses.R[leader].T @ poses.R[nodes]
    arm = (poses.x[nodes] - poses.x[leader]) @ poses.R[leader]
    linear = motion[3:] + np.cross(motion[:3], arm)
    return np.concatenate([np.einsum("nij,i->nj", R, motion[:3]), np.einsum("nij,ni->nj", R, linear)], axis=1)


class BeamWorkspace:
    """Scratch of one thread for some beams."""

    def __init__(self, beams: Beams) -> None:
        self.v: Array = np.zeros((VECTOR_SCRATCH, 6))
        self.m: Array = np.zeros((MATRIX_SCRATCH, 6, 6))
        self.poses: Array = np.zeros((2, 4, 3))
        self.strains: Array = np.zeros((beams.elements, 6))
        self.rates: Array = np.zeros((beams.elements, 6))
        self.tangents: Array = np.zeros((beams.elements, 12, 12))
        self.inverses: Array = np.zeros((beams.elements, 6, 6))
        self.couplings: Array = np.zeros((beams.elements, 6, 6))
        self.diagonals: Array = np.zeros((beams.nodes, 6, 6))


def make_beams(
    ends: ArrayLike,
    rest: ArrayLike,
    sections: Sequence[Sequence[Section]],
    damping_s: ArrayLike,
    *,
    bodies: ArrayLike = (),
    inertia: ArrayLike = (),
    nodes: int | None = None,
) -> Beams:
    """Integrate elements from their sections at the Gauss points.

    Parameters
    ----------
    ends : (e, 2) nodes. rest : (e, 6) logarithms of the relative poses at rest.
    sections : for each element, one section at each of the three Gauss points.
    damping_s : (e,) or one number. bodies, inertia : rigid bodies on nodes (k,), (k, 6, 6).
    nodes : number of nodes, if some carry no element.
    """
    end_nodes = np.array(ends, dtype=np.int64).reshape(-1, 2)
    at_rest = np.array(rest, dtype=np.float64).reshape(-1, 6)
    count = end_nodes.shape[0]
    stiffness = np.empty((count, 6, 6))
    mass = np.empty((count, GAUSS.size, 6, 6))
    for e in range(count):
        along = at_rest[e, 3:]
        length = float(np.sqrt(along @ along))
        stiffness[e] = np.linalg.inv(element_flexibility(along, [s.stiffness for s in sections[e]]))
        for g, section in enumerate(sections[e]):
            mass[e, g] = GAUSS_WEIGHTS[g] * length * section.mass
    beams = Beams(
        ends=end_nodes,
        rest=at_rest,
        stiffness=stiffness,
        damping=np.broadcast_to(np.asarray(damping_s, dtype=np.float64), (count,)).copy(),
        mass=mass,
        mass12=np.zeros((count, 12, 12)),
        bodies=np.array(bodies, dtype=np.int64).reshape(-1),
        inertia=np.array(inertia, dtype=np.float64).reshape(-1, 6, 6),
        nodes=nodes if nodes is not None else int(end_nodes.max(initial=-1)) + 1,
    )
    for value in vars(beams).values():
        if isinstance(value, np.ndarray):
            value.setflags(write=False)
    return replace(beams, mass12=_consistent_mass(beams))


def element_flexibility(along: Array, section_stiffness: Sequence[Array]) -> Array:
    """Flexibility (6, 6) of an element's relative displacement, at its middle, under loads at its ends.

    A force f and moment m through the middle produce the moment m - (s - 1/2) along x f at s; the integral of
    B^T C^-1 B over the length is exact for straight elements with constant or varying sections.

    Parameters
    ----------
    along : (3,) from inner to outer node at rest, m. section_stiffness : (6, 6) at each Gauss point.
    """
    total = np.zeros((6, 6))
    for part in flexibility_parts(along, section_stiffness):
        total += part
    return total


def flexibility_parts(along: Array, section_stiffness: Sequence[Array]) -> list[Array]:
    """What each Gauss point adds to `element_flexibility`."""
    length, parts = float(np.sqrt(along @ along)), []
    for s, weight, stiffness in zip(GAUSS, GAUSS_WEIGHTS, section_stiffness, strict=True):
        B = np.eye(6)
        B[:3, 3:] = -(s - 0.5) * skew(along)
        parts.append(weight * length * B.T @ np.linalg.solve(stiffness, B))
    return parts


def node_forces(
    beams: Beams, work: BeamWorkspace, poses: NodePoses, V: Array, A: Array, gravity_N: Array
) -> Array:
    """Forces (n, 6) that strain, inertia and weight require at the nodes; zero in motion without other loads.

    Raises
    ------
    BeamTurnedTooFar : an element turns by more than 1.5 rad.
    """
    out = np.zeros((beams.nodes, 6))
    failed = beam_forces(
        beams.ends, beams.rest, beams.stiffness, beams.damping, beams.mass, GAUSS, GAUSS_SERIES,
        poses.R, poses.x, V, A, gravity_N, work.v, work.poses, work.strains, work.rates, out,
    )  # fmt: skip
    if failed >= 0:
        raise BeamTurnedTooFar(f"element {failed} is bent too far", hint="use more elements")
    body_forces(beams.bodies, beams.inertia, poses.R, V, A, gravity_N, work.v, out)
    return out


class Sections:
    """Sections of some beams, with the maps between their twists and the nodes' at their last position.

    Parameters
    ----------
    elements, fractions : (k,) element and position in it, 0..1; element -1 - i stands for node i itself.
    """

    def __init__(self, beams: Beams, elements: IntArray, fractions: Array) -> None:
        self.beams, self.elements, self.fractions = beams, elements, fractions
        self.series: Array = helix_series(fractions)
        self.blocks: Array = np.zeros((elements.size, 2, 3, 3))

    def place(self, work: BeamWorkspace, poses: NodePoses) -> NodePoses:
        """Compute the poses of the sections for the strains of the last `node_forces`."""
        count = self.elements.size
        found = NodePoses(np.empty((count, 3, 3)), np.empty((count, 3)))
        place_sections(
            self.beams.ends, self.fractions, self.series, self.elements, work.strains, poses.R, poses.x,
            work.v, work.poses, found.R, found.x, self.blocks,
        )  # fmt: skip
        return found

    def twists(self, V: Array) -> Array:
        """Twists (k, 6) in the sections' axes for the nodes' twists V (n, 6)."""
        out = np.empty((self.elements.size, 6))
        section_twists(self.beams.ends, self.elements, self.blocks, V, out)
        return out

    def subtract(self, forces: Array, out: Array) -> None:
        """Subtract from out (n, 6) the nodes' share of force vectors (k, 6) on sections, in section axes."""
        subtract_forces(self.beams.ends, self.elements, self.blocks, forces, out)


def factor(
    beams: Beams,
    work: BeamWorkspace,
    of_mass: float,
    of_rate: float,
    of_pose: float,
    on_nodes: Array | None = None,
) -> None:
    """Factor of_mass M + of_rate C + of_pose K + on_nodes (n, 6, 6) at the strains of the last `node_forces`.

    Afterwards ``work.diagonals`` holds the condensed matrix of each chain at its root.
    """
    beam_tangents(
        beams.rest, beams.stiffness, beams.damping, beams.mass12, work.strains, work.rates,
        of_mass, of_rate, of_pose, work.v, work.m, work.tangents,
    )  # fmt: skip
    work.diagonals[:] = 0.0 if on_nodes is None else on_nodes
    np.add.at(work.diagonals, beams.bodies, of_mass * beams.inertia)
    eliminate(beams.ends, work.tangents, work.diagonals, work.inverses, work.couplings, work.m)


def reduce_right(beams: Beams, work: BeamWorkspace, right: Array) -> None:
    """First half of a solve, in place: condense the right-hand sides (n, 6) to the roots."""
    condense(beams.ends, work.tangents, work.inverses, work.v, right)


def expand_solution(beams: Beams, work: BeamWorkspace, right: Array) -> None:
    """Second half, in place: from the roots' solutions in their rows, compute those of all nodes."""
    substitute(beams.ends, work.couplings, right)


def _consistent_mass(beams: Beams) -> Array:
    """``mass12``: the kernel's forces for unit accelerations of each element on its own, at rest."""
    R, x = np.tile(np.eye(3), (2, 1, 1)), np.zeros((2, 3))
    zero, unit, none = np.zeros((2, 6)), np.zeros((2, 6)), np.zeros(3)
    v, scratch = np.zeros((VECTOR_SCRATCH, 6)), np.zeros((2, 4, 3))
    ends, strain = np.array([[0, 1]]), np.zeros((1, 6))
    ends.setflags(write=False)  # the same types as in Beams, so that it is compiled only once
    found = np.zeros((beams.elements, 12, 12))
    for e in range(beams.elements):
        R[1], x[1] = np.eye(3), 0.0
        move_poses(np.stack([np.zeros(6), beams.rest[e]]), R, x, np.empty((7, 3)))
        for column in range(12):
            unit[:] = 0.0
            unit[column // 6, column % 6] = 1.0
            out = np.zeros((2, 6))
            beam_forces(
                ends, beams.rest[e : e + 1], beams.stiffness[e : e + 1], beams.damping[e : e + 1],
                beams.mass[e : e + 1], GAUSS, GAUSS_SERIES, R, x, zero, unit, none, v, scratch, strain,
                strain.copy(), out,
            )  # fmt: skip
            found[e, :, column] = out.ravel()
    found.setflags(write=False)
    return found
