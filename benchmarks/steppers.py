"""Candidate time steppers of the equivalent model, all made of one stage (see stage.py).

Every one is a function of stages, a step and a number of steps that yields the mechanical state at the start
and after each step. In all of them the lag states are exact from stage to stage and the hinges' acceleration
is the mean over the step. What the study found is in docs/performance_stepper.md.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from benchmarks.stage import Lag, Stages

Array = NDArray[np.float64]
Stepper = Callable[[Stages, float, int], Iterator[Array]]
Rows = Sequence[Sequence[float]]

GAMMA_2 = 1.0 - 1.0 / math.sqrt(2.0)  # ROS2's
GAMMA_3 = 7.8867513459481287e-01  # ROS3Pw's
GAMMA_4 = 4.3586652150845900e-01  # ROS34PW2's
GAMMA_SHIPPED = 9.0 / 16.0


def linear_euler(stages: Stages, h: float, steps: int) -> Iterator[Array]:
    """Linearly implicit Euler; Hairer & Wanner (1996), section IV.9. One stage, order one."""
    u, lag = stages.first, stages.first_lag
    yield u
    for n in range(steps):
        u, lag = _euler(stages, u, lag, stages.course.start_s + n * h, h, 1)
        yield _unit(u)


def w_method(alpha: Rows, gamma: Rows, diagonal: float, weights: Sequence[float]) -> Stepper:
    """A W-method: Rosenbrock's with any matrix A; Steihaug & Wolfbrandt (1979, Math. Comput. 33).

        k_i = F(u + h sum alpha_ij k_j) + h A (diagonal k_i + sum gamma_ij k_j),   u' = u + h sum b_i k_i

    Hairer & Wanner (1996), section IV.7, equation 7.4.
    """

    def steps_of(stages: Stages, h: float, steps: int) -> Iterator[Array]:
        u, lag = stages.first, stages.first_lag
        yield u
        for n in range(steps):
            begin = stages.course.start_s + n * h
            acceleration = stages.course.mean_acceleration(begin, begin + h)
            slopes: list[Array] = []
            settled = lag
            for a, g in zip(alpha, gamma, strict=True):
                stage_u, slope = u + h * _sum(a, slopes, u), h * _sum(g, slopes, u)
                time_s = begin + h * math.fsum(a)
                k, closed = stages(time_s, acceleration, stage_u, settled, diagonal * h, slope)
                if not slopes:  # the first stage lies at the begin: the lag states are exact there
                    settled = closed
                slopes.append(k)
            lag = settled
            u = _unit(u + h * _sum(weights, slopes, u))
            yield u

    return steps_of


def extrapolated_euler(parts: Sequence[int]) -> Stepper:
    """Linearly implicit Euler with 1, 2, ... substeps, extrapolated; Hairer & Wanner (1996), section IV.9."""
    return _extrapolated(_euler, parts, 1)


def extrapolated_ros2(parts: Sequence[int]) -> Stepper:
    """ROS2 with 1, 2, ... substeps, extrapolated; Hairer, Norsett & Wanner (1993), section II.9."""
    return _extrapolated(_ros2, parts, 2)


def generalized_alpha(radius: float, iterations: int) -> Stepper:
    """Generalized-alpha for systems of first order with so many linearised iterations a step.

    Jansen, Whiting & Hulbert (2000, Comput. Methods Appl. Mech. Eng. 190), section 3. ``radius``: of
    the amplification at infinity.
    """
    a_m, a_f = 0.5 * (3.0 - radius) / (1.0 + radius), 1.0 / (1.0 + radius)
    gamma = 0.5 + a_m - a_f

    def steps_of(stages: Stages, h: float, steps: int) -> Iterator[Array]:
        u = stages.first
        yield u
        rate, lag = _first_slope(stages, h, 1.0)
        implicit = a_f * gamma * h / a_m
        for n in range(steps):
            begin = stages.course.start_s + n * h
            acceleration = stages.course.mean_acceleration(begin, begin + h)
            end, middle_rate, end_rate, closed = u + h * rate, rate, rate, lag
            for _ in range(iterations):
                middle_rate, closed = stages(
                    begin + a_f * h, acceleration, u + a_f * (end - u), lag, implicit, -implicit * middle_rate
                )
                end_rate = rate + (middle_rate - rate) / a_m
                end = u + h * (rate + gamma * (end_rate - rate))
            u, rate, lag = _unit(end), end_rate, closed
            yield u

    return steps_of


def sbdf2(stages: Stages, h: float, steps: int) -> Iterator[Array]:
    """The implicit-explicit two-step formula SBDF; Ascher, Ruuth & Wetton (1995, SIAM J. Numer. Anal. 32).

    Its explicit part reads one extrapolated state instead of extrapolating rates: one stage. ROS2 starts.
    """
    u, lag = stages.first, stages.first_lag
    yield u
    start_s = stages.course.start_s
    last = u
    u, lag = _ros2(stages, u, lag, start_s, h, 1)
    yield _unit(u)
    before = stages.course.mean_acceleration(start_s, start_s + h)
    for n in range(1, steps):
        begin = start_s + n * h
        acceleration = stages.course.mean_acceleration(begin, begin + h)
        guess, base = 2.0 * u - last, (4.0 * u - last) / 3.0
        at_end = 1.5 * acceleration - 0.5 * before
        k, lag = stages(begin + h, at_end, guess, lag, 2.0 * h / 3.0, base - guess)
        last, u, before = u, _unit(base + 2.0 * h / 3.0 * k), acceleration
        yield u


def two_step_w(node: float, gamma: float, *, quadratic: bool) -> Stepper:
    """A W-method of one stage that remembers slopes; Podhaisky, Schmitt & Weiner (2002).

    With the slopes k1 and k2 of the last two steps:

        k = F(t + node h, u + h node k1 [+ h node (1 - node / 2) (k1 - k2)]) + ...
        u' = u + h ((3/2 - node) k + (node - 1/2) k1)

    The bracket is there if ``quadratic``; the dots stand for h A times what makes the argument of an exact A
    u + h (node k1 + gamma (k - k1)), whatever the bracket. Node 1/2, gamma 9/16 and quadratic: the shipped
    step, simulate/kernels/step.py.
    """

    def steps_of(stages: Stages, h: float, steps: int) -> Iterator[Array]:
        u = stages.first
        yield u
        last, lag = _first_slope(stages, h, gamma)
        before = last
        curve = node * (1.0 - 0.5 * node) if quadratic else 0.0
        for n in range(steps):
            begin = stages.course.start_s + n * h
            acceleration = stages.course.mean_acceleration(begin, begin + h)
            bend = curve * (last - before)
            guess, slope = u + h * (node * last + bend), -h * (gamma * last + bend)
            k, lag = stages(begin + node * h, acceleration, guess, lag, gamma * h, slope)
            # the first slope stands at the start, not a step before the node
            share = 0.5 / node if n == 0 else 1.5 - node
            u = _unit(u + h * (share * k + (1.0 - share) * last))
            last, before = k, last
            yield u

    return steps_of


def _unit(u: Array) -> Array:
    """The same state with a unit quaternion, in place."""
    u[:4] /= np.sqrt(np.sum(u[:4] ** 2, axis=0))
    return u


def _sum(weights: Sequence[float], slopes: Sequence[Array], u: Array) -> Array:
    total = np.zeros_like(u)
    for weight, slope in zip(weights, slopes, strict=True):
        total += weight * slope
    return total


def _first_slope(stages: Stages, h: float, gamma: float) -> tuple[Array, Lag]:
    """A stage of linearly implicit Euler at the start, and the lag states settled there."""
    begin = stages.course.start_s
    acceleration = stages.course.mean_acceleration(begin, begin + h)
    return stages(begin, acceleration, stages.first, stages.first_lag, gamma * h)


Part = Callable[[Stages, Array, Lag, float, float, int], tuple[Array, Lag]]


def _euler(stages: Stages, u: Array, lag: Lag, begin: float, h: float, parts: int) -> tuple[Array, Lag]:
    """Some substeps of linearly implicit Euler over h; the end, and the lag states settled at the begin."""
    first, part = None, h / parts
    for i in range(parts):
        time_s = begin + i * part
        acceleration = stages.course.mean_acceleration(time_s, time_s + part)
        k, lag = stages(time_s, acceleration, u, lag, part)
        first = first or lag
        u = u + part * k
    return u, first or lag


def _ros2(stages: Stages, u: Array, lag: Lag, begin: float, h: float, parts: int) -> tuple[Array, Lag]:
    """Some substeps of ROS2 over h; the end, and the lag states settled at the begin."""
    first, part = None, h / parts
    g = GAMMA_2 * part
    for i in range(parts):
        time_s = begin + i * part
        acceleration = stages.course.mean_acceleration(time_s, time_s + part)
        k1, lag = stages(time_s, acceleration, u, lag, g)
        k2, _ = stages(time_s + part, acceleration, u + part * k1, lag, g, -2.0 * g * k1)
        first = first or lag
        u = u + 0.5 * part * (k1 + k2)
    return u, first or lag


def _extrapolated(rule: Part, parts: Sequence[int], order: int) -> Stepper:
    """Aitken and Neville's table over errors of h^order, h^(order + 1), ..."""

    def steps_of(stages: Stages, h: float, steps: int) -> Iterator[Array]:
        u, lag = stages.first, stages.first_lag
        yield u
        for n in range(steps):
            begin = stages.course.start_s + n * h
            row: list[Array] = []
            settled = lag
            for j, count in enumerate(parts):
                above, row = row, []
                end, settled = rule(stages, u, lag, begin, h, count)
                row.append(end)
                for m in range(1, j + 1):
                    factor = count / parts[j - m] if order == 1 else (count / parts[j - m]) ** (order + m - 1)
                    row.append(row[-1] + (row[-1] - above[m - 1]) / (factor - 1.0))
            u, lag = _unit(row[-1]), settled
            yield u

    return steps_of


