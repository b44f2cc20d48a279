"""Flutter of a uniform cantilever by strips: Theodorsen's loads on modes of bending and torsion.

Nothing is shared with the models: no lattice, no time integration, no indicial function.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import fsolve
from scipy.special import hankel2

Array = NDArray[np.float64]

ROOTS = (1.875104068711961, 4.694091132974174, 7.854757438237613, 10.995540734875467)  # cos cosh = -1
STATIONS = 400  # of the midpoint rule along the span


def theodorsen(k: float) -> complex:
    """Theodorsen's function of the reduced frequency."""
    return complex(hankel2(1, k) / (hankel2(1, k) + 1j * hankel2(0, k)))


class StripWing:
    """A uniform cantilever in incompressible flow.

    Parameters
    ----------
    span_m, chord_m : m. elastic_axis, mass_axis : fractions of the chord. mass : kg/m. inertia : about the
    elastic axis, kg m. ei_flap, gj : N m^2. density : kg/m^3. lagged_damping : whether the moment of the
    pitch rate about mid-chord, -pi rho b^3 V / 2, is multiplied by Theodorsen's function. In theory it is
    not: it belongs to a distribution of vortices along the chord whose sum is zero.
    """

    def __init__(
        self,
        *,
        span_m: float,
        chord_m: float,
        elastic_axis: float,
        mass_axis: float,
        mass: float,
        inertia: float,
        ei_flap: float,
        gj: float,
        density: float,
        lagged_damping: bool = False,
    ) -> None:
        y, modes = (np.arange(STATIONS) + 0.5) / STATIONS, len(ROOTS)
        roots = np.array(ROOTS)[:, None]
        ratio = (np.cosh(roots) + np.cos(roots)) / (np.sinh(roots) + np.sin(roots))
        bending = np.cosh(roots * y) - np.cos(roots * y) - ratio * (np.sinh(roots * y) - np.sin(roots * y))
        waves = (2.0 * np.arange(modes)[:, None] + 1.0) * 0.5 * np.pi
        torsion = np.sin(waves * y)
        step = span_m / STATIONS
        self.bb, self.bt, self.tt = (
            one @ other.T * step
            for one, other in ((bending, bending), (bending, torsion), (torsion, torsion))
        )
        arm = mass * (mass_axis - elastic_axis) * chord_m
        self.mass = np.block([[mass * self.bb, arm * self.bt], [arm * self.bt.T, inertia * self.tt]])
        stiffness = np.concatenate(
            [
                ei_flap * (roots[:, 0] / span_m) ** 4 * np.diag(self.bb),
                gj * (waves[:, 0] / span_m) ** 2 * np.diag(self.tt),
            ]
        )
        self.stiffness = np.diag(stiffness)
        self.b, self.a, self.density = 0.5 * chord_m, 2.0 * elastic_axis - 1.0, density
        self.lagged_damping = lagged_damping

    def dynamics(self, speed: float, omega: float) -> NDArray[np.complex128]:
        """Equations of (bending down, torsion nose up) at a frequency.

        Loads of Bisplinghoff, Ashley & Halfman (1955), equations 5-311 and 5-312.
        """
        a, b, s = self.a, self.b, 1j * omega
        lag = theodorsen(omega * b / speed)
        apparent, bound = np.pi * self.density * b**2, 2.0 * np.pi * self.density * speed * b * lag
        damping = 0.5 * (lag if self.lagged_damping else 1.0) - a
        at_three_quarters = speed + b * (0.5 - a) * s
        lift = (
            apparent * s**2 + bound * s,
            apparent * (speed * s - b * a * s**2) + bound * at_three_quarters,
        )
        arm = b * (a + 0.5)
        moment = (
            apparent * b * a * s**2 + arm * bound * s,
            apparent * (-speed * b * damping * s - b**2 * (0.125 + a**2) * s**2)
            + arm * bound * at_three_quarters,
        )
        air = np.block(
            [[lift[0] * self.bb, lift[1] * self.bt], [-moment[0] * self.bt.T, -moment[1] * self.tt]]
        )
        return np.asarray(self.mass * s**2 + self.stiffness + air)

    def flutter(self, speed: float, omega: float) -> tuple[float, float]:
        """Speed, m/s, and frequency, rad/s, at which a mode neither grows nor decays, near given ones."""

        def smallest(x: Array) -> list[float]:
            # scaled by the stiffness, whose entries differ by orders of magnitude
            values = np.linalg.eigvals(np.linalg.solve(self.stiffness, self.dynamics(x[0], x[1])))
            least = values[np.abs(values).argmin()]
            return [float(least.real), float(least.imag)]

        found, _, arrived, message = fsolve(smallest, [speed, omega], full_output=True)
        if arrived != 1:
            raise ArithmeticError(message)
        return float(found[0]), float(found[1])
