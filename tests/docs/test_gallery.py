"""The gallery of aircraft: complete, quiet, and identified as well as it says."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from morphcore import load_aircraft, load_flight, load_trajectory

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "examples"))
import gallery  # noqa: E402  # a script, not a package

FOLDERS = sorted(path.parent for path in gallery.FOLDER.glob("*/aircraft.json"))


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: folder.name)
def test_every_aircraft_is_complete(folder: Path) -> None:
    """Documents, three flights to fit and one to judge, of the aircraft's own drives, and a picture."""
    aircraft = load_aircraft(folder / "aircraft.json")
    load_flight(folder / "flight.json")
    flights = gallery.morphs(folder)
    assert (len(flights["train"]), len(flights["held_out"])) == (3, 1)
    for name in (*flights["train"], *flights["held_out"]):
        flown = load_trajectory(folder / f"{name}.csv")
        assert set(flown.drives) <= set(aircraft.drives) | {
            name.rsplit("_", 1)[0] for name in aircraft.drives
        }
    assert "<svg" in (folder / "picture.svg").read_text("utf-8")


def test_there_are_as_many_as_promised() -> None:
    """Kinds of aircraft, each in its folder."""
    assert [folder.name for folder in FOLDERS] == [
        "folding",
        "gull",
        "slender",
        "tailed_uav",
        "telescope",
        "transport",
    ]


@pytest.mark.slow
@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: folder.name)
def test_held_out_flights_are_met(folder: Path) -> None:
    """J of the held-out flight is at most a thousandth of the rigid model's, whatever aircraft it is."""
    name, links, ratio, largest, grade, seconds = gallery.judged(folder)
    print(name, links, ratio, largest, grade, seconds)
    assert float(ratio) <= 1e-3
    assert grade in ("good", "usable")
