"""Identify a model with httpx: post, poll, fetch. Usage: identify_httpx.py [URL] [FOLDER]."""

from __future__ import annotations

import json
import os
import sys

from job import run, sample, save, service_at, vehicle


def main(url: str = "http://127.0.0.1:8000", folder: str = "client-output") -> None:
    """Fit one flight, predict another."""
    body = {
        **vehicle(),
        "samples": [sample("train_rate_0.5", "train"), sample("train_rate_0.8", "held_out")],
        "model": {"links_per_wing": 3},
        "search": json.loads(os.environ.get("MORPHID_SEARCH", "{}")),
    }
    with service_at(url) as service:
        _, result = run(service, "identify", body)
    save(result, folder)
    for row in result["fit"]:
        print(
            f"{row['sample']:<16} {row['role']:<9} J {row['J_rigid']:.3g} -> {row['J_identified']:.3g} rad^2"
        )


if __name__ == "__main__":
    main(*sys.argv[1:3])
