"""A channel is one entry and what documents say of it: it arrives in API, page, command and a job's files."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.simulate.channels import Channel
from morphcore.simulate.record import FlightRecord

ROOT = Path(__file__).resolve().parents[2]


def climb_angle(record: FlightRecord, _aircraft: Aircraft, _flight: Flight) -> np.ndarray[Any, Any]:
    """Of the velocity over ground."""
    north, east, down = record.velocity_N.T
    return np.asarray(np.arctan2(-down, np.hypot(north, east)))


CLIMB = Channel("climb", climb_angle)

# in a process of its own, for documents read their list when they are imported
HOUSE_WITH_A_TOY = """
import json, sys
from morphdata.channels import CHANNELS as KNOWN
from morphdata.channels import ChannelFacts

KNOWN.append(ChannelFacts("climb", "rad", "Angle of the flight path above the horizon."))

from morphcore.simulate.channels import CHANNELS
from tests.house.test_toy_channel import CLIMB

CHANNELS.append(CLIMB)

from typer.testing import CliRunner
from app.settings import Settings
from morphid.main import app
from tests.app.running_service import DEAD_BROKER, running_service
from tests.morphid.command_lines import COARSE, command
from tests.worker.operations.jobs_of_the_library import RealWorker, simulation

def shown(*words):
    ended = CliRunner().invoke(app, list(words), env={"COLUMNS": "200"})
    return [ended.exit_code, ended.output]

asked = {**simulation(0.1), "channels": ["q", "climb"]}
flight = sys.argv[1] + ".csv"
with running_service(Settings(database_url=f"sqlite:///{sys.argv[1]}", broker_url=DEAD_BROKER)) as service:
    client = service.client
    job = client.post("/simulate", json=asked)
    RealWorker(service.database).run()
    address = job.headers["location"]
    found = {
        "schemas": client.get("/openapi.json").json()["components"]["schemas"],
        "page": client.get("/").text,
        "result": client.get(f"{address}/result").json(),
        "table": client.get(f"{address}/artifacts/flight.csv").text,
        "refused": client.post("/simulate", json={**asked, "channels": ["climbs"]}).json(),
        "help": shown("simulate", "--help"),
        "here": shown(*command("simulate", *COARSE, "--rate", "1", "--final", "0.4", "--channels", "climb",
                               "--out", flight)),
        "written": open(flight).readline().strip(),
    }
print("FOUND" + json.dumps(found))
"""


@pytest.fixture(scope="module")
def house(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What the house with a toy channel shows and does."""
    place = tmp_path_factory.mktemp("toy") / "service.sqlite3"
    ended = subprocess.run(
        [sys.executable, "-c", HOUSE_WITH_A_TOY, str(place)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert ended.returncode == 0, ended.stderr
    found: dict[str, Any] = json.loads(ended.stdout.partition("FOUND")[2])
    return found


def test_the_api_offers_it(house: dict[str, Any]) -> None:
    """OpenAPI lists its name among those of a request; an unknown one is refused with it in the hint."""
    assert '"climb"' in json.dumps(house["schemas"]["SimulateRequest"]["properties"]["channels"])
    (fault,) = house["refused"]["errors"]
    assert fault["pointer"] == "/channels/0"
    assert "'climb'" in fault["hint"]


def test_its_job_ends_with_it(house: dict[str, Any]) -> None:
    """Result and table hold the channels that were requested and no other, the unit in the result."""
    attitude = {"phi_rad", "theta_rad", "psi_rad"}
    moved = {name for name in house["result"]["trajectory"] if name.startswith("sweep_")}
    assert set(house["result"]["trajectory"]) - moved == {"time_s", *attitude, "q_rad_s", "climb_rad"}
    assert house["table"].splitlines()[0].split(",")[-2:] == ["q", "climb"]
    climb = np.array(house["result"]["trajectory"]["climb_rad"])
    assert abs(climb[0]) < 1e-9, "level flight at the start"
    assert climb.size == 11


def test_the_page_and_the_command_know_it(house: dict[str, Any]) -> None:
    """It stands in the page's help and in the command's, and the command writes it."""
    assert "<dt>climb, rad</dt><dd>Angle of the flight path above the horizon.</dd>" in house["page"]
    assert "climb" in house["help"][1]
    code, output = house["here"]
    assert code == 0, output
    assert house["written"].split(",")[-1] == "climb"
