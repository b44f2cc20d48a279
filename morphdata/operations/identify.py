"""The operation ``identify`` and its cost estimate."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from morphdata.aircraft import Aircraft, Surface
from morphdata.drive_keys import resolved
from morphdata.drives import SIDES, Hinge, drive_name, shown_drives
from morphdata.identifiable import corrections, on_request
from morphdata.identified import CostEstimate, IdentifyResult
from morphdata.identify import IdentifyRequest, SamplesRequest, Search
from morphdata.masses import reflected_masses
from morphdata.operations.descriptor import Operation, after_budget
from morphdata.samples import InlineSample
from morphdata.vehicle import paired_by_reflection

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


def _cost_of_links(request: SamplesRequest, links: int) -> CostEstimate:
    """Estimate flights and computing time of one identification with a number of links per wing."""
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
        core_s=flight_s / REAL_TIME_FACTOR * max(links / REFERENCE_LINKS, 1.0),
    )


def _parameter_count(request: SamplesRequest, links: int, training: Sequence[InlineSample]) -> int:
    """Count the unknowns: per joint three stiffnesses, three dampings and a share, and the corrections.

    Every flexible surface has its own, except that mirror images may share theirs; a pair always shares the
    profile drag and the coefficients of its sections.
    """
    model, surfaces = request.model, request.aircraft.surfaces
    groups = _mirror_groups(request.aircraft)
    if model.aero_coefficients is None:
        bounded = () if model.bounds is None else model.bounds.given()
        left_out = {name for name in on_request() if name not in bounded}
        if not any(_asymmetric(sample) for sample in training):
            left_out.add("profile_drag")
        searched = [name for name in corrections() if name not in left_out]
    else:
        searched = list(model.aero_coefficients)
    of_pairs = sum(name in ("profile_drag", *on_request()) for name in searched)
    sets = sum(surface.flexible for surface in surfaces) if model.separate_wings else groups
    return 7 * (links - 1) * sets + len(searched) + of_pairs * (groups - 1)


def _mirror_groups(aircraft: Aircraft) -> int:
    """Count the flexible surfaces, with mirror images and what they carry counted once."""
    flexible = [each for each in aircraft.surfaces if each.flexible]
    carried = [reflected_masses(aircraft.point_masses or [], each.name) for each in flexible]
    nameless = [(_plainly(each), own) for each, (own, _) in zip(flexible, carried, strict=True)]
    reflections = [
        (_reflection(each), images) for (each, _), (_, images) in zip(nameless, carried, strict=True)
    ]
    return len(paired_by_reflection(nameless, reflections))


def _reflection(surface: Surface) -> Surface:
    side = "left" if surface.side == "right" else "right"
    hinges = [_mirrored(hinge, surface.side, side) for hinge in surface.all_hinges]
    return surface.model_copy(
        update={"side": side, "position_m": _across(surface.position_m), "hinges": hinges}
    )


def _mirrored(hinge: Hinge, from_side: str, to_side: str) -> Hinge:
    """Return a hinge's mirror image: a rotation vector keeps its y and changes the other signs."""
    x, y, z = hinge.axis_B(from_side)
    name = drive_name(hinge, from_side).removesuffix(f"_{from_side}") + f"_{to_side}"
    update = {"name": name, "axis": [-x, y, -z], "position_m": _across(hinge.position_m)}
    return hinge.model_copy(update=update)


def _plainly(surface: Surface) -> Surface:
    """Return a surface without its name, with its hinges in normal form: a list, with names and vectors."""
    hinges = [
        hinge.model_copy(
            update={"name": drive_name(hinge, surface.side), "axis": list(hinge.axis_B(surface.side))}
        )
        for hinge in surface.all_hinges
    ]
    return surface.model_copy(update={"name": "", "hinge": None, "hinges": hinges})


def _across(position_m: list[float] | None) -> list[float] | None:
    return position_m and [position_m[0], -position_m[1], position_m[2]]


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
    return {**samples_summary(request), "links_per_wing": None if links == "auto" else links}


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
