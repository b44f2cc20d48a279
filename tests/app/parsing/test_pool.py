"""Laws of the parser processes: confined, bounded, reaped, and never trusted."""

from __future__ import annotations

import asyncio
import math
import os
import sys
import tempfile
import time
from array import array
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any, BinaryIO

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.errors import InvalidRequest, MalformedBody, ServiceBusy
from app.owner_turns import OwnerTurns
from app.parsing import pool
from app.parsing.confinement import Limits
from app.parsing.frame import MARK, BadFrame, pack, unpack
from app.parsing.pool import ParserPool

FileOf = Callable[[bytes], BinaryIO]
FLIGHT = b"t,sweep_left,sweep_right,phi,theta,psi\n0,0,0,0,0,0\n1,0,0,0,0,0\n"
TEXT = st.text(st.characters(exclude_characters="\x00", exclude_categories=["Cs"]), max_size=5)
NUMBERS = st.floats() | st.integers(-(2**60), 2**60)
DOCUMENTS = st.recursive(
    st.none() | st.booleans() | NUMBERS | TEXT,
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.dictionaries(TEXT, inner, max_size=4)
        | st.lists(NUMBERS, min_size=64, max_size=70)
        | st.lists(st.floats() | st.none() | TEXT, min_size=64, max_size=66)
    ),
    max_leaves=8,
)


@pytest.fixture
def file_of() -> Iterator[FileOf]:
    """Makes open files with a content."""
    with ExitStack() as stack:

        def made(content: bytes) -> BinaryIO:
            file = stack.enter_context(tempfile.TemporaryFile())
            file.write(content)
            return file

        yield made


def reader(**limits: int) -> ParserPool:
    """A pool of one."""
    return ParserPool(OwnerTurns(1, 1), Limits(**limits))


def same(left: Any, right: Any) -> bool:
    """Equality that knows NaN, and that 1 and 1.0 are one number among floats."""
    if isinstance(left, float) and isinstance(right, (int, float)) and math.isnan(left):
        return math.isnan(right)
    if isinstance(left, dict):
        return left.keys() == right.keys() and all(same(left[key], right[key]) for key in left)
    if isinstance(left, list):
        return len(left) == len(right) and all(map(same, left, right))
    return bool(left == right)


@given(DOCUMENTS)
def test_frames_carry_every_document(document: Any) -> None:
    """What was packed is unpacked: numbers to the last bit, and what stands between them in its place."""
    assert same(document, unpack(pack(document)))


def test_integers_stay_integers() -> None:
    """A list of integers comes back as one; arrays come back as lists."""
    assert unpack(pack([*range(100)])) == [*range(100)]
    assert all(type(item) is int for item in unpack(pack([*range(100)])))
    assert unpack(pack({"a": array("d", [1.0])})) == {"a": [1.0]}


@given(st.binary(max_size=60) | st.binary(max_size=60).map(lambda tail: pack([0.5] * 70)[:40] + tail))
def test_no_bytes_break_the_reader_of_frames(frame: bytes) -> None:
    """Whatever a parser that was taken over writes is a JSON value or no frame."""
    try:
        unpack(frame)
    except BadFrame:
        return


def test_frames_that_lie_are_refused() -> None:
    """Lengths and places that are not there, and more text than numbers."""
    honest = pack({"a": [0.5] * 100})
    for frame in (honest + b"x", honest[:-1], honest.replace(b'"\\u0000":0', b'"\\u0000":7')):
        with pytest.raises(BadFrame):
            unpack(frame)
    with pytest.raises(BadFrame):
        pack("x" * 5_000_000)
    assert MARK == "\x00"


def test_a_flight_is_read(file_of: FileOf) -> None:
    """Columns by their standard names."""
    columns = asyncio.run(reader().flight("alpha", "csv", file_of(FLIGHT), "/file"))
    assert columns.values["t"] == [0.0, 1.0]


def test_faults_come_with_their_place(file_of: FileOf) -> None:
    """Pointers into the file."""
    with pytest.raises(InvalidRequest) as caught:
        asyncio.run(reader().flight("alpha", "csv", file_of(FLIGHT.replace(b"1,0,", b"1,x,")), "/file"))
    assert caught.value.pointer == "/file/1/sweep_left"


@pytest.mark.slow
def test_a_million_keys_and_a_deep_nest_are_reported(file_of: FileOf) -> None:
    """Bodies that are costly to parse are refused in the words of the parser."""
    many = b"{" + b",".join(b'"%d":1' % number for number in range(1_000_000)) + b"}"
    for body, words in ((many, "more than 100 fields"), (b"[" * 99_999, "nested")):
        with pytest.raises(MalformedBody, match=words):
            asyncio.run(reader().json_document("alpha", file_of(body)))


def played(monkeypatch: pytest.MonkeyPatch, code: str) -> None:
    """Let every parser be this program instead."""
    real = pool.subprocess.Popen

    def popen(_command: list[str], **options: Any) -> Any:
        return real([sys.executable, "-c", code], **options)

    monkeypatch.setattr(pool.subprocess, "Popen", popen)


