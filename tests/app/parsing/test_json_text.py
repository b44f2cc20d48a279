"""Laws of reading JSON bodies."""

from __future__ import annotations

import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.errors import MalformedBody
from app.parsing.json_text import MAX_KEYS, parse_json

TEXT = st.text(st.characters(exclude_characters="\x00", exclude_categories=["Cs"]))
JSON_VALUES = st.recursive(
    st.none() | st.booleans() | st.floats(allow_nan=False) | st.integers(-(2**53), 2**53) | TEXT,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(TEXT, inner, max_size=4),
    max_leaves=20,
)


@given(JSON_VALUES)
def test_reads_what_was_written(value: object) -> None:
    """Every JSON value comes back as it was written."""
    assert parse_json(json.dumps(value).encode()) == value


def test_not_a_number_is_left_to_the_schema() -> None:
    """NaN and overflowing numbers pass, so that the schema can name their field."""
    first, second = parse_json(b"[NaN, 1e400]")
    assert math.isnan(first)
    assert math.isinf(second)


@pytest.mark.parametrize(
    ("body", "words"),
    [
        (b'{"a": 1,}', "line 1"),
        (b"", "no body"),
        (b"[" * 99_999, "nested"),
        (b'{"a":' * 9_000 + b"1" + b"}" * 9_000, "nested"),
        (b'{"a": 1, "b": {"c": 1, "c": 2}}', "'c' appears twice"),
        (b"[" * 200_000, "lists"),
        (b'"\xff\xfe"', "UTF-8"),
        ("{}".encode("utf-8-sig"), "byte order mark"),
        ("{}".encode("utf-16"), "UTF-16"),
        ("{}".encode("utf-16-be"), "UTF-16"),
        ("{}".encode("utf-32"), "UTF-16"),
        (rb'{"a": "\ud800"}', "surrogate"),
        (rb'{"\uDC00": 1}', "surrogate"),
        (rb'["a\u0000"]', "null character"),
        (b"9" * 5000, "Not JSON"),
        (json.dumps({str(i): i for i in range(MAX_KEYS + 1)}).encode(), "fields"),
    ],
)
def test_bad_text_is_refused_in_words(body: bytes, words: str) -> None:
    """Whatever is not a sensible JSON text is refused with a sentence and a way out."""
    with pytest.raises(MalformedBody, match=words) as caught:
        parse_json(body)
    assert caught.value.hint


def test_a_text_that_cannot_be_stored_is_pointed_to() -> None:
    """The pointer leads to the text; a whole pair and an escaped backslash are nothing to complain of."""
    with pytest.raises(MalformedBody) as caught:
        parse_json(rb'{"a/b": [1, {"c": "x\ud800"}]}')
    assert caught.value.pointer == "/a~1b/1/c"
    assert parse_json(rb'["\ud83d\ude00", "\\u0000", "\\ud800"]') == ["\U0001f600", "\\u0000", "\\ud800"]
