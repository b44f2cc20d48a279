"""Lift of a wing that flies into a gust against Küssner's theory, and when its parts meet the gust."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import quad
from scipy.interpolate import CubicSpline
from scipy.special import hankel2, jv

from morphcore.simulate.flight import simulate
from morphdata.aircraft import Aircraft
from morphdata.environment import Environment
from morphdata.flight import Flight
from morphdata.lattice import Lattice

Array = NDArray[np.float64]

DENSITY, SPEED, CHORD = 1.225, 10.0, 1.0
SPAN_M = 200.0  # of each wing: lift is 0.5 per cent below that of the infinite wing
FUSELAGE_KG = 1e7  # hardly moves: its specific force measures the lift
GRAVITY = 1e-9  # next to none, but the unit of the load factor
SEMICHORD_S = 0.5 * CHORD / SPEED


def surface(side: str, span_m: float, at_m: float, name: str = "") -> dict[str, Any]:
    """A wing of negligible mass, which bends hardly more than the fuselage moves."""
    return {
        "name": f"{name}{side}",
        "side": side,
        "span_m": span_m,
        "chord_m": CHORD,
        "thickness_m": 0.1,
        "material": {"density_kg_m3": 100.0, "youngs_modulus_pa": 1e9},
        "section": {
            "ei_flap_n_m2": 1e14,
            "ei_edge_n_m2": 1e14,
            "gj_n_m2": 1e14,
            "mass_per_length_kg_m": 1e-3,
            "inertia_per_length_kg_m": [1e-6, 1e-6, 1e-6],
        },
        "position_m": [at_m, 0.0, 0.0],
    }


def heavy(*surfaces: dict[str, Any]) -> Aircraft:
    """Surfaces on a fuselage that hardly moves."""
    inertia = [FUSELAGE_KG * 1e3] * 3
    return Aircraft.parse(
        {"fuselage": {"mass_kg": FUSELAGE_KG, "inertia_kg_m2": inertia}, "surfaces": list(surfaces)}
    )


def load_factor(aircraft: Aircraft, gust: dict[str, Any], duration_s: float, **options: Any) -> Any:
    """Times (s) and upward force (N) on an aircraft that flies through a gust at zero incidence."""
    air = {"airspeed_m_s": SPEED, "air_density_kg_m3": DENSITY, "gravity_m_s2": GRAVITY}
    flown = simulate(
        aircraft,
        Flight.parse({**air, "apparent_mass": True, "start": {"alpha_rad": 0.0}}),
        {},
        duration_s=duration_s,
        start="given",
        environment=Environment.parse({"gust": gust}),
        channels=["nz"],
        **options,
    ).trajectory
    return flown.time_s, flown.channels["nz"] * GRAVITY * FUSELAGE_KG


def sears_at_leading_edge(k: float) -> complex:
    """Lift over 2 pi rho U b w of a sinusoidal gust w at the leading edge.

    Bisplinghoff, Ashley & Halfman (1955), equation 5-373, with the gust's phase at the leading edge.
    """
    c = hankel2(1, k) / (hankel2(1, k) + 1j * hankel2(0, k))
    return complex((c * (jv(0, k) - 1j * jv(1, k)) + 1j * jv(1, k)) * np.exp(-1j * k))


def kuessner() -> CubicSpline:
    """Küssner's function over 150 semichords, by Fourier's integral of Sears' function.

    psi(s) = 2/pi integral of Re S(k) sin(k s) / k dk; the tail beyond k = 40, where Re S oscillates about zero
    in step with cos k, is left out: it is below 2e-3 and averages out over a gust.
    """
    at = np.concatenate([[0.0], np.geomspace(0.05, 150.0, 120)])
    k = np.concatenate([np.linspace(1e-6, 1.0, 4001)[:-1], np.linspace(1.0, 40.0, 16001)])
    real = np.array([sears_at_leading_edge(each).real for each in k])
    values = [2.0 / np.pi * np.trapezoid(real * np.sin(k * s) / k, k) for s in at]
    return CubicSpline(at, values)


KUESSNER = kuessner()


def duhamel(time_s: Array, gradient_m: float, start_s: float) -> Array:
    """Lift per length over 2 pi rho U b w0, by Duhamel's integral of Küssner's function."""
    gradient_s = gradient_m / SPEED

    def slope(t: float) -> float:
        """Rate of the gust at the leading edge."""
        return 0.5 * np.pi / gradient_s * np.sin(np.pi * t / gradient_s)

    out = []
    for t in time_s - start_s:
        end = min(t, 2.0 * gradient_s)
        if end <= 0.0:
            out.append(0.0)
            continue
        out.append(quad(lambda x, t=t: slope(x) * KUESSNER((t - x) / SEMICHORD_S), 0.0, end, limit=200)[0])
    return np.array(out)


@pytest.mark.parametrize("model", ["rigid", "flexible"])
@pytest.mark.parametrize("chords", [2.0, 5.0, 10.0])
def test_lift_in_a_gust_follows_kuessner(chords: float, model: str) -> None:
    """1 - cos gusts with gradients of some chords; the history to 3 per cent of its largest value."""
    gradient_m, amplitude = chords * CHORD, 0.01
    start_s = 0.1
    duration_s = start_s + 2.0 * gradient_m / SPEED + 0.3
    more = {"elements": 1, "step_s": 0.01} if model == "flexible" else {"step_s": 0.005}
    time, lift = load_factor(
        heavy(surface("right", SPAN_M, 0.0), surface("left", SPAN_M, 0.0)),
        {"amplitude_m_s": amplitude, "gradient_m": gradient_m, "start_s": start_s},
        duration_s,
        model=model,
        output_step_s=0.02,
        lattice=Lattice(chordwise=2, spanwise=12),
        **more,
    )
    scale = 2.0 * np.pi * DENSITY * SPEED * 0.5 * CHORD * amplitude * 2.0 * SPAN_M
    # the reference point is at mid-chord: the leading edge meets the gust half a chord earlier
    expected = duhamel(time, gradient_m, start_s - SEMICHORD_S)
    error = np.abs(lift / scale - expected).max() / expected.max()
    print(f"{model}, {chords} chords: largest error {100.0 * error:.2f} per cent of {expected.max():.3f}")
    assert error < 0.03
