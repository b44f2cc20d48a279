"""A cantilever in large bending and twist under given loads: Kirchhoff's rod on a grid, by curvature."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import newton_krylov
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Loads:
    """Dead loads in N: points (k,) m from the root with forces and moments (k, 3); (3,) per length, N/m."""

    at_m: Array
    force_N: Array
    moment_N: Array
    per_length_N: Array


def cantilever_tip(
    length_m: float, rigidity: Array, root_R: Array, axis: Array, loads: Loads, cells: int = 320
) -> Array:
    """Tip position (3,) relative to the root, in N, of an inextensible rod without shear.

    Love (1927), chapter 18: the curvature in section axes is the moment there over the ``rigidity`` (3,) EI,
    GJ, EI about these axes. Moments are sums over all loads further out; axes turn by the curvature of each
    cell, midpoint rule. The rod runs along ``axis`` (3,) of the section axes ``root_R`` (3, 3).
    """
    width = length_m / cells
    ends = np.arange(cells + 1) * width
    middle = 0.5 * (ends[1:] + ends[:-1])
    inside = np.clip((loads.at_m / width).astype(int), 0, cells - 1)

    def shape(curvature: Array) -> tuple[Array, Array]:
        """Section axes (cells, 3, 3) at the middles, and positions (cells + 1, 3) of the ends."""
        R, axes = Rotation.from_matrix(root_R), []
        for half in Rotation.from_rotvec(0.5 * width * curvature):
            R = R * half
            axes.append(R.as_matrix())
            R = R * half
        middles = np.stack(axes)
        return middles, np.concatenate([np.zeros((1, 3)), np.cumsum(width * middles @ axis, axis=0)])

    def excess(curvature: Array) -> Array:
        R, x = shape(curvature)
        place = x[inside] + (loads.at_m / width - inside)[:, None] * (x[inside + 1] - x[inside])
        centre = 0.5 * (x[1:] + x[:-1])
        moment = np.empty((cells, 3))
        for cell in range(cells):
            beyond = loads.at_m > middle[cell]
            arms = place[beyond] - centre[cell]
            moment[cell] = loads.moment_N[beyond].sum(axis=0)
            moment[cell] += np.cross(arms, loads.force_N[beyond]).sum(axis=0)
            # the rest of this cell, and all cells after it
            weight = np.cross(0.25 * (x[cell + 1] - x[cell]), 0.5 * width * loads.per_length_N)
            arms = centre[cell + 1 :] - centre[cell]
            moment[cell] += weight + np.cross(arms.sum(axis=0), width * loads.per_length_N)
        return np.asarray(curvature - np.einsum("kij,ki->kj", R, moment) / rigidity)

    found = newton_krylov(excess, np.zeros((cells, 3)), f_tol=1e-9, method="lgmres")
    return shape(np.asarray(found))[1][-1]
