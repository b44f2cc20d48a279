"""What an identification would cost, before it is run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from morphdata.aircraft import Aircraft, Surface
from morphdata.identify import CostEstimate, SamplesRequest, Search, SoughtModel
from morphdata.samples import InlineSample

# nominal figures, to an order of magnitude: what a request does not say is the solver's choice
SWARM_PARTICLES = {"pso": 200, "cma": 32}
PAPER_PARTICLES = 2500
SWARM_GENERATIONS = {"pso": 100, "cma": 200}
DESCENT_ITERATIONS = 20
DESCENT_TRIALS = (
    24  # trial steps of an iteration; its Jacobian flies a parameter set a parameter and one more
)
REAL_TIME_FACTOR = 1000.0  # flights of three-link wings on one core; measured by `morphid bench`
REFERENCE_LINKS = 3
CORRECTIONS = 4  # that may be sought; of symmetric samples all but the profile drag
ASYMMETRIC_RAD = 0.01  # a sample is asymmetric whose sweeps differ, or that rolls or yaws, by more


def _asymmetric(sample: InlineSample) -> bool:
    apart = max(abs(a - b) for a, b in zip(sample.sweep_left_rad, sample.sweep_right_rad, strict=True))
    turned = max(max(angle) - min(angle) for angle in (sample.phi_rad, sample.psi_rad))
    return max(apart, turned) > ASYMMETRIC_RAD


def _mirror_groups(surfaces: Sequence[Surface]) -> int:
    """Count the flexible surfaces, mirror images once: a pair has equal values, mirrored."""
    waiting: list[Surface] = []
    groups = 0
    for surface in (each for each in surfaces if each.flexible):
        side: Literal["right", "left"] = "left" if surface.side == "right" else "right"
        hinge = surface.hinge
        changes = {
            "side": side,
            "position_m": _across(surface.position_m),
            "hinge": hinge and hinge.model_copy(update={"position_m": _across(hinge.position_m)}),
        }
        image = next(
            (w for w in waiting if w == surface.model_copy(update={**changes, "name": w.name})), None
        )
        if image is None:
            groups += 1
            waiting.append(surface)
        else:
            waiting.remove(image)
    return groups


def _across(position_m: list[float] | None) -> list[float] | None:
    return position_m and [position_m[0], -position_m[1], position_m[2]]


def parameter_count(
    aircraft: Aircraft, model: SoughtModel, links: int, training: Sequence[InlineSample]
) -> int:
    """Unknowns: per joint three stiffnesses and three dampings, link shares, aerodynamic corrections.

    Every flexible surface has its own but for mirror images; those of a pair always share the profile drag.
    """
    groups = _mirror_groups(aircraft.surfaces)
    if model.aero_coefficients is None:
        drag = any(_asymmetric(sample) for sample in training)
        corrections = CORRECTIONS - 1 + drag
    else:
        drag = "profile_drag" in model.aero_coefficients
        corrections = len(model.aero_coefficients)
    sets = sum(surface.flexible for surface in aircraft.surfaces) if model.separate_wings else groups
    return 7 * (links - 1) * sets + corrections + drag * (groups - 1)


def _parameter_sets(search: Search, parameters: int) -> int:
    """Count the parameter sets that a search flies through every training sample."""
    if search.method not in SWARM_PARTICLES and search.preset != "paper":
        return DESCENT_ITERATIONS * (parameters + 1 + DESCENT_TRIALS)
    method = "pso" if search.preset == "paper" else search.method
    particles = search.particles or (PAPER_PARTICLES if search.preset == "paper" else SWARM_PARTICLES[method])
    return particles * (search.generations or SWARM_GENERATIONS[method])


def estimate(request: SamplesRequest, links: int, samples: Sequence[InlineSample]) -> CostEstimate:
    """Estimate flights and computing time of one identification.

    Parameters
    ----------
    links
        Links per wing.
    samples
        The samples with their rows.
    """
    training = [sample for sample in samples if sample.role == "train"]
    parameters = parameter_count(request.aircraft, request.model, links, training)
    sets = _parameter_sets(request.search, parameters)
    flight_s = sets * sum(sample.time_s[-1] - sample.time_s[0] for sample in training)
    return CostEstimate(
        samples=len(samples),
        rows=sum(len(sample.time_s) for sample in samples),
        parameters=parameters,
        flights=sets * len(training),
        flight_s=flight_s,
        core_s=flight_s / REAL_TIME_FACTOR * max(links / REFERENCE_LINKS, 1.0),
    )
