"""Which identified model a finished job leaves: that of an identification, the recommended one of a study.

A model that does not fly the samples it was fitted to is none.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from app.documents import Document


def left_model(operation: str, result: Document) -> Document | None:
    """Find the identified model in a result, as an object with its ``model`` and its ``fit``.

    None for results that hold none.
    """
    find = LEFT_MODELS.get(operation)
    found = None if find is None else find(result)
    return found if found is not None and has_flown(found) else None


def has_flown(identified: Document) -> bool:
    """Whether there is a model, and it flies all samples to fit: where it does not, J is null."""
    fits = identified.get("fit")
    rows = [row for row in fits if isinstance(row, dict)] if isinstance(fits, list) else []
    lost = any(row.get("role") == "train" and row.get("J_identified", 0.0) is None for row in rows)
    return identified.get("model") is not None and not lost


def _identified(result: Document) -> Document | None:
    return result


def _recommended(result: Document) -> Document | None:
    links = (result.get("recommended") or {}).get("links_per_wing")
    rows = (row for row in result.get("rows") or () if links is not None and row["links_per_wing"] == links)
    return next(rows, None)


LEFT_MODELS: Mapping[str, Callable[[Document], Document | None]] = {
    "identify": _identified,
    "study": _recommended,
}
