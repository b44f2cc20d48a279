"""Flutter of two wings of the literature, by flights of the flexible model with a root that hardly moves.

And by strips, which is where the literature's figures come from.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from morphcore.simulate.flight import simulate
from morphcore.simulate.schedule import Spline
from morphdata.aircraft import Aircraft
from morphdata.flight import Flight
from morphdata.lattice import Lattice
from tests.oracles.strip_flutter import StripWing

Array = NDArray[np.float64]

ROOT_KG = 1e7  # of the fuselage, with as much inertia: the root is clamped
ORDER = 8  # of the linear recurrence: four modes
KICK_RAD = 1e-4


@dataclass(frozen=True)
class Wing:
    """A uniform cantilever; elastic and mass axis as fractions of the chord, inertia about the former."""

    span_m: float
    chord_m: float
    elastic_axis: float
    mass_axis: float
    mass: float
    inertia: float
    ei_flap: float
    ei_edge: float
    gj: float

    @property
    def own_inertia(self) -> float:
        """Inertia per length about the mass axis, kg m."""
        return self.inertia - self.mass * ((self.mass_axis - self.elastic_axis) * self.chord_m) ** 2

    def document(self, side: str) -> dict[str, object]:
        """The wing on a hinge that can kick it."""
        return {
            "name": side,
            "side": side,
            "span_m": self.span_m,
            "chord_m": self.chord_m,
            "thickness_m": 0.1 * self.chord_m,
            "elastic_axis_offset_m": (self.elastic_axis - 0.5) * self.chord_m,
            "mass_axis_offset_m": (self.mass_axis - 0.5) * self.chord_m,
            "material": {"density_kg_m3": 100.0, "youngs_modulus_pa": 1e9},
            "section": {
                "ei_flap_n_m2": self.ei_flap,
                "ei_edge_n_m2": self.ei_edge,
                "gj_n_m2": self.gj,
                "mass_per_length_kg_m": self.mass,
                # torsion is what matters; of flat sections the other two are next to nothing and that
                "inertia_per_length_kg_m": [1e-4 * self.own_inertia, self.own_inertia, self.own_inertia],
            },
            "hinge": {"position_m": [0.0, 0.0, 0.0], "axis": "x"},
        }


GOLAND = Wing(6.096, 1.8288, 0.33, 0.43, 35.71, 8.64, 9.77e6, 9.77e8, 0.987e6)
PATIL = Wing(16.0, 1.0, 0.5, 0.5, 0.75, 0.1, 2e4, 4e6, 1e4)


def least_damped(wing: Wing, density: float, speed_m_s: float, duration_s: float, near: float) -> complex:
    """Growth rate and frequency, 1/s and rad/s, of the mode near a frequency that is left after a kick."""
    root = {"mass_kg": ROOT_KG, "inertia_kg_m2": [1e4 * ROOT_KG] * 3}
    flown = simulate(
        Aircraft.parse({"fuselage": root, "surfaces": [wing.document("right"), wing.document("left")]}),
        Flight.parse(
            {
                "airspeed_m_s": speed_m_s,
                "air_density_kg_m3": density,
                "gravity_m_s2": 0.0,
                "apparent_mass": True,
                "start": {"alpha_rad": 0.0},
            }
        ),
        {"fold": Spline(duration_s * np.array([0.0, 0.05, 0.1]), np.array([0.0, KICK_RAD, 0.0]))},
        model="flexible",
        duration_s=duration_s,
        output_step_s=duration_s / 400.0,
        step_s=duration_s / 2000.0,
        start="given",
        lattice=Lattice(chordwise=4, spanwise=16),
        elements=16,
        channels=["tip_twist"],
    ).trajectory
    later = flown.time_s > 0.3 * duration_s
    twist = next(iter(flown.channels.values()))[later]
    # free decay follows a linear recurrence, whose roots are exp(s dt) (Prony)
    rows = np.stack([twist[i : twist.size - ORDER + i] for i in range(ORDER)], axis=1)
    weights = np.linalg.lstsq(rows, twist[ORDER:], rcond=1e-12)[0]
    roots = np.roots(np.concatenate([[1.0], -weights[::-1]]))
    found = np.log(roots.astype(complex)) / (flown.time_s[1] - flown.time_s[0])
    close = found[(found.imag > 0.5 * near) & (found.imag < 2.0 * near)]
    return complex(close[np.argmax(close.real)])


def by_strips(wing: Wing, density: float, *, lagged_damping: bool = False) -> StripWing:
    """The wing in strip theory."""
    return StripWing(
        span_m=wing.span_m,
        chord_m=wing.chord_m,
        elastic_axis=wing.elastic_axis,
        mass_axis=wing.mass_axis,
        mass=wing.mass,
        inertia=wing.inertia,
        ei_flap=wing.ei_flap,
        gj=wing.gj,
        density=density,
        lagged_damping=lagged_damping,
    )


@pytest.mark.parametrize(
    ("wing", "density", "speed_m_s", "omega"), [(GOLAND, 1.225, 137.0, 70.7), (PATIL, 0.0889, 32.2, 22.6)]
)
def test_the_literature_is_strip_theory(wing: Wing, density: float, speed_m_s: float, omega: float) -> None:
    """Theodorsen's loads on four modes each of bending and torsion: 1.1 per cent from the figures."""
    speed, frequency = by_strips(wing, density).flutter(speed_m_s, omega)
    print(f"{speed:.2f} m/s, {frequency:.2f} rad/s")
    assert speed == pytest.approx(speed_m_s, rel=0.012)
    assert frequency == pytest.approx(omega, rel=0.012)


