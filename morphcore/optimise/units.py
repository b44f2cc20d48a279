"""Names of results for drives that slide: searches count in the drive's unit under the names of angles."""

from __future__ import annotations

from typing import Any

from morphdata.drives import Unit
from morphdata.extensions import SLIDING_LIMITS

SLIDING_NAMES = {
    **SLIDING_LIMITS,
    "knot_angle_rad": "knot_extension_m",
    "initial_rad": "initial_m",
    "final_rad": "final_m",
    "sweep_rad": "extension_m",
    "rate_rad_s": "rate_m_s",
    "acceleration_rad_s2": "acceleration_m_s2",
}
FORMER = "knot_sweep_rad"  # name of angles in old results


def named_in(unit: Unit, document: Any) -> Any:
    """Return a document of results with the names that a drive's unit has; that of angles as it is."""
    if unit == "rad":
        return document
    if isinstance(document, dict):
        return {
            SLIDING_NAMES.get(name, name): named_in(unit, value)
            for name, value in document.items()
            if name != FORMER and not (name in SLIDING_NAMES.values() and value is None)
        }
    if isinstance(document, list | tuple):
        return [named_in(unit, value) for value in document]
    return document
