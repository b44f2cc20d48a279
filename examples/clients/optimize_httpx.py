"""Find a gentle morph with a model identified just before. Usage: optimize_httpx.py [URL] [FOLDER]."""

from __future__ import annotations

import json
import os
import sys

from job import run, sample, save, service_at, vehicle


def main(url: str = "http://127.0.0.1:8000", folder: str = "client-output") -> None:
    """Identify a model, then sweep the wings by 1 rad in 2 s so that the attitude varies least."""
    search = json.loads(os.environ.get("MORPHID_SEARCH", "{}"))
    with service_at(url) as service:
        identification = {
            **vehicle(),
            "samples": [sample("train_rate_0.5", "train")],
            "model": {"links_per_wing": 2},
            "search": search,
        }
        job, _ = run(service, "identify", identification)
        optimisation = {
            **vehicle(),
            "model": {"model_id": job["model_id"]},
            "morph": {"final_rad": 1.0, "duration_s": 2.0, "knots": 6, "settle_s": 2.0},
            "limits": {"max_rate_rad_s": 1.0},
            "search": search,
            "verify": "none",  # omit this to fly the schedules in the flexible model too
        }
        _, result = run(service, "optimize", optimisation)
    save(result, folder)
    for name, variation in result["variation"].items():
        print(f"{name:<14} {variation['equivalent']:.4g} rad^2")
    schedule = result["schedule"]
    for time_s, sweep in zip(schedule["knot_time_s"], schedule["knot_sweep_rad"], strict=True):
        print(f"{time_s:8.3f} s {sweep:8.3f} rad")


if __name__ == "__main__":
    main(*sys.argv[1:3])
