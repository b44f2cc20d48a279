"""What is believed about the parameters beyond standard errors: their posterior, and profile likelihoods."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from morphcore.identify.coloured import MIN_FLIGHTS, ColouredNoise
from morphcore.identify.evidence import guess_spread, linear_model
from morphcore.identify.likelihood import Likelihood
from morphcore.identify.parameters import SearchSpace
from morphcore.identify.posterior import Posterior, posterior
from morphcore.identify.profile import Profile, profile, require_names
from morphcore.identify.sample_measurement import Nuisances, fit_records
from morphcore.search.solver import Batch
from morphcore.shown import Shown
from morphdata.measurement import ANGLES
from morphdata.renamed import under_both_spellings

if TYPE_CHECKING:
    from morphcore.identify.identification import Identification

Array = NDArray[np.float64]

COUNT = len(ANGLES)  # first channels of every record


@dataclass(frozen=True, repr=False)
class Belief(Shown):
    """What the samples say about the parameters, as far as it was requested.

    Attributes
    ----------
    space : SearchSpace or None
        None where nothing was searched, or nobody has looked at the errors.
    estimate : ndarray, shape (d,)
        The best search point.
    covariance : ndarray, shape (d, d)
        Of the search coordinates in a linear model, with the physical guess as a prior.
    noise_rad : ndarray, shape (3,)
        Standard deviation of what measured angles differ from the model by, weights undone.
    posterior : Posterior or None
    profiles : tuple of Profile
    """

    space: SearchSpace | None = field(default=None, repr=False)
    estimate: Array = field(default_factory=lambda: np.zeros(0))
    covariance: Array = field(default_factory=lambda: np.zeros((0, 0)))
    noise_rad: Array = field(default_factory=lambda: np.zeros(COUNT))
    posterior: Posterior | None = None
    profiles: tuple[Profile, ...] = ()

    def to_document(self) -> dict[str, Any]:
        """JSON form of what was requested, with the names that the API fixes."""
        found: dict[str, Any] = {}
        if self.posterior is not None:
            document = self.posterior.to_document()
            found["posterior"] = document | {"parameters": under_both_spellings(document["parameters"])}
        if self.profiles:
            found["profile"] = under_both_spellings({each.name: each.to_document() for each in self.profiles})
        return found


def fit_noise(
    run: Identification,
    estimate: Array,
    residual: Array,
    jacobian: Array,
    motions_rad: Sequence[float],
    nuisances: Sequence[Nuisances],
) -> ColouredNoise:
    """Compute the noise around a fit, with the prior that the fit was drawn to.

    Parameters
    ----------
    run : Identification
    estimate : ndarray, shape (d,)
        The best search point.
    residual, jacobian : ndarray, shape (m,) and (m, d)
        There.
    motions_rad : sequence of float
        What the model adds to a rigid one, rms, of each sample to fit.
    nuisances : sequence of Nuisances
        Of each sample to fit.
    """
    weight = run.prior_weight
    linear = linear_model(residual, jacobian, estimate - run.space.guess, weight, run.shapes())
    parts = fit_records(run, residual, jacobian, motions_rad, nuisances)
    return ColouredNoise(parts, weight, guess_spread(linear))


def belief_of(run: Identification, estimate: Array, jacobian: Array, noise: ColouredNoise) -> Belief:
    """Compute what an identification's request wants to know about its parameters.

    Parameters
    ----------
    run : Identification
    estimate : ndarray, shape (d,)
        The best search point.
    jacobian : ndarray, shape (m, d)
        Of the residuals there.
    noise : ColouredNoise
        Of the same residuals.
    """
    space, requested = run.space, run.uncertainty
    likelihood = Likelihood.of(noise, jacobian, space.guess, space.lower, space.upper)

    def errors(points: Array) -> Array:
        flown = run.evaluate(Batch(points, residuals=True), None).residuals
        assert flown is not None  # noqa: S101 - for the type checker: the batch asked for them
        return flown

    names = require_names(space, requested.profile)
    return Belief(
        space=space,
        estimate=estimate,
        covariance=likelihood.covariance,
        noise_rad=_noise(noise),
        posterior=None
        if requested.posterior is None
        else posterior(space, estimate, likelihood, errors, requested.posterior),
        profiles=tuple(
            profile(space, name, estimate, likelihood, errors, requested.profile_points) for name in names
        ),
    )


def _noise(noise: ColouredNoise) -> Array:
    """(3,) rms of the residuals of the angles, with what chains miss where few flights show it, rad."""
    total, rows = np.zeros(COUNT), 0
    for record in noise.records:
        if record.residual.shape[1] < COUNT:
            continue
        hidden = record.discrepancy_rad[:COUNT] if len(noise.records) < MIN_FLIGHTS else np.zeros(COUNT)
        count = record.time_s.size
        total += np.sum(record.residual[:, :COUNT] ** 2, axis=0) + count * hidden**2
        rows += count
    return np.asarray(np.sqrt(total / max(rows, 1)))