def no_child_left() -> bool:
    """Every child of this process was reaped."""
    children = Path(f"/proc/self/task/{os.getpid()}/children").read_text().split()
    states = [Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] for pid in children]
    return "Z" not in states


@pytest.mark.parametrize(
    ("code", "words"),
    [
        ("import time; time.sleep(60)", "too long"),
        ("import signal; signal.signal(signal.SIGTERM, signal.SIG_IGN)\nwhile True: pass", "too long"),
        ("import os, time; os.close(1); time.sleep(60)", "too long"),
        ("print('hello')", "crashed"),
        ("import os; os.abort()", "crashed"),
        ("import sys\nwhile True: sys.stdout.write('x' * 100000)", "crashed"),
        ("import sys; sys.exit(3)", "crashed"),
    ],
)
def test_whatever_a_parser_does_it_is_ended_and_reaped(
    monkeypatch: pytest.MonkeyPatch, code: str, words: str, file_of: FileOf
) -> None:
    """Sleeping, spinning, babbling, dying: reported in a sentence in time, and no process is left."""
    played(monkeypatch, code)
    start = time.monotonic()
    with pytest.raises(InvalidRequest, match=words):
        asyncio.run(reader(wall_s=1).flight("alpha", "csv", file_of(FLIGHT), "/file"))
    assert time.monotonic() - start < 20.0
    assert no_child_left()


def test_no_secret_reaches_a_parser(monkeypatch: pytest.MonkeyPatch, file_of: FileOf) -> None:
    """Its environment is made from nothing, and it has no open file but the three."""
    monkeypatch.setenv("MORPHID_DATABASE_URL", "postgresql://secret")
    monkeypatch.setenv("MORPHID_API_KEY", "secret")
    played(
        monkeypatch,
        "import os, sys; from app.parsing.frame import pack\n"
        "seen = [*os.environ, *os.environ.values(), *os.listdir('/proc/self/fd')]\n"
        "found = {'columns': {'seen': seen}, 'candidates': {}, 'channels': {}, 'unreadable': {}}\n"
        "sys.stdout.buffer.write(pack(found))",
    )
    answer: Any = asyncio.run(reader().flight("alpha", "csv", file_of(FLIGHT), "/file"))
    seen = answer.values["seen"]
    assert not any("secret" in word or word.startswith("MORPHID") for word in seen)
    assert {word for word in seen if word.isdigit() and len(word) < 4} <= {"0", "1", "2", "3"}


def test_limits_hold_inside_a_parser(monkeypatch: pytest.MonkeyPatch, file_of: FileOf) -> None:
    """Memory, files and time are bounded when the first byte is read."""
    played(
        monkeypatch,
        "import os, resource, sys; from app.parsing.frame import pack\n"
        "from app.parsing.confinement import Limits, confine, confine_time\n"
        "confine_time(Limits()); confine(Limits())\n"
        "found = {n: resource.getrlimit(getattr(resource, 'RLIMIT_' + n)) for n in"
        " ('DATA', 'AS', 'CPU', 'FSIZE', 'NOFILE', 'NPROC', 'CORE')}\n"
        "try: bytearray(2**30); found['got'] = True\n"
        "except MemoryError: found['got'] = False\n"
        "read = {'columns': found, 'candidates': {}, 'channels': {}, 'unreadable': {}}\n"
        "sys.stdout.buffer.write(pack(read))",
    )
    answer: Any = asyncio.run(reader().flight("alpha", "csv", file_of(FLIGHT), "/file"))
    found = answer.values
    assert found["DATA"] == [Limits().memory_bytes] * 2
    assert found["CPU"] == [Limits().cpu_s] * 2
    assert found["FSIZE"] == found["NPROC"] == found["CORE"] == [0, 0]
    assert found["NOFILE"] == [64, 64]
    assert found["got"] is False


def test_too_many_wait_in_vain(monkeypatch: pytest.MonkeyPatch, file_of: FileOf) -> None:
    """One at a time; a request that waits too long is refused as busy, and its turn is given back."""
    played(monkeypatch, "import time; time.sleep(60)")
    parsers = ParserPool(OwnerTurns(1, 1), Limits(wall_s=1), queue_s=0.2)

    async def crowd() -> list[Any]:
        calls = [parsers.flight("alpha", "csv", file_of(FLIGHT), "/file") for _ in range(4)]
        found = await asyncio.gather(*calls, return_exceptions=True)
        try:
            await parsers.flight("alpha", "csv", file_of(FLIGHT), "/file")
        except InvalidRequest as error:
            found.append(error)
        return found

    kinds = [type(item) for item in asyncio.run(crowd())]
    assert kinds.count(ServiceBusy) == 3
    assert kinds.count(InvalidRequest) == 2


def test_gaps_take_no_text() -> None:
    """A million nulls among numbers come back in their places."""
    column = [None if row % 3 else 0.5 * row for row in range(1_500_000)]
    assert unpack(pack({"p_rad_s": column})) == {"p_rad_s": column}
