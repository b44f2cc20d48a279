"""The operation ``export``: the file of one model."""

from __future__ import annotations

from collections.abc import Iterator

from morphcore.export.formats import Export
from morphdata.export import ExportRequest
from worker.operations import Document, Outcome, Step, Stop
from worker.operations.library_work import result_file

NO_CHECKPOINT = b""


class ExportWork:
    """An export as work: a single step of about a second.

    Parameters
    ----------
    export : the library's.
    """

    def __init__(self, export: Export) -> None:
        self._export = export

    def steps(self, checkpoint: bytes | None, stop: Stop) -> Iterator[Step]:
        """Trim the model and write the file."""
        del checkpoint, stop
        self._export.data()
        message = f"{self._export.format.file} written"
        yield Step({"fraction": 1.0, "phase": "export", "message": message}, NO_CHECKPOINT)

    def outcome(
        self,
        checkpoint: bytes,  # noqa: ARG002 - the file is in the export
        *,
        files: bool = True,
    ) -> Outcome:
        """Return the description of the file, and the file if wanted."""
        document = self._export.to_document()
        written = {self._export.format.file: self._export.data()} if files else {}
        return Outcome(document, {**result_file(document), **written})

    def best_so_far(self, checkpoint: bytes) -> None:  # noqa: ARG002 - as above
        """Return None: half a file is not a result."""
        return


def begin(request: Document, threads: int) -> ExportWork:
    """Check the request and prepare the export.

    Raises
    ------
    InvalidInput : the model belongs to another aircraft.
    """
    del threads
    return ExportWork(Export(ExportRequest.parse(request)))
