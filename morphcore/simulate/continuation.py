"""Roots of equations that differ little from the identity: Newton with Krylov steps, and continuation.

The equations are of the kind x - G(x) = 0, where G responds to few directions of x: a wing's strains under
the loads that they cause, times its flexibility. Arnoldi's process then finds within a few products with the
Jacobian all that differs from the identity. Products are one-sided differences. What it has found serves the
following steps as well, each with one evaluation, as long as they converge quickly.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Residual = Callable[[Array], Array]

PROBE = 1e-6  # length of a one-sided difference: balances truncation and rounding
INNER = 1e-3  # relative residual at which a linear solve ends
MAX_DIRECTIONS = 60  # of one linear solve
QUICK = 0.3  # a step without new products must reduce the residual to this share
STRAIGHT = 0.3  # a step that reduces the residual by less than this goes astray: another root may attract it
SHRINK = 0.5  # of a step that does not reduce the residual
MAX_SHRINKS = 4
MAX_NEWTON = 12  # linear solves of one root

FIRST_SHARE = 1e-3  # of a continuation: gives the curve's direction
FIRST_LENGTH = 0.25  # of its next step, along the curve
LONGEST = 0.5
SMALLEST = 1e-4
ASIDE, SMALL = 0.5, 0.05  # a root may lie so far from its guess: share of the unknowns' change, and besides
EASY = 3  # linear solves of a root after which the next step is twice as long
MAX_SOLVES = 200  # of one continuation


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


@dataclass(frozen=True)
class Rules:
    """When to stop, and how far to step.

    tolerance : of the largest residual. accepted : the same, where rounding leaves more than the tolerance.
    longest : share of a step of the unknowns that may be taken at once, at most 1.
    """

    tolerance: float
    accepted: float
    longest: Callable[[Array], float]


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
        size = _norm(rest)
        if not size > 1e-10 * _norm(w):
            return False
        row[-1] = size
        self.V.append(v)
        self.W.append(w)
        self.Q.append(rest / size)
        self.R.append(row)
        return True

    def turned(self) -> bool:
        """Whether an eigenvalue of J in the directions, orthonormal so far, is real and negative."""
        values = np.linalg.eigvals(np.stack(self.V) @ np.stack(self.W).T)
        return bool(np.any((np.abs(values.imag) < 1e-9 * np.abs(values)) & (values.real < 0.0)))

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
            moved = x + share * step
            found = residual(moved)
            if _norm(found) < (1.0 - 0.1 * share) * before:  # false if it is not finite
                break
            share *= SHRINK
        else:
            break
        straight &= share == 1.0 and _norm(found) < STRAIGHT * before and not linear.turned()
        if share < 1.0:
            x, r = moved, found
        else:
            x, r = _follow(residual, linear, (x, moved), (r, found), rules)
    arrived = size < rules.accepted
    return Root(x, size, solves, arrived, straight and arrived)


def _norm(r: Array) -> float:
    return float(np.sqrt(r @ r))


def _solve(residual: Residual, x: Array, r: Array) -> tuple[_Linear, Array]:
    """Step that removes all but ``INNER`` of the linearised residual, and the products that it needed."""
    linear, left, target = _Linear(), r.copy(), INNER * _norm(r)
    basis: list[Array] = []
    v = -r / _norm(r)
    for _ in range(min(MAX_DIRECTIONS, r.size)):
        w = (residual(x + PROBE * v) - r) / PROBE
        basis.append(v)
        if not np.isfinite(w).all() or not linear.add(v, w):
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
    residual: Residual, linear: _Linear, x: tuple[Array, Array], r: tuple[Array, Array], rules: Rules
) -> tuple[Array, Array]:
    """Further steps with the products of the last solve, corrected by every change that they have brought."""
    (x0, x1), (r0, r1) = x, r
    while float(np.abs(r1).max()) >= rules.tolerance:
        step = x1 - x0
        length = _norm(step)
        if not linear.add(step / length, (r1 - r0) / length):
            break
        step = linear.step(r1)
        if rules.longest(step) < 1.0:
            break
        found = residual(x1 + step)
        if not _norm(found) <= QUICK * _norm(r1):
            break
        x0, r0, x1, r1 = x1, r1, x1 + step, found
    return x1, r1


@dataclass
class Continued:
    """Where a continuation ended: the root of the largest share that it reached, and all linear solves.

    arrived : whether the share is 1. path : shares and unknowns of all roots on the way.
    """

    root: Root
    share: float
    solves: int
    arrived: bool
    path: list[tuple[float, Array]] = field(default_factory=list)


def continue_root(residual: Callable[[Array, float], Array], start: Array, rules: Rules) -> Continued:
    """Follow a root from share 0, where ``start`` is near it, to share 1, in steps as long as possible.

    The curve of roots is followed by its length, so that it may turn back on its way: the share is an unknown
    like the others, and a step ends where the curve meets the plane across the straight line through the last
    two roots. If the root of share 0 is not found, that is the end, at share 0.

    Parameters
    ----------
    residual : (n,) of unknowns (n,) and the share.
    """
    extended = Rules(rules.tolerance, rules.accepted, lambda step: rules.longest(step[:-1]))
    best = Continued(find_root(lambda x: residual(x, 0.0), start, rules), 0.0, 0, arrived=False)
    best.solves = best.root.solves
    if not best.root.arrived:
        return best
    near = find_root(lambda x: residual(x, FIRST_SHARE), best.root.x, rules)
    best.solves += near.solves
    if not near.arrived:
        return best
    z, line = np.append(near.x, FIRST_SHARE), np.append(near.x - best.root.x, FIRST_SHARE)
    best.root, best.share = near, FIRST_SHARE
    line, length = line / _norm(line), FIRST_LENGTH
    while best.solves < MAX_SOLVES:
        ahead = z + length * line
        last = ahead[-1] >= 1.0
        if last:  # shares beyond 1 mean nothing: the root of 1 itself
            ahead = z + (1.0 - z[-1]) / line[-1] * line
            found = find_root(lambda x: residual(x, 1.0), ahead[:-1], rules)
            moved = np.append(found.x, 1.0)
        else:
            found = find_root(_across(residual, ahead, line), ahead, extended)
            moved = found.x
        best.solves += found.solves
        step = moved - z
        distance = _norm(step)
        # a root far from the straight line may lie on another curve
        aside = ASIDE * _norm(ahead[:-1] - z[:-1]) + SMALL
        if not found.arrived or _norm(moved - ahead) > aside or not 0.0 < moved[-1] <= 1.0:
            length *= 0.25
            if length < SMALLEST:
                break
            continue
        z, line = moved, step / distance
        best.path.append((float(z[-1]), z[:-1]))
        length = min(LONGEST, distance * (2.0 if found.solves <= EASY else 1.0))
        if z[-1] > best.share:
            best.root, best.share, best.arrived = replace(found, x=z[:-1]), float(z[-1]), last
        if last:
            break
    return best


def _across(residual: Callable[[Array, float], Array], place: Array, line: Array) -> Residual:
    """The equations of unknowns and share together, on the plane across ``line`` at ``place``."""
    return lambda z: np.append(residual(z[:-1], float(z[-1])), line @ (z - place))
