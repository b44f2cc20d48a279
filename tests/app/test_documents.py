"""Laws of stored documents and identifiers."""

from __future__ import annotations

import json
import math

from hypothesis import given
from hypothesis import strategies as st

from app.documents import json_bytes, packed, sealed, unpacked
from app.identifiers import new_identifier

DOCUMENTS = st.dictionaries(
    st.text(), st.floats(allow_nan=False, allow_infinity=False) | st.integers() | st.text()
)


@given(DOCUMENTS)
def test_packing_loses_nothing(document: dict[str, object]) -> None:
    """What is unpacked is what was packed."""
    assert unpacked(packed(document)) == document


@given(DOCUMENTS)
def test_digest_ignores_the_order_of_keys(document: dict[str, object]) -> None:
    """The same document written in another order has the same digest."""
    assert sealed(dict(reversed(document.items()))) == sealed(document)


def test_text_is_json_whatever_the_numbers() -> None:
    """NaN and infinity become null at any depth."""
    document = {"a": [math.nan, {"b": -math.inf}], "c": (1.5, True)}
    assert json.loads(json_bytes(document)) == {"a": [None, {"b": None}], "c": [1.5, True]}


def test_identifiers_are_unique_and_sort_by_time() -> None:
    """Ten thousand identifiers differ, and their time parts never fall."""
    made = [new_identifier("job") for _ in range(10_000)]
    assert len(set(made)) == len(made)
    times = [identifier[4:14] for identifier in made]
    assert times == sorted(times)
