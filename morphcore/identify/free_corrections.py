"""Which aerodynamic corrections flights can tell: those that are searched if a request names none.

A search begins without the corrections that most aircraft do not need (zero-lift angle, moment coefficient),
and with one lift factor for all surfaces. When it has ended, the model is linearised with all of them free.
Those are searched, too, whose marginal likelihood is highest, if it is well above that of the model without
them: it charges a model for each parameter (`evidence`). Of three flights or more, each must also be met
better by what the others say: likelihood alone also takes what fits one flight at the expense of the next.
"""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from morphcore.identify.cost import residuals
from morphcore.identify.evidence import left_out, linear_model, log_evidence
from morphcore.models.parameters import Parameter
from morphcore.search.least_squares import differences
from morphcore.simulate.trajectory import Trajectory
from morphdata.drives import SIDES

if TYPE_CHECKING:
    from morphcore.identify.identification import Identification
    from morphcore.identify.parameters import SearchSpace

Array = NDArray[np.float64]

OWN_LIFT = "own_lift"  # lift factors of unlike surfaces apart, of mirror images together
# by which freedoms have to raise the logarithm of the marginal likelihood: strong evidence (Kass & Raftery
# 1995). Where they are not needed it falls, by 1 to 5 on the example flights
WORTH_FREEING = 3.0
MIN_FLIGHTS = 3  # of which each can be predicted from others that differ

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


def spare_freedoms(run: Identification, training: Sequence[Trajectory]) -> tuple[str, ...]:
    """What a search begins without, and the flights to fit might call for: corrections, and `OWN_LIFT`."""
    if run.model.links_per_wing == 1:
        return ()  # a rigid wing misses so much that anything would explain it
    found: list[str] = []
    if run.settings.aero_coefficients is None:
        uneven = any(asymmetric(sample) for sample in training)
        found += [
            each.name
            for each in run.model.parameters
            if each.correction and each.name not in run.first_corrections and (uneven or not each.asymmetric)
        ]
    unlike = "lift_factor" in run.first_corrections and len(run.model.unlike) > 1
    if run.settings.own_lift is None and unlike and len(training) >= MIN_FLIGHTS:
        found.append(OWN_LIFT)
    return tuple(found)


def called_for(run: Identification, best: Array) -> tuple[str, ...]:
    """The spare freedoms with which the flights to fit are much likelier; often none.

    Parameters
    ----------
    run : Identification
    best : ndarray, shape (d,)
        Search point at which a descent has ended.
    """
    spare, shapes = run.spare, run.shapes()
    if not spare:
        return ()
    wide = run.space_with(spare)
    error, jacobian = linearised(run, wide, moved(run.space, wide, best))
    ends = np.cumsum([rows * channels for rows, channels in shapes])
    models, left = {}, {}
    for count in range(len(spare) + 1):
        for chosen in combinations(spare, count):
            space = run.space_with(chosen)
            own = jacobian @ (sources(space, wide)[:, None] == np.arange(space.dimension))
            offset = moved(run.space, space, best) - space.guess
            models[chosen] = linear_model(error, own, offset, run.prior_weight, shapes)
            left[chosen] = left_out(error, own, offset, run.prior_weight, ends)
    # the same rows for all: as many as the model with the most correlated residuals leaves
    rows = min(model.count for model in models.values())
    likelihood = {chosen: log_evidence(model, rows) for chosen, model in models.items()}
    if len(ends) >= MIN_FLIGHTS:
        likelihood = {chosen: value for chosen, value in likelihood.items() if left[chosen] <= left[()]}
    likeliest = max(likelihood, key=lambda chosen: likelihood[chosen])
    return likeliest if likelihood[likeliest] > likelihood[()] + WORTH_FREEING else ()


def sources(space: SearchSpace, other: SearchSpace) -> NDArray[np.int64]:
    """Which coordinate of a search space stands for each one of another (d,); -1: none.

    A factor that is shared stands for those of all surfaces.
    """
    places = {name: k for k, name in enumerate(space.names)}
    return np.array([places.get(name, places.get(name.rpartition(".")[2], -1)) for name in other.names])


def moved(space: SearchSpace, other: SearchSpace, point: Array) -> Array:
    """A point of one search space in another, where what the first keeps fixed is at the guess."""
    at = sources(space, other)
    return np.where(at < 0, other.guess, point[at])


def linearised(run: Identification, space: SearchSpace, point: Array) -> tuple[Array, Array]:
    """Residuals (m,) and their Jacobian (m, d) at a point (d,) of a search space."""

    def errors(points: Array) -> Array:
        return residuals(run.model, space.decode(points), run.training, run.settings.start)

    residual, jacobian = differences(point[None, :], space.upper, errors)
    return residual[0], jacobian[0]
