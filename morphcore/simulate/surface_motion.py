"""Motion of the surfaces relative to the fuselage, from that of their hinges."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from morphcore.geometry.aircraft import Aircraft
from morphcore.geometry.hinge import hinged_pose
from morphcore.multibody.hinges import relative_motion
from morphcore.multibody.kernels.hinge import H_ORIGIN, H_ROTATION, H_TWIST, HINGE_ROWS

Array = NDArray[np.float64]


def surface_rows(aircraft: Aircraft, angles: Array, rates: Array) -> Array:
    """Rows (k, s, HINGE_ROWS) of the surfaces' motion for the kernels, from that of all hinges (k, h).

    See multibody/kernels/hinge.py.
    """
    rows = np.empty((angles.shape[0], len(aircraft.surfaces), HINGE_ROWS))
    for number, (surface, own) in enumerate(zip(aircraft.surfaces, aircraft.hinge_columns, strict=True)):
        arms, rest = surface.root_arms_B, surface.rest_R_BW
        R_BW, origin_B = hinged_pose(surface.hinges, arms, angles[:, own], rest)
        still = 0.0 * rates[:, own]
        twist, _ = relative_motion(surface.hinges, arms, angles[:, own], rates[:, own], still, rest)
        rows[:, number, H_ROTATION:H_TWIST] = R_BW.reshape(-1, 9)
        rows[:, number, H_TWIST:H_ORIGIN] = twist
        rows[:, number, H_ORIGIN:] = origin_B
    return rows


def surface_accelerations(aircraft: Aircraft, angles: Array, rates: Array, accelerations: Array) -> Array:
    """Time derivative (k, s, 6) of the surfaces' twist relative to the fuselage, from the hinges' motion."""
    return np.stack(
        [
            relative_motion(
                surface.hinges,
                surface.root_arms_B,
                angles[:, own],
                rates[:, own],
                accelerations[:, own],
                surface.rest_R_BW,
            )[1]
            for surface, own in zip(aircraft.surfaces, aircraft.hinge_columns, strict=True)
        ],
        axis=1,
    )
