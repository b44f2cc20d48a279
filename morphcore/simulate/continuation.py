"""Roots of equations that differ little from the identity: Newton with Krylov steps, and continuation.

The equations are of the kind x - G(x) = 0, where G responds to few directions of x: a wing's strains under
the loads that they cause, times its flexibility. Arnoldi's process then finds within a few products with the
Jacobian all that differs from the identity. Products are one-sided differences. What it has found serves the
following steps as well, each with one evaluation, as long as they converge quickly.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Residual = Callable[[Array], Array]

PROBE = 1e-6  # length of a one-sided difference: balances truncation and rounding
INNER = 1e-3  # relative residual at which a linear solve ends
MAX_DIRECTIONS = 60  # of one linear solve
QUICK = 0.3  # a step without new products must reduce the residual to this share
SHRINK = 0.5  # of a step that does not reduce the residual
MAX_SHRINKS = 5
MAX_NEWTON = 12  # linear solves of one root

FIRST_SHARE = 0.25  # first step of a continuation
SMALLEST_SHARE = 1.0 / 256.0
EASY = 3  # linear solves of a root after which the next step is twice as long


@dataclass
class Root:
    """Where an iteration ended.

    x : (n,) unknowns. size : largest absolute residual there. solves : linear solves taken. arrived : whether
    the residual is accepted. straight : whether it is, and every step towards it was taken in full.
    """

    x: Array
    size: float
    solves: int
    arrived: bool
    straight: bool


@dataclass
class _Linear:
    """Directions V and their products W = J V, (k, n) rows, with the factors W^T = Q^T R."""

    V: list[Array] = field(default_factory=list)
    W: list[Array] = field(default_factory=list)
    Q: list[Array] = field(default_factory=list)
    R: list[Array] = field(default_factory=list)

    def add(self, v: Array, w: Array) -> bool:
        """Add a direction with its product; return False if the product is a combination of the others."""
        rest, row = w.copy(), np.zeros(len(self.Q) + 1)
        for _ in range(2):  # once more removes what rounding leaves
            for k, q in enumerate(self.Q):
                along = float(q @ rest)
                row[k] += along
                rest -= along * q
        size = float(np.sqrt(rest @ rest))
        if not size > 1e-10 * float(np.sqrt(w @ w)):
            return False
        row[-1] = size
        self.V.append(v)
        self.W.append(w)
        self.Q.append(rest / size)
        self.R.append(row)
        return True

    def step(self, r: Array) -> Array:
        """The step that removes residual r: within the directions by their products, the rest as it is."""
        count = len(self.Q)
        if count == 0:
            return -r
        upper = np.zeros((count, count))
        for k, row in enumerate(self.R):
            upper[: k + 1, k] = row
        Q, V, W = np.stack(self.Q), np.stack(self.V), np.stack(self.W)
        y = np.linalg.solve(upper, -(Q @ r))
        return np.asarray(y @ V - (r + y @ W))


@dataclass(frozen=True)
class Rules:
    """When to stop, and how far to step.

    tolerance : of the largest residual. accepted : the same, where rounding leaves more than the tolerance.
    longest : share of a step of the unknowns that may be taken at once, at most 1.
    """

    tolerance: float
    accepted: float
    longest: Callable[[Array], float]


def find_root(residual: Residual, x: Array, rules: Rules) -> Root:
    """Newton's method from ``x``; ``residual`` (n,) of n unknowns is not finite where it has no meaning."""
    r = residual(x)
    solves, straight = 0, True
    while (size := float(np.abs(r).max(initial=0.0))) >= rules.tolerance and solves < MAX_NEWTON:
        solves += 1
        linear, step = _solve(residual, x, r)
        whole = rules.longest(step)
        share, before = whole, _norm(r)
        for _ in range(MAX_SHRINKS + 1):
            moved, found = _tried(residual, x + share * step)
            if found is not None and _norm(found) < (1.0 - 0.1 * share) * before:
                break
            share *= SHRINK
        else:
            return Root(x, size, solves, size < rules.accepted, straight and size < rules.accepted)
        straight &= share == 1.0
        if share < whole or whole < 1.0:
            x, r = moved, found
            continue
        x, r = _follow(residual, linear, (x, moved), (r, found), rules.tolerance)
    return Root(x, size, solves, size < rules.accepted, straight and size < rules.accepted)


def _norm(r: Array) -> float:
    return float(np.sqrt(r @ r))


def _tried(residual: Residual, x: Array) -> tuple[Array, Array | None]:
    """A place and the residual there, if there is one."""
    found = residual(x)
    return x, found if np.isfinite(found).all() else None


def _solve(residual: Residual, x: Array, r: Array) -> tuple[_Linear, Array]:
    """Step that removes all but ``INNER`` of the linearised residual, and the products that it needed."""
    linear, left, target = _Linear(), r.copy(), INNER * _norm(r)
    basis: list[Array] = []
    v = -r / _norm(r)
    for _ in range(min(MAX_DIRECTIONS, r.size)):
        w = (residual(x + PROBE * v) - r) / PROBE
        if not np.isfinite(w).all():
            break
        basis.append(v)
        if not linear.add(v, w):
            break
        q = linear.Q[-1]
        left = left - float(q @ left) * q
        if _norm(left) <= target:
            break
        v = w.copy()
        for _ in range(2):
            for u in basis:
                v -= float(u @ v) * u
        if not _norm(v) > 1e-10 * _norm(w):
            break
        v /= _norm(v)
    return linear, linear.step(r)


def _follow(
    residual: Residual, linear: _Linear, x: tuple[Array, Array], r: tuple[Array, Array], tolerance: float
) -> tuple[Array, Array]:
    """Further steps with the products of the last solve, corrected by every change that they have brought."""
    (x0, x1), (r0, r1) = x, r
    while float(np.abs(r1).max()) >= tolerance:
        step = x1 - x0
        length = _norm(step)
        if not linear.add(step / length, (r1 - r0) / length):
            break
        moved, found = _tried(residual, x1 + linear.step(r1))
        if found is None or _norm(found) > QUICK * _norm(r1):
            break
        x0, r0, x1, r1 = x1, r1, moved, found
    return x1, r1


@dataclass
class Continued:
    """Where a continuation ended: the root at the last ``share``, and the solves of all steps together.

    missed : the iteration that did not arrive at the next share, if one stopped the continuation.
    """

    root: Root
    share: float
    solves: int
    missed: Root | None


def continue_root(residual_at: Callable[[float], Residual], start: Array, rules: Rules) -> Continued:
    """Follow a root from share 0, where ``start`` is near it, to share 1, in steps as long as possible.

    A step begins from the straight line through the last two roots. ``residual_at`` gives the equations of a
    share. If the root of share 0 is not found, that is the end, at share 0.
    """
    root = find_root(residual_at(0.0), start, rules)
    if not root.arrived:
        return Continued(root, 0.0, root.solves, root)
    share, solves, length = 0.0, root.solves, FIRST_SHARE
    slope = np.zeros_like(start)
    while share < 1.0:
        target = min(1.0, share + length)
        found = find_root(residual_at(target), root.x + (target - share) * slope, rules)
        solves += found.solves
        if not found.arrived:
            length = 0.5 * (target - share)
            if length < SMALLEST_SHARE:
                return Continued(root, share, solves, found)
            continue
        slope = (found.x - root.x) / (target - share)
        length = (target - share) * (2.0 if found.solves <= EASY else 1.0)
        root, share = found, target
    return Continued(root, 1.0, solves, None)
