"""Long work in stages whose results are files: finished stages are not run again.

The key of a stage covers everything that determines its result: its own inputs, and the keys of the stages
that it needs. Its result is kept as long as the key is unchanged; when inputs change, the stage and
everything that depends on it run again. An interrupted stage continues from its last checkpoint.
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

FORMAT = 1  # version of the files; other versions are recomputed
CHECKPOINT_EVERY_S = 2.0


@dataclass(frozen=True)
class Progress:
    """Progress of a stage.

    fraction : 0..1. checkpoint : state from which it can continue; None keeps the previous one.
    """

    fraction: float
    message: str = ""
    checkpoint: bytes | None = None


Work = Generator[Progress, None, Document]


def part(work: Work, done: float, share: float) -> Work:
    """Work as a part of another: fractions run from ``done`` over ``share``; checkpoints pass unchanged."""
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
    name : also the name of its file. title : for display.
    inputs : JSON-able; with the results of the stages in ``needs``, these determine the result.
    run : does the work, given the needed results and its own checkpoint (or None); reports progress and
    returns a JSON-able result, never None.
    expected_s : approximate duration, for the displayed progress.
    """

    name: str
    title: str
    run: Callable[[Results, bytes | None], Work]
    inputs: Document = field(default_factory=dict)
    needs: tuple[str, ...] = ()
    expected_s: float = 1.0


@dataclass(frozen=True)
class Finished:
    """A stage's result and its origin.

    wall_s : time spent on it, over all runs. finished_at : UTC. where : the machine, as passed to the runner.
    reused : whether it already existed.
    """

    key: str
    result: Document
    wall_s: float
    finished_at: str
    where: Document
    reused: bool = False


class StageRunner:
    """Runs stages in order.

    Parameters
    ----------
    stages : each needs only earlier ones.
    folder : of the results; created if necessary.
    where : stored with each result: the machine that produced it. It is not part of the key.

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
        """Run the unfinished stages; yield the current stage, and the overall progress by expected times.

        An interrupted stage keeps its last checkpoint.
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
            return None  # missing or damaged: computed again
        return known if known.key == self.key(stage.name) else None


@dataclass(frozen=True)
class _Checkpoint:
    """The file of an unfinished stage: its key, the seconds spent so far, and the state."""

    path: Path
    key: str

    def read(self) -> tuple[bytes | None, float]:
        """The state and the seconds spent on it; (None, 0) if there is none for this key."""
        try:
            key, spent, state = self.path.read_bytes().split(b"\n", 2)
            spent_s = float(spent)
        except (OSError, ValueError):
            return None, 0.0
        return (state, spent_s) if key.decode("ascii", "replace") == self.key else (None, 0.0)

    def write(self, state: bytes, spent_s: float) -> None:
        """Store a state."""
        _replace(self.path, b"%s\n%r\n%s" % (self.key.encode(), spent_s, state))


def _replace(path: Path, content: bytes) -> None:
    """Replace a file atomically: a killed process leaves either the old or the new one."""
    partial = path.with_suffix(path.suffix + ".part")
    partial.write_bytes(content)
    partial.replace(path)
