"""States as bytes: exactly what they were, of one version, and nothing but plain values."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from morphcore.search.checkpoint import UnreadableCheckpoint, pack, stored, unpack
from morphcore.search.run import SearchState


def test_plain_values_come_back_exactly() -> None:
    """Types, shapes, bits of numbers, infinities and empty arrays survive."""
    value = {
        "numbers": (1, -0.0, 0.1 + 0.2, float("inf"), True, None, 2**80),
        "arrays": [np.arange(6.0).reshape(2, 3), np.zeros((0, 4)), np.array([], dtype=np.int64)],
        "texts": {"a": "ä", "bytes": b"\x00\xff"},
        "state": SearchState(budget_s=1.5, solver={"rows": (np.array([1e-300]),)}),
    }
    again = unpack(pack(value, "v"), "v", dict)
    assert repr(again) == repr(value)
    assert again["state"].solver["rows"][0].tobytes() == value["state"].solver["rows"][0].tobytes()  # type: ignore[attr-defined]


def test_other_versions_values_and_bytes_are_refused() -> None:
    """With one error that says to start again, whatever is wrong."""
    good = pack(SearchState(), "version 1")
    for bad in (b"", b"nonsense", good[: len(good) // 2], pack({}, "version 1")):
        with pytest.raises(UnreadableCheckpoint):
            unpack(bad, "version 1", SearchState)
    with pytest.raises(UnreadableCheckpoint, match="version 1"):
        unpack(good, "version 2", SearchState)


def test_only_what_is_marked_is_stored() -> None:
    """A dataclass that nobody marked is an error where it is written, and a name belongs to one class."""

    @dataclass(frozen=True)
    class Other:
        number: int = 1

    with pytest.raises(TypeError, match="Other"):
        pack(Other(), "v")
    with pytest.raises(TypeError, match="SearchState"):
        stored(type("SearchState", (), {}))
