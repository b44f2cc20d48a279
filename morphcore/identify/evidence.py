"""How much the first guess weighs against the flights, chosen by the flights themselves.

A chain of links is never the truth. Its parameters stand for what a flexible aircraft does, and those that
the flights to fit do not determine would fit what no chain can fly, at the cost of every other flight. So
parameters are drawn to the physical guess, as if it were off by normal errors of standard deviation `spread`
in search coordinates, and the residuals were normal of variance v: a parameter one unit off costs as much as
v / spread^2 of J. Both are the ones under which the flights are most likely (marginal likelihood of the model
linearised where the search is: MacKay 1992), and are chosen again in every iteration, out of residuals and
Jacobian that it has anyway.

Residuals of neighbouring rows say the same. A record counts as many independent rows as its residuals'
autocorrelation leaves it, so that the choice does not depend on how densely a flight was sampled.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from morphcore.search.checkpoint import stored
from morphcore.search.least_squares import EXACT_RMS

Array = NDArray[np.float64]

Shapes = Sequence[tuple[int, int]]  # rows and channels of the residuals of each sample

MIN_SPREAD, MAX_SPREAD = 0.03, 1.0  # of the guess: from a few per cent to a factor e
WEIGHTS = np.geomspace(1e-16, 1e-2, 113)  # that are tried, rad^2 a squared unit
# a weight stays until another one makes the flights e times likelier: else it would wander to and fro
WORTH_A_CHANGE = 1.0
SMALLEST_RAD = 1e-13  # below, a residual is rounding


@dataclass(frozen=True)
class ChosenPrior:
    """The physical guess, with the weight that the flights give it.

    Attributes
    ----------
    point : ndarray, shape (d,)
        The guess in search coordinates.
    first : ndarray, shape (d,)
        Weights with which the search begins, rad^2 a squared unit.
    shapes : callable, () -> sequence of (int, int)
        Rows and channels of the residuals of each sample to fit; looked at when the first ones come.
    """

    point: Array
    first: Array
    shapes: Callable[[], Shapes]

    def weights(self, error: Array, jacobian: Array, offset: Array, present: Array) -> Array:
        """Return the weights (d,) under which the residuals are most likely.

        Parameters
        ----------
        error, jacobian : ndarray, shape (m,) and (m, d)
            Residuals at a point, rad, and their derivatives.
        offset : ndarray, shape (d,)
            The point less the guess.
        present : ndarray, shape (d,)
            The weights so far.
        """
        weight = float(present.max())
        linear = linear_model(error, jacobian, offset, weight, self.shapes())
        tried = np.append(WEIGHTS, weight)
        likelihood = log_likelihood(linear, tried)
        best = int(np.argmax(likelihood))
        changes = likelihood[best] > likelihood[-1] + WORTH_A_CHANGE
        return np.full(present.shape, tried[best] if changes else weight)


def left_after(error: Array, jacobian: Array, offset: Array, weight: float) -> Array:
    """Residuals (m,) that the linear model leaves with a weight of the prior."""
    square = jacobian.T @ jacobian + weight * np.eye(offset.size)
    return np.asarray(error - jacobian @ np.linalg.solve(square, jacobian.T @ error + weight * offset))


def independent_rows(error: Array, shapes: Shapes) -> float:
    """How many independent rows residuals (m,) are worth, by their autocorrelation in each channel.

    The sum of the autocorrelation is taken as far as it stays positive (Geyer 1992).
    """
    total, first = 0.0, 0
    for count, channels in shapes:
        own = error[first : first + channels * count].reshape(count, channels).T
        first += channels * count
        for channel in own[np.abs(own).max(axis=1) > SMALLEST_RAD]:
            spectrum = np.abs(np.fft.rfft(channel, 2 * count)) ** 2
            correlation = np.fft.irfft(spectrum)[:count]
            correlation = correlation / correlation[0]
            negative = np.flatnonzero(correlation <= 0.0)
            end = int(negative[0]) if negative.size else count
            total += count / (2.0 * float(correlation[:end].sum()) - 1.0)
    return max(total, 1.0)


@stored
@dataclass(frozen=True)
class Linear:
    """A model linearised at a point, as far as the likelihood of a prior's weight depends on it.

    Attributes
    ----------
    stiffness : ndarray, shape (d,)
        Eigenvalues of D'D, with the Jacobian D.
    pull : ndarray, shape (d,)
        Squares of D'r along its eigenvectors, r the residuals at the guess.
    square : float
        r'r, rad^2.
    rows : int
        Residuals m.
    count : float
        Independent ones among them.
    """

    stiffness: Array
    pull: Array
    square: float
    rows: int
    count: float


def linear_model(error: Array, jacobian: Array, offset: Array, weight: float, shapes: Shapes) -> Linear:
    """Linearise a model.

    Parameters
    ----------
    error, jacobian : ndarray, shape (m,) and (m, d)
        Residuals at a point, rad, and their derivatives.
    offset : ndarray, shape (d,)
        The point less the guess.
    weight : float
        Of the prior, with which what remains of the residuals is looked at.
    shapes : sequence of (int, int)
        Rows and channels of the residuals of each sample.
    """
    count = independent_rows(left_after(error, jacobian, offset, weight), shapes)
    at_guess = error - jacobian @ offset
    stiffness, axes = np.linalg.eigh(jacobian.T @ jacobian)
    pull = (axes.T @ (jacobian.T @ at_guess)) ** 2
    return Linear(np.maximum(stiffness, 0.0), pull, float(at_guess @ at_guess), error.size, count)


def log_likelihood(linear: Linear, weights: Array, count: float | None = None) -> Array:
    """Logarithm (w,) of the marginal likelihood of a linear model by weights (w,) of the prior.

    Of each weight with the variance of the residuals, and so the spread of the guess, that fits it best.

    Parameters
    ----------
    linear : Linear
    weights : ndarray, shape (w,)
        rad^2 a squared unit.
    count : float, optional
        Independent rows; None for the model's own.
    """
    count = linear.count if count is None else count
    fitted, variance = _fitted(linear, weights, count)
    occam = np.log1p(linear.stiffness / weights[:, None]).sum(axis=1)
    return np.asarray(-0.5 * (fitted / variance + count * np.log(variance) + occam))


def guess_spread(linear: Linear) -> float:
    """Standard deviation of the physical guess in search coordinates, by what the flights say of it.

    Root mean square over all weights of the prior by their likelihood: few parameters tell their spread only
    roughly, and that of the likeliest weight alone would promise too much.
    """
    likelihood = log_likelihood(linear, WEIGHTS)
    _, variance = _fitted(linear, WEIGHTS, linear.count)
    share = np.exp(likelihood - likelihood.max())
    return float(np.sqrt(np.average(variance / WEIGHTS, weights=share)))


def _fitted(linear: Linear, weights: Array, count: float) -> tuple[Array, Array]:
    """(w,) J and the prior's cost together, at their minimum, and the likeliest variance of a residual."""
    share = linear.stiffness + weights[:, None]
    # never less than what a descent leaves of an exact fit
    fitted = np.maximum(linear.square - (linear.pull / share).sum(axis=1), linear.rows * EXACT_RMS**2)
    return fitted, np.clip(fitted / count, weights * MIN_SPREAD**2, weights * MAX_SPREAD**2)


def log_evidence(linear: Linear, count: float | None = None) -> float:
    """Logarithm of the marginal likelihood with the likeliest weight of the prior."""
    return float(log_likelihood(linear, WEIGHTS, count).max())


def left_out(
    error: Array, jacobian: Array, offset: Array, weight: float, ends: Sequence[int] | NDArray[np.int64]
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
