"""Long work in stages whose results are files: what is there already is not done again.

A stage is known by a key of everything that decides its result: its own inputs, and the keys of the stages
that it needs. Its result stays as long as the key does; when the inputs change it is made anew, and so is
whatever needs it. A stage that is interrupted goes on from its last checkpoint.
"""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from morphcore.errors import InvalidInput

Document = dict[str, Any]
Results = Mapping[str, Document]
Clock = Callable[[], float]

FORMAT = 1  # of the files; others are made anew
CHECKPOINT_EVERY_S = 2.0


@dataclass(frozen=True)
class Progress:
    """How far a stage has come.

    fraction : 0..1. checkpoint : from where it can go on; None leaves the last one as it is.
    """

    fraction: float
    message: str = ""
    checkpoint: bytes | None = None


Work = Generator[Progress, None, Document]


def part(work: Work, done: float, share: float) -> Work:
    """Work as a part of another: its fractions from ``done`` over ``share``, its checkpoints its own."""
    while True:
        try:
            progress = next(work)
        except StopIteration as end:
            result: Document = end.value
            return result
        yield Progress(done + share * progress.fraction, progress.message)


@dataclass(frozen=True)
class Stage:
    """One piece of long work.

    Attributes
    ----------
    name : also of its file. title : for people.
    inputs : JSON-able; with the results of the stages ``needs`` it decides the result.
    run : does the work, given the results needed and a checkpoint of its own (or None); reports progress and
        returns a JSON-able result, never None.
    expected_s : how long it takes about, for the progress that is shown.
    """

    name: str
    title: str
    run: Callable[[Results, bytes | None], Work]
    inputs: Document = field(default_factory=dict)
    needs: tuple[str, ...] = ()
    expected_s: float = 1.0


@dataclass(frozen=True)
class Finished:
    """A stage's result and how it came about.

    wall_s : time spent on it, in all runs that it took. finished_at : UTC. where : the machine, as the runner
    got it. reused : whether it was there already.
    """

    key: str
    result: Document
    wall_s: float
    finished_at: str
    where: Document
    reused: bool = False


class StageRunner:
    """Works stages off in their order.

    Parameters
    ----------
    stages : each needs only earlier ones.
    folder : of the results; it is made if need be.
    where : kept with each result: the machine that it was made on. It is not part of the key.

    Raises
    ------
    InvalidInput : a stage needs one that does not come before it.
    """

    def __init__(
        self,
        stages: Sequence[Stage],
        folder: Path,
        *,
        where: Document | None = None,
        clock: Clock = time.monotonic,
    ) -> None:
        self.stages = tuple(stages)
        self.folder = folder
        self.finished: dict[str, Finished] = {}
        self._where = where or {}
        self._clock = clock
        self._keys: dict[str, str] = {}
        for stage in self.stages:
            self._keys[stage.name] = self._key(stage)

    @property
    def results(self) -> Results:
        """Results of all stages finished so far."""
        return {name: done.result for name, done in self.finished.items()}

    def key(self, name: str) -> str:
        """The key of a stage."""
        return self._keys[name]

    def steps(self) -> Generator[tuple[Stage, Progress]]:
        """Do what is not done yet; yields the stage at work, and the progress of all by their expected times.

        A step that is interrupted leaves its last checkpoint behind.
        """
        self.folder.mkdir(parents=True, exist_ok=True)
        total = sum(stage.expected_s for stage in self.stages)
        before = 0.0
        for stage in self.stages:
            known = self._load(stage)
            if known is None:
                for progress in self._work(stage):
                    share = (before + progress.fraction * stage.expected_s) / total
                    yield stage, Progress(share, progress.message)
            else:
                self.finished[stage.name] = known
            before += stage.expected_s
            how = "done" if known is None else "was there"
            yield stage, Progress(before / total, how)

    # one stage

    def _work(self, stage: Stage) -> Iterator[Progress]:
        key = self.key(stage.name)
        place = _Checkpoint(self.folder / f"{stage.name}.checkpoint", key)
        state, spent_s = place.read()
        begin = last_kept = self._clock()
        needed = {name: self.finished[name].result for name in stage.needs}
        work = stage.run(needed, state)
        result: Document | None = None
        try:
            while True:
                try:
                    progress = next(work)
                except StopIteration as end:
                    result = end.value
                    break
                state = state if progress.checkpoint is None else progress.checkpoint
                if state is not None and self._clock() - last_kept >= CHECKPOINT_EVERY_S:
                    place.write(state, spent_s + self._clock() - begin)
                    last_kept = self._clock()
                yield replace(progress, checkpoint=None)
        finally:
            if result is None and state is not None:  # interrupted
                place.write(state, spent_s + self._clock() - begin)
        wall_s, finished_at = spent_s + self._clock() - begin, datetime.now(UTC).isoformat(timespec="seconds")
        done = Finished(key, result or {}, wall_s, finished_at, self._where)
        document = {"stage": stage.name, "title": stage.title, "inputs": stage.inputs, **vars(done)}
        _replace(self._file(stage), json.dumps(document, indent=1, allow_nan=False).encode())
        self.finished[stage.name] = done
        place.path.unlink(missing_ok=True)

    # files

    def _file(self, stage: Stage) -> Path:
        return self.folder / f"{stage.name}.json"

    def _key(self, stage: Stage) -> str:
        missing = [name for name in stage.needs if name not in self._keys]
        if missing:
            raise InvalidInput(
                f"the stage {stage.name} needs {', '.join(missing)}, which does not come before it",
                hint="put the stages in order",
            )
        inputs = {
            "format": FORMAT,
            "stage": stage.name,
            "inputs": stage.inputs,
            "needs": {name: self._keys[name] for name in stage.needs},
        }
        return hashlib.sha256(json.dumps(inputs, sort_keys=True, allow_nan=False).encode()).hexdigest()

    def _load(self, stage: Stage) -> Finished | None:
        try:
            stored = json.loads(self._file(stage).read_text(encoding="utf-8")) | {"reused": True}
            known = Finished(**{each.name: stored[each.name] for each in fields(Finished)})
        except (OSError, ValueError, KeyError, TypeError):
            return None  # not there, or damaged: made anew
        return known if known.key == self.key(stage.name) else None


@dataclass(frozen=True)
class _Checkpoint:
    """The file of an unfinished stage: its key, the seconds spent so far, and the state."""

    path: Path
    key: str

    def read(self) -> tuple[bytes | None, float]:
        """The state and the seconds spent on it; (None, 0) where there is none for this key."""
        try:
            key, spent, state = self.path.read_bytes().split(b"\n", 2)
            spent_s = float(spent)
        except (OSError, ValueError):
            return None, 0.0
        return (state, spent_s) if key.decode("ascii", "replace") == self.key else (None, 0.0)

    def write(self, state: bytes, spent_s: float) -> None:
        """Keep a state."""
        _replace(self.path, b"%s\n%r\n%s" % (self.key.encode(), spent_s, state))


def _replace(path: Path, content: bytes) -> None:
    """Write a file so that a killed process leaves the old one or the new one, never half of one."""
    partial = path.with_suffix(path.suffix + ".part")
    partial.write_bytes(content)
    partial.replace(path)
