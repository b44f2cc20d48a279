"""Reads the user's files and writes results, with errors that name the file and a remedy."""

from __future__ import annotations

import glob
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from morphid.exits import CommandError, Exit

STANDARD_OUTPUT = Path("-")
# no folder, no hidden file, no control character
PLAIN_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,159}")


def read_json(path: Path) -> Any:
    """Read a JSON file."""
    require_file(path)
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise CommandError(f"{path} cannot be read: {error}", code=Exit.INVALID_INPUT) from None
    except json.JSONDecodeError as error:
        raise CommandError(
            f"{path} is not JSON: {error.msg} in line {error.lineno}", code=Exit.INVALID_INPUT
        ) from None


def require_file(path: Path) -> None:
    """Raise CommandError if there is no such file."""
    if not path.is_file():
        raise CommandError(
            f"there is no file {path}", code=Exit.INVALID_INPUT, hint=f"looked in {Path.cwd()}"
        )


def matching_files(paths: Sequence[Path], option: str) -> list[Path]:
    """Expand patterns (``flights/*.csv``) in a list of files, sorted by name.

    A shell expands unquoted patterns itself; an existing file of exactly that name is not a pattern.
    """
    found: list[Path] = []
    for path in paths:
        pattern = str(path)
        if not glob.has_magic(pattern) or path.exists():
            found.append(path)
            continue
        # a pattern may be absolute, which Path.glob does not support
        names = glob.glob(pattern, recursive=True)  # noqa: PTH207
        matches = sorted(Path(name) for name in names if Path(name).is_file())
        if not matches:
            raise CommandError(
                f"{option} {pattern}: no file matches",
                code=Exit.INVALID_INPUT,
                hint=f"looked in {Path.cwd()}",
            )
        found += matches
    return found


def require_place(path: Path | None, option: str) -> None:
    """Refuse an output file whose folder is missing, before a search rather than after it."""
    if path is not None and path != STANDARD_OUTPUT and not path.absolute().parent.is_dir():
        raise CommandError(
            f"{option} {path}: there is no folder {path.parent}",
            code=Exit.ENVIRONMENT,
            hint="create it first, or choose another",
        )


def write_json(document: object, path: Path) -> None:
    """Write a document as indented JSON."""
    write_bytes((json.dumps(document, indent=1) + "\n").encode(), path)


def write_bytes(content: bytes, path: Path) -> None:
    """Write a file; raise CommandError if that fails."""
    with writing(path):
        path.write_bytes(content)


def save_files(files: Mapping[str, bytes], folder: Path) -> list[Path]:
    """Write plots and curves into a folder and return their paths.

    Names may come from a service, which is not trusted to stay in the folder.
    """
    for name in files:
        if not PLAIN_NAME.fullmatch(name):
            raise CommandError(
                f"the service sent a file with the name {name[:80]!r}, which is not a plain file name",
                hint="nothing was written; do not trust this service",
            )
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
    for name, content in files.items():
        write_bytes(content, folder / name)
    return [folder / name for name in files]


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Convert write errors to a CommandError with path and reason."""
    try:
        yield
    except OSError as error:
        raise CommandError(f"{path} cannot be written: {error.strerror}", code=Exit.ENVIRONMENT) from None
