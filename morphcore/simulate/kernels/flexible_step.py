"""Steps of the flexible model, one after the other without a return to Python.

Generalised-alpha on SE(3) as `simulate.flexible` describes it. A step starts from the acceleration carried on
straight from the last two, places the lattice and the sections' maps there (third order off), and iterates on
the whole equations of its end, air loads included, with the structure's factored matrix, the air's part left
out; if the iteration slows down, the step requests a new matrix and is flown again. The circulations follow
by refinement with the inverse of an earlier influence matrix, to `REFINED`; a step that does not reach it
hands back its matrix for a new inverse and is flown again.

The parts of a step are inlined into one kernel: compiled separately, each would be optimised again together
with everything it calls.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from morphcore.aero.kernels.lattice_forces import blocked_flow, deflect, place_lattice, section_forces
from morphcore.aero.kernels.lattice_gusts import add_gust_flow, add_gust_forces, limit_circulation
from morphcore.aero.kernels.lattice_place import refine
from morphcore.aero.kernels.loads import JONES_A1, JONES_A2
from morphcore.jit import entry_kernel, inlined
from morphcore.multibody.kernels.beam import (
    apparent_forces,
    beam_forces,
    body_forces,
    condense,
    invert,
    multiply,
    place_sections,
    section_twists,
    substitute,
    subtract_forces,
)
from morphcore.multibody.kernels.poses import move_poses
from morphcore.simulate.kernels.roots import (
    follow_fuselage,
    gather_root_matrices,
    gather_roots,
    spread_to_roots,
)

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]

TOLERANCE = 1e-8  # rad/s and m/s, of the last Newton step's change of the velocities
SLOW = 0.1  # share of the last iteration's change: slower convergence means that the matrix may be too old
MAX_ITERATIONS = 50
REFINED = 1e-12  # remaining flow through the panels, relative to its largest value before
STILL = 1e-7  # of the largest circulation: smaller changes within a step leave the induced velocities
MAX_PASSES = 8  # passes of refinement; if more are needed, the inverse is renewed
FLOWN, INVERSE_WANTED, MATRIX_WANTED, LOST, BENT_TOO_FAR = 0, 1, 2, 3, 4
# numbers of a record before those of the tips: R_NB row by row, twist, position, twist rate of the fuselage
RECORD = 24


@inlined
def lag_after(lag, before, after, decay, mean):
    """A lag state after a step over which the circulation runs straight from ``before`` to ``after``.

    The exact solution of T dz/dt = circulation - z. decay : exp(-h / T). mean : mean of the decay over the
    step.
    """
    return decay * lag + (mean - decay) * before + (1.0 - mean) * after


class Structure(NamedTuple):
    """Beams, bodies, roots and sections as their kernels take them, with scratch; see `multibody.beam`."""

    ends: IntArray
    rest: Array
    stiffness: Array
    damping: Array
    mass: Array
    bodies: IntArray
    inertia: Array
    apparent: Array
    gauss: Array
    gauss_series: Array
    roots: IntArray
    tips: IntArray
    gravity_N: Array
    thrust: Array
    section_element: IntArray
    section_fraction: Array
    section_series: Array
    section_blocks: Array
    strains: Array
    rates: Array
    tangents: Array
    inverses: Array
    couplings: Array
    diagonals: Array
    v: Array
    m: Array
    poses: Array


class Path(NamedTuple):
    """Prescribed motion of hinges and controls, `simulate.flexible.HingePath`, and wind_N (k, 3).

    gusts : (k, 6 t), as in `lattice_gusts`; (k, 0) without.
    """

    R_BW: Array
    origin_B: Array
    axis: Array
    rate: Array
    acceleration: Array
    wind_N: Array
    deflection: Array
    gusts: Array


class Rule(NamedTuple):
    """Coefficients of the stepper; decay, mean : (2, r) of the lag's exact step; still : `STILL`."""

    step_s: float
    gamma: float
    beta: float
    of_new: float
    of_old: float
    of_average: float
    of_rate: float
    of_pose: float
    still: float
    decay: Array
    mean: Array


class State(NamedTuple):
    """State arrays that move in time, as `FlexibleState`; A_before : (n, 6) twist rates one step earlier."""

    R: Array
    x: Array
    V: Array
    A: Array
    a: Array
    A_before: Array
    lag: Array
    circulation: Array


class Scratch(NamedTuple):
    """Room for one step (n nodes, k sections, r rings): right (n, 6); twists, forces (k, 6); others (r,).

    stall : (3,) of the last iteration, `lattice_gusts.limit_circulation`.
    """

    R_NS: Array
    x_N: Array
    twists: Array
    forces: Array
    right: Array
    blocked: Array
    residual: Array
    acting: Array
    inverse: Array
    small: Array
    pace: Array
    turn: Array
    vector: Array
    stall: Array


