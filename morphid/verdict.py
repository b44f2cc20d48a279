"""Say in plain words whether the result of an identification may be believed, and what to do next."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from morphdata.renamed import current_names

Document = Mapping[str, Any]

ANGLES = ("phi", "theta", "psi")
GOOD_SHARE = 0.01  # of the motion, in a flight that was held out
USABLE_SHARE = 0.05
GRADES = ("good", "usable", "poor")
SHOWN_NAMES = 4
DOUBT = (
    "Check the units and signs of the samples, and that aircraft, flight condition and samples belong "
    "together; then compare numbers of links with morphid study."
)


@dataclass(frozen=True)
class Verdict:
    """A grade ("good", "usable", "poor"), why, and what to do next."""

    grade: str
    reasons: tuple[str, ...]
    next_steps: tuple[str, ...]


class Judgement(NamedTuple):
    """One view of a result: the best grade that it allows, why, and what to do about it."""

    grade: str
    reason: str
    step: str = ""


def verdict(result: Document, use: str) -> Verdict:
    """Judge a result by the flights that were held out, and by its parameters and warnings.

    Parameters
    ----------
    result : of an identification, as the service returns it.
    use : what to do next with a model that is not poor.
    """
    found = [_judge_fit(result["fit"]), *_judge_parameters(result.get("uncertainty") or {})]
    # whether a parameter at its bound matters is judged with the parameters
    if any(warning["code"] != "at_bound" for warning in result.get("warnings") or ()):
        found.append(Judgement("usable", "The result carries warnings: see above."))
    grade = max((judgement.grade for judgement in found), key=GRADES.index)
    steps = [judgement.step for judgement in found if judgement.step]
    reasons = tuple(judgement.reason for judgement in found)
    return Verdict(grade, reasons, tuple(steps if grade == "poor" else [use, *steps]))


def _judge_parameters(uncertainty: Document) -> Iterator[Judgement]:
    unknown = current_names(uncertainty.get("undetermined") or ())
    # a parameter that has no effect on the fit may end anywhere, at its bound too
    at_bound = current_names(uncertainty.get("at_bound") or ())
    stopped = [name for name in at_bound if name not in unknown]
    if stopped:
        reason = f"The search stopped at a bound of {_names(stopped)}: the best value may lie outside."
        step = "Widen model.bounds of these parameters if physics allows it, or change the number of links."
        yield Judgement("usable", reason, step)
    if unknown:
        reason = (
            f"The flights do not determine {_names(unknown)}: the model flies as they do, but do not take "
            "these numbers for properties of the aircraft."
        )
        step = "To determine them, add a flight that moves the wings differently (one-sided, faster)."
        yield Judgement("good", reason, step)


def _judge_fit(fits: Sequence[Document]) -> Judgement:
    """Judge by the flights that were held out, else by those that were fitted: by the worst of them."""
    held_out = [fit for fit in fits if fit["role"] == "held_out"]
    worst = max(held_out or fits, key=_share)
    name, share = worst["sample"], _share(worst)
    if not math.isfinite(share):
        return Judgement("poor", f"The model does not fly {name} to its end, or nothing moves in it.", DOUBT)
    error, motion = (1e3 * _size(worst[key]) for key in ("rms_rad", "range_rad"))
    measure = f"within {error:.2g} mrad rms, {_percent(share)} of its motion of {motion:.0f} mrad"
    if share > USABLE_SHARE:
        return Judgement("poor", f"{name} is met only {measure}.", DOUBT)
    if not held_out:
        reason = f"{name} is fitted {measure}, but no flight was held out to prove the model."
        return Judgement("usable", reason, "Hold one flight out and identify again.")
    reason = f"{name}, which the search has not seen, is predicted {measure}."
    if share > GOOD_SHARE:
        return Judgement("usable", reason, "More links may fit better: compare with morphid study.")
    return Judgement("good", reason)


def _share(fit: Document) -> float:
    """Error as a part of the motion; infinite where the model does not fly or nothing moves."""
    if fit["J_identified"] is None or any(fit["rms_rad"][angle] is None for angle in ANGLES):
        return math.inf
    motion = _size(fit["range_rad"])
    return _size(fit["rms_rad"]) / motion if motion > 0.0 else math.inf


def _size(angles: Document) -> float:
    return math.hypot(*(angles[angle] for angle in ANGLES))


def _percent(share: float) -> str:
    return f"{100.0 * share:.2g} %" if share >= 1e-4 else "less than 0.01 %"


def _names(names: Sequence[str]) -> str:
    more = f" and {len(names) - SHOWN_NAMES} more" if len(names) > SHOWN_NAMES else ""
    return ", ".join(names[:SHOWN_NAMES]) + more
