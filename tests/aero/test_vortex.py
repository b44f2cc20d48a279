"""The laws of straight vortices, against quadrature of Biot and Savart."""

import numpy as np
import pytest
from scipy.integrate import quad

from morphcore.aero.kernels.vortex import (
    leg_velocity,
    segment_velocity,
    smoothed_leg_velocity,
    smoothed_segment_velocity,
)
from morphcore.jit import entry_kernel

LAWS = ("line", "smoothed")
TINY_CORE = 1e-9  # of a metre: no core at the distances of these tests


@entry_kernel
def _segment(a, e, core4):  # the inlined laws are called from kernels only
    return segment_velocity(a[0], a[1], a[2], e[0], e[1], e[2], core4)


@entry_kernel
def _leg(a, u, core4, width4, chord2):
    return leg_velocity(a[0], a[1], a[2], u[0], u[1], u[2], core4, width4, chord2)


@entry_kernel
def _smoothed_segment(a, e, core2):
    return smoothed_segment_velocity(a[0], a[1], a[2], e[0], e[1], e[2], core2)


@entry_kernel
def _smoothed_leg(a, u, core2):
    return smoothed_leg_velocity(a[0], a[1], a[2], u[0], u[1], u[2], core2)


def segment(start, end, point, core=TINY_CORE, law="line"):
    """Velocity at a point of a segment of unit circulation."""
    start, end, point = (np.asarray(v, dtype=float) for v in (start, end, point))
    if law == "smoothed":
        return np.array(_smoothed_segment(start - point, end - start, core**2))
    return np.array(_segment(start - point, end - start, core**4))


def leg(start, direction, point, core=TINY_CORE, law="line", width=0.0, chord=1.0):
    """Velocity at a point of a semi-infinite vortex of unit circulation; its core grows to ``width``."""
    start, direction, point = (np.asarray(v, dtype=float) for v in (start, direction, point))
    unit = direction / np.linalg.norm(direction)
    if law == "smoothed":
        return np.array(_smoothed_leg(start - point, unit, core**2))
    return np.array(_leg(start - point, unit, core**4, width**4, chord**2))


def product_form(start, end, point, core):
    """The law "smoothed" as it is printed, a x b and all."""
    a, b = np.asarray(start) - point, np.asarray(end) - point
    la, lb, length = np.linalg.norm(a), np.linalg.norm(b), np.linalg.norm(b - a)
    return (la + lb) * np.cross(a, b) / (la * lb * (la * lb + a @ b) + (core * length) ** 2) / (4 * np.pi)


def biot_savart(start, end, point):
    """Quadrature of (1 / 4 pi) dl x r / |r|^3 along the segment."""
    start, end, point = (np.asarray(v, dtype=float) for v in (start, end, point))

    def integrand(s, axis):
        r = point - start - s * (end - start)
        return np.cross(end - start, r)[axis] / np.linalg.norm(r) ** 3 / (4 * np.pi)

    return np.array([quad(integrand, 0, 1, args=(axis,), epsabs=1e-13, epsrel=1e-12)[0] for axis in range(3)])


POINTS = [(0.3, 0.2, -0.1), (2.5, 0.4, 0.3), (-1.0, 0.2, 0.5), (0.9, -0.3, 0.05), (40.0, 30.0, 20.0)]


@pytest.mark.parametrize("point", POINTS)
def test_segment_follows_biot_savart(point):
    """A segment's velocity agrees with Biot-Savart quadrature next to it, beyond its ends and far away."""
    start, end = (0.1, -0.2, 0.3), (1.2, 0.4, -0.1)
    expected = biot_savart(start, end, point)
    # quadrature to 1e-12 of the largest component
    np.testing.assert_allclose(
        segment(start, end, point), expected, rtol=0, atol=1e-10 * np.abs(expected).max()
    )


@pytest.mark.parametrize("point", POINTS)
def test_leg_is_a_long_segment(point):
    """A semi-infinite vortex is the limit of long segments: the rest beyond 1e7 m is below 1e-14 1/m."""
    start, direction = np.array((0.1, -0.2, 0.3)), np.array((-0.9, 0.1, -0.4))
    far = start + 1e7 * direction / np.linalg.norm(direction)
    expected = segment(start, far, point)
    np.testing.assert_allclose(leg(start, direction, point), expected, rtol=1e-9, atol=1e-13)


