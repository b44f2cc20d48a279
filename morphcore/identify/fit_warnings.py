"""What is said about an identified model: that it does not fly, or what its method does not answer for."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from morphcore.errors import NotFlyable
from morphcore.geometry.aircraft import Aircraft
from morphcore.geometry.obstacle import obstacle
from morphcore.identify.cost import shared_trims, trimmed_flight
from morphcore.identify.diagnoses import WRONG_DATA
from morphcore.identify.parameters import SearchSpace
from morphcore.identify.sample_fit import SampleFit
from morphcore.models.equivalent import ChainModel, ParameterBatch
from morphcore.models.kinematics import tip_bending
from morphcore.simulate.chain_motion import chain_motion
from morphcore.simulate.hinge_schedules import followed_flight, hinge_schedules
from morphcore.validity import (
    AirMotion,
    ResultWarning,
    air_warnings,
    bending_warnings,
    deflection_warnings,
    error_warning,
    light_wing_warnings,
    overlap_warnings,
    steep_warning,
    wake_warnings,
)

if TYPE_CHECKING:
    from morphcore.identify.identification import Identification
    from morphdata.identify import EquivalentModel

Motions = list[tuple[str, str, AirMotion]]  # name, pointer and motion of each flight
SHOWN_NAMES = 4  # of parameters in a sentence
COMPARED = {"rigid": "the rigid model", "initial": "the first guess from beam theory"}


def not_flyable(
    model: ChainModel,
    lost: Sequence[SampleFit],
    settings: EquivalentModel,
    diagnosed: Sequence[ResultWarning] = (),
) -> NotFlyable:
    """The error of a search whose best model does not fly what it was fitted to, with what may be why."""
    found = obstacle(model.aircraft, model.flight)
    cause = next((warning for warning in diagnosed if warning.code in WRONG_DATA), None)
    if cause is not None:
        pointer, hint = cause.pointer, f"{cause.message}: {cause.hint}"
    elif found is not None:
        pointer, hint = found.pointer, found.hint
    elif all(fit.ending("rigid") for fit in lost):
        pointer = "/aircraft"
        hint = (
            "the rigid aircraft cannot fly them either: check masses, positions and hinges of the "
            "aircraft, and the flight condition"
        )
    elif settings.bounds is not None and settings.bounds.given():
        pointer, hint = "/model/bounds", "the rigid aircraft flies them: widen the bounds of the search"
    else:
        pointer = "/search"
        hint = (
            "the rigid aircraft flies them: check stiffness and damping of the wings' material, or search "
            "longer, with more particles or fewer links"
        )
    flights = ", ".join(f"{fit.case.sample.name} ({fit.ending('identified')})" for fit in lost)
    return NotFlyable(f"no model was found that flies the samples: {flights}", pointer=pointer, hint=hint)


def fit_warnings(
    run: Identification,
    best: ParameterBatch,
    fits: Sequence[SampleFit],
    at_bound: Mapping[str, str],
    undetermined: Collection[str],
    diagnosed: Sequence[ResultWarning] = (),
) -> tuple[ResultWarning, ...]:
    """Warnings of the best model (one parameter set) of an identification.

    at_bound : parameters that ended at a bound, and which. undetermined : those that the samples do not see.
    diagnosed : what is wrong with the samples.
    """
    aircraft = run.model.aircraft
    found: list[ResultWarning] = []
    lost = [fit for fit in fits if fit.case.sample.role == "train" and fit.ending("identified")]
    if lost:
        error = not_flyable(run.model, lost, run.settings, diagnosed)
        found.append(ResultWarning(error.code, error.message, error.hint, error.pointer))
    found += diagnosed
    found += _of_samples(fits, explained=any(warning.code in WRONG_DATA for warning in diagnosed))
    found += _of_bounds(run.space, at_bound, undetermined)
    found += air_warnings(run.model.flight, _motions(run, best, fits))
    found += _of_bending(run, best, fits)
    found += _of_wakes(run, best, fits)
    found += light_wing_warnings(aircraft, run.model.flight)
    angles = np.concatenate([_angles(fit, aircraft) for fit in fits])
    found += overlap_warnings(aircraft, angles)
    found += deflection_warnings(aircraft, angles)
    return tuple(found)


def _of_samples(fits: Sequence[SampleFit], *, explained: bool) -> Iterable[ResultWarning]:
    """What each flight shows; a large error is not reported where a diagnosis explains it."""
    for number, fit in enumerate(fits):
        sample = fit.case.sample
        name, pointer = f"sample {sample.name!r}", f"/samples/{number}"
        yield from steep_warning(name, pointer, sample.theta)
        if sample.role != "train" and fit.ending("identified"):
            yield ResultWarning(
                "diverged",
                f"the model does not fly {name}, which was held out: the flight {fit.ending('identified')}",
                "the model is good for flights like those it was fitted to: fit one like this too, or check "
                "its drives and conditions",
                pointer,
            )
        for model, title in COMPARED.items():
            if fit.ending(model):
                yield ResultWarning(
                    "diverged",
                    f"{title} does not fly {name}: the flight {fit.ending(model)}",
                    "there is nothing to compare the identified model with on this sample",
                    pointer,
                )
        if not explained:
            yield from error_warning(name, pointer, fit.errors("identified"), fit.case.motion)


def _of_bounds(
    space: SearchSpace, at_bound: Mapping[str, str], undetermined: Collection[str]
) -> Iterable[ResultWarning]:
    """One warning for each kind of parameter and end of its range.

    A parameter that the samples do not see may end anywhere: it is reported as undetermined, and no reason to
    doubt the fit.
    """
    kinds: dict[tuple[str, str], list[str]] = {}
    for name, end in at_bound.items():
        if name not in undetermined:
            kinds.setdefault((space.parameter(name).name, end), []).append(name)
    for (kind, end), names in kinds.items():
        shown = ", ".join(names[:SHOWN_NAMES])
        more = f" and {len(names) - SHOWN_NAMES} more" if len(names) > SHOWN_NAMES else ""
        hint = space.parameter(names[0]).at_bound.get(
            end, f"the best value may lie beyond: widen model.bounds.{kind}"
        )
        yield ResultWarning(
            "at_bound",
            f"{shown}{more} ended at the {end} bound of the search",
            hint,
            f"/model/bounds/{kind}",
        )


def _of_bending(run: Identification, best: ParameterBatch, fits: Sequence[SampleFit]) -> list[ResultWarning]:
    """Tips that the best model's trim displaces too far for its lattice, for the first such sample."""
    trims = shared_trims(run.model, best, [fit.case for fit in fits], run.settings.start)
    for number, (fit, (case, found)) in enumerate(zip(fits, trims, strict=True)):
        flown = case.plan.flown(run.model)
        bending = tip_bending(flown, best, found.q_joint, case.plan.shape)[found.converged]
        name, shape = f"the trim of sample {fit.case.sample.name!r}", flown.lattice.settings.shape
        if warnings := bending_warnings(flown.aircraft, bending, name, f"/samples/{number}", shape):
            return warnings
    return []


