"""Checks across fields of a request with samples; each fault names the field and the way out."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence

from morphdata.faults import Fault
from morphdata.identify import Bounds, SamplesRequest
from morphdata.samples import InlineSample
from morphdata.vehicle import HingeRange, flexible_wing_faults, hinge_ranges, start_faults

MAX_TOTAL_ROWS = 200_000
MAX_DECADES = 12.0  # of a stiffness range: more is no knowledge at all, and spoils a logarithmic search
POSITIVE_BOUNDS = ("stiffness_nm_rad", "damping_nms_rad", "lift_factor")  # searched on a logarithmic scale
BOUND_LIMITS = {
    "stiffness_nm_rad": (0.0, 1e12),
    "damping_nms_rad": (0.0, 1e10),
    "division": (0.0, 1.0),
    "lift_factor": (0.0, 10.0),
    "centre_shift_m": (-50.0, 50.0),
    "profile_drag": (0.0, 2.0),
    "lag_s": (0.0, 10.0),
}


def samples_request_faults(request: SamplesRequest, samples: Sequence[InlineSample]) -> list[Fault]:
    """Everything that the schema alone cannot see.

    Parameters
    ----------
    samples
        The samples with their rows, those uploaded earlier resolved, in the order of the request.
    """
    model = request.model
    faults = [
        *start_faults(request.flight, model.start),
        *flexible_wing_faults(request.aircraft, "nothing_to_identify"),
        *_bounds_faults(model.bounds),
        *_together_faults(samples),
        *repeated_faults(
            model.aero_coefficients or [], "/model/aero_coefficients", "Name each correction once."
        ),
    ]
    hinges = hinge_ranges(request.aircraft)
    for number, sample in enumerate(samples):
        faults += _sweep_faults(sample, f"/samples/{number}", hinges)
    return faults


def repeated_faults(items: Sequence[object], pointer: str, hint: str) -> Iterator[Fault]:
    """Check that no item of a list comes twice."""
    for number, item in enumerate(items):
        if item in items[:number]:
            yield Fault("name_not_unique", f"{item} appears twice.", f"{pointer}/{number}", hint)


def _together_faults(samples: Sequence[InlineSample]) -> Iterator[Fault]:
    names: dict[str, int] = {}
    for number, sample in enumerate(samples):
        if sample.name in names:
            yield Fault(
                "name_not_unique",
                f"Samples {names[sample.name]} and {number} are both called {sample.name!r}.",
                f"/samples/{number}/name",
                "Give every sample a name of its own: plots are named after it.",
            )
        names.setdefault(sample.name, number)
    if all(sample.role != "train" for sample in samples):
        yield Fault(
            "no_training_sample",
            "Every sample is held out.",
            "/samples/0/role",
            'Give at least one sample the role "train".',
        )


def total_rows_faults(rows: Iterable[int]) -> list[Fault]:
    """Check the rows of all samples together."""
    total = sum(rows)
    if total <= MAX_TOTAL_ROWS:
        return []
    return [
        Fault(
            "too_many_rows",
            f"The samples have {total} rows together.",
            "/samples",
            f"At most {MAX_TOTAL_ROWS}: 10 ms between rows are enough.",
        )
    ]


def _sweep_faults(sample: InlineSample, pointer: str, hinges: Mapping[str, HingeRange]) -> Iterator[Fault]:
    for side, hinge in hinges.items():
        column = sample.sweep_left_rad if side == "left" else sample.sweep_right_rad
        for row, angle in enumerate(column):
            fault = hinge.fault(side, angle, f"{pointer}/sweep_{side}_rad/{row}")
            if fault is not None:
                yield fault
                break


def _bounds_faults(bounds: Bounds | None) -> Iterator[Fault]:
    for name, (least, most) in BOUND_LIMITS.items():
        bound = None if bounds is None else getattr(bounds, name)
        if bound is None:
            continue
        low, high = bound
        at = f"/model/bounds/{name}"
        if low >= high:
            yield Fault(
                "range_upside_down",
                f"The lower bound {low:g} is not below the upper bound {high:g}.",
                f"{at}/0",
                "Give [low, high] with low < high.",
            )
        elif name in POSITIVE_BOUNDS and low <= 0.0:
            yield Fault(
                "bound_not_positive",
                f"{name} is searched on a logarithmic scale; {low:g} has no logarithm.",
                f"{at}/0",
                "Give a small positive lower bound, or leave the bounds out: beam theory gives them.",
            )
        elif low < least or high > most:
            yield Fault(
                "bound_out_of_range",
                f"[{low:g}, {high:g}] leaves what is physical, [{least:g}, {most:g}].",
                f"{at}/{0 if low < least else 1}",
                "Narrow the bounds, or leave them out: they follow from beam theory.",
            )
        elif name in POSITIVE_BOUNDS and math.log10(high / low) > MAX_DECADES:
            yield Fault(
                "bound_too_wide",
                f"[{low:g}, {high:g}] spans {math.log10(high / low):.0f} decades.",
                f"{at}/1",
                f"Narrow it to {MAX_DECADES:g} decades, or leave the bounds out: beam theory gives them.",
            )
