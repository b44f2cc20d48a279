"""Lift of a wing that flies into a gust against Küssner's theory, and when its parts meet the gust."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import quad
from scipy.interpolate import CubicSpline
from scipy.special import hankel2, jv

from morphcore.aero.environment import MovingAir, moving_air
from morphcore.aero.gust_lag import KUESSNER as KUESSNER_LAG
from morphcore.geometry.aircraft import Aircraft as Resolved
from morphcore.geometry.aircraft import Flight as ResolvedFlight
from morphcore.models.equivalent import chain_model, physical_guess
from morphcore.simulate.flight import simulate
from morphcore.simulate.gust_table import GustTable
from morphcore.simulate.schedule import ConstantRate, Hold
from morphdata.aircraft import Aircraft
from morphdata.environment import Environment
from morphdata.flight import Flight
from morphdata.lattice import Lattice
from tests.models.chains import example_aircraft, example_flight
from tests.simulate.flights import example_model, fly

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


@cache
def kuessner() -> CubicSpline:
    """Küssner's function over 150 semichords, by Fourier's integral of Sears' function.

    psi(s) = 2/pi integral of Re S(k) sin(k s) / k dk. The part beyond k = 40 is left out: below 2e-3, and its
    oscillation averages out over a gust.
    """
    at = np.concatenate([[0.0], np.geomspace(0.05, 150.0, 120)])
    k = np.concatenate([np.linspace(1e-6, 1.0, 4001)[:-1], np.linspace(1.0, 40.0, 16001)])
    real = np.array([sears_at_leading_edge(each).real for each in k])
    values = [2.0 / np.pi * np.trapezoid(real * np.sin(k * s) / k, k) for s in at]
    return CubicSpline(at, values)


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
        out.append(quad(lambda x, t=t: slope(x) * kuessner()((t - x) / SEMICHORD_S), 0.0, end, limit=200)[0])
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


@pytest.mark.parametrize("model", ["rigid", "equivalent", "flexible"])
def test_a_tail_meets_the_gust_later(model: str) -> None:
    """Surfaces 4 m further aft bear the same lift 4 m over the airspeed later.

    To round-off; of beams to Newton's tolerance, which is large beside a fuselage of 1e7 kg.
    """
    behind_m, at_s = 4.0, 0.4
    gust = {"amplitude_m_s": 0.5, "gradient_m": 2.0, "start_s": 0.1}
    more: dict[str, Any] = {
        "step_s": 0.01,
        "output_step_s": 0.02,
        "lattice": Lattice(chordwise=2, spanwise=6),
    }
    if model == "flexible":
        more |= {"elements": 1}
    lift = {}
    for aft in (0.0, behind_m):
        aircraft = heavy(surface("right", 3.0, -aft), surface("left", 3.0, -aft))
        flown = guess_of(aircraft) if model == "equivalent" else model
        time, lift[aft] = load_factor(aircraft, gust, 1.2, model=flown, **more)
    later = round(at_s / (time[1] - time[0]))
    assert np.abs(lift[0.0]).max() > 1.0
    tolerance = 1e-3 if model == "flexible" else 1e-5
    assert np.abs(lift[behind_m][:later]).max() < tolerance
    np.testing.assert_allclose(lift[behind_m][later:], lift[0.0][:-later], atol=tolerance)


def guess_of(aircraft: Aircraft) -> Any:
    """The physical guess of three links in this module's air."""
    flight = Flight.parse({"airspeed_m_s": SPEED, "air_density_kg_m3": DENSITY, "gravity_m_s2": GRAVITY})
    return physical_guess(chain_model(Resolved.of(aircraft), ResolvedFlight.of(flight), 3))


def test_leading_edges_follow_the_hinges() -> None:
    """By hand: a wing swept by its hinge, at an angle of attack; right and left are mirror images."""
    model = example_model(1)
    angles = np.array([[0.6, 0.6], [0.2, 0.2]])
    air = MovingAir((), 150.0)
    table = GustTable(air, model.lattice, 0.1, KUESSNER_LAG, np.zeros(2), angles)
    ahead, right = table.leading_edges(angles)
    strips = model.lattice.lattices[0].spanwise
    y = 3.0 * (np.arange(strips) + 0.5) / strips
    for row, sweep in enumerate((0.6, 0.2)):
        x_B = 0.15 * np.cos(sweep) - y * np.sin(sweep)
        np.testing.assert_allclose(ahead[row, :strips], x_B * np.cos(0.1), atol=1e-12)
        np.testing.assert_allclose(right[row, :strips], 0.35 + y * np.cos(sweep) + 0.15 * np.sin(sweep))
    np.testing.assert_allclose(ahead[:, strips:], ahead[:, :strips], atol=1e-12)
    np.testing.assert_allclose(right[:, strips:], -right[:, :strips], atol=1e-12)


