"""Deflections of control surfaces along a flight: prescribed like hinge angles, and lagged beforehand.

The circulation follows a deflection by Jones' function, with the semichord of the surface over the airspeed
as its time. A deflection is known in advance and the same for all parameter sets, so its lag is computed
once for each plan; an identified lag time concerns the motion of the links.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from morphcore.aero.kernels.loads import JONES_A1, JONES_A2, JONES_B1, JONES_B2
from morphcore.geometry.aircraft import Aircraft
from morphcore.simulate.schedule import Hold, Schedule

Array = NDArray[np.float64]


def of_every_part(aircraft: Aircraft, schedules: Sequence[Schedule]) -> list[Schedule]:
    """Return the schedules of all hinges, then of all controls; controls without any hold their angle.

    Raises
    ------
    ValueError
        The number of schedules is neither that of hinges nor that of hinges and controls.
    """
    hinges, controls = len(aircraft.hinges), aircraft.controls
    if len(schedules) == hinges:
        return [*schedules, *(Hold(control.angle_rad) for control in controls)]
    if len(schedules) != hinges + len(controls):
        raise ValueError(f"{len(schedules)} schedules for {hinges} hinges and {len(controls)} controls")
    return list(schedules)


def control_angles(aircraft: Aircraft, schedules: Sequence[Schedule], times_s: Array) -> Array:
    """Angles (k, c) of the drives of all controls at times (k,), from the schedules of every part."""
    own = of_every_part(aircraft, schedules)[len(aircraft.hinges) :]
    angles = np.zeros((times_s.size, len(own)))
    for column, schedule in enumerate(own):
        angles[:, column] = schedule.motion(times_s).angle
    return angles


def deflections(aircraft: Aircraft, angles: Array) -> Array:
    """Deflections (k, c), trailing edge down, from the angles of the controls' drives."""
    return np.asarray(angles * np.array([control.sign for control in aircraft.controls]))


def lagged_deflections(aircraft: Aircraft, airspeed_m_s: float, deflected: Array, spacing_s: float) -> Array:
    """Deflections (k, c) as the circulation follows them, from evenly spaced ones; settled at the first."""
    out = np.empty_like(deflected)
    column = 0
    for surface in aircraft.surfaces:
        semichord_s = 0.5 * surface.mean_chord_m / airspeed_m_s
        for _ in surface.controls:
            own = deflected[:, column]
            slow = _followed(own, semichord_s / JONES_B1, spacing_s)
            fast = _followed(own, semichord_s / JONES_B2, spacing_s)
            out[:, column] = (1.0 - JONES_A1 - JONES_A2) * own + JONES_A1 * slow + JONES_A2 * fast
            column += 1
    return out


def _followed(values: Array, time_s: float, spacing_s: float) -> Array:
    """The exact solution (k,) of T dz/dt = x - z for x straight between values (k,), from z = x."""
    if not np.any(values != values[0]):
        return values
    from scipy.signal import lfilter  # late: few flights move a control

    z = spacing_s / time_s
    decay, mean = np.exp(-z), -np.expm1(-z) / z
    # z[k] = decay z[k - 1] + (mean - decay) x[k - 1] + (1 - mean) x[k]
    change = values - values[0]  # begins at rest
    return np.asarray(values[0] + lfilter([1.0 - mean, mean - decay], [1.0, -decay], change))
