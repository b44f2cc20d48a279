"""The requirements on the figures: the project's promises about speed, next to the measured values."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from benchmarks.setting import Figures


@dataclass(frozen=True)
class Requirement:
    """A bound on one figure.

    path : its keys in the figures, joined by "/". bound, at_least : limit, and whether it is a minimum.
    """

    path: str
    bound: float
    at_least: bool = False

    def value(self, figures: Figures) -> float | None:
        """The figure; None where it was not measured."""
        found: Any = figures
        for key in self.path.split("/"):
            if not isinstance(found, dict) or key not in found:
                return None
            found = found[key]
        return float(found)

    def holds(self, value: float) -> bool:
        """Whether a value is within the bound; one that is no number is not."""
        return value >= self.bound if self.at_least else value <= self.bound

    @property
    def text(self) -> str:
        """The bound in short."""
        return f"{'>=' if self.at_least else '<='} {self.bound:,g}"


REQUIREMENTS = (
    Requirement("batch/real_time_factor_per_core", 3_000.0, at_least=True),
    Requirement("search/arrived_share", 1.0, at_least=True),
    Requirement("search/flight_sets_to_target", 3_000.0),
    Requirement("search/wall_s_to_target", 15.0),
    Requirement("mujoco/batch_ratio", 30.0, at_least=True),
    Requirement("mujoco/single_ratio", 1.0, at_least=True),
    # the counts are whole numbers of a short flight: no allowance for time, one for rounding
    Requirement("structural_growth", 1.001),
    Requirement("threads/speed_up", 1.8, at_least=True),
    Requirement("threads/speed_up_by_computing_time", 1.8, at_least=True),
    Requirement("memory/beyond_mb/as they are", 200.0),
    Requirement("memory/beyond_mb/eight times as long", 200.0),
    Requirement("step_error/worst_rad", 1e-4),
    Requirement("start_up/job/wall_s", 0.5),
    Requirement("start_up/job/computing_s", 0.5),
    Requirement("start_up/import/ratio", 1.5),
    Requirement("compilation/computing_s", 60.0),
)
BY_PATH = {requirement.path: requirement for requirement in REQUIREMENTS}


def judged(figures: Figures) -> list[Figures]:
    """All requirements that were measured, each with its figure and whether it holds."""
    found = []
    for requirement in REQUIREMENTS:
        value = requirement.value(figures)
        if value is not None:
            found.append(
                {
                    "figure": requirement.path,
                    "value": value,
                    "must_be": requirement.text,
                    "holds": requirement.holds(value),
                }
            )
    return found