# Verwer, Spee, Blom & Hundsdorfer (1999), equation 2.1, written with the second slope itself
ROS2 = w_method([[], [1.0]], [[], [-2.0 * GAMMA_2]], GAMMA_2, [0.5, 0.5])
# Rang & Angermann (2005, BIT 45): of order three; with any A ROS34PW2 still, ROS3Pw of order two
ROS3PW = w_method(
    [[], [2.0 * GAMMA_3], [0.5, 0.0]],
    [[], [-2.0 * GAMMA_3], [-6.7075317547305480e-01, -1.7075317547305482e-01]],
    GAMMA_3,
    [1.0566243270259355e-01, 4.9038105676657971e-02, 8.4529946162074843e-01],
)
ROS34PW2 = w_method(
    [[], [8.7173304301691801e-01], [8.4457060015369423e-01, -1.1299064236484185e-01], [0.0, 0.0, 1.0]],
    [
        [],
        [-8.7173304301691801e-01],
        [-9.0338057013044082e-01, 5.4180672388095326e-02],
        [2.4212380706095346e-01, -1.2232505839045147e00, 5.4526025533510214e-01],
    ],
    GAMMA_4,
    [2.4212380706095346e-01, -1.2232505839045147e00, 1.5452602553351020e00, GAMMA_4],
)

SHIPPED = "two-step W, midpoint, quadratic (shipped)"
FORMER = "ROS2 (shipped before)"
STEPPERS: Mapping[str, Stepper] = {
    SHIPPED: two_step_w(0.5, GAMMA_SHIPPED, quadratic=True),
    "two-step W, midpoint, linear": two_step_w(0.5, GAMMA_SHIPPED, quadratic=False),
    FORMER: ROS2,
    "ROS3Pw": ROS3PW,
    "ROS34PW2": ROS34PW2,
    "linearly implicit Euler": linear_euler,
    "the same, extrapolated 1-2": extrapolated_euler((1, 2)),
    "the same, extrapolated 1-2-3": extrapolated_euler((1, 2, 3)),
    "ROS2, extrapolated 1-2": extrapolated_ros2((1, 2)),
    "generalized-alpha, 1 iteration": generalized_alpha(1.0 / 3.0, 1),
    "generalized-alpha, 2 iterations": generalized_alpha(1.0 / 3.0, 2),
    "SBDF2": sbdf2,
}
