"""Names of folders that programs trip over."""

from __future__ import annotations

from pathlib import Path

FOLDER_NAMES = [
    "a%2Fb",
    "100%",
    "%(here)s",
    "a?b=c&d",
    "a#b",
    "a b",
    " a ",
    'a"b',
    "a'b",
    "a\\b",
    "a\\x41",
    "~a",
    "~",
    "-a",
    "a@b:c",
    "a+b;c,d",
    "$HOME",
    "[red]a[/]",
    "Fluß φ 飛行",
    "e\u0301",
    "a\nb",
    ":memory:",
    "file:a",
]
ALL_NESTED = Path(*FOLDER_NAMES)  # each within the one before: one try shows what trips over any
