"""A swarm without numerics: birds whose costs are hashes, flown in parts that any worker may take."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from morphdata.faults import Interrupted, InvalidInput
from worker.operations import Begin, Document, Outcome, Step, Stop

Hook = Callable[[int, list[int]], None]


class Flock:
    """``request["birds"]`` numbers that move for ``request["generations"]`` by hashes of where they are.

    Parameters
    ----------
    request : also ``pause_s``, the duration of one bird's flight, and ``refuse_at``, a generation that fails.
    before_flight : called with a generation and a part of its birds before they fly.
    """

    def __init__(self, request: Document, before_flight: Hook | None = None) -> None:
        self.request = request
        self._before_flight = before_flight

    def steps(self, checkpoint: bytes | None, stop: Stop) -> Iterator[Step]:
        """Move on from the checkpoint."""
        if checkpoint is None:
            checkpoint = json.dumps({"generation": 0, "places": self._first(), "best": 2**63}).encode()
            yield self._step(checkpoint)
        while (parts := self.tasks(checkpoint, 1)) is not None:
            step = self.combine(checkpoint, [self.fly(part, stop) for part in parts], 0.0)
            checkpoint = step.checkpoint
            yield step

    def _first(self) -> list[int]:
        return [hashed(self.request.get("seed", 7), bird) for bird in range(self.request["birds"])]

    def tasks(self, checkpoint: bytes, max_parts: int) -> list[bytes] | None:
        """Give the places of the next generation in parts."""
        state = json.loads(checkpoint)
        if state["generation"] >= self.request["generations"]:
            return None
        count = len(state["places"])
        parts_made = min(max_parts, count)
        bounds = [part * count // parts_made for part in range(parts_made + 1)]
        parts = [state["places"][bounds[k] : bounds[k + 1]] for k in range(parts_made)]
        return [json.dumps([state["generation"], part]).encode() for part in parts]

    def fly(self, task: bytes, stop: Stop) -> bytes:
        """Give the costs of some places."""
        generation, places = json.loads(task)
        if self._before_flight is not None:
            self._before_flight(generation, places)
        if generation == self.request.get("refuse_at"):
            raise InvalidInput("the flock fell from the sky", hint="fewer birds")
        until = time.monotonic() + self.request.get("pause_s", 0.0) * len(places)
        while time.monotonic() < until or stop():
            if stop():
                raise Interrupted
            time.sleep(0.005)
        return json.dumps([hashed(place, 1) for place in places]).encode()

    def combine(self, checkpoint: bytes, outcomes: Sequence[bytes], elapsed_s: float) -> Step:  # noqa: ARG002 - keeps no times
        """Move every bird by the costs of all."""
        state = json.loads(checkpoint)
        costs = [cost for outcome in outcomes for cost in json.loads(outcome)]
        assert len(costs) == len(state["places"])
        best = min(state["best"], *costs)
        places = [hashed(place, cost ^ best) for place, cost in zip(state["places"], costs, strict=True)]
        moved = {"generation": state["generation"] + 1, "places": places, "best": best}
        return self._step(json.dumps(moved).encode())

    def _step(self, checkpoint: bytes) -> Step:
        generation = json.loads(checkpoint)["generation"]
        progress = {
            "fraction": generation / self.request["generations"],
            "generation": generation,
            "flights": generation * self.request["birds"],
            "phase": "swarm",
        }
        return Step(progress, checkpoint)

    def outcome(self, checkpoint: bytes, *, files: bool = True) -> Outcome:  # noqa: ARG002
        """Give where the birds are."""
        return Outcome(json.loads(checkpoint), {"flock.txt": b"birds\n"})

    best_so_far = outcome


def hashed(*numbers: int) -> int:
    """A number that depends on others in no simple way."""
    text = ",".join(map(str, numbers)).encode()
    return int.from_bytes(hashlib.sha256(text).digest()[:6])


def find_flock(before_flight: Hook | None = None) -> Callable[[str], Begin]:
    """A registry with one operation in it, whatever its name."""
    return lambda _name: lambda request, _threads: Flock(request, before_flight)


def alone(request: dict[str, Any]) -> dict[str, Any]:
    """Fly to the end without any service."""
    flock = Flock({**request, "pause_s": 0.0})
    *_, last = flock.steps(None, lambda: False)
    return flock.outcome(last.checkpoint).document
