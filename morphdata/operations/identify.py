"""The operation ``identify`` and its cost estimate."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from morphdata.drive_keys import resolved
from morphdata.drives import SIDES, shown_drives
from morphdata.identifiable import corrections, on_request
from morphdata.identified import CostEstimate, IdentifyResult
from morphdata.identify import IdentifyRequest, SamplesRequest, Search
from morphdata.links import LinksPerWing, mean_links, to_choose
from morphdata.operations.descriptor import Operation, after_budget
from morphdata.pairs import joints_of_sets, mirror_pairs, own_lift_count
from morphdata.samples import InlineSample

# nominal figures, to an order of magnitude, for settings that a request leaves to the solver
SWARM_PARTICLES = {"pso": 200, "cma": 32}
PAPER_PARTICLES = 2500
SWARM_GENERATIONS = {"pso": 100, "cma": 200}
DESCENT_ITERATIONS = 20
# trial steps of an iteration; its Jacobian flies a parameter set a parameter and one more
DESCENT_TRIALS = 24
REAL_TIME_FACTOR = 1000.0  # flights of three-link wings on one core; measured by `morphid bench`
REFERENCE_LINKS = 3
ASYMMETRIC_RAD = 0.01  # rad; a sample is asymmetric if its sweeps differ, or it rolls or yaws, by more
REPORT_TIME_S = 120.0  # uncertainty, plots, writing


def cost(request: SamplesRequest) -> CostEstimate:
    """Estimate flights and computing time for all numbers of links per wing that are searched.

    Parameters
    ----------
    request : SamplesRequest
        With the rows of its samples.
    """
    parts = [_cost_of_links(request, links) for links in request.model.numbers_of_links()]
    return CostEstimate(
        samples=parts[0].samples,
        rows=parts[0].rows,
        parameters=max(part.parameters for part in parts),
        flights=sum(part.flights for part in parts),
        flight_s=sum(part.flight_s for part in parts),
        core_s=sum(part.core_s for part in parts),
    )


def _cost_of_links(request: SamplesRequest, links: LinksPerWing) -> CostEstimate:
    """Estimate flights and computing time of one identification with so many links per wing."""
    samples = list(request.inline_samples().values())
    training = [sample for sample in samples if sample.role == "train"]
    parameters = _parameter_count(request, links, training)
    sets = _parameter_sets(request.search, parameters)
    flight_s = sets * sum(sample.time_s[-1] - sample.time_s[0] for sample in training)
    return CostEstimate(
        samples=len(samples),
        rows=sum(len(sample.time_s) for sample in samples),
        parameters=parameters,
        flights=sets * len(training),
        flight_s=flight_s,
        core_s=flight_s / REAL_TIME_FACTOR * max(mean_links(links) / REFERENCE_LINKS, 1.0),
    )


def _parameter_count(request: SamplesRequest, links: LinksPerWing, training: Sequence[InlineSample]) -> int:
    """Count the unknowns: per joint three stiffnesses, three dampings and a share, and the corrections.

    Every flexible surface has its own, except that mirror images may share theirs; a pair always shares the
    profile drag and the coefficients of its sections. Lift factors of their own are of rigid surfaces too.
    """
    model, surfaces, pairs = request.model, request.aircraft.surfaces, mirror_pairs(request.aircraft)
    groups = sum(surfaces[pair[0]].flexible for pair in pairs)
    if model.aero_coefficients is None:
        bounded = () if model.bounds is None else model.bounds.given()
        left_out = {name for name in on_request() if name not in bounded}
        if not any(_asymmetric(sample) for sample in training):
            left_out.add("profile_drag")
        searched = [name for name in corrections() if name not in left_out]
    else:
        searched = list(model.aero_coefficients)
    of_pairs = sum(name in ("profile_drag", *on_request()) for name in searched)
    apart = own_lift_count(request.aircraft, model.own_lift or ())
    joints = joints_of_sets(request.aircraft, links, separate_wings=model.separate_wings)
    aero = len(searched) + of_pairs * (groups - 1) + apart * ("lift_factor" in searched)
    return 7 * joints + aero


def _asymmetric(sample: InlineSample) -> bool:
    drives = sample.drives
    apart = max((_apart(drives, key) for key in drives), default=0.0)
    turned = max(max(angle) - min(angle) for angle in (sample.phi_rad, sample.psi_rad))
    return max(apart, turned) > ASYMMETRIC_RAD


def _apart(drives: Mapping[str, Sequence[float]], key: str) -> float:
    """Largest difference between a drive and that of the other side (or rest, if there is none), rad."""
    for side, other in (SIDES, SIDES[::-1]):
        if key.endswith(f"_{side}"):
            angles = drives[key]
            opposite = drives.get(f"{key.removesuffix(side)}{other}", [angles[0]] * len(angles))
            return max(abs(a - b) for a, b in zip(angles, opposite, strict=True))
    return 0.0  # a word moves both sides together


def _parameter_sets(search: Search, parameters: int) -> int:
    """Count the parameter sets that a search flies through every training sample."""
    if search.method not in SWARM_PARTICLES and search.preset != "paper":
        return DESCENT_ITERATIONS * (parameters + 1 + DESCENT_TRIALS)
    method = "pso" if search.preset == "paper" else search.method
    particles = search.particles or (PAPER_PARTICLES if search.preset == "paper" else SWARM_PARTICLES[method])
    return particles * (search.generations or SWARM_GENERATIONS[method])


def samples_summary(request: SamplesRequest) -> dict[str, Any]:
    """Return the summary of a request with samples for lists."""
    drives = request.aircraft.drives
    measured = (resolved(sample.drives, drives)[0] for sample in request.inline_samples().values())
    return {
        "aircraft": request.aircraft.name,
        "method": request.search.method,
        "drives": shown_drives(name for moved in measured for name in moved),
        "samples": [
            {"name": sample.name, "role": sample.role, "rows": len(sample.time_s)}
            for sample in request.inline_samples().values()
        ],
    }


def _summary(request: IdentifyRequest) -> dict[str, Any]:
    links = request.model.links_per_wing
    return {**samples_summary(request), "links_per_wing": None if to_choose(links) else links}


IDENTIFY = Operation(
    name="identify",
    subject="From sample flights to an equivalent model.",
    help="Finds the equivalent model (rigid links, springs and dampers) that repeats the attitude of sample "
    "flights.",
    noun="an identification",
    title="Identify an equivalent model from sample flights",
    description="The samples with the role `train` are fitted; those with the role `held_out` are flown and "
    "reported only.",
    request=IdentifyRequest,
    result=IdentifyResult,
    cost_model=CostEstimate,
    cost=cost,
    summary=_summary,
    begin="worker.operations.identification:begin",
    files=(
        "result.json",
        "convergence.*",
        "attitude_*",
        "residuals_*",
        "autocorrelation_*",
        "intervals.*",
        "curves_*.csv",
        "posterior.npz",
    ),
    deadline_s=after_budget(REPORT_TIME_S),
    model_in=lambda result: result,
)
