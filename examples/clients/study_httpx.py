"""Find how many links per wing a model should have. Usage: study_httpx.py [URL] [FOLDER]."""

from __future__ import annotations

import json
import os
import sys

from job import run, sample, save, service_at, vehicle


def main(url: str = "http://127.0.0.1:8000", folder: str = "client-output") -> None:
    """Compare models of one, two and three links, judged on a flight that none of them has seen."""
    body = {
        **vehicle(),
        "samples": [sample("train_rate_0.8", "train"), sample("train_asymmetric", "held_out")],
        "model": {"links_per_wing": [1, 2, 3]},
        "search": json.loads(os.environ.get("MORPHID_SEARCH", "{}")),
    }
    with service_at(url) as service:
        job, result = run(service, "study", body)
    save(result, folder)
    for row in result["rows"]:
        print(
            f"{row['links_per_wing']} links: J {row['J_train']:.3g} fitted, {row['J_held_out']:.3g} rad^2 "
            f"held out; a flight takes {1e3 * row['flight_s']:.0f} ms"
        )
    print(result["recommended"]["reason"])
    print(f"kept as {job['model_id']}")


if __name__ == "__main__":
    main(*sys.argv[1:3])
