"""The export formats of identified models: to add one, write its module and list it here.

The module has one function, ``write(exported) -> bytes``, named by the format's ``write``; see
``morphcore/export/formats.py``. OpenAPI document, command, page and artifacts are built from this list.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ExportFormat:
    """One file format for models.

    Attributes
    ----------
    name : str
        In requests and on the command line.
    title : str
        One line on the file's contents and use.
    media_type : str
        Of the file.
    ending : str
        File extension, with its dot.
    write : str
        Its function, ``package.module:function``, imported on first use. It takes a
        `morphcore.export.formats.ExportedModel` and returns the file's bytes, the same for the same model.
    """

    name: str
    title: str
    media_type: str
    ending: str
    write: str

    @property
    def file(self) -> str:
        """Name of the job's file."""
        return f"model{self.ending}"


FORMATS: list[ExportFormat] = [
    ExportFormat(
        "npz",
        "NumPy arrays: parameters, links, joints, hinges and trim, for numpy.load.",
        "application/x-npz",
        ".npz",
        "morphcore.export.npz_file:write",
    ),
    ExportFormat(
        "mat",
        "MATLAB structs (version 5) with the same contents, for load in MATLAB, GNU Octave and scipy.io.",
        "application/x-matlab-data",
        ".mat",
        "morphcore.export.matlab_file:write",
    ),
    ExportFormat(
        "json",
        "Aircraft, flight and model in one document that every command takes as --parameters.",
        "application/json",
        ".json",
        "morphcore.export.json_file:write",
    ),
]


def format_named(name: str) -> ExportFormat:
    """Find a format by its name.

    Raises
    ------
    LookupError
        There is none of this name.
    """
    for each in FORMATS:
        if each.name == name:
            return each
    raise LookupError(f"there is no format {name!r}, only {', '.join(each.name for each in FORMATS)}")
