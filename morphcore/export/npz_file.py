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
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from morphcore.export.formats import ExportedModel

NO_DATE = (1980, 1, 1, 0, 0, 0)  # the earliest of a zip file


def write(exported: ExportedModel) -> bytes:
    """Write the arrays; no text in them is pickled."""
    return archive(
        {
            f"{group}.{name}": np.asarray(values)
            for group, table in exported.tables.items()
            for name, values in table.items()
        }
    )


def archive(arrays: Mapping[str, NDArray[np.generic]]) -> bytes:
    """Write named arrays as an ``npz`` file; the same arrays give the same bytes."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as file:
        for name, values in arrays.items():
            entry = zipfile.ZipInfo(f"{name}.npy", NO_DATE)
            entry.compress_type = zipfile.ZIP_DEFLATED
            with file.open(entry, "w") as member:
                np.lib.format.write_array(member, values, allow_pickle=False)
    return stream.getvalue()
