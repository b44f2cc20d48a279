"""Lowering the hinge torque of a schedule until it keeps its limit: a place to search from.

Sequential minimisation of the largest torque: its history is linear in the unknowns near a base, found by
differences of flights; a smooth form of the maximum over it is minimised under the exact limits, within a
radius that grows with success and shrinks without.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from morphcore.optimise.descent import MARGIN, linear_model, probes_of
from morphcore.optimise.limits import MorphSpace
from morphcore.optimise.torque_limit import MOST_WATCHED, WATCHED, Trials

Array = NDArray[np.float64]

FIRST_RADIUS = 0.05  # of the unknowns' range
LARGEST_RADIUS, SMALLEST_RADIUS = 0.3, 1e-4
SHARES = (1.0, 0.25)  # of the radius: steps that are flown side by side
STALLED = 2e-3  # relative decrease of the peak that counts as none
PATIENCE = 3
MOST_ITERATIONS = 20
SHARPNESS = 100.0  # of the smooth maximum: off by a few per cent of the peak


@dataclass(frozen=True)
class EaseState:
    """A schedule on its way down: point (d,), peak torque (N m), radius of the next step, stalls."""

    point: Array
    peak: float
    radius: float = FIRST_RADIUS
    stalled: int = 0
    iteration: int = 0

    @property
    def over(self) -> bool:
        """Whether the torque falls no further."""
        return self.stalled >= PATIENCE or self.radius < SMALLEST_RADIUS or self.iteration >= MOST_ITERATIONS


def next_ease(state: EaseState, space: MorphSpace, fly: Callable[[Array], Trials]) -> EaseState:
    """One step towards a smaller peak."""
    probed = probes_of(space, state.point)
    if probed is None:
        return EaseState(state.point, state.peak, 0.0, state.stalled, state.iteration + 1)
    points, steps = probed
    model = linear_model(fly(points), points, steps)
    watched = np.flatnonzero(np.abs(model.torque) > WATCHED * np.abs(model.torque).max())
    watched = watched[:: -(-watched.size // MOST_WATCHED)]
    side = np.sign(model.torque[watched])
    torque = side * model.torque[watched] / state.peak
    gradient = side[:, None] * model.torque_gradient[watched] / state.peak

    def smooth(z: Array) -> tuple[float, Array]:
        """Log-sum-exp of the linear torques, and its gradient."""
        value = SHARPNESS * (torque + gradient @ (z - model.base))
        top = float(value.max())
        weight = np.exp(value - top)
        total = float(weight.sum())
        return (top + float(np.log(total))) / SHARPNESS, (weight / total) @ gradient

    eye = np.eye(state.point.size)
    tried = []
    for share in SHARES:
        radius = share * state.radius
        ends = np.concatenate([radius + state.point, radius - state.point])
        within = (
            lambda z, ends=ends: ends - np.concatenate([z, -z]),
            lambda _: np.concatenate([-eye, eye]),
        )
        found = space.constrained(lambda z: smooth(z)[0], lambda z: smooth(z)[1], model.base, MARGIN, within)
        tried.append(space.put_back(found, state.point))
    flown = fly(np.stack(tried))
    peaks = np.where(np.isfinite(flown.peak), flown.peak, np.inf)
    best = int(np.argmin(peaks))
    if peaks[best] >= state.peak:
        smaller = state.radius * SHARES[-1] ** 2
        return EaseState(state.point, state.peak, smaller, state.stalled + 1, state.iteration + 1)
    still = state.peak - peaks[best] < STALLED * state.peak
    return EaseState(
        tried[best],
        float(peaks[best]),
        min(2.0 * SHARES[best] * state.radius, LARGEST_RADIUS),
        state.stalled + 1 if still else 0,
        state.iteration + 1,
    )
