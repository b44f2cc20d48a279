"""The requirements on this reproduction next to the figures measured in this run, judged automatically."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from morphcore.paper.scenario import paper_flights
from morphcore.paper.stages import Results
from morphdata.lattice import CoreLaw

Document = dict[str, Any]

THEIR_CORE: CoreLaw = "smoothed"  # of the independent program, as far as its trim shows (DECISIONS 9)
MRAD = 1e3  # in a radian
PERCENT = 100.0  # in a share of one

# limits, in the units of the table
ELEMENTS_MRAD, STEP_MRAD = 1.0, 0.1
TIP_PERCENT, PITCH_RMS_MRAD, ANGLE_PERCENT = 5.0, 3.0, 5.0
HELD_OUT_RATIO = 5e-4
FLIGHT_PERCENT, BATCH_PERCENT = 0.5, 0.1
FLEXIBLE_FLIGHT_S = 20.0
BACKWARD_RAD_S = 1e-12  # round-off in the rate of a spline at rest
REDUCTION_PERCENT, SEARCH_S = 20.0, 60.0
FULL_RUN_S, QUICK_RUN_S = 3600.0, 300.0


@dataclass(frozen=True)
class Requirement:
    """One figure: its description, its limit and the measured value (None: not measured), in ``unit``.

    at_least : the limit is a minimum instead of a maximum.
    """

    what: str
    limit: float
    value: float | None
    unit: str = ""
    at_least: bool = False

    @property
    def met(self) -> bool | None:
        """Whether the limit is met; None if nothing was measured."""
        if self.value is None:
            return None
        return self.value >= self.limit if self.at_least else self.value <= self.limit

    def to_document(self) -> Document:
        """JSON form."""
        return {**vars(self), "met": self.met}


def judged_requirements(results: Results, *, total_s: float, quick: bool) -> list[Requirement]:
    """Every requirement whose stage is available, with its measured value.

    Parameters
    ----------
    total_s : wall time of all stages, s.
    """
    return [
        *_convergence(results.get("truth")),
        *_independent(results.get("independent")),
        *_held_out(results.get("identification")),
        *_computation(results.get("computation")),
        *_morph(results.get("morph")),
        Requirement("this run, all stages together", QUICK_RUN_S if quick else FULL_RUN_S, total_s, "s"),
    ]


def held_out_ratios(identification: Document) -> dict[str, float | None]:
    """J of the identified model over J of the rigid one for each held-out flight."""
    return {fit["sample"]: ratio(fit) for fit in identification["fit"] if fit["role"] == "held_out"}


def ratio(fit: Document) -> float | None:
    """J of the identified model over that of the rigid one; None if either diverged."""
    identified, rigid = fit["J_identified"], fit["J_rigid"]
    return None if identified is None or not rigid else float(identified / rigid)


def flight_share(row: Document, model: str, part: str = "fly_s") -> float:
    """Ratio of a model's time for a part of a flight to the flexible model's."""
    return float(row["models"][model][part] / row["models"]["flexible"][part])


def batch_share(computation: Document) -> float:
    """Time of one flight in a batch, with preparation, over that of the same flexible flight."""
    flexible = computation["flights"][0]["models"]["flexible"]
    return float(computation["batch"]["flight_s"] / flexible["total_s"])


def _convergence(truth: Document | None) -> Iterator[Requirement]:
    limits = {"elements doubled": ELEMENTS_MRAD, "step halved": STEP_MRAD}
    for row in [] if truth is None else truth["convergence"]["rows"]:
        if row["what"] in limits:
            moved = MRAD * max(row["max_abs_rad"].values())
            yield Requirement(
                f"flexible model, {row['what']}: attitude moves by", limits[row["what"]], moved, "mrad"
            )


def _independent(found: Document | None) -> Iterator[Requirement]:
    if found is None or not found["available"]:
        return
    law = next(law for law in found["laws"] if law["core"] == THEIR_CORE)
    theirs = found["theirs"]["tip_z_m"]
    if theirs:
        off = PERCENT * abs(law["trim"]["tip_z_m"] / theirs - 1.0)
        yield Requirement(
            "another program's trim, nothing fitted: tip deflection off by", TIP_PERCENT, off, "%"
        )
    for flown in law["flights"]:
        shares = [share for share in flown["worst_share"].values() if share is not None]
        if len(shares) > 1:
            worst = PERCENT * max(shares)
            yield Requirement(
                f"its flight {flown['sample']}: worst angle off by, of its range", ANGLE_PERCENT, worst, "%"
            )
        else:
            rms = MRAD * flown["rms_rad"]["theta"]
            yield Requirement(f"its flight {flown['sample']}: RMS of pitch", PITCH_RMS_MRAD, rms, "mrad")


def _held_out(identification: Document | None) -> Iterator[Requirement]:
    ratios: Mapping[str, float | None] = {} if identification is None else held_out_ratios(identification)
    labels = {each.name: each.label for each in paper_flights()}
    for name, value in ratios.items():
        what = f"{labels.get(name, name)}, held out: J of the equivalent over J of the rigid model"
        yield Requirement(what, HELD_OUT_RATIO, value)


def _computation(found: Document | None) -> Iterator[Requirement]:
    if found is None:
        return
    row = found["flights"][0]
    shares = {part: PERCENT * flight_share(row, "equivalent", part) for part in ("fly_s", "total_s")}
    one = "computation of one equivalent flight of 2 s, of the flexible one's"
    yield Requirement(f"{one}: the flight alone", FLIGHT_PERCENT, shares["fly_s"], "%")
    yield Requirement(f"{one}: with lattice and trim", FLIGHT_PERCENT, shares["total_s"], "%")
    batch = PERCENT * batch_share(found)
    yield Requirement("the same in a batch, with lattice and trim", BATCH_PERCENT, batch, "%")
    flexible = row["models"]["flexible"]["wall_s"]
    yield Requirement("flexible flight of 2 s on one core", FLEXIBLE_FLIGHT_S, flexible, "s")


def _morph(found: Document | None) -> Iterator[Requirement]:
    if found is None:
        return
    yield Requirement(
        "optimised morph: attitude variation below constant rate by, flown in the flexible model",
        REDUCTION_PERCENT,
        found["reduction_percent"],
        "%",
        at_least=True,
    )
    checked = found["checked"]
    limit = found["limits"]["max_rate_rad_s"]
    yield Requirement("its largest rate", limit, checked["max_rate_rad_s"], "rad/s")
    yield Requirement(
        "its fastest backward turn", BACKWARD_RAD_S, max(0.0, -checked["min_rate_rad_s"]), "rad/s"
    )
    yield Requirement("found in", SEARCH_S, checked["found_s"], "s")
