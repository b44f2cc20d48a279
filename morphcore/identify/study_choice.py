"""How many links per wing to recommend out of a study, and why.

The rule: every link has to halve the error at least. So the choice is the number of links n with the least
2^n times the error, which is the square root of J over the flights held out, or over the fitted ones where
none was held out. It is an information criterion (least log J + n log 4) whose price of a link is set by what
an engineer would notice, not by statistics: the errors of these models are no noise.

So a model is chosen for what it predicts, not for what it was fitted to, and luck on one flight does not
buy many links. A model whose error is below what the integration itself is good for needs no more links.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from morphcore.identify.study_row import Role, StudyRow
from morphdata.links import LinksPerWing, shown_links, shown_per_wing

WORTH_OF_A_LINK = 2.0  # factor in the error
# RMS of any attitude angle; the step of 10 ms holds attitude to within this (simulate/time_grid.py)
RESOLUTION_RAD = 1e-4


@dataclass(frozen=True)
class Recommendation:
    """The number of links recommended (None: no model flew) and sentences that say why.

    judged_by : the role of the flights on which the models were compared.
    """

    links_per_wing: LinksPerWing | None
    reason: str
    judged_by: Role

    def to_document(self) -> dict[str, Any]:
        """JSON form."""
        return dict(vars(self))


def recommend(rows: Sequence[StudyRow]) -> Recommendation:
    """Choose among the finished rows of a study by the rule at the head of this file."""
    role: Role = "held_out" if any(row.has_held_out for row in rows) else "train"
    flown = sorted(
        (row for row in rows if row.finished and row.flown and row.J(role) is not None),
        key=lambda row: row.mean_links,
    )
    if not flown:
        what = "was identified to the end" if not any(row.finished for row in rows) else "flew every flight"
        return Recommendation(None, f"No model {what}.", role)
    cheapest = min(flown, key=lambda row: _error(row, role) * WORTH_OF_A_LINK**row.mean_links)
    chosen = next(row for row in flown if row is cheapest or _is_resolved(row))
    return Recommendation(chosen.links_per_wing, _reason(chosen, flown, role), role)


def _error(row: StudyRow, role: Role) -> float:
    J = row.J(role)
    return float(np.sqrt(np.inf if J is None else J))


def _is_resolved(row: StudyRow) -> bool:
    return row.worst_rms_rad is not None and row.worst_rms_rad <= RESOLUTION_RAD


def _reason(chosen: StudyRow, flown: Sequence[StudyRow], role: Role) -> str:
    """The sentences, with the figures that they rest on."""
    n = chosen.mean_links
    flights = "the flights held out" if role == "held_out" else "the fitted flights, for none was held out"
    said = f"{shown_per_wing(chosen.links_per_wing)}: J = {chosen.J(role):.2g} rad^2 on {flights}"
    if chosen.worst_rms_rad is not None:
        said += f", RMS up to {1e3 * chosen.worst_rms_rad:.2g} mrad in an angle"
    others = [
        *_compared("the best with fewer,", [row for row in flown if row.mean_links < n], chosen, role),
        *_compared("the best with more,", [row for row in flown if row.mean_links > n], chosen, role),
    ]
    sentences = [said, "; ".join(others)] if others else [said]
    if _is_resolved(chosen):
        sentences.append(f"An RMS of {1e3 * RESOLUTION_RAD:g} mrad is all that the integration resolves")
    elif others:
        sentences.append("An additional link must at least halve the error")
    sentences += _overfitted(chosen, flown)
    return ". ".join(sentence[0].upper() + sentence[1:] for sentence in sentences) + "."


def _compared(label: str, rows: Sequence[StudyRow], chosen: StudyRow, role: Role) -> list[str]:
    """What the best of some other models would change."""
    if not rows:
        return []
    best = min(rows, key=lambda row: _error(row, role))
    own, other = _error(chosen, role), _error(best, role)
    said = f"{label} {shown_links(best.links_per_wing)}, "
    said += (
        f"has {_two_digits(other / own)} times the error" if own > 0.0 else "has an error; this one has none"
    )
    if chosen.flight_s and best.flight_s:
        said += f" and takes {_two_digits(best.flight_s / chosen.flight_s)} times as long to fly"
    return [said]


def _overfitted(chosen: StudyRow, flown: Sequence[StudyRow]) -> list[str]:
    """Where larger models fit better and predict worse, say from which on."""
    for row in flown:
        if row.mean_links > chosen.mean_links and row.has_held_out:
            fits_better = _error(row, "train") < _error(chosen, "train")
            if fits_better and _error(row, "held_out") > _error(chosen, "held_out"):
                return [f"With {shown_links(row.links_per_wing)} the fit is better and the prediction worse"]
    return []


def _two_digits(ratio: float) -> str:
    return f"{float(f'{ratio:.2g}'):g}"  # 110, not 1.1e+02