def test_law_of_the_infinite_vortex():
    """Two opposite legs from one point make the plane vortex 1 / (2 pi h), right-handed."""
    point = np.array((0.0, 0.25, 0.0))
    whole = leg((0, 0, 0), (1, 0, 0), point) - leg((0, 0, 0), (-1, 0, 0), point)
    np.testing.assert_allclose(whole, (0, 0, 1 / (2 * np.pi * 0.25)), rtol=1e-14, atol=1e-15)


@pytest.mark.parametrize("core", [TINY_CORE, 0.05])
@pytest.mark.parametrize("point", [(0.5, 0.01, 0.0), (0.3, 0.0, 0.2), (2.0, 0.02, 0.01), (-0.1, 0.001, 0.0)])
def test_cut_vortex_induces_what_the_whole_does(core, point):
    """With or without core, a segment or a leg cut in two induces what the whole one does."""
    a, b, c = (0.0, 0.0, 0.0), (0.4, 0.0, 0.0), (1.0, 0.0, 0.0)
    parts = segment(a, b, point, core) + segment(b, c, point, core)
    np.testing.assert_allclose(parts, segment(a, c, point, core), rtol=1e-11, atol=1e-15)
    parts = segment(a, c, point, core) + leg(c, (1, 0, 0), point, core)
    np.testing.assert_allclose(parts, leg(a, (1, 0, 0), point, core), rtol=1e-11, atol=1e-15)


def test_core_spares_the_distance_and_bounds_the_middle():
    """The core changes the velocity by (core/h)^4 / 2 far out; the peak is 1 / (2 sqrt(2) pi core)."""
    core, ends = 0.0075, ((0.0, -50.0, 0.0), (0.0, 50.0, 0.0))
    speed = [np.linalg.norm(segment(*ends, (h, 0, 0), core)) for h in (0.0375, 0.1)]
    plane = [1 / (2 * np.pi * h) for h in (0.0375, 0.1)]
    assert 0.5 * (core / 0.0375) ** 4 == pytest.approx(1 - speed[0] / plane[0], rel=0.01)
    assert 1 - speed[0] / plane[0] < 1e-3
    assert 1 - speed[1] / plane[1] < 2e-5
    near = [np.linalg.norm(segment(*ends, (h, 0.3, 0), core)) for h in np.geomspace(1e-6, 1.0, 400)]
    assert max(near) <= 1.0001 / (2 * np.pi * core * np.sqrt(2))
    assert max(near) > 0.99 / (2 * np.pi * core * np.sqrt(2))


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("point", [(0, 0, 0), (1, 0, 0), (0.5, 0, 0), (2, 0, 0), (-3, 0, 0)])
def test_nothing_on_the_line(point, law):
    """On its own line, ends and middle included, a vortex of either law induces exactly nothing."""
    assert not segment((0, 0, 0), (1, 0, 0), point, 0.01, law).any()
    assert not leg((0, 0, 0), (1, 0, 0), point, 0.01, law).any()


def test_no_cancellation_on_the_extension():
    """Ahead of a leg, nearly in line with it, the velocity is h / (8 pi d^2) to ten digits."""
    h, d = 1e-7, 0.2
    speed = leg((0, 0, 0), (1, 0, 0), (-d, h, 0), core=1e-12)[2]
    assert speed == pytest.approx(h / (8 * np.pi * d**2), rel=1e-10)


@pytest.mark.parametrize("core", [TINY_CORE, 0.015, 0.4])
def test_smoothed_segment_is_the_product_form(core):
    """The law "smoothed" is the printed product form, at random points within some lengths of the segment.

    The printed form suffers from cancellation in |a||b| + a.b next to the segment: nine digits at these
    points.
    """
    rng = np.random.default_rng(11)
    start, end = np.array((0.1, -0.2, 0.3)), np.array((1.2, 0.4, -0.1))
    for point in rng.uniform(-2.0, 2.0, size=(200, 3)):
        expected = product_form(start, end, point, core)
        found = segment(start, end, point, core, "smoothed")
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize("core", [TINY_CORE, 0.015, 0.4])
@pytest.mark.parametrize("point", [*POINTS, (0.1, -0.2, 0.301), (-4.4, 0.3, -1.68)])
def test_smoothed_leg_is_a_long_segment(point, core):
    """A smoothed leg is the limit of smoothed segments, which near it as distance over length: 1e-7 or less.

    The last two points lie next to the start and, within about one core, next to the leg.
    """
    start, direction = np.array((0.1, -0.2, 0.3)), np.array((-0.9, 0.1, -0.4))
    far = start + 1e9 * direction / np.linalg.norm(direction)
    expected = segment(start, far, point, core, "smoothed")
    found = leg(start, direction, point, core, "smoothed")
    np.testing.assert_allclose(found, expected, rtol=0, atol=2e-7 * np.abs(expected).max())