@entry_kernel
def fly_steps(structure, parts, place, path, rule, state, trial, scratch, records, first, last, fresh):
    """Fly from row ``first`` to row ``last`` of the path; states move in place.

    ``trial`` is a State of scratch. records (k, RECORD + 2 tips) gets a row for every time. ``fresh`` : the
    matrix was formed in the first step itself. Returns the row reached and the reason for stopping there.
    """
    row = first
    while True:
        _record(structure, state, scratch, records[row])
        if row == last:
            return row, FLOWN
        status = _step(structure, parts, place, path, rule, state, trial, scratch, row + 1, fresh)
        if status != FLOWN:
            return row, status
        row, fresh = row + 1, False


@inlined
def _record(structure, state, scratch, out):
    """Record the fuselage's attitude, twist, position and twist rate, and the tips' z in B and twist.

    If sections stall, the record ends with ``scratch.stall``. A tip's twist is recorded as its sine: element
    (x, z) of the rotation from its axes to the root's.
    """
    tips = structure.roots.size
    for i in range(3):
        for j in range(3):
            out[3 * i + j] = state.R[0, i, j]
        out[15 + i] = state.x[0, i]
    for i in range(6):
        out[9 + i] = state.V[0, i]
        out[18 + i] = state.A[0, i]
    for s in range(tips):
        root, tip = structure.roots[s], structure.tips[s]
        total, sine = 0.0, 0.0
        for i in range(3):
            total += (state.x[tip, i] - state.x[root, i]) * state.R[0, i, 2]
            sine += state.R[root, i, 0] * state.R[tip, i, 2]
        out[RECORD + s] = total
        out[RECORD + tips + s] = sine
    if out.size > RECORD + 2 * tips:
        for i in range(3):
            out[RECORD + 2 * tips + i] = scratch.stall[i]


@inlined
def _moved(structure, path, rule, state, trial, scratch, row):
    """Move the trial to the end of a step by its twist rates; the roots' part of these is set."""
    h = rule.step_s
    increments = scratch.right
    for n in range(trial.A.shape[0]):
        for i in range(6):
            a0 = state.a[n, i]
            a = rule.of_new * trial.A[n, i] + rule.of_old * state.A[n, i] - rule.of_average * a0
            trial.a[n, i] = a
            trial.V[n, i] = state.V[n, i] + h * ((1.0 - rule.gamma) * a0 + rule.gamma * a)
            increments[n, i] = h * state.V[n, i] + h * h * ((0.5 - rule.beta) * a0 + rule.beta * a)
        for i in range(3):
            trial.x[n, i] = state.x[n, i]
            for j in range(3):
                trial.R[n, i, j] = state.R[n, i, j]
    move_poses(increments, trial.R, trial.x, scratch.turn)
    follow_fuselage(
        structure.roots,
        path.R_BW[row],
        path.origin_B[row],
        path.axis[row],
        path.rate[row],
        path.acceleration[row],
        trial.R,
        trial.x,
        trial.V,
        trial.A,
        structure.v,
    )


@inlined
def _place(structure, parts, place, trial, scratch, wind_B):
    """Place sections and lattice at the trial state."""
    place_sections(
        structure.ends,
        structure.section_fraction,
        structure.section_series,
        structure.section_element,
        structure.strains,
        trial.R,
        trial.x,
        structure.v,
        structure.poses,
        scratch.R_NS,
        scratch.x_N,
        structure.section_blocks,
    )
    R, x = trial.R[0], trial.x[0]
    for k in range(structure.section_element.size):
        for i in range(3):
            place.x_B[k, i] = 0.0
            for j in range(3):
                place.x_B[k, i] += R[j, i] * (scratch.x_N[k, j] - x[j])
                total = 0.0
                for c in range(3):
                    total += R[c, i] * scratch.R_NS[k, c, j]
                place.R_BS[k, i, j] = total
    stream_B = scratch.vector[1]
    for i in range(3):
        stream_B[i] = wind_B[i] - trial.V[0, 3 + i]
    place_lattice(parts, place, stream_B)


@inlined
def _tie_roots(structure, path, small, row):
    """small[0] = inverse of the condensed matrix of fuselage and all chains at the reference point."""
    for i in range(6):
        for j in range(6):
            small[1, i, j] = structure.diagonals[0, i, j]
    gather_root_matrices(
        structure.roots,
        path.R_BW[row],
        path.origin_B[row],
        structure.diagonals,
        structure.v,
        structure.m,
        small[1],
    )
    invert(small[1], small[0])


@inlined
def _solve(structure, path, small, right, vector, row):
    """Solution of the factored matrix, the roots tied to the fuselage, in place of ``right`` (n, 6)."""
    condense(structure.ends, structure.tangents, structure.inverses, structure.v, right)
    total = vector[0]
    for i in range(6):
        total[i] = right[0, i]
    gather_roots(structure.roots, path.R_BW[row], path.origin_B[row], right, total)
    multiply(small[0], total, right[0])
    spread_to_roots(structure.roots, path.R_BW[row], path.origin_B[row], right[0], right)
    substitute(structure.ends, structure.couplings, right)


