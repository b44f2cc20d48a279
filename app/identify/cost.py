"""What an identification would cost, before it is run."""

from __future__ import annotations

from collections.abc import Sequence

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


def parameter_count(model: SoughtModel, links: int, training: Sequence[InlineSample]) -> int:
    """Unknowns: per joint three stiffnesses and three dampings, link shares, aerodynamic corrections."""
    if model.aero_coefficients is None:
        corrections = CORRECTIONS - (not any(_asymmetric(sample) for sample in training))
    else:
        corrections = len(model.aero_coefficients)
    joints = links - 1
    per_wing = 7 * joints
    return per_wing * (2 if model.separate_wings else 1) + corrections


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
    parameters = parameter_count(request.model, links, training)
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
