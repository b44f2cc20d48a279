"""The shape of a flight as files: a table of points, and NumPy arrays."""

from __future__ import annotations

import io
from collections.abc import Iterator

import numpy as np

from morphcore.export.npz_file import archive
from morphcore.simulate.shape import LINES, Shape
from morphdata.channels import column_parts
from morphdata.samplefiles.csv_table import write_table

COLUMNS = ("t", "surface", "station", "at", *(f"{line[:-2]}_{axis}" for line in LINES for axis in "xyz"))


def shape_files(shape: Shape) -> dict[str, bytes]:
    """Write a shape.

    Parameters
    ----------
    shape : Shape
        Of a simulation.

    Returns
    -------
    dict of str to bytes
        ``shape.csv``: a row for each time, surface and station with the elastic axis, leading and trailing
        edge (m; north, east, down). ``shape.npz``: the arrays of the result's ``shape``, those of a surface
        under its name (``right_wing.leading_n_m``). The same shape gives the same bytes.
    """
    stream = io.StringIO()
    write_table(stream, COLUMNS, _rows(shape))
    document = shape.to_document()
    surfaces = document.pop("surfaces")
    tables = {"": document} | dict(
        zip(column_parts(each["name"] for each in surfaces), surfaces, strict=True)
    )
    arrays = {
        f"{part}.{name}" if part else name: np.asarray(values)
        for part, table in tables.items()
        for name, values in table.items()
    }
    return {"shape.csv": stream.getvalue().encode(), "shape.npz": archive(arrays)}


def _rows(shape: Shape) -> Iterator[list[str]]:
    for number, time_s in enumerate(shape.time_s):
        for surface in shape.surfaces:
            points = np.concatenate([getattr(surface, line)[number] for line in LINES], axis=1)
            for station, (at, point) in enumerate(zip(surface.at, points, strict=True)):
                numbers = (f"{value:.9g}" for value in (at, *point))
                yield [f"{time_s:.9g}", surface.name, str(station), *numbers]