SLANTED = {
    "amplitude_m_s": 4.0,
    "gradient_m": 10.0,
    "start_s": 0.1,
    "direction_n": [0.2, 0.4, -1.0],
    "spanwise": [{"y_m": -2.0, "factor": 0.2}, {"y_m": 1.0, "factor": 1.5}, {"y_m": 3.0, "factor": -0.4}],
}


def mirrored(gust: dict[str, Any]) -> dict[str, Any]:
    """The mirror image of a gust about the x-z plane."""
    north, east, down = gust["direction_n"]
    rows = [{"y_m": -row["y_m"], "factor": row["factor"]} for row in reversed(gust["spanwise"])]
    return gust | {"direction_n": [north, -east, down], "spanwise": rows}


@pytest.mark.parametrize("kind", ["rigid", "equivalent", "flexible"])
def test_mirrored_gusts_give_mirrored_flights(kind: str) -> None:
    """A morph of one side in a slanted gust, and that of the other side in its image: to 1e-9 rad."""
    aircraft, flight = example_aircraft(), example_flight()
    model: Any = physical_guess(chain_model(aircraft, flight, 3)) if kind == "equivalent" else kind
    more = {"elements": 4, "step_s": 0.002} if kind == "flexible" else {"step_s": 0.005}
    morph, still = ConstantRate(0.0, 0.3, 0.6), Hold()
    one, other = (
        fly(
            aircraft, flight, sides, model=model, duration_s=0.4, output_step_s=0.02,
            environment=Environment.parse({"gust": gust}), lattice=Lattice(chordwise=2, spanwise=6), **more,
        ).trajectory
        for sides, gust in (([morph, still], SLANTED), ([still, morph], mirrored(SLANTED)))
    )  # fmt: skip
    assert np.abs(one.phi).max() > 1e-3
    for name, sign in (("phi", 1.0), ("theta", -1.0), ("psi", 1.0)):
        assert np.abs(getattr(one, name) + sign * getattr(other, name)).max() < 1e-9, name


@pytest.mark.parametrize("kind", ["rigid", "flexible"])
def test_an_antisymmetric_gust_rolls(kind: str) -> None:
    """Up on the right and down on the left: it rolls to the left, and does not heave."""
    gust = {
        "amplitude_m_s": 2.0,
        "gradient_m": 10.0,
        "start_s": 0.05,
        "spanwise": [{"y_m": -0.2, "factor": -1.0}, {"y_m": 0.2, "factor": 1.0}],
    }
    more = {"elements": 4, "step_s": 0.002} if kind == "flexible" else {"step_s": 0.005}
    flown = fly(
        example_aircraft(), example_flight(), [Hold(), Hold()], model=kind, duration_s=0.3,
        output_step_s=0.02, environment=Environment.parse({"gust": gust}),
        lattice=Lattice(chordwise=2, spanwise=6), **more,
    ).trajectory  # fmt: skip
    assert flown.phi[-1] < -1e-3
    assert np.abs(flown.theta - flown.theta[0]).max() < 0.02 * np.abs(flown.phi).max()


def test_turbulence_of_one_seed_is_one_air() -> None:
    """It does not depend on a model's step, and a longer flight begins like a short one."""
    rough = Environment.parse({"turbulence": {"wind_20ft_m_s": 7.7, "sigma_high_m_s": 1.5}})
    aircraft, flight = example_aircraft(), example_flight()
    times, short = np.linspace(0.0, 1.0, 11), np.linspace(0.0, 1.0, 41)

    def at(times: Array, end: float) -> Array:
        air = moving_air(rough, flight, [0.0, end], np.random.default_rng(5), aircraft)
        place = flight.airspeed_m_s * times[:, None] - 0.5
        return air.velocity(np.tile(place, (1, 2)), np.array([[-3.0, 3.0]]))

    np.testing.assert_array_equal(at(times, 1.0), at(short, 30.0)[::4])
    apart = np.diff(at(short, 1.0), axis=1)
    assert np.abs(apart[..., 2]).max() > 0.01, "the rolling gust"
    assert not apart[..., :2].any()


def test_a_gust_shorter_than_steps_warns() -> None:
    """Eight steps resolve it; with fewer there is a warning that names the step to choose."""
    hold = [Hold(), Hold()]

    def codes(gradient_m: float) -> list[str]:
        found = fly(
            example_aircraft(), example_flight(), hold, duration_s=0.1, step_s=0.01, output_step_s=0.05,
            environment=Environment.parse({"gust": {"amplitude_m_s": 0.1, "gradient_m": gradient_m}}),
        ).warnings  # fmt: skip
        return [each.code for each in found]

    assert codes(6.1) == []
    assert codes(5.9) == ["gust_unresolved"]
