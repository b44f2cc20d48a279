"""The export format ``json``: aircraft, flight, model and origin as a `morphdata.export.ModelFile`."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from morphcore.export.formats import ExportedModel


def write(exported: ExportedModel) -> bytes:
    """Write the document."""
    document = exported.file.model_dump(exclude_none=True)
    return json.dumps(document, indent=1, allow_nan=False).encode()
