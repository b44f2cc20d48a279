"""Files of the command line."""

from __future__ import annotations

from pathlib import Path

import pytest

from morphid.exits import CommandError, Exit
from morphid.files import read_json, require_place, save_files, write_json


def test_a_broken_json_file_names_the_line(tmp_path: Path) -> None:
    """JSON that does not parse is reported with file and line."""
    (tmp_path / "a.json").write_text('{"span_m": 3,\n oops}')
    with pytest.raises(CommandError, match="line 2") as caught:
        read_json(tmp_path / "a.json")
    assert caught.value.code is Exit.INVALID_INPUT


NASTY_NAMES = [
    "../../evil.svg",
    "..",
    ".",
    "",
    "/etc/evil",
    "a/b.svg",
    "..\\evil.svg",
    ".bashrc",
    "a\x00.svg",
    "a\n.svg",
    "\x1b]0;owned\x07.svg",
    "a\u202egvs.svg",
    "a.svg ",
    "-rf",
    "x" * 300,
]


@pytest.mark.parametrize("name", NASTY_NAMES)
def test_saved_names_stay_in_the_folder(tmp_path: Path, name: str) -> None:
    """A name from a service that is no plain file name is refused in words; nothing at all is written."""
    with pytest.raises(CommandError, match="not a plain file name") as caught:
        save_files({"fine.svg": b"x", name: b"x"}, tmp_path / "plots")
    assert str(caught.value).isprintable()
    assert list(tmp_path.iterdir()) == []


def test_plain_names_are_saved(tmp_path: Path) -> None:
    """Every file lands in the folder, which is made."""
    files = {"convergence.svg": b"x", "curves_train_rate_0.8.csv": b"y"}
    saved = save_files(files, tmp_path / "new" / "plots")
    assert {path.name: path.read_bytes() for path in saved} == files


def test_a_missing_folder_is_found_before_the_work(tmp_path: Path) -> None:
    """A file in a folder that is not there is refused at once; the sentence names the option."""
    for fine in (None, Path("-"), Path("out.json"), tmp_path / "out.json"):
        require_place(fine, "--json")
    with pytest.raises(CommandError, match=r"--json .*nowhere") as caught:
        require_place(tmp_path / "nowhere" / "out.json", "--json")
    assert caught.value.code is Exit.ENVIRONMENT


def test_a_file_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    """A folder in the place of the file is said to be in the way."""
    with pytest.raises(CommandError, match=f"{tmp_path} cannot be written") as caught:
        write_json({}, tmp_path)
    assert caught.value.code is Exit.ENVIRONMENT
