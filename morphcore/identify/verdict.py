"""The verdict on an identification: whether the model may be believed, why, and what to do next."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np

from morphcore.identify.diagnoses import LATE_SHARE, WRONG_DATA
from morphcore.identify.sample_fit import SampleFit
from morphcore.validity import ResultWarning
from morphdata.measurement import ANGLES

Grade = Literal["good", "usable", "poor", "failed"]

GRADES: tuple[Grade, ...] = ("good", "usable", "poor", "failed")  # the worst last
GOOD_SHARE = 0.01  # of the motion, in the worst of the flights that were held out
USABLE_SHARE = 0.05
NO_GAIN = 0.5  # of the rigid model's J: the links add nothing
OVERFITTED = 5.0  # times the error in the fitted flights, in one that was held out
DRIVE_SHAPE = 0.5  # correlation of a residual with a drive that is worth a sentence
MIN_FITTED = 2  # flights of one model that prove each other a little
SHOWN_NAMES = 4
# what says where the method ends or what a record is like, and not that this fit is doubtful; and what the
# flights and the parameters are judged by anyway
HARMLESS = frozenset({"compressible", "repeated_rows", "gap", "large_error", "at_bound"})
DOUBT = (
    "Check the units and signs of the samples, and that aircraft, flight condition and samples belong "
    "together; then compare numbers of links with a study."
)


@dataclass(frozen=True)
class Verdict:
    """A grade, the reasons for it, the weightiest first, and what to do next."""

    grade: Grade
    reasons: tuple[str, ...]
    next_steps: tuple[str, ...] = ()

    def to_document(self) -> dict[str, Any]:
        """JSON form with the names that the API fixes."""
        return {"grade": self.grade, "reasons": list(self.reasons), "next_steps": list(self.next_steps)}


class Judgement(NamedTuple):
    """One view of a result: the best grade that it allows, why, and what to do about it."""

    grade: Grade
    reason: str
    step: str = ""


def verdict(
    fits: Sequence[SampleFit],
    warnings: Sequence[ResultWarning] = (),
    *,
    undetermined: Collection[str] = (),
    at_bound: Collection[str] = (),
    measurement: Mapping[str, Any] | None = None,
    finished: bool = True,
) -> Verdict:
    """Judge an identification.

    Parameters
    ----------
    fits : sequence of SampleFit
        How each sample is met, in the order of the request.
    warnings : sequence of ResultWarning
        Of the result, diagnoses included.
    undetermined, at_bound : collection of str
        Names of parameters.
    measurement : mapping of str to dict, optional
        Biases and delays that the fit has allowed for, by sample, as the result has them.
    finished : bool
        Whether the search came to its end.

    Returns
    -------
    Verdict
        ``failed`` where the model does not fly what it was fitted to; else the worst of what the flights, the
        parameters and the warnings allow.
    """
    lost = [fit for fit in fits if fit.case.sample.role == "train" and fit.ending("identified")]
    if lost:
        return _failed(lost, warnings)
    found = [
        *_judge_data(fits, warnings),
        *_judge_fit(fits),
        *([] if any(warning.code in WRONG_DATA for warning in warnings) else _judge_residuals(fits)),
        *_judge_parameters(undetermined, at_bound),
        *_judge_measurement(measurement or {}),
    ]
    if not finished:
        found.append(Judgement("usable", "The search was stopped before its end.", "Let the search end."))
    found.sort(key=lambda judgement: -GRADES.index(judgement.grade))
    steps = dict.fromkeys(judgement.step for judgement in found if judgement.step)
    return Verdict(found[0].grade, tuple(judgement.reason for judgement in found), tuple(steps))


def _failed(lost: Sequence[SampleFit], warnings: Sequence[ResultWarning]) -> Verdict:
    flights = ", ".join(f"{fit.case.sample.name} ({fit.ending('identified')})" for fit in lost)
    causes = [warning for warning in warnings if warning.code in WRONG_DATA]
    reasons = [f"No model was found that flies the samples: {flights}."]
    return Verdict(
        "failed",
        tuple(reasons + [_sentence(cause.message) for cause in causes]),
        tuple(dict.fromkeys(_sentence(cause.hint) for cause in causes)) or (DOUBT,),
    )


def _judge_data(fits: Sequence[SampleFit], warnings: Sequence[ResultWarning]) -> Iterator[Judgement]:
    """Diagnoses of the data: what was fitted to wrong data is poor, however well it fits."""
    held_out = tuple(
        f"/samples/{number}/" for number, fit in enumerate(fits) if fit.case.sample.role != "train"
    )
    # a fit that is free to shift the drives meets late samples as well as any; its delay is still a mistake
    trained = [fit.error_share() for fit in fits if fit.case.sample.role == "train"]
    allowed_for = max(trained, default=0.0) < LATE_SHARE
    alike: dict[tuple[str, str], list[ResultWarning]] = {}
    for warning in warnings:
        if warning.code not in HARMLESS:
            alike.setdefault((warning.code, warning.hint), []).append(warning)
    for (code, hint), group in alike.items():
        fitted = any(not f"{warning.pointer}/".startswith(held_out) for warning in group)
        wrong = code in WRONG_DATA and fitted and (code != "late" or not allowed_for)
        grade: Grade = "poor" if wrong else "usable"
        others = f" (and {len(group) - 1} more like it)" if len(group) > 1 else ""
        yield Judgement(grade, _sentence(f"{group[0].message}{others}"), _sentence(hint))


def _judge_fit(fits: Sequence[SampleFit]) -> Iterator[Judgement]:
    """Judge by the flights that were held out, else by those that were fitted: by the worst of them."""
    held_out = [fit for fit in fits if fit.case.sample.role == "held_out"]
    fitted = [fit for fit in fits if fit.case.sample.role == "train"]
    worst = max(held_out or fitted, key=SampleFit.error_share)
    name, share = worst.case.sample.name, worst.error_share()
    if not math.isfinite(share):
        yield Judgement("poor", f"The model does not fly {name} to its end, or nothing moves in it.", DOUBT)
        return
    measure = _measure(worst, share)
    if share > USABLE_SHARE:
        yield Judgement("poor", f"{name} is met only {measure}.", DOUBT)
    elif held_out:
        grade: Grade = "usable" if share > GOOD_SHARE else "good"
        step = "More links may fit better: compare with a study." if grade == "usable" else ""
        yield Judgement(grade, f"{name}, which the search has not seen, is predicted {measure}.", step)
    else:
        grade = "good" if share <= GOOD_SHARE and len(fitted) >= MIN_FITTED else "usable"
        reason = f"{name} is fitted {measure}, but no flight was held out to prove the model."
        yield Judgement(grade, reason, "Hold one flight out and identify again.")
    before = max((fit.error_share() for fit in fitted), default=0.0)
    if held_out and share > max(OVERFITTED * before, GOOD_SHARE):
        reason = f"{name} is predicted {share / before:.0f} times worse than the fitted flights are met."
        yield Judgement(
            "usable", reason, "Fit flights that differ more, or take fewer links: the model is overfitted."
        )
    J, J_rigid = worst.J("identified"), worst.J("rigid")
    if J is not None and J_rigid and NO_GAIN * J_rigid < J and share > GOOD_SHARE:
        reason = f"The links gain nothing: J of {name} is {J / J_rigid:.2g} times that of the rigid model."
        yield Judgement("poor", reason, DOUBT)


def _judge_residuals(fits: Sequence[SampleFit]) -> Iterator[Judgement]:
    """Residuals that the model should have explained, where they are large enough to matter."""
    for fit in fits:
        share = fit.error_share()
        if not GOOD_SHARE < share < math.inf:
            continue
        found = fit.statistics()
        coloured = [angle for angle in ANGLES if found[angle].white is False]
        driven = [a for a in coloured if abs(found[a].drive_correlation or 0.0) > DRIVE_SHAPE]
        if coloured:
            shape = f", and with the drives ({', '.join(driven)})" if driven else ""
            yield Judgement(
                "usable",
                f"The errors in {fit.case.sample.name} are not noise: they are correlated from row to row "
                f"({', '.join(coloured)}){shape}.",
            )


def _judge_parameters(undetermined: Collection[str], at_bound: Collection[str]) -> Iterator[Judgement]:
    # a parameter that has no effect on the fit may end anywhere, at its bound too
    stopped = [name for name in at_bound if name not in undetermined]
    if stopped:
        reason = f"The search stopped at a bound of {_names(stopped)}: the best value may lie outside."
        step = "Widen model.bounds of these parameters if physics allows it, or change the number of links."
        yield Judgement("usable", reason, step)
    if undetermined:
        reason = (
            f"The flights do not determine {_names(list(undetermined))}: the model flies as they do, but do "
            "not take these numbers for properties of the aircraft."
        )
        step = "To determine them, add a flight that moves the wings differently (one-sided, faster)."
        yield Judgement("good", reason, step)


def _judge_measurement(measurement: Mapping[str, Any]) -> Iterator[Judgement]:
    """What the fit has allowed for, so that nobody takes the flights for better than they are."""
    biases = [
        abs(estimate["value"] or 0.0)
        for found in measurement.values()
        for name, estimate in (found.get("bias") or {}).items()
        if name in ANGLES[:2]  # that of yaw is the heading
    ]
    delays = [abs((found.get("delay_s") or {}).get("value") or 0.0) for found in measurement.values()]
    parts = [f"biases of roll and pitch up to {1e3 * max(biases):.2g} mrad"] if any(biases) else []
    parts += [f"delays up to {1e3 * max(delays):.2g} ms"] if any(delays) else []
    if parts:
        yield Judgement("good", f"The fit has found and allowed for {' and '.join(parts)}.")


def _measure(fit: SampleFit, share: float) -> str:
    motion = fit.case.motion
    size = 1e3 * float(np.sqrt(np.mean(np.sum(motion**2, axis=1))))
    error = 1e3 * float(np.sqrt(np.mean(np.sum(fit.errors("identified") ** 2, axis=1))))
    percent = f"{100.0 * share:.2g} %" if share >= 1e-4 else "less than 0.01 %"
    return f"within {error:.2g} mrad rms, {percent} of its motion of {size:.0f} mrad rms"


def _names(names: Sequence[str]) -> str:
    more = f" and {len(names) - SHOWN_NAMES} more" if len(names) > SHOWN_NAMES else ""
    return ", ".join(names[:SHOWN_NAMES]) + more


def _sentence(text: str) -> str:
    return f"{text[:1].upper()}{text[1:]}" + ("" if text.endswith(".") else ".")