@inlined
def _step(structure, parts, place, path, rule, state, trial, scratch, row, fresh):
    """One step to ``row``; returns a status, FLOWN if it was made.

    A matrix is discarded when convergence is twice as slow as with one that is ``fresh`` in its step:
    slowness due to the air loads would not improve with a new matrix.
    """
    nodes, rings = state.A.shape[0], state.circulation.size
    wind_B, right = scratch.vector[0], scratch.right
    for n in range(nodes):
        for i in range(6):
            trial.A[n, i] = 2.0 * state.A[n, i] - state.A_before[n, i]
    for q in range(rings):
        trial.circulation[q] = state.circulation[q]
    tied, last, arrived = False, math.inf, False
    status = LOST
    for iteration in range(MAX_ITERATIONS):
        _moved(structure, path, rule, state, trial, scratch, row)
        if arrived:
            status = FLOWN
            break
        right[:] = 0.0
        failed = beam_forces(
            structure.ends,
            structure.rest,
            structure.stiffness,
            structure.damping,
            structure.mass,
            structure.gauss,
            structure.gauss_series,
            trial.R,
            trial.x,
            trial.V,
            trial.A,
            structure.gravity_N,
            structure.v,
            structure.poses,
            structure.strains,
            structure.rates,
            right,
        )
        if failed >= 0:
            status = BENT_TOO_FAR
            break
        body_forces(
            structure.bodies,
            structure.inertia,
            trial.R,
            trial.V,
            trial.A,
            structure.gravity_N,
            structure.v,
            right,
        )
        apparent_forces(structure.apparent, trial.R, trial.V, trial.A, path.wind_N[row], structure.v, right)
        for i in range(3):
            wind_B[i] = 0.0
            for j in range(3):
                wind_B[i] += trial.R[0, j, i] * path.wind_N[row, j]
        if iteration == 0:
            deflect(parts, place, path.deflection[row])
            _place(structure, parts, place, trial, scratch, wind_B)
        section_twists(
            structure.ends, structure.section_element, structure.section_blocks, trial.V, scratch.twists
        )
        blocked_flow(parts, place, scratch.twists, wind_B, scratch.blocked)
        gust = path.gusts[row]
        if gust.size:
            add_gust_flow(parts, place, trial.R[0], gust, scratch.blocked)
        if not refine(
            place.influence,
            scratch.inverse,
            scratch.blocked,
            scratch.residual,
            REFINED,
            MAX_PASSES,
            trial.circulation,
        ):
            status = INVERSE_WANTED
            break
        for q in range(rings):
            before, after = state.circulation[q], trial.circulation[q]
            total = (1.0 - JONES_A1 - JONES_A2) * after
            for k in range(2):
                lag = lag_after(state.lag[k, q], before, after, rule.decay[k, q], rule.mean[k, q])
                trial.lag[k, q] = lag
                total += (JONES_A1 if k == 0 else JONES_A2) * lag
            scratch.acting[q] = total
        if parts.limits.size:
            limit_circulation(
                parts, place, trial.R[0], gust, scratch.twists, wind_B, scratch.acting, scratch.stall
            )
        section_forces(parts, place, scratch.acting, scratch.twists, wind_B, rule.still, scratch.forces)
        if gust.size:
            add_gust_forces(parts, place, trial.R[0], gust, scratch.twists, wind_B, scratch.forces)
        subtract_forces(
            structure.ends, structure.section_element, structure.section_blocks, scratch.forces, right
        )
        for i in range(6):
            right[0, i] -= structure.thrust[i]
        for n in range(nodes):
            for i in range(6):
                right[n, i] = -right[n, i]
        if not tied:
            _tie_roots(structure, path, scratch.small, row)
            tied = True
        _solve(structure, path, scratch.small, right, scratch.vector[2:], row)
        largest = 0.0
        for n in range(nodes):
            for i in range(6):
                trial.A[n, i] += right[n, i]
                size = abs(right[n, i])
                largest = size if not size <= largest else largest  # NaN wins
        largest *= rule.step_s
        if not largest < math.inf:
            break
        arrived = largest < TOLERANCE
        pace, last = largest / last, largest
        if fresh:
            scratch.pace[0] = max(scratch.pace[0], pace) if iteration > 1 else pace
        elif pace > max(SLOW, 2.0 * scratch.pace[0]) and not arrived:
            status = MATRIX_WANTED
            break
    if status == FLOWN:
        _accept(state, trial)
    return status


@inlined
def _accept(state, trial):
    """Make the trial the state."""
    for n in range(state.A.shape[0]):
        for i in range(6):
            state.A_before[n, i] = state.A[n, i]
            state.V[n, i], state.A[n, i], state.a[n, i] = trial.V[n, i], trial.A[n, i], trial.a[n, i]
        for i in range(3):
            state.x[n, i] = trial.x[n, i]
            for j in range(3):
                state.R[n, i, j] = trial.R[n, i, j]
    for q in range(state.circulation.size):
        state.circulation[q] = trial.circulation[q]
        state.lag[0, q], state.lag[1, q] = trial.lag[0, q], trial.lag[1, q]
