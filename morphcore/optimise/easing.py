"""Lowers the hinge torque of a schedule until it meets the limit, to obtain a feasible start for the search.

Sequential minimisation of the largest torque: its history is linear in the unknowns near a base, found by
finite differences of flights. A smooth approximation of its maximum is minimised under the exact limits,
within a trust radius that grows after a success and shrinks after a failure.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from morphcore.optimise.descent import MARGIN, linear_model, probes_of
from morphcore.optimise.limits import MorphSpace
from morphcore.optimise.torque_limit import MAX_WATCHED, WATCHED, Trials
from morphcore.search.checkpoint import stored
from morphcore.search.solver import Batch, Solver

Array = NDArray[np.float64]

FIRST_RADIUS = 0.05  # of the unknowns' range
MAX_RADIUS, MIN_RADIUS = 0.3, 1e-4
SHARES = (1.0, 0.25)  # of the radius: steps that are flown in parallel
STALLED = 2e-3  # a smaller relative decrease of the peak counts as none
PATIENCE = 3
MAX_ITERATIONS = 20
SHARPNESS = 100.0  # of the smooth maximum: off by a few per cent of the peak


@stored
@dataclass(frozen=True)
class EasingState:
    """A schedule being eased: point (d,), its cost and peak torque (N m), radius of the next step, stalls.

    probes, steps : (1 + d, d) and (d,) of the next iteration; None if there are none. tried : (k, d) its
    trial steps, which are flown after the probes.
    """

    point: Array
    cost: float
    peak: float
    radius: float = FIRST_RADIUS
    stalled: int = 0
    iteration: int = 0
    probes: Array | None = field(default=None, repr=False)
    steps: Array | None = field(default=None, repr=False)
    tried: Array | None = field(default=None, repr=False)


class TorqueEasing(Solver[EasingState, Trials]):
    """Lowers the peak torque of the known schedule with the lowest peak.

    Parameters
    ----------
    space : the limits that the schedules must satisfy.
    """

    name = "ease"  # its name in the history of a result

    def __init__(self, space: MorphSpace) -> None:
        self._space = space

    def init(self, known: Trials) -> EasingState:
        """Start at the schedule with the lowest peak torque."""
        lowest = int(np.argmin(np.where(np.isfinite(known.peak), known.peak, np.inf)))
        return self._aimed(
            EasingState(known.points[lowest], float(known.cost[lowest]), float(known.peak[lowest]))
        )

    def ask(self, state: EasingState) -> Batch:
        """Return the probes, then the trial steps."""
        points = state.probes if state.tried is None else state.tried
        if points is None:
            raise ValueError("the torque cannot be lowered further")
        return Batch(points, residuals=True)

    def tell(self, state: EasingState, outcome: Trials) -> EasingState:
        """Compute trial steps, or accept the one with the lowest peak torque."""
        if state.tried is None:
            return replace(state, tried=self._trial_steps(state, outcome))
        return self._aimed(_accepted(state, outcome))

    def done(self, state: EasingState) -> bool:
        """Return whether the torque cannot be lowered further."""
        return state.probes is None

    def best(self, state: EasingState, outcome: Trials) -> tuple[Array, float]:
        """Return no point: nothing satisfies the limit yet."""
        del outcome
        return state.point, np.inf

    def between_steps(self, state: EasingState) -> bool:
        """Return whether an iteration has ended."""
        return state.tried is None

    def _aimed(self, state: EasingState) -> EasingState:
        """Return the state with the probes of the next iteration, if there is one."""
        over = state.stalled >= PATIENCE or state.radius < MIN_RADIUS or state.iteration >= MAX_ITERATIONS
        probed = None if over else probes_of(self._space, state.point)
        return state if probed is None else replace(state, probes=probed[0], steps=probed[1])

    def _trial_steps(self, state: EasingState, outcome: Trials) -> Array:
        """Return steps (k, d) to the lowest peak torque of a linear model within fractions of the radius."""
        if state.steps is None:
            raise ValueError("the torque cannot be lowered further")
        space = self._space
        model = linear_model(outcome, slice(None), state.steps)
        watched = np.flatnonzero(np.abs(model.torque) > WATCHED * np.abs(model.torque).max())
        watched = watched[:: -(-watched.size // MAX_WATCHED)]
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
            found = space.constrained(
                lambda z: smooth(z)[0], lambda z: smooth(z)[1], model.base, MARGIN, within
            )
            tried.append(space.put_back(found, state.point))
        return np.stack(tried)


def _accepted(state: EasingState, outcome: Trials) -> EasingState:
    peaks = np.where(np.isfinite(outcome.peak), outcome.peak, np.inf)
    best = int(np.argmin(peaks))
    after = replace(state, iteration=state.iteration + 1, probes=None, steps=None, tried=None)
    if peaks[best] >= state.peak:
        return replace(after, radius=state.radius * SHARES[-1] ** 2, stalled=state.stalled + 1)
    still = state.peak - peaks[best] < STALLED * state.peak
    return replace(
        after,
        point=outcome.points[best],
        cost=float(outcome.cost[best]),
        peak=float(peaks[best]),
        radius=min(2.0 * SHARES[best] * state.radius, MAX_RADIUS),
        stalled=state.stalled + 1 if still else 0,
    )
