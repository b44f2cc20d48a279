"""The stage runner: what is kept, what is recomputed, and where it continues."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from morphcore.errors import InvalidInput
from morphcore.paper.stages import Document, Progress, Results, Stage, StageRunner, Work, part

STEPS = 4


class Count:
    """Work that counts to STEPS and remembers from where it began; its checkpoint is the count."""

    def __init__(self) -> None:
        self.began_at: list[int] = []

    def __call__(self, needed: Results, checkpoint: bytes | None) -> Work:
        """Count."""
        done = int(checkpoint or b"0")
        self.began_at.append(done)
        for n in range(done + 1, STEPS + 1):
            yield Progress(n / STEPS, f"counted to {n}", str(n).encode())
        return {"counted": STEPS, "seen": sorted(needed)}


def chain() -> tuple[dict[str, Count], tuple[Stage, ...]]:
    """Give three stages: b needs a, c needs nothing."""
    works = {name: Count() for name in "abc"}
    stages = (
        Stage("a", "first", works["a"], {"size": 1}),
        Stage("b", "second", works["b"], {"size": 1}, needs=("a",), expected_s=2.0),
        Stage("c", "third", works["c"], {"size": 1}),
    )
    return works, stages


def worked_off(stages: tuple[Stage, ...], folder: Path) -> StageRunner:
    """Give a runner after all its stages."""
    runner = StageRunner(stages, folder)
    list(runner.steps())
    return runner


def test_what_is_there_is_not_done_again(tmp_path: Path) -> None:
    """A second runner finds all results in the folder and does no work; the results are the same."""
    works, stages = chain()
    first = worked_off(stages, tmp_path)
    second = worked_off(stages, tmp_path)
    assert [work.began_at for work in works.values()] == [[0], [0], [0]]
    assert second.results == first.results
    assert first.results["b"] == {"counted": STEPS, "seen": ["a"]}
    assert all(done.reused for done in second.finished.values())
    assert not list(tmp_path.glob("*.checkpoint"))


def test_a_changed_input_makes_anew_what_depends_on_it(tmp_path: Path) -> None:
    """New inputs of a stage: it and what needs it run again, the others stay."""
    works, stages = chain()
    worked_off(stages, tmp_path)
    changed = (replace(stages[0], inputs={"size": 2}), *stages[1:])
    again = worked_off(changed, tmp_path)
    assert {name: len(work.began_at) for name, work in works.items()} == {"a": 2, "b": 2, "c": 1}
    assert [done.reused for done in again.finished.values()] == [False, False, True]


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b'{"key": "x"}', b"\xff\xfe"])
def test_a_damaged_result_is_made_anew(tmp_path: Path, content: bytes) -> None:
    """A file that is no result, whatever it is, is replaced."""
    works, stages = chain()
    worked_off(stages, tmp_path)
    (tmp_path / "c.json").write_bytes(content)
    assert worked_off(stages, tmp_path).results["c"]["counted"] == STEPS
    assert works["c"].began_at == [0, 0]


def interrupted(stages: tuple[Stage, ...], folder: Path, after: int, seconds: Iterator[float]) -> None:
    """Run some steps, then stop as Ctrl-C does."""
    steps = StageRunner(stages, folder, clock=lambda: next(seconds)).steps()
    for _ in range(after):
        next(steps)
    steps.close()  # what an exception in the caller does to it


def test_an_interrupted_stage_goes_on_from_its_checkpoint(tmp_path: Path) -> None:
    """Stopped after three of four steps it does the last one only, and the seconds of both runs add up."""
    works, stages = chain()
    interrupted(stages, tmp_path, 3, iter([0.1 * i for i in range(100)]))
    assert not (tmp_path / "a.json").exists()
    done = worked_off(stages, tmp_path).finished["a"]
    assert works["a"].began_at == [0, 3]
    assert done.result["counted"] == STEPS
    assert done.wall_s > 0.2, "the second run takes next to nothing: this is the first one's"


def test_a_killed_run_finds_a_recent_checkpoint(tmp_path: Path) -> None:
    """Checkpoints are written on the way, not only when the runner is stopped."""
    works, stages = chain()
    hours = iter([3600.0 * i for i in range(100)])
    steps = StageRunner(stages, tmp_path, clock=lambda: next(hours)).steps()
    for _ in range(2):
        next(steps)
    kept = (tmp_path / "a.checkpoint").read_bytes()  # and now the process dies: nothing is closed
    worked_off(stages, tmp_path)
    assert kept.endswith(b"\n2")
    assert works["a"].began_at == [0, 2]


def test_a_checkpoint_of_other_inputs_is_not_used(tmp_path: Path) -> None:
    """Changed inputs begin at the beginning, though a checkpoint of the old ones lies there."""
    works, stages = chain()
    interrupted(stages, tmp_path, 3, iter([0.1 * i for i in range(100)]))
    worked_off((replace(stages[0], inputs={"size": 2}), *stages[1:]), tmp_path)
    assert works["a"].began_at == [0, 0]


def test_progress_rises_to_one(tmp_path: Path) -> None:
    """Fractions never fall; each stage has its expected share; the last is 1."""
    _, stages = chain()
    seen = [(stage.name, progress.fraction) for stage, progress in StageRunner(stages, tmp_path).steps()]
    fractions = [fraction for _, fraction in seen]
    assert fractions == sorted(fractions)
    assert fractions[-1] == pytest.approx(1.0)
    assert max(fraction for stage, fraction in seen if stage == "a") == pytest.approx(0.25)
    assert max(fraction for stage, fraction in seen if stage == "b") == pytest.approx(0.75)


def test_stages_out_of_order_are_refused(tmp_path: Path) -> None:
    """A stage that needs a later one, or none at all, is said before any work begins."""
    _, (a, b, _) = chain()
    with pytest.raises(InvalidInput, match="b needs a"):
        StageRunner((b, a), tmp_path)


def test_the_file_tells_where_it_was_made(tmp_path: Path) -> None:
    """Machine and inputs are stored with the result; the machine is not part of the key."""
    _, stages = chain()
    first = StageRunner(stages, tmp_path, where={"machine": "here"})
    list(first.steps())
    stored = json.loads((tmp_path / "a.json").read_text())
    assert stored["where"] == {"machine": "here"}
    assert stored["inputs"] == {"size": 1}
    assert StageRunner(stages, tmp_path, where={"machine": "there"}).key("a") == first.key("a")


def test_work_as_a_part_of_other_work() -> None:
    """Its fractions lie in its share, its checkpoints do not get out, its result does."""

    def whole() -> Work:
        result = yield from part(Count()({}, None), 0.5, 0.25)
        return {"inner": result}

    reported: list[Progress] = []
    results: list[Document] = []

    def observed() -> Iterator[Progress]:
        results.append((yield from whole()))

    reported += observed()
    assert results[0]["inner"]["counted"] == STEPS
    assert [progress.fraction for progress in reported] == [0.5625, 0.625, 0.6875, 0.75]
    assert {progress.checkpoint for progress in reported} == {None}
