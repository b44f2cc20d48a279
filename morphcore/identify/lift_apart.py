"""Whether unlike surfaces get lift factors of their own: where the flights can tell them.

A search begins with one factor for all surfaces. When it has ended, the model is linearised with a factor for
each, mirror images sharing theirs. They are freed where two things hold, both to first order: the flights
become at least e times likelier (`evidence`, which charges each unknown), and each flight is met better by
what the others say. Alone, the former also takes what fits one flight at the expense of the next: factors of
wing and tail and the aerodynamic centre move the same pitching moment.

Then another descent goes on from there. Its row in the history is what says so.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from morphcore.identify.cost import residuals
from morphcore.identify.descents import descent
from morphcore.identify.evidence import linear_model, log_evidence
from morphcore.identify.parameters import SearchSpace
from morphcore.identify.rounds import DESCENDING, MAX_ROUNDS, Prepared
from morphcore.search.least_squares import differences
from morphcore.search.run import SearchState
from morphcore.search.solver import Batch, Box
from morphcore.stopping import Stop

if TYPE_CHECKING:
    from morphcore.identify.identification import Identification

Array = NDArray[np.float64]

LIFT_APART = "lift factors"  # as the history of a result calls the step that frees them
WORTH_A_FACTOR = 1.0  # by which the logarithm of the likelihood must rise
MIN_FLIGHTS = 3  # of which each can be predicted from others that differ


def is_apart(state: SearchState) -> bool:
    """Whether a search has freed the lift factors."""
    return any(row["phase"] == LIFT_APART for row in state.history)


def told_apart(run: Identification, state: SearchState, stop: Stop | None = None) -> SearchState | None:
    """The state in which a descent with lift factors apart begins, after one with a shared factor has ended.

    Parameters
    ----------
    run : Identification
        It has entered the state of the next round where there is one.
    state : SearchState
        Of the end of a search.
    stop : callable, optional
        As of `Identification.steps`.

    Returns
    -------
    SearchState or None
        None where the flights cannot tell them, or were asked to.
    """
    if not _may_differ(run, state):
        return None
    shared, apart = run.space, _in_the_same_box(run.apart_space, run.space)
    best = moved(shared, apart, state.best)
    if not _are_told(run, shared, apart, best, stop):
        return None
    prepared = state.prepared
    openness = tuple(
        replace(each, reference=moved(shared, apart, each.reference)) if each.reference.size else each
        for each in run.openness
    )
    generation, flown = (
        state.generation + 1,
        2 + apart.dimension,
    )  # a difference quotient, and the first point
    flights = state.flights + flown * run.flights_each
    row = {
        "generation": generation,
        "phase": LIFT_APART,
        "particles": flown,
        "flights": flights,
        "best_cost": state.best_cost,
    }
    begun = replace(
        state,
        prepared=replace(prepared, openness=openness, round=prepared.round + 1),
        solver=None,
        best=best,
        generation=generation,
        flights=flights,
        history=(*state.history, row),
        over=False,
    )
    run.entered(begun)
    known = run.evaluate(Batch(best[None, :]), stop)
    solver = descent(run, run.search).init(known, apart.box)
    return replace(begun, solver=solver, best_cost=float(known.cost[0]))


def _may_differ(run: Identification, state: SearchState) -> bool:
    """Whether there is anything to tell, and a search that can go on."""
    up = state.budget_s is not None and state.wall_s >= state.budget_s
    able = run.search.method in DESCENDING and isinstance(state.prepared, Prepared) and not up
    return (
        able
        and run.settings.own_lift is None
        and not is_apart(state)
        and bool(np.isfinite(state.best_cost))
        and state.prepared.round + 1 < MAX_ROUNDS
        and len(run.training) >= MIN_FLIGHTS
        # a rigid wing misses so much that anything would explain it
        and run.model.links_per_wing != 1
        and run.measurement.loss == "linear"
        and run.apart_space.dimension > run.space.dimension
    )


def moved(shared: SearchSpace, apart: SearchSpace, point: Array) -> Array:
    """A search point (d,) with one factor as the same (d + a,) with factors of their own."""
    return np.asarray(point[_sources(shared, apart)])


def _sources(shared: SearchSpace, apart: SearchSpace) -> NDArray[np.int64]:
    """Which coordinate of the shared space each one of the other is at first (d + a,)."""
    places = {name: k for k, name in enumerate(shared.names)}
    return np.array([places.get(name, places.get(name.rpartition(".")[2], -1)) for name in apart.names])


def _in_the_same_box(apart: SearchSpace, shared: SearchSpace) -> SearchSpace:
    """With the bounds that the search has widened by now."""
    at = _sources(shared, apart)
    return apart.widened(Box(shared.lower[at], shared.upper[at]))


def _are_told(
    run: Identification, shared: SearchSpace, apart: SearchSpace, best: Array, stop: Stop | None
) -> bool:
    """Whether the flights are likelier with them, and better predicted by each other."""

    def errors(points: Array) -> Array:
        return residuals(run.model, apart.decode(points), run.training, run.settings.start, stop)

    residual, jacobian = (values[0] for values in differences(best[None, :], apart.upper, errors))
    together = np.zeros((apart.dimension, shared.dimension))
    together[np.arange(apart.dimension), _sources(shared, apart)] = 1.0
    weight, shapes = run.prior_weight, run.shapes()
    offset = best - apart.guess
    own = linear_model(residual, jacobian, offset, weight, shapes)
    first = np.array([np.argmax(together[:, k]) for k in range(shared.dimension)])
    one = linear_model(residual, jacobian @ together, offset[first], weight, shapes)
    count = min(own.count, one.count)
    if log_evidence(own, count) < log_evidence(one, count) + WORTH_A_FACTOR:
        return False
    ends = np.cumsum([rows * channels for rows, channels in shapes])
    return left_out(residual, jacobian, offset, weight, ends) < left_out(
        residual, jacobian @ together, offset[first], weight, ends
    )


def left_out(
    error: Array, jacobian: Array, offset: Array, weight: float, ends: Sequence[int] | Array
) -> float:
    """J of flights (rad^2), each as the others predict it, to first order.

    Parameters
    ----------
    error, jacobian : ndarray, shape (m,) and (m, d)
        Residuals at a point, rad, and their derivatives.
    offset : ndarray, shape (d,)
        The point less the guess that the prior draws to.
    weight : float
        Of the prior, rad^2 a squared unit.
    ends : sequence of int
        Rows after the last one of each flight.
    """
    normal, pull = jacobian.T @ jacobian, jacobian.T @ error + weight * offset
    prior, found, first = weight * np.eye(offset.size), 0.0, 0
    for end in ends:
        own, left = jacobian[first:end], error[first:end]
        change = np.linalg.lstsq(normal - own.T @ own + prior, own.T @ left - pull, rcond=1e-14)[0]
        found += float(np.sum((left + own @ change) ** 2))
        first = int(end)
    return found
