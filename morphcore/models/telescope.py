"""What the mouth of a telescoping panel takes from its drive: strain energy of parts drawn in and let out.

A bent panel stores energy in its visible part. The mouth straightens what is drawn in, so the drive does the
work by which the energy changes at held shape, and a bent panel pushes itself outward: the configurational
force of a sliding beam (Bigoni et al. 2015, Mech. Mater. 80, 368).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from morphcore.aero.kernels.loads import L_DRAG_Y
from morphcore.models.equivalent import ChainModel
from morphcore.models.kernels.layout import JOINTS, LINKS_C, constant_rows
from morphcore.models.kernels.telescope import HELD
from morphcore.multibody.kernels.articulated import LINK_ROWS

Array = NDArray[np.float64]


def mouth_forces(model: ChainModel, constants: Array, angles: Array, states: Array) -> Array:
    """Derivatives (t, h), N, of the joints' strain energy with respect to the extension of each hinge.

    Parameters
    ----------
    constants : ndarray, shape (rows, width)
        Of the block, of which the first lane is flown.
    angles : ndarray, shape (t, h)
        Of all hinges, rad or m.
    states : ndarray, shape (t, state_rows)
    """
    out = np.zeros_like(angles)
    c_stiffness, _, _ = constant_rows(model.links, model.coordinates)
    joint = 0
    for number, surface in enumerate(model.aircraft.surfaces):
        first, count = int(model.surfaces[number, 0]), int(model.surfaces[number, 1])
        begin = 0.0
        for k in range(count - 1):
            if surface.mouth_m is not None:
                column = model.aircraft.hinge_columns[number].stop - 1
                end = constants[LINKS_C + LINK_ROWS * (first + k) + L_DRAG_Y, 0]
                hidden = np.maximum(surface.mouth_m - angles[:, column], 0.0)
                whole = (surface.length_m - begin) ** 2 - (surface.length_m - end) ** 2
                seen = np.clip(hidden, begin, end)
                share = ((surface.length_m - seen) ** 2 - (surface.length_m - end) ** 2) / whole
                slope = np.where(
                    (hidden > begin) & (share > HELD), 2.0 * (surface.length_m - hidden) / whole, 0.0
                )
                rows = slice(3 * joint, 3 * joint + 3)
                stiffness = constants[c_stiffness + 3 * joint : c_stiffness + 3 * joint + 3, 0]
                turned = states[:, JOINTS : JOINTS + model.coordinates][:, rows]
                energy = 0.5 * np.sum(stiffness * turned**2, axis=1)
                out[:, column] -= energy * slope / np.maximum(share, HELD) ** 2
                begin = end
            joint += 1
    return out
