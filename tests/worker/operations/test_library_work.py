"""The adapter between the library's searches and the runner, with a search that counts."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass

import pytest

from morphcore.errors import InvalidInput
from morphcore.search.checkpoint import UnreadableCheckpoint
from morphcore.stopping import Interrupted, check_stop
from worker.attempt import error_document
from worker.operations import Document, Stop
from worker.operations.library_work import BEGUN_AGAIN, SearchWork


@dataclass(frozen=True)
class Counted:
    """A result: how far the count came."""

    count: int

    def to_document(self) -> Document:
        """Give it as JSON."""
        return {"count": self.count}


@dataclass(frozen=True)
class CountStep:
    """One step of the count."""

    checkpoint: bytes
    fraction: float
    phase: str = "count"
    generation: int = 1
    best_cost: float = 0.5
    flights: int = 7
    message: str = "counting"


class Count:
    """Counts to five, its state in the checkpoint."""

    def steps(self, checkpoint: bytes | None = None, stop: Stop | None = None) -> Iterator[CountStep]:
        """Count on."""
        if checkpoint == b"old":
            raise UnreadableCheckpoint("of another version")
        for number in range(int(checkpoint or b"0") + 1, 6):
            if stop is not None and stop():
                raise Interrupted
            yield CountStep(str(number).encode(), number / 5)

    def result(self, checkpoint: bytes) -> Counted:
        """Give the count; nobody likes three."""
        if checkpoint == b"3":
            raise InvalidInput("three", pointer="/count", hint="count on")
        return Counted(int(checkpoint))

    best_so_far = result


def work() -> SearchWork:
    """Count as the runner sees it."""
    return SearchWork(Count(), lambda result, document: {"n.txt": f"{result.count} {document}".encode()})


def test_a_search_goes_on_from_its_checkpoint() -> None:
    """Steps carry the library's progress and checkpoint; begun from one, the rest follows."""
    whole = list(work().steps(None, lambda: False))
    assert [step.checkpoint for step in whole] == [b"1", b"2", b"3", b"4", b"5"]
    assert whole[0].progress == {
        "fraction": 0.2,
        "generation": 1,
        "best_cost": 0.5,
        "flights": 7,
        "phase": "count",
        "message": "counting",
    }
    assert list(work().steps(b"3", lambda: False)) == whole[3:]


def test_a_checkpoint_of_another_version_is_begun_again_with_a_note() -> None:
    """A worker of a new version does not fail the jobs of the one before: it repeats them and says so."""
    whole, again = (list(work().steps(checkpoint, lambda: False)) for checkpoint in (None, b"old"))
    assert [step.checkpoint for step in again] == [step.checkpoint for step in whole]
    assert {step.progress["message"] for step in again} == {f"counting{BEGUN_AGAIN}"}


def test_the_result_comes_as_a_file_too() -> None:
    """An outcome holds document, `result.json` and the operation's files; a best so far the first two."""
    outcome = work().outcome(b"5")
    assert outcome.document == {"count": 5} == json.loads(outcome.artifacts["result.json"])
    assert outcome.artifacts["n.txt"] == b"5 {'count': 5}"
    best = work().best_so_far(b"2")
    assert best.document == {"count": 2}
    assert set(best.artifacts) == {"result.json"}


def test_a_stop_is_an_interruption() -> None:
    """The library's own signal reaches the runner."""
    with pytest.raises(Interrupted):
        list(work().steps(None, lambda: True))


def test_a_refusal_keeps_its_words() -> None:
    """Code, sentence, pointer and hint of the library's error reach the user."""
    with pytest.raises(InvalidInput) as refused:
        work().outcome(b"3")
    assert error_document(refused.value, "job_1") == {
        "code": "invalid_input",
        "detail": "three",
        "pointer": "/count",
        "hint": "count on",
    }


def test_a_stop_between_two_pictures_is_respected() -> None:
    """A cancel while plots are drawn waits for one plot, not for all of them."""
    drawn: list[str] = []

    def files(_result: Counted, _document: Document) -> dict[str, bytes]:
        for name in ("a", "b", "c"):
            check_stop()  # as every picture and every chunk of a flight does
            drawn.append(name)
        return {}

    searched = SearchWork(Count(), files)
    *_, last = searched.steps(None, lambda: bool(drawn))
    with pytest.raises(Interrupted):
        searched.outcome(last.checkpoint)
    assert drawn == ["a"]
    assert searched.best_so_far(last.checkpoint).document == {"count": 5}
