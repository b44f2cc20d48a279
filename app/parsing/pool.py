"""The parser processes of an API process: one per file, a few at once, always killed and reaped."""

from __future__ import annotations

import asyncio
import json
import logging
import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import astuple
from pathlib import Path
from typing import Any, BinaryIO

from fastapi.concurrency import run_in_threadpool

from app.errors import InvalidRequest, MalformedBody, ServiceBusy, UnsupportedMediaType
from app.owner_turns import OwnerTurns
from app.parsing.child import BODY
from app.parsing.confinement import Limits
from app.parsing.frame import BadFrame, unpack
from app.parsing.json_text import token
from morphdata.faults import Fault
from morphdata.samplefiles.columns import FlightColumns
from morphdata.samplefiles.fault import TITLES, FileFault, as_sentence
from morphdata.samplefiles.flight import MAX_ROWS

ROOT = Path(__file__).resolve().parent.parent.parent
MAX_ANSWER_BYTES = 48 * 2**20  # three million numbers and the text around them
PIECE = 2**18
QUEUE_S = 30.0  # a client that waits longer should come again later
FORMAT_FAULTS = frozenset({"unknown_format", "needs_pyarrow", "needs_h5py", "needs_pyulog", "matlab_object"})

logger = logging.getLogger(__name__)


class _Unanswered(Exception):
    """The process ended or was ended without an answer; the argument is the reason."""


class ParserPool:
    """Starts parser processes; owners take turns.

    A request that waits for a process longer than `queue_s` is refused because the service is busy.
    """

    def __init__(self, turns: OwnerTurns, limits: Limits, queue_s: float = QUEUE_S) -> None:
        self._turns = turns
        self._queue_s = queue_s
        self._limits = limits

    async def json_document(self, owner: str, file: BinaryIO) -> Any:
        """Parse the JSON text in a file of this owner, as `parse_json` would."""
        try:
            answer = await self._read(owner, BODY, file, {})
        except _Unanswered as why:
            raise MalformedBody(f"The body cannot be read: {why}.", hint="Send less text.") from None
        if "malformed" in answer:
            raise MalformedBody(*answer["malformed"])
        return answer["document"]

    async def flight(
        self, owner: str, kind: str, file: BinaryIO, pointer: str, said: Mapping[str, Any] | None = None
    ) -> FlightColumns:
        """Read the columns of a flight, its channels and what could be drives, SI units, by standard names.

        Parameters
        ----------
        kind : str
            As `morphdata.samplefiles.reading.kind_of` returns it.
        file : binary file
            With a descriptor.
        pointer : str
            Where faults point to: ``{pointer}/{row}/{column}``.
        said : mapping of str to object
            What is declared about the file: arguments of `morphdata.samplefiles.declared.declared`, checked.
        """
        try:
            answer = await self._read(owner, kind, file, said or {})
        except _Unanswered as why:
            hint = "Send a plain file of time, drives and attitude only."
            raise InvalidRequest.of(
                [Fault("unreadable_file", f"The file cannot be read: {why}.", pointer, hint)]
            ) from None
        if "fault" in answer:
            raise refusal(FileFault(*answer["fault"]), pointer)
        unreadable = {name: FileFault(*words) for name, words in answer["unreadable"].items()}
        return FlightColumns(
            answer["columns"],
            candidates=answer["candidates"],
            unreadable=unreadable,
            channels=answer["channels"],
        )

    async def _read(self, owner: str, kind: str, file: BinaryIO, said: Mapping[str, Any]) -> dict[str, Any]:
        try:
            async with asyncio.timeout(self._queue_s):
                await self._turns.take(owner)
        except TimeoutError:
            raise ServiceBusy("Too many files are being read at the moment.") from None
        try:
            answer: dict[str, Any] = await run_in_threadpool(_answer_of, kind, file, self._limits, said)
        finally:
            self._turns.give_back(owner)
        return answer


def refusal(fault: FileFault, pointer: str) -> InvalidRequest | UnsupportedMediaType:
    """Convert a file's fault to an error of the request."""
    detail, hint = as_sentence(fault.detail), as_sentence(fault.hint)
    if fault.code in FORMAT_FAULTS:
        return UnsupportedMediaType(detail, pointer, hint)
    place = "".join(f"/{part}" for part in (fault.row, token(fault.title)) if part not in (None, ""))
    if fault.title and fault.row is None and fault.title != TITLES:
        place = f"/{token(fault.title)}"
    return InvalidRequest.of([Fault(fault.code, detail, f"{pointer}{place}", hint)])


def _answer_of(kind: str, file: BinaryIO, limits: Limits, said: Mapping[str, Any]) -> dict[str, Any]:
    """Run one process on `file` (any position: it is read from its beginning)."""
    file.flush()
    file.seek(0)
    os.lseek(file.fileno(), 0, os.SEEK_SET)
    words = [*map(str, astuple(limits)), str(MAX_ROWS), json.dumps(said)]
    command = [sys.executable, "-s", "-P", "-m", "app.parsing.child", kind, *words]
    started = time.monotonic()
    with subprocess.Popen(
        command,
        stdin=file.fileno(),
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env=_environment(),
        cwd="/",
        start_new_session=True,  # Ctrl-C goes to the parent only, and one signal ends all descendants
    ) as process:
        assert process.stdout is not None  # noqa: S101 - a pipe was requested
        try:
            frame = _drained(process.stdout, started + limits.wall_s)
            process.wait(max(0.1, started + limits.wall_s - time.monotonic()))
            found: dict[str, Any] = unpack(frame)
        except (BadFrame, TimeoutError, subprocess.TimeoutExpired) as error:
            exit_code = process.poll()  # None: it is alive, and is ended below
            logger.warning(
                "a parser of %s gave no answer: %s, exit %s", kind, type(error).__name__, exit_code
            )
            raise _Unanswered(_reason(error, exit_code)) from None
        finally:
            _end(process)
    if "failed" in found:
        raise _Unanswered(
            "it needs too much memory" if found["failed"] == "MemoryError" else "it is too complex"
        )
    return found


def _drained(pipe: Any, deadline: float) -> bytes:
    """Read a pipe to its end; raise BadFrame if it is too long, TimeoutError if it takes too long."""
    found = bytearray()
    ready = select.poll()
    ready.register(pipe, select.POLLIN | select.POLLHUP)
    while True:
        left_s = deadline - time.monotonic()
        if left_s <= 0 or not ready.poll(left_s * 1000):
            raise TimeoutError
        piece = os.read(pipe.fileno(), PIECE)
        if not piece:
            return bytes(found)
        found += piece
        if len(found) > MAX_ANSWER_BYTES:
            raise BadFrame("the reader's output is too large")


def _end(process: subprocess.Popen[bytes]) -> None:
    if process.poll() is None:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def _reason(error: Exception, exit_code: int | None) -> str:
    if isinstance(error, BadFrame) and exit_code not in (-signal.SIGXCPU, -signal.SIGKILL):
        return "its reader process crashed"
    return "reading it takes too long"


def _environment() -> dict[str, str]:
    """Environment without secrets, with single-threaded libraries and the system's allocator."""
    return {
        "PATH": os.defpath,
        "LC_ALL": "C.UTF-8",
        "PYTHONPATH": str(ROOT),
        "PYTHONDONTWRITEBYTECODE": "1",
        "OPENBLAS_NUM_THREADS": "1",
        "OMP_NUM_THREADS": "1",
        "ARROW_DEFAULT_MEMORY_POOL": "system",
        "ARROW_IO_THREADS": "1",
    }
