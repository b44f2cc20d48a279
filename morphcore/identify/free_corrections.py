"""Which aerodynamic corrections flights can tell: those that are searched if a request names none.

A search begins without the corrections that most aircraft do not need (zero-lift angle, moment coefficient).
When it has ended, the model is linearised with all of them free. Those are searched, too, whose marginal
likelihood is highest, if it is well above that of the model without them: it charges a model for each
parameter (`evidence`), so that one which only fits noise, or what no chain can fly, is not taken up.
"""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from morphcore.identify.cost import residuals
from morphcore.identify.evidence import linear_model, log_evidence
from morphcore.models.parameters import Parameter
from morphcore.search.least_squares import differences
from morphcore.simulate.trajectory import Trajectory
from morphdata.drives import SIDES

if TYPE_CHECKING:
    from morphcore.identify.identification import Identification
    from morphcore.identify.parameters import SearchSpace

Array = NDArray[np.float64]

# by which corrections have to raise the logarithm of the marginal likelihood: strong evidence (Kass & Raftery
# 1995). Where they are not needed it falls, by 1 to 5 on the example flights
WORTH_FREEING = 3.0

# 0.6 degrees: above what the noise of an attitude sensor makes of a symmetric flight, and far below what a
# flight shows that can tell a drag
ASYMMETRIC_RAD = 0.01


def asymmetric(sample: Trajectory) -> bool:
    """Whether drives of both sides differ, or the flight rolls or yaws, by more than ASYMMETRIC_RAD."""
    apart = max((_apart(sample.drives, name) for name in sample.drives), default=0.0)
    turned = np.ptp(np.unwrap(np.stack([sample.phi, sample.psi]), axis=1), axis=1).max()
    return bool(max(apart, turned) > ASYMMETRIC_RAD)


def _apart(drives: Mapping[str, Array], name: str) -> float:
    """Largest difference of a drive to that of the other side, rad; to rest where that is not moved."""
    for side, other in (SIDES, SIDES[::-1]):
        if name.endswith(f"_{side}"):
            rest = np.full_like(drives[name], drives[name][0])
            opposite = drives.get(f"{name.removesuffix(side)}{other}", rest)
            return float(np.abs(drives[name] - opposite).max())
    return 0.0  # a word moves both sides


def determined_corrections(
    parameters: Sequence[Parameter], training: Sequence[Trajectory], bounded: Container[str] = ()
) -> tuple[str, ...]:
    """The corrections among a model's parameters that the flights to fit can tell.

    Those that are searched on request are among them if the request gives their bounds.
    """
    uneven = any(asymmetric(sample) for sample in training)
    return tuple(
        each.name
        for each in parameters
        if each.correction
        and (uneven or not each.asymmetric)
        and (each.name in bounded or not each.on_request)
    )


def spare_corrections(
    parameters: Sequence[Parameter], training: Sequence[Trajectory], free: Container[str]
) -> tuple[str, ...]:
    """The corrections that the flights to fit might tell beside the ones that are searched."""
    possible = {each.name: each for each in parameters if each.correction and each.name not in free}
    uneven = any(asymmetric(sample) for sample in training)
    return tuple(name for name, each in possible.items() if uneven or not each.asymmetric)


def likelier_corrections(run: Identification, best: Array) -> tuple[str, ...]:
    """Names of the corrections, fixed so far, with which the flights to fit are much likelier; often none.

    Parameters
    ----------
    run : Identification
    best : ndarray, shape (d,)
        Search point at which a descent has ended.
    """
    spare = run.spare_corrections
    if not spare:
        return ()
    wide = run.space_with(spare)
    point = wide.encode(run.space.decode(best))
    error, jacobian = linearised(run, wide, point)
    fixed = {name: wide.coordinates_of(name) for name in spare}
    known = np.setdiff1d(np.arange(wide.dimension), np.concatenate(list(fixed.values())))
    models = {}
    for count in range(len(spare) + 1):
        for chosen in combinations(spare, count):
            at = np.sort(np.concatenate([known, *(fixed[name] for name in chosen)]))
            offset = point[at] - wide.guess[at]
            models[chosen] = linear_model(error, jacobian[:, at], offset, run.prior_weight, run.shapes())
    # the same rows for all: as many as the model with the most correlated residuals leaves
    rows = min(model.count for model in models.values())
    likelihood = {chosen: log_evidence(model, rows) for chosen, model in models.items()}
    likeliest = max(likelihood, key=lambda chosen: likelihood[chosen])
    return likeliest if likelihood[likeliest] > likelihood[()] + WORTH_FREEING else ()


def linearised(run: Identification, space: SearchSpace, point: Array) -> tuple[Array, Array]:
    """Residuals (m,) and their Jacobian (m, d) at a point (d,) of a search space."""

    def errors(points: Array) -> Array:
        return residuals(run.model, space.decode(points), run.training, run.settings.start)

    residual, jacobian = differences(point[None, :], space.upper, errors)
    return residual[0], jacobian[0]
