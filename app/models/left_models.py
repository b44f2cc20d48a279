"""Which identified model a finished job leaves: that of an identification, the recommended one of a study.

A model that does not fly the samples it was fitted to is none.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from app.documents import Document
from morphdata.parameters import has_flown


def left_model(operation: str, result: Document) -> Document | None:
    """Find the identified model in a result, as an object with its ``model`` and its ``fit``.

    None for results that hold none.
    """
    find = LEFT_MODELS.get(operation)
    found = None if find is None else find(result)
    if found is None or found.get("model") is None or not has_flown(found.get("fit")):
        return None
    return found


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
