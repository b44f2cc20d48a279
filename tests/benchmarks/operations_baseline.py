"""What one flight costs in floating-point operations: the committed counts, and how to renew them.

    python -m tests.benchmarks.operations_baseline

rewrites operations.json. Do so when a flight is *meant* to cost more, and say why in the commit; do so too
when it has become cheaper, so that the gain is kept.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from benchmarks.operations import operations
from benchmarks.setting import QUICK, bench_of

BASELINE = Path(__file__).with_name("operations.json")
MAX_GROWTH = 1.10
RENEW = "python -m tests.benchmarks.operations_baseline"


def counts() -> dict[str, Any]:
    """Count now."""
    return operations(bench_of(QUICK))


def grown(baseline: Mapping[str, Any], found: Mapping[str, Any]) -> list[str]:
    """Say which counts exceed the baseline by more than 10 per cent; a count that is new exceeds it too."""
    before = dict(_leaves(baseline))
    return [
        f"{name}: {count:,} operations a simulated second, {before.get(name, 0):,} before"
        for name, count in _leaves(found)
        if count > MAX_GROWTH * before.get(name, 0)
    ]


def _leaves(tree: Mapping[str, Any], path: str = "") -> Iterator[tuple[str, int]]:
    for name, value in tree.items():
        where = f"{path}/{name}" if path else name
        if isinstance(value, Mapping):
            yield from _leaves(value, where)
        else:
            yield where, value


if __name__ == "__main__":
    BASELINE.write_text(json.dumps(counts(), indent=1) + "\n", encoding="utf-8")
