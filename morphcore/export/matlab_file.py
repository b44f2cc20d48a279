"""The export format ``mat``: the groups of `morphcore.export.model_tables` as structs, version 5.

Vectors are columns, lists of names are cell arrays, and arrays named ``..._index`` count from 1::

    model = load('model.mat');
    model.links.mass_kg(model.joints.outboard_link_index)
"""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from scipy.io import savemat

if TYPE_CHECKING:
    from morphcore.export.formats import ExportedModel

HEADER = b"MATLAB 5.0 MAT-file, written by MorphID"  # without a date: the same model gives the same bytes
HEADER_BYTES = 116


def write(exported: ExportedModel) -> bytes:
    """Write the structs."""
    structs = {
        group: {name: _value(name, values) for name, values in table.items()}
        for group, table in exported.tables.items()
    }
    stream = io.BytesIO()
    savemat(cast("Any", stream), structs, long_field_names=True, oned_as="column", do_compression=True)
    return HEADER.ljust(HEADER_BYTES) + stream.getvalue()[HEADER_BYTES:]


def _value(name: str, values: Any) -> Any:
    if values.dtype.kind == "U":  # text, or a cell array of texts
        return str(values) if values.ndim == 0 else values.astype(object)
    return values + 1 if name.endswith("_index") else np.asarray(values, dtype=np.float64)
