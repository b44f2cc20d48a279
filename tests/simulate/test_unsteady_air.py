"""Lift of an oscillating wing of high aspect ratio against Theodorsen's theory."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray
from scipy.special import hankel2

from morphcore.simulate.flight import simulate
from morphcore.simulate.schedule import HingeMotion
from morphdata.aircraft import Aircraft
from morphdata.flight import Flight
from morphdata.lattice import Lattice

Array = NDArray[np.float64]

DENSITY, SPEED, SEMICHORD = 1.225, 10.0, 0.5
SPAN_M = 200.0  # of each wing: lift is 0.5 per cent below that of the infinite wing
FUSELAGE_KG = 1e7  # hardly moves: its specific force measures the lift
AMPLITUDE_RAD = 1e-3
GRAVITY = 1e-9  # next to none, but the unit of the load factor


@dataclass(frozen=True)
class Sine:
    """A steady oscillation."""

    amplitude_rad: float
    omega: float

    def motion(self, time_s: ArrayLike) -> HingeMotion:
        """Angle, rate and acceleration."""
        phase = self.omega * np.asarray(time_s, dtype=np.float64)
        a, w = self.amplitude_rad, self.omega
        return HingeMotion(a * np.sin(phase), a * w * np.cos(phase), -a * w**2 * np.sin(phase))


def pitching_wings(ahead_m: float) -> Aircraft:
    """Two wings that pitch about an axis ``ahead_m`` ahead of mid-chord; their mass is negligible."""

    def wing(side: str) -> dict[str, object]:
        return {
            "name": side,
            "side": side,
            "span_m": SPAN_M,
            "chord_m": 2.0 * SEMICHORD,
            "thickness_m": 0.1,
            "material": {"density_kg_m3": 100.0, "youngs_modulus_pa": 1e9},
            "section": {
                "ei_flap_n_m2": 1e9,
                "ei_edge_n_m2": 1e9,
                "gj_n_m2": 1e9,
                "mass_per_length_kg_m": 1e-3,
                "inertia_per_length_kg_m": [1e-6, 1e-6, 1e-6],
            },
            "flexible": False,
            "position_m": [-ahead_m, 0.0, 0.0],
            "hinge": {"position_m": [0.0, 0.0, 0.0], "axis": "y"},
        }

    inertia = [FUSELAGE_KG * 1e3] * 3
    return Aircraft.parse(
        {
            "fuselage": {"mass_kg": FUSELAGE_KG, "inertia_kg_m2": inertia},
            "surfaces": [wing("right"), wing("left")],
        }
    )


def theodorsen_lift(k: float, a: float) -> complex:
    """Lift per length over the pitch angle, N/m, at reduced frequency k about an axis a semichords aft.

    Bisplinghoff, Ashley & Halfman (1955), equation 5-311, for pitch alone.
    """
    b, u = SEMICHORD, SPEED
    s = 1j * k * u / b
    c = hankel2(1, k) / (hankel2(1, k) + 1j * hankel2(0, k))
    apparent = np.pi * DENSITY * b**2 * (u * s - b * a * s**2)
    return complex(apparent + 2.0 * np.pi * DENSITY * u * b * c * (u + b * (0.5 - a) * s))


@pytest.mark.parametrize("a", [-0.5, 0.0, -20.0])
@pytest.mark.parametrize("k", [0.05, 0.2, 0.5, 1.0])
def test_lift_of_an_oscillating_wing(k: float, a: float) -> None:
    """Pitch about quarter chord, about mid-chord, and far ahead of it, which is nearly plunge."""
    omega = k * SPEED / SEMICHORD
    period = 2.0 * np.pi / omega
    air = {"airspeed_m_s": SPEED, "air_density_kg_m3": DENSITY, "gravity_m_s2": GRAVITY}
    flown = simulate(
        pitching_wings(-a * SEMICHORD),
        Flight.parse({**air, "apparent_mass": True, "start": {"alpha_rad": 0.0}}),
        {"incidence": Sine(AMPLITUDE_RAD, omega)},
        duration_s=8.0 * period,
        output_step_s=period / 50.0,
        step_s=period / 400.0,
        start="given",
        lattice=Lattice(chordwise=4, spanwise=12),
        channels=["nz"],
    ).trajectory
    last = flown.time_s > 7.0 * period - 1e-9
    time, lift = flown.time_s[last], flown.channels["nz"][last] * GRAVITY * FUSELAGE_KG / (2.0 * SPAN_M)
    columns = np.stack([np.sin(omega * time), np.cos(omega * time), np.ones_like(time)], axis=1)
    sine, cosine, _ = np.linalg.lstsq(columns, lift, rcond=None)[0]
    ratio = complex(sine, cosine) / AMPLITUDE_RAD / theodorsen_lift(k, a)
    print(f"k {k}, a {a}: amplitude {abs(ratio):.4f}, phase {np.degrees(np.angle(ratio)):.2f} degrees")
    assert abs(ratio) == pytest.approx(1.0, abs=0.05)
    assert abs(np.degrees(np.angle(ratio))) < 5.0