def test_laws_agree_far_away():
    """Far from a vortex, or with vanishing cores, its law does not matter.

    What the product form's core takes at a distance R of many lengths is core^2 l^2 / 2 R^4.
    """
    start, end, core = np.zeros(3), np.array((0.0, 0.3, 0.0)), 0.015
    for distance in (3.0, 30.0):
        point = distance * np.array((0.8, 0.0, 0.6))
        line, smoothed = (np.linalg.norm(segment(start, end, point, core, law)) for law in LAWS)
        assert abs(smoothed / line - 1) < 1.1 * (core * 0.3 / distance**2) ** 2 / 2 + 1e-14
    for point in POINTS:
        line, smoothed = (leg(start, (1, 0, 0), point, TINY_CORE, law) for law in LAWS)
        np.testing.assert_allclose(smoothed, line, rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("law", LAWS)
def test_velocity_is_bounded_near_the_line(law):
    """Passing a vortex at any distance, down to nothing, the velocity is finite and below 1 / (4 core).

    The peaks are 1 / (2 sqrt(2) pi core) of "line" and, with two cores squared in the denominator, 1 / (4
    sqrt(2) pi core) for "smoothed" next to a long vortex; next to a leg's start, half of 1 / (2 pi core).
    """
    core = 0.0075
    for h in np.append(0.0, np.geomspace(1e-200, 10.0, 300)):
        for along in (-1.0, -1e-9, 0.0, 1e-9, 0.4, 1.0, 1.0 + 1e-9, 7.0):
            for speed in (
                segment((0, 0, 0), (1, 0, 0), (along, h, 0), core, law),
                leg((0, 0, 0), (1, 0, 0), (along, h, 0), core, law),
            ):
                assert np.linalg.norm(speed) < 1 / (4 * core)


def test_a_smoothed_core_reaches_further():
    """Next to the middle of a long vortex "smoothed" is the plane vortex times h^2 / (h^2 + 2 core^2)."""
    core, ends = 0.015, ((0.0, -500.0, 0.0), (0.0, 500.0, 0.0))
    for h in (0.0375, 0.06, 0.15):
        speed = np.linalg.norm(segment(*ends, (h, 0, 0), core, "smoothed"))
        assert speed == pytest.approx(h / (2 * np.pi * (h**2 + 2 * core**2)), rel=1e-6)


def test_core_of_a_leg_grows_downstream():
    """Upstream and beside the trailing edge a leg is as without growth; far behind, its core is its strip.

    Growth has fraction (s^2 / (s^2 + chord^2))^4 of the width's fourth power, and that vortex is of Vatistas.
    """
    width, chord, h = 0.3, 0.5, 0.15
    for s, change in ((-0.3, 0.0), (0.0, 0.0), (0.1 * chord, 1e-6), (0.25 * chord, 1e-4)):
        plain = leg((0, 0, 0), (1, 0, 0), (s, h, 0))[2]
        grown = leg((0, 0, 0), (1, 0, 0), (s, h, 0), width=width, chord=chord)[2]
        assert abs(grown / plain - 1.0) <= change
    s = 4.0 * chord
    core4 = width**4 * (16.0 / 17.0) ** 4
    plain = leg((0, 0, 0), (1, 0, 0), (s, h, 0))[2]
    grown = leg((0, 0, 0), (1, 0, 0), (s, h, 0), width=width, chord=chord)[2]
    assert grown / plain == pytest.approx(h**2 / np.sqrt(h**4 + core4), rel=1e-12)
