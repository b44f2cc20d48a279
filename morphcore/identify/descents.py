"""How an identification descends: toward a prior whose weight the flights choose, and from where."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from morphcore.identify.evidence import ChosenPrior
from morphcore.identify.measurement import angle_noise
from morphcore.identify.settings import SearchSettings
from morphcore.search.hybrid import Hybrid
from morphcore.search.least_squares import LeastSquares
from morphcore.search.methods import Factory

if TYPE_CHECKING:
    from morphcore.identify.identification import Identification

CANDIDATE_SPREAD = (
    0.5  # standard deviation of the candidates around the physical guess, in search coordinates
)
# A weak prior, until the flights have chosen its weight: being off the physical guess by one unit costs as
# much as one error of this size. It settles the directions that the samples do not determine.
PRIOR_RAD = 3e-5
# "hybrid" looks elsewhere where the descent from the physical guess leaves errors above 1 % of the motion
# (rms, so squared here): it may have ended in a wrong valley. Where it does not, a screening and three times
# the flights lowered J by five per cent at most (docs/performance_search.md).
GOOD_FIT = 1e-4
NOISE_MARGIN = 1.5  # by which a good fit may exceed the noise of the rows


def descent(run: Identification, settings: SearchSettings) -> LeastSquares:
    """A descent with the bounds and the prior that a run has by now."""
    first = np.full(run.space.dimension, run.prior_weight)
    return LeastSquares(
        run, settings.iterations, ChosenPrior(run.space.guess, first, run.shapes), run.space.limits
    )


def hybrid(run: Identification, settings: SearchSettings) -> Hybrid:
    """Descents, with a screening of candidates in between where the first one does not end well."""
    return Hybrid(
        descent(run, settings),
        candidates=settings.screen,
        starts=settings.starts,
        spread=CANDIDATE_SPREAD,
        good_cost=lambda: good_cost(run),  # later: it needs the time step, which a deadline may end
        seed=settings.seed,
    )


def good_cost(run: Identification) -> float:
    """J with which a descent has ended well, rad^2: a share of the motion, and the noise."""
    total = 0.0
    for case in run.training:
        setup = case.setup
        moved = setup.weight * (setup.values - setup.values[0])
        noise = np.array(list(angle_noise(case.sample).values()))
        total += GOOD_FIT * float(np.nansum(moved**2))
        total += NOISE_MARGIN * case.sample.time_s.size * float(np.sum((setup.weight[:3] * noise) ** 2))
    return total


METHODS: dict[str, Factory] = {"least_squares": descent, "hybrid": hybrid}
