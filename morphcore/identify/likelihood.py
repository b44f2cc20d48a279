"""How likely a parameter set is, given what the residuals around the best fit say about their noise.

The estimate solves D'r = 0, with the Jacobian D at the estimate. At the true parameters the same scores D'r
are those of the noise alone: their covariance M = sum_ij D_i' R(i - j) D_j is known (`coloured`). So

    -2 log L(x) = (D'r(x))' M^-1 D'r(x) + |(1 - D D^+) r(x)|^2 / v

which is the generalised method of moments with its optimal weight (Hansen 1982), read as a posterior
(Chernozhukov & Hong 2003). For white noise M = v D'D, and both terms together are r'r / v exactly. For
coloured noise the spread of a linear model is that of the sandwich formula, where whitening the residuals
would promise more than least squares can keep. The second term, of what no linear change explains, only
matters far from the estimate; v is the mean variance that the scores see.

The physical guess adds a normal prior in search coordinates, of the spread that the flights say it has
(`evidence.guess_spread`), and the box ends it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from morphcore.identify.coloured import PRIOR_SPREAD, ColouredNoise

Array = NDArray[np.float64]

UNSEEN = 1e-12  # of the largest variance of a score: there the flights say nothing
UNSEEN_COLUMN = 1e-7  # of the largest singular value of the Jacobian


@dataclass(frozen=True)
class Likelihood:
    """Logarithm of the posterior density of parameter sets from their residuals.

    Attributes
    ----------
    jacobian : ndarray, shape (m, d)
        D at the estimate, nuisances eliminated.
    middle : ndarray, shape (d, d)
        Covariance M of the scores.
    guess : ndarray, shape (d,)
        Middle of the prior.
    lower, upper : ndarray, shape (d,)
        Box of the search.
    spread : float
        Standard deviation of the prior in search coordinates.
    """

    jacobian: Array
    middle: Array
    guess: Array
    lower: Array
    upper: Array
    spread: float = PRIOR_SPREAD

    @classmethod
    def of(
        cls, noise: ColouredNoise, jacobian: Array, guess: Array, lower: Array, upper: Array
    ) -> Likelihood:
        """Likelihood out of the noise around a fit."""
        return cls(jacobian, noise.middle, guess, lower, upper, noise.spread)

    @cached_property
    def whitening(self) -> Array:
        """(d, s) takes scores to s independent ones of unit variance."""
        variance, axes = np.linalg.eigh(self.middle)
        seen = variance > UNSEEN * max(float(variance.max(initial=0.0)), 1e-300)
        return np.asarray(axes[:, seen] / np.sqrt(variance[seen]))

    @cached_property
    def explained(self) -> Array:
        """(m, e) orthonormal: changes of the residuals that the linear model explains."""
        basis, size, _ = np.linalg.svd(self.jacobian, full_matrices=False)
        return np.asarray(basis[:, size > UNSEEN_COLUMN * max(float(size.max(initial=0.0)), 1e-300)])

    @cached_property
    def variance(self) -> float:
        """Mean variance v of the noise in the explained directions, rad^2."""
        _, size, axes = np.linalg.svd(self.jacobian, full_matrices=False)
        seen = size > UNSEEN_COLUMN * max(float(size.max(initial=0.0)), 1e-300)
        along = axes[seen] / size[seen, None]
        return float(np.mean(np.einsum("ed,dc,ec->e", along, self.middle, along))) if seen.any() else 1.0

    @cached_property
    def slope(self) -> Array:
        """(s, d) derivative of the whitened scores by the search coordinates at the estimate."""
        return np.asarray(self.whitening.T @ (self.jacobian.T @ self.jacobian))

    @cached_property
    def covariance(self) -> Array:
        """(d, d) of the posterior of a linear model."""
        return np.asarray(np.linalg.inv(self.slope.T @ self.slope + np.eye(self.guess.size) / self.spread**2))

    def inside(self, points: Array) -> NDArray[np.bool_]:
        """(p,) which points (p, d) lie in the box."""
        return np.asarray(np.all((points >= self.lower) & (points <= self.upper), axis=1))

    def scores(self, residual: Array) -> Array:
        """(p, s) whitened scores of residuals (p, m): of unit variance at the truth."""
        return np.asarray(residual @ self.jacobian @ self.whitening)

    def log_density(self, points: Array, residual: Array) -> Array:
        """(p,) logarithm of the posterior at points (p, d) with residuals (p, m); -inf outside the box."""
        beyond = np.sum(residual**2, axis=1) - np.sum((residual @ self.explained) ** 2, axis=1)
        found = self.log_of_scores(points, self.scores(residual)) - 0.5 * beyond / self.variance
        return np.asarray(found)

    def log_of_scores(self, points: Array, scores: Array) -> Array:
        """(p,) the same without the part that no linear change explains."""
        off = np.sum((points - self.guess) ** 2, axis=1) / self.spread**2
        found = -0.5 * (np.sum(scores**2, axis=1) + off)
        return np.where(self.inside(points), found, -np.inf)
