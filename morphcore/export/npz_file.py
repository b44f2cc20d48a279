"""The export format ``npz``: the groups of `morphcore.export.model_tables` as ``group.array``.

Examples
--------
>>> import numpy as np
>>> with np.load("model.npz") as model:  # doctest: +SKIP
...     model["links.mass_kg"], model["joints.stiffness_nm_rad"]
"""

from __future__ import annotations

import io
import zipfile
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from morphcore.export.formats import ExportedModel

NO_DATE = (1980, 1, 1, 0, 0, 0)  # the earliest of a zip file: the same model gives the same bytes


def write(exported: ExportedModel) -> bytes:
    """Write the arrays; no text in them is pickled."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for group, table in exported.tables.items():
            for name, values in table.items():
                entry = zipfile.ZipInfo(f"{group}.{name}.npy", NO_DATE)
                entry.compress_type = zipfile.ZIP_DEFLATED
                with archive.open(entry, "w") as member:
                    np.lib.format.write_array(member, np.asarray(values), allow_pickle=False)
    return stream.getvalue()
