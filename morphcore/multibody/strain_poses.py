"""Beams described by their strains: poses from the roots outward, and the loads conjugate to the strains.

The logarithms ``d`` of the elements' relative poses are the coordinates, H_b = H_a exp(d) along each chain. A
change of one moves all that is outboard as one rigid body and stretches nothing else: unlike increments
of the nodes' poses, steps in bending do not excite the stretch, which is thousands of times stiffer.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from morphcore.multibody.beam import Beams, BeamTurnedTooFar, NodePoses
from morphcore.multibody.kernels.se3 import LARGEST_ANGLE

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]

SERIES_ROUNDING = 1e-18  # relative size of the terms that are left out


class StrainPoses:
    """Poses and loads of chains whose nodes are numbered one after the other from root to tip.

    Parameters
    ----------
    beams : the elements, those of a chain numbered from its root.
    roots, tips : (s,) first and last node of each chain.
    """

    def __init__(self, beams: Beams, roots: IntArray, tips: IntArray) -> None:
        self.beams = beams
        inner, outer = beams.ends.T
        self._inner, self._outer = inner, outer
        # elements at the same distance from their roots are placed together
        first = np.searchsorted(roots, inner, side="right") - 1
        depth = inner - roots[first]
        self._levels = [np.flatnonzero(depth == level) for level in range(int(depth.max(initial=-1)) + 1)]
        self._tips = tips[first]

    def place(self, d: Array, poses: NodePoses) -> None:
        """Put the nodes (n), those of the roots excepted, where the logarithms d (e, 6) say; in place.

        Raises
        ------
        BeamTurnedTooFar : an element turns by more than 1.5 rad.
        """
        turned = (d[:, :3] ** 2).sum(axis=1)
        if not (turned < LARGEST_ANGLE**2).all():
            element = int(np.argmax(turned))
            raise BeamTurnedTooFar(f"element {element} is bent too far", hint="use more elements")
        count = self.beams.elements
        step = NodePoses(np.tile(np.eye(3), (count, 1, 1)), np.zeros((count, 3)))
        step.move(np.ascontiguousarray(d))
        for level in self._levels:
            a, b = self._inner[level], self._outer[level]
            poses.x[b] = poses.x[a] + (poses.R[a] @ step.x[level, :, None])[..., 0]
            poses.R[b] = poses.R[a] @ step.R[level]

    def conjugate(self, d: Array, poses: NodePoses, forces: Array) -> Array:
        """Loads (e, 6) whose work on d is that of ``forces`` (n, 6) on the nodes, in node axes.

        A change of d moves the outer node by T(d) d' in its axes, and with it all nodes further out: the load
        is T(d)^T times the resultant of their forces at the outer node.
        """
        force = (poses.R @ forces[:, 3:, None])[..., 0]
        moment = (poses.R @ forces[:, :3, None])[..., 0] + _cross(poses.x, force)
        # sums over each node and all nodes after it; what lies beyond a chain's tip is taken off again
        sums = np.zeros((forces.shape[0] + 1, 6))
        sums[:-1] = np.concatenate([moment, force], axis=1)[::-1].cumsum(axis=0)[::-1]
        total = sums[self._outer] - sums[self._tips + 1]
        R, x = poses.R[self._outer], poses.x[self._outer]
        at_node = total[:, :3] - _cross(x, total[:, 3:])
        resultant = np.stack([at_node, total[:, 3:]], axis=1) @ R
        return transposed_tangent(d, resultant.reshape(-1, 6))


def transposed_tangent(d: Array, force: Array) -> Array:
    """T(d)^T f for each row of d and f, (e, 6); T(d) = sum (-1)^k ad(d)^k / (k + 1)!, `kernels.se3`."""
    bracket = np.zeros((d.shape[0], 6, 6))  # ad(d)^T
    bracket[:, :3, :3] = bracket[:, 3:, 3:] = -_skew(d[:, :3])
    bracket[:, :3, 3:] = -_skew(d[:, 3:])
    angle = float(np.sqrt((d[:, :3] ** 2).sum(axis=1)).max(initial=0.0))
    term = force[..., None].copy()
    total, size, k = term.copy(), 1.0, 0
    # the k-th term is of size k angle^(k - 1) / (k + 1)!: the lower block of ad(d) counts only once
    while size * (k + 1) > SERIES_ROUNDING:
        k += 1
        term = bracket @ term / -(k + 1.0)
        total += term
        size *= angle / (k + 2.0)
    return np.asarray(total[..., 0])


def _skew(v: Array) -> Array:
    """Matrices (e, 3, 3) of the cross products with the rows of v (e, 3)."""
    out = np.zeros((v.shape[0], 3, 3))
    out[:, 0, 1], out[:, 0, 2], out[:, 1, 2] = -v[:, 2], v[:, 1], -v[:, 0]
    out[:, 1, 0], out[:, 2, 0], out[:, 2, 1] = v[:, 2], -v[:, 1], v[:, 0]
    return out


def _cross(a: Array, b: Array) -> Array:
    """Cross products of rows (n, 3); numpy's own takes longer than all the rest here."""
    return a[:, [1, 2, 0]] * b[:, [2, 0, 1]] - a[:, [2, 0, 1]] * b[:, [1, 2, 0]]