def _of_wakes(run: Identification, best: ParameterBatch, fits: Sequence[SampleFit]) -> list[ResultWarning]:
    """Surfaces in wakes of others, at the trim of the first such sample."""
    aircraft = run.model.aircraft
    trims = shared_trims(run.model, best, [fit.case for fit in fits], run.settings.start)
    for fit, (_, found) in zip(fits, trims, strict=True):
        angles, alpha = _angles(fit, aircraft)[0], float(found.alpha[0])
        warnings = wake_warnings(
            aircraft, angles, alpha, "/aircraft/surfaces", sideslip_rad=run.model.flight.sideslip_rad
        )
        if found.converged[0] and warnings:
            return warnings
    return []


def _angles(fit: SampleFit, aircraft: Aircraft) -> np.ndarray:
    """Angles (k, h + c) of all hinges, then of all controls, along a sample."""
    sample = fit.case.sample
    schedules = hinge_schedules(aircraft, followed_flight(aircraft, sample))
    angles = np.empty((sample.time_s.size, len(schedules)))
    for column, schedule in enumerate(schedules):
        angles[:, column] = schedule.motion(sample.time_s).angle
    return angles


def _motions(run: Identification, best: ParameterBatch, fits: Sequence[SampleFit]) -> Motions:
    """The best model's motion through the air along the samples that it is trimmed for."""
    motions: Motions = []
    trims = shared_trims(run.model, best, [fit.case for fit in fits], run.settings.start)
    for number, (fit, (case, found)) in enumerate(zip(fits, trims, strict=True)):
        if not found.converged[0]:
            continue
        flown, constants, state = trimmed_flight(run.model, best, case, found)
        motion = chain_motion(flown, case.plan, constants, state)
        motions.append((f"sample {fit.case.sample.name!r}", f"/samples/{number}", motion))
    return motions
