"""The result of a study: a row for each number of links, the rigid model beside them, one recommended."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from morphcore.errors import NotFlyable
from morphcore.identify.study_choice import Recommendation, recommend
from morphcore.identify.study_row import Document, StudyRow
from morphcore.identify.study_timing import FLIGHT_S
from morphcore.shown import Shown, Summary
from morphdata.links import LinksPerWing, shown_links

TIMING_THREADS = 1  # see FlightTiming.round


@dataclass(frozen=True, repr=False)
class StudyResult(Shown):
    """Accuracy and cost of the numbers of links studied, in rising order (the paper's Table 1).

    recommended : one of them, with the reason. rigid : J over the flights of each role (rad^2) and wall time
    of one flight (s) of the rigid model without corrections. search : how it was searched. cost : what was
    timed.
    """

    rows: tuple[StudyRow, ...]
    recommended: Recommendation
    rigid: Document
    search: Document
    cost: Document

    def row(self, links_per_wing: LinksPerWing) -> StudyRow:
        """The row of one number of links."""
        return next(row for row in self.rows if row.links_per_wing == links_per_wing)

    def summary(self) -> Summary:
        """Accuracy and cost of each number of links, and which to take."""
        return Summary(
            f"StudyResult: {len(self.rows)} models, recommended: {_links(self.recommended.links_per_wing)}",
            {"rigid J, rad^2": self.rigid["J_train"], "rigid J held out": self.rigid["J_held_out"]},
            ("links", "J train, rad^2", "J held out", "flight, ms"),
            [
                [
                    shown_links(row.links_per_wing),
                    row.J_train,
                    row.J_held_out,
                    None if row.flight_s is None else 1e3 * row.flight_s,
                ]
                for row in self.rows
            ],
            [self.recommended.reason],
        )

    @property
    def warnings(self) -> list[Document]:
        """Those of the recommended model; without any, of the first row."""
        chosen = [row for row in self.rows if row.links_per_wing == self.recommended.links_per_wing]
        return [warning for row in (chosen or list(self.rows))[:1] for warning in row.warnings]

    def require_flown(self) -> StudyResult:
        """Itself, if a model of any size flies what it was fitted to; else NotFlyable."""
        if self.rows and not any(row.flown for row in self.rows):
            why = next(warning for warning in self.rows[0].warnings if warning["code"] == NotFlyable.code)
            raise NotFlyable(why["message"], pointer=why["pointer"], hint=why["hint"])
        return self

    def to_document(self) -> dict[str, Any]:
        """JSON form."""
        return {
            "rows": [row.to_document() for row in self.rows],
            "rigid": self.rigid,
            "recommended": self.recommended.to_document(),
            "search": self.search,
            "cost": self.cost,
            "warnings": self.warnings,
        }


def _links(links: LinksPerWing | None) -> str:
    return "none" if links is None else shown_links(links)


def study_result(
    rows: tuple[StudyRow, ...],
    *,
    rigid_flight_s: float | None,
    plan_s: float | None,
    rounds: int,
    search: Document,
) -> StudyResult:
    """Put a study's rows together and recommend one."""
    ordered = tuple(sorted(rows, key=lambda row: row.mean_links))
    first = ordered[0] if ordered else None
    return StudyResult(
        rows=ordered,
        recommended=recommend(ordered),
        rigid={
            "J_train": first.J_rigid("train") if first else None,
            "J_held_out": first.J_rigid("held_out") if first else None,
            "flight_s": rigid_flight_s,
        },
        search=search,
        cost={
            "flight_duration_s": FLIGHT_S,
            "plan_s": plan_s,
            "rounds": rounds,
            "threads": TIMING_THREADS,
        },
    )
