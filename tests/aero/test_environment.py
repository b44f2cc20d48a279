"""Wind, gusts and turbulence."""

import numpy as np
import pytest
from scipy.signal import welch

from morphcore.aero.environment import FOOT_M, air_velocity, turbulence_scales
from morphcore.errors import InvalidInput
from morphcore.geometry.aircraft import Flight
from morphdata.environment import Environment, Gust, Turbulence
from tests.models.chains import flight_of


def flight(altitude_m: float = 0.0, wind=(0.0, 0.0, 0.0)) -> Flight:
    """150 m/s."""
    return flight_of({"airspeed_m_s": 150.0, "altitude_m": altitude_m, "wind_n_m_s": list(wind)})


def test_air_is_the_flights_wind_by_default():
    """Without gust and turbulence the air moves with the flight's uniform wind."""
    velocity_N = air_velocity(Environment(), flight(wind=(3.0, -1.0, 0.5)), [0.0, 0.3, 2.0])
    np.testing.assert_array_equal(velocity_N, np.tile((3.0, -1.0, 0.5), (3, 1)))


def test_gust_has_the_shape_of_the_rule():
    """CS-25.341: nothing before, U at H, half of it at H/2 and 3H/2, nothing after 2H; impulse U H / V."""
    gust = Gust(amplitude_m_s=8.0, gradient_m=30.0, start_s=0.5)
    at = 0.5 + np.array([-0.1, 0.0, 15.0 / 150, 30.0 / 150, 45.0 / 150, 60.0 / 150, 0.6])
    velocity_N = air_velocity(Environment(gust=gust), flight(), at)
    np.testing.assert_allclose(-velocity_N[:, 2], [0, 0, 4, 8, 4, 0, 0], atol=1e-12)
    assert not velocity_N[:, :2].any()
    t = np.linspace(0.0, 1.5, 3001)
    impulse = np.trapezoid(air_velocity(Environment(gust=gust), flight(), t)[:, 2], t)
    assert impulse == pytest.approx(-8.0 * 30.0 / 150.0, rel=1e-6)


def test_gust_blows_along_its_direction():
    """The direction's length does not matter."""
    gust = Gust(amplitude_m_s=5.0, gradient_m=30.0, direction_n=[0.0, 3.0, -4.0])
    np.testing.assert_allclose(
        air_velocity(Environment(gust=gust), flight(), [0.2]), [[0.0, 3.0, -4.0]], atol=1e-12
    )


def test_turbulence_scales_of_the_specification():
    """MIL-F-8785C: at 1000 ft sigma_u = sigma_w and all lengths are 1000 ft; then 1750 ft and one sigma."""
    turbulence = Turbulence(wind_20ft_m_s=15.0, sigma_high_m_s=3.0)
    sigma, length = turbulence_scales(turbulence, 1000 * FOOT_M)
    np.testing.assert_allclose(sigma, 1.5, rtol=1e-12)
    np.testing.assert_allclose(length, 1000 * FOOT_M, rtol=1e-12)
    sigma, length = turbulence_scales(turbulence, 5000.0)
    np.testing.assert_allclose(sigma, 3.0)
    np.testing.assert_allclose(length, 1750 * FOOT_M)
    sigma, length = turbulence_scales(turbulence, 200 * FOOT_M)
    assert sigma[2] == pytest.approx(1.5)
    assert length[2] == pytest.approx(200 * FOOT_M)
    assert sigma[0] == pytest.approx(1.5 / (0.177 + 0.1646) ** 0.4)


TURBULENCE = Environment(turbulence=Turbulence(wind_20ft_m_s=15.0, sigma_high_m_s=3.0))


def test_dryden_spectrum():
    """The spectra are Dryden's, over two decades about the corner frequency.

    Welch's estimate over about 230 segments scatters by 1/sqrt(230) = 7 per cent a line; averages over ten
    lines by 2 per cent, so 10 per cent is four to five standard deviations.
    """
    dt, count = 0.05, 120_000
    u_N = air_velocity(TURBULENCE, flight(3000.0), dt * np.arange(count), np.random.default_rng(7))
    tau = 1750 * FOOT_M / 150.0
    f, psd = welch(u_N, fs=1 / dt, nperseg=1024, axis=0, detrend=False)
    s = 2 * np.pi * f * tau
    along = 9.0 * 4 * tau / (1 + s**2)  # one-sided in Hz; sigma^2 = 9
    across = 9.0 * 2 * tau * (1 + 3 * s**2) / (1 + s**2) ** 2
    for axis, law in enumerate((along, across, across)):
        ratio = (psd[:, axis] / law)[4:154].reshape(15, 10).mean(axis=1)  # the window blurs the first lines
        np.testing.assert_allclose(ratio, 1.0, atol=0.1)


def test_dryden_variance():
    """The filters start in and keep their stationary variance, whatever the steps.

    Over 4000 independent starts a variance scatters by sqrt(2 / 4000) = 2.2 per cent: 8 per cent is 3.6 of
    that.
    """
    rng = np.random.default_rng(3)
    times = [0.0, 0.01, 0.5, 7.0]
    samples = np.array([air_velocity(TURBULENCE, flight(3000.0), times, rng) for _ in range(4000)])
    np.testing.assert_allclose(samples.var(axis=0), 9.0, rtol=0.08)


def test_turbulence_repeats_with_its_generator():
    """The same generator state gives the same air; another one another."""
    t = np.linspace(0, 1, 50)
    first, second, other = (
        air_velocity(TURBULENCE, flight(500.0), t, np.random.default_rng(seed)) for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(first, second)
    assert np.abs(first - other).max() > 0.1


def test_bad_environments_are_refused():
    """Wrong values name their field."""
    with pytest.raises(InvalidInput, match="gradient"):
        Gust(amplitude_m_s=1.0, gradient_m=0.0)
    with pytest.raises(InvalidInput, match="no direction"):
        Gust(amplitude_m_s=1.0, gradient_m=10.0, direction_n=[0.0, 0.0, 0.0])
    with pytest.raises(InvalidInput, match="sigma_high_m_s"):
        Turbulence(wind_20ft_m_s=1.0, sigma_high_m_s=-1.0)
    with pytest.raises(InvalidInput, match="generator"):
        air_velocity(TURBULENCE, flight(), [0.0, 1.0])
    with pytest.raises(InvalidInput, match="increasing"):
        air_velocity(Environment(), flight(), [0.0, 0.0])
