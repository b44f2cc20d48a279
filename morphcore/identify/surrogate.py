"""A quadratic model of the scores of a fit, and draws from the posterior that it has.

Along the loose directions of a chain its valley bends, so that draws from a normal distribution around the
estimate miss it: hardly one in three hundred has any weight. Scores as quadratic functions of the
parameters, fitted to flights, follow the bend. Draws from them are cheap, since the model knows its own
slope and curvature, and serve as proposals that flights then accept or not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from morphcore.identify.likelihood import Likelihood

Array = NDArray[np.float64]

LOOSEST_WEIGHT = 1e4  # misfit beyond which a flight has no less weight in the regression
RIDGE = 1e-6  # of the regression, in units of its mean square


@dataclass(frozen=True)
class Surrogate:
    """Whitened scores s(z) = c + B z + z'Q z of standardised coordinates x = centre + root z.

    Attributes
    ----------
    likelihood : Likelihood
    centre : ndarray, shape (d,)
    root : ndarray, shape (d, d)
        A root of the covariance of the linear model.
    constant, linear, quadratic : ndarray, shapes (s,), (s, d), (s, d, d)
    """

    likelihood: Likelihood
    centre: Array
    root: Array
    constant: Array
    linear: Array
    quadratic: Array

    def points(self, z: Array) -> Array:
        """Search points (p, d) of standardised coordinates (p, d)."""
        return np.asarray(self.centre + z @ self.root.T)

    def scores(self, z: Array) -> Array:
        """(p, s)."""
        return np.asarray(self.constant + z @ self.linear.T + np.einsum("psd,pd->ps", self._bent(z), z))

    def log_density(self, z: Array) -> Array:
        """(p,) logarithm of the posterior that the model has."""
        return self.likelihood.log_of_scores(self.points(z), self.scores(z))

    def with_gradient(self, z: Array) -> tuple[Array, Array]:
        """Log densities (p,), and their gradients (p, d) as if there were no box."""
        bent = self._bent(z)
        slope = self.linear + 2.0 * bent
        scores = self.constant + np.matmul(self.linear + bent, z[:, :, None])[:, :, 0]
        points = self.points(z)
        prior = (points - self.likelihood.guess) @ self.root / self.likelihood.spread**2
        force = -np.matmul(scores[:, None, :], slope)[:, 0] - prior
        return self.likelihood.log_of_scores(points, scores), force

    def _bent(self, z: Array) -> Array:
        """(p, s, d) Q z."""
        count, d = z.shape
        flat = z @ self.quadratic.reshape(-1, d).T  # Q is symmetric
        return np.asarray(flat.reshape(count, -1, d))


def surrogate(
    likelihood: Likelihood, centre: Array, root: Array, z: Array, scores: Array, log_density: Array
) -> Surrogate:
    """Fit the model to flights at standardised coordinates z (p, d) by weighted linear regression.

    A flight weighs the less the less likely it is: the model has to be right where the posterior is.
    """
    d = z.shape[1]
    first, second = np.triu_indices(d)
    design = np.concatenate([np.ones((z.shape[0], 1)), z, z[:, first] * z[:, second]], axis=1)
    weight = 1.0 / np.clip(log_density.max() - log_density, 1.0, LOOSEST_WEIGHT)
    normal = design.T @ (weight[:, None] * design)
    ridge = RIDGE * np.diag(np.diag(normal))
    found = np.linalg.solve(normal + ridge, design.T @ (weight[:, None] * scores))
    half = np.zeros((scores.shape[1], d, d))
    half[:, first, second] = found[1 + d :].T
    return Surrogate(
        likelihood, centre, root, found[0], found[1 : 1 + d].T, 0.5 * (half + half.transpose(0, 2, 1))
    )


def wander(
    model: Surrogate, z: Array, rng: np.random.Generator, *, transitions: int, leaps: int, step: float
) -> tuple[Array, float]:
    """Move chains z (p, d) by so many transitions that leave the model's posterior as it is.

    Hamiltonian Monte Carlo (Duane et al. 1987): each transition begins with fresh momenta and has a step of
    its own, drawn around ``step``; the whole move is reversible. Returns the chains and the share of accepted
    transitions.
    """
    accepted = 0.0
    log_density, slope = model.with_gradient(z)
    for _ in range(transitions):
        momentum = rng.normal(size=z.shape)
        own = step * rng.uniform(0.5, 1.5, size=(z.shape[0], 1))
        energy = log_density - 0.5 * np.sum(momentum**2, axis=1)
        with np.errstate(invalid="ignore", over="ignore"):  # a step too long runs away, and is not accepted
            moved, kick, force = z, momentum + 0.5 * own * slope, slope
            found = log_density
            for leap in range(leaps):
                moved = moved + own * kick
                found, force = model.with_gradient(moved)
                kick = kick + (own if leap < leaps - 1 else 0.5 * own) * force
            gain = np.nan_to_num(found - 0.5 * np.sum(kick**2, axis=1) - energy, nan=-np.inf)
        taken = np.log(rng.random(z.shape[0])) < gain
        z, slope = np.where(taken[:, None], moved, z), np.where(taken[:, None], force, slope)
        log_density = np.where(taken, found, log_density)
        accepted += float(np.mean(taken)) / transitions
    return z, accepted
