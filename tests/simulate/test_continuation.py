"""Newton's method and continuation on equations with known roots."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from morphcore.simulate.continuation import Rules, continue_root, find_root

Array = NDArray[np.float64]

RULES = Rules(
    tolerance=1e-12, accepted=1e-9, longest=lambda step: min(1.0, 0.3 / max(np.abs(step).max(), 1e-9))
)


def response(size: int = 200) -> tuple[Array, Array]:
    """A matrix of rank five that responds to few directions, and a constant."""
    rng = np.random.default_rng(0)
    left, right = rng.normal(size=(2, size, 5)) / np.sqrt(size)
    return left @ right.T, rng.normal(scale=0.01, size=size)


def test_few_evaluations_solve_many_unknowns() -> None:
    """x = A x^2 + A x / 2 + b in 200 unknowns: the root by a dense solve, in 30 evaluations."""
    A, b = response()
    count = 0

    def residual(x: Array) -> Array:
        nonlocal count
        count += 1
        return x - A @ (x**2 + 0.5 * x) - b

    root = find_root(residual, np.zeros(b.size), RULES)
    x = np.zeros(b.size)
    for _ in range(20):
        x -= np.linalg.solve(np.eye(b.size) - A @ np.diag(2.0 * x + 0.5), x - A @ (x**2 + 0.5 * x) - b)
    assert root.arrived
    assert root.straight
    assert count < 30
    np.testing.assert_allclose(root.x, x, rtol=0.0, atol=1e-11)


def test_a_root_beyond_a_singular_place_is_not_straight() -> None:
    """x = 2 s x + 0.1 s - x^3: from zero Newton's method finds the branch that is not the identity's."""

    def residual(x: Array, share: float) -> Array:
        return x - share * (2.0 * x + 0.1) + x**3

    root = find_root(lambda x: residual(x, 1.0), np.zeros(1), RULES)
    assert root.arrived
    assert root.x[0] < 0.0
    assert not root.straight
    followed = continue_root(residual, np.zeros(1), RULES)
    assert followed.arrived
    # the real root on the side to which the load pushes
    roots = np.roots([1.0, 0.0, -1.0, -0.1])
    assert abs(followed.root.x[0] - roots.real.max()) < 1e-10


def test_a_curve_is_followed_around_its_folds() -> None:
    """s = 10 x^3 - 15 x^2 + 6 x turns back at x = 0.28 and 0.72; its end at s = 1 is x = 1."""

    def residual(x: Array, share: float) -> Array:
        return 10.0 * x**3 - 15.0 * x**2 + 6.0 * x - share

    found = continue_root(residual, np.zeros(1), RULES)
    assert found.arrived
    assert abs(found.root.x[0] - 1.0) < 1e-8
    shares = np.array([share for share, _ in found.path])
    assert np.diff(shares).min() < 0.0  # it did turn back on its way


def test_a_curve_that_ends_says_where() -> None:
    """x = s e^x has no root beyond s = 1 / e: the largest share that was reached is close below it."""

    def residual(x: Array, share: float) -> Array:
        return x - share * np.exp(x)

    found = continue_root(residual, np.zeros(1), RULES)
    assert not found.arrived
    assert 0.95 * np.exp(-1.0) < found.share < np.exp(-1.0)
    assert abs(found.root.x[0] - found.share * np.exp(found.root.x[0])) < 1e-9