def test_what_the_lag_on_the_pitch_rate_does() -> None:
    """The models' lag acts on all circulation, so on the moment of the pitch rate, too, which has no lag.

    By strips this raises the frequency of Patil's flutter by 15 per cent, from 22.4 to 25.7 rad/s, and lowers
    its speed by 16. Finite span raises the speed: `test_flutter` has 24.1 rad/s and 32.1 m/s.
    """
    speed, frequency = by_strips(PATIL, 0.0889).flutter(32.2, 22.6)
    slower, faster = by_strips(PATIL, 0.0889, lagged_damping=True).flutter(29.0, 25.0)
    print(f"{slower:.2f} m/s, {faster:.2f} rad/s")
    assert faster / frequency == pytest.approx(1.147, abs=0.01)
    assert slower / speed == pytest.approx(0.844, abs=0.01)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("wing", "density", "speeds", "duration_s", "measured", "figures", "apart"),
    [
        # figures of unsteady vortex lattices
        (GOLAND, 1.225, (175.0, 183.0), 1.0, (178.9, 67.2), (165.0, 69.0), (0.09, 0.05)),
        # by strips, without the tip's loss of lift (Patil, Hodges & Cesnik 2001)
        (PATIL, 0.0889, (31.0, 34.0), 3.0, (32.1, 24.1), (32.2, 22.6), (0.05, 0.07)),
    ],
)
def test_flutter(
    wing: Wing,
    density: float,
    speeds: tuple[float, float],
    duration_s: float,
    measured: tuple[float, float],
    figures: tuple[float, float],
    apart: tuple[float, float],
) -> None:
    """The mode that is damped at the lower speed grows at the higher one; in between it neither does.

    Goland's speed is 8 per cent above that of unsteady lattices: the lag is that of a wing of infinite span,
    and delays the lift of a short one too much. Patil's frequency is 7 per cent above that of strips: the
    lag delays the moment of the pitch rate, see above.
    """
    below, above = (least_damped(wing, density, speed, duration_s, figures[1]) for speed in speeds)
    assert below.real < 0.0 < above.real
    share = -below.real / (above.real - below.real)
    speed = speeds[0] + share * (speeds[1] - speeds[0])
    frequency = below.imag + share * (above.imag - below.imag)
    print(f"flutter at {speed:.1f} m/s, {frequency:.1f} rad/s; {figures}")
    assert (speed, frequency) == pytest.approx(measured, rel=0.005)
    assert speed == pytest.approx(figures[0], rel=apart[0])
    assert frequency == pytest.approx(figures[1], rel=apart[1])
