"""Lattice operators at nodes along a morph, and between them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from morphcore.shown import Shown
from morphcore.simulate.kernels.interpolate import blend

Array = NDArray[np.float64]


@dataclass(frozen=True, repr=False)
class ControlTable(Shown):
    """Loads of the controls at the nodes, and their deflections in time (m parts, `ControlSlopes`).

    matrices : (nodes, rows, m) for unit deflection. columns : (m,) of the operator that each adds to.
    deflection : (steps + 1, m) at each grid time, trailing edge down, lagged.
    """

    matrices: Array
    columns: NDArray[np.int64]
    deflection: Array


@dataclass(frozen=True, repr=False)
class OperatorTable(Shown):
    """Reduced lattice operators at nodes along the morph, interpolated by local cubics in the path length.

    matrices : (nodes, rows, columns); strips : (nodes, strips, 3); position : (steps + 1,) of each grid time
    among the nodes, in node spacings. controls : None without control surfaces.
    """

    matrices: Array
    strips: Array
    position: Array
    controls: ControlTable | None = None

    def at(self, rows: slice | NDArray[np.int64]) -> OperatorTable:
        """The table at some of the grid times."""
        controls = self.controls and replace(self.controls, deflection=self.controls.deflection[rows])
        return replace(self, position=self.position[rows], controls=controls)

    def between(self, first: int, last: int) -> tuple[Array, Array]:
        """Operators (k, rows, columns) and strips (k, strips, 3) at the grid times first..last - 1."""
        nodes = self.matrices.shape[0]
        position = self.position[first:last]
        if nodes == 1:
            base = np.zeros(position.size, dtype=np.int64)
            weights = np.ones((position.size, 1))
        else:
            base = np.clip(np.floor(position).astype(np.int64) - 1, 0, nodes - 4)
            s = position - base
            # Lagrange's cubic through four neighbours
            cubic = [np.prod([(s - j) / (i - j) for j in range(4) if j != i], axis=0) for i in range(4)]
            weights = np.stack(cubic, axis=1)
        operators = _blended(self.matrices, weights, base)
        if self.controls is not None:
            loads = _blended(self.controls.matrices, weights, base)
            loads *= self.controls.deflection[first:last, None, :]
            for part, column in enumerate(self.controls.columns):  # two controls may share a strip
                operators[:, :, column] += loads[:, :, part]
        return operators, _blended(self.strips, weights, base)


def _blended(nodes: Array, weights: Array, base: NDArray[np.int64]) -> Array:
    out = np.empty((base.size, *nodes.shape[1:]))
    blend(weights, base, nodes.reshape(nodes.shape[0], -1), out.reshape(base.size, -1))
    return out
