"""A working folder of a user's whose modules must not be imported by ours."""

from __future__ import annotations

from pathlib import Path

OURS = ("app", "morphid", "worker", "morphcore", "morphdata", "migrations")
OTHERS = ("celeryconfig", "numpy", "redis", "sqlalchemy", "email")  # what we, or our packages, might look for
RECORD = "imported.txt"
SOURCE = """
from pathlib import Path

with (Path({folder!r}) / {record!r}).open("a") as record:
    record.write(__name__ + "\\n")
raise RuntimeError("a module of the working folder was imported: " + __name__)
"""


class HostileFolder:
    """A folder full of modules that note their import and raise.

    Parameters
    ----------
    folder : to be made.
    """

    def __init__(self, folder: Path) -> None:
        self.path = folder
        source = SOURCE.format(folder=str(folder), record=RECORD)
        for name in OURS:
            (folder / name).mkdir(parents=True)
            (folder / name / "__init__.py").write_text(source)
        for name in OTHERS:
            (folder / f"{name}.py").write_text(source)

    def imported(self) -> list[str]:
        """Give the modules of the folder that anybody imported."""
        record = self.path / RECORD
        return record.read_text().split() if record.exists() else []
