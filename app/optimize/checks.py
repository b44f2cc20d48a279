"""Checks across fields of an optimisation; each fault names the field and the way out."""

from __future__ import annotations

import math
from collections.abc import Iterator

from morphdata.faults import Fault
from morphdata.optimize import Limits, OptimizeRequest
from morphdata.vehicle import hinge_ranges

MOST_FLIGHTS = 2_000_000


def morph_faults(request: OptimizeRequest) -> Iterator[Fault]:
    """Check that the morph is one, lies within the hinges' range and has its time."""
    morph = request.morph
    if morph.final_rad == morph.initial_rad:
        yield Fault(
            "nothing_to_morph",
            f"The morph begins and ends at {morph.final_rad:g} rad.",
            "/morph/final_rad",
            "Give another final_rad.",
        )
    hinges = hinge_ranges(request.aircraft)
    if not hinges:
        yield Fault(
            "nothing_to_morph", "No surface has a hinge.", "/aircraft/surfaces", "Give the wings hinges."
        )
    for name in ("initial_rad", "final_rad"):
        for side, hinge in hinges.items():
            fault = hinge.fault(side, getattr(morph, name), f"/morph/{name}")
            if fault is not None:
                yield fault
                break
    least_s = shortest_morph_s(abs(morph.final_rad - morph.initial_rad), request.limits)
    if 0.0 < morph.duration_s <= least_s:
        yield Fault(
            "morph_too_short",
            f"No motion within the limits takes {morph.duration_s:g} s or less.",
            "/morph/duration_s",
            f"Give more than {least_s:.4g} s, or raise max_rate_rad_s or max_accel_rad_s2 in limits.",
        )
    if morph.goal == "minimum_time" and morph.max_variation_rad2 is None:
        yield Fault(
            "missing",
            "The least time is sought under a limit of the variation.",
            "/morph/max_variation_rad2",
            "Add it; the variation of a result at constant rate tells its order of magnitude.",
        )
    elif morph.goal != "minimum_time" and morph.max_variation_rad2 is not None:
        yield Fault(
            "not_used",
            f"The goal {morph.goal!r} has no limit of the variation.",
            "/morph/max_variation_rad2",
            'Leave it out, or use the goal "minimum_time".',
        )
    limits = request.limits
    if morph.goal != "variation" and limits.max_rate_rad_s is None and limits.max_accel_rad_s2 is None:
        yield Fault(
            "missing",
            f"Without a limit the goal {morph.goal!r} has no shortest duration.",
            "/limits",
            "Give max_rate_rad_s or max_accel_rad_s2.",
        )
    weights = request.weights
    if weights.phi == weights.theta == weights.psi == 0.0:
        yield Fault("weights_all_zero", "No angle counts.", "/weights", "Give one of them a weight.")


def shortest_morph_s(change_rad: float, limits: Limits) -> float:
    """Least time from rest to rest over an angle: full acceleration, full rate, full braking.

    Parameters
    ----------
    change_rad
        How far, rad, without its sign.
    """
    rate = math.inf if limits.max_rate_rad_s is None else limits.max_rate_rad_s
    accel = math.inf if limits.max_accel_rad_s2 is None else limits.max_accel_rad_s2
    if rate * rate / accel < change_rad:
        return change_rad / rate + rate / accel
    return 2.0 * math.sqrt(change_rad / accel)


def work_faults(flights: int) -> Iterator[Fault]:
    """Check the size of the search."""
    if flights > MOST_FLIGHTS:
        yield Fault(
            "too_much_work",
            f"The search would fly {flights} flights.",
            "/search/generations",
            f"At most {MOST_FLIGHTS}: choose fewer particles, generations, knots or front_points.",
        )
