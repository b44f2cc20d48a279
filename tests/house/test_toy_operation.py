"""An operation is one descriptor: named in the list, it arrives in API, page, command and worker."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]

# in a process of its own, for most of the house reads the list when it is imported
HOUSE_WITH_A_TOY = """
import json, sys
import morphdata.operations
from tests.house.toy_operation import TOY

morphdata.operations.OPERATIONS = (*morphdata.operations.OPERATIONS, TOY)

from typer.testing import CliRunner
from app.settings import Settings
from morphid.main import app
from tests.app.running_service import DEAD_BROKER, running_service
from tests.worker.operations.jobs_of_the_library import RealWorker

def shown(*words):
    ended = CliRunner().invoke(app, list(words), env={"COLUMNS": "200"})
    return [ended.exit_code, ended.output]

with running_service(Settings(database_url=f"sqlite:///{sys.argv[1]}", broker_url=DEAD_BROKER)) as service:
    client = service.client
    job = client.post("/count", json={"count_to": 3})
    RealWorker(service.database).run()
    address = job.headers["location"]
    found = {
        "openapi": client.get("/openapi.json").json(),
        "page": client.get("/").text,
        "accepted": job.status_code,
        "job": client.get(address).json(),
        "result": client.get(f"{address}/result").json(),
        "files": [item["name"] for item in client.get(f"{address}/artifacts").json()["artifacts"]],
        "listed": len(client.get("/jobs", params={"operation": "count"}).json()["jobs"]),
        "valid": client.post("/validate/count", json={"count_to": 3}).json(),
        "refused": client.post("/validate/count", json={"count_to": 4}).json(),
        "help": shown("--help"),
        "own_help": shown("count", "--help"),
        "here": shown("count", "--count-to", "2", "--json", "-"),
        "wrong": shown("count", "--count-to", "4"),
    }
print("FOUND" + json.dumps(found))
"""


@pytest.fixture(scope="module")
def house(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What the house with a toy operation shows and does."""
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
    """OpenAPI has both calls, the forms of request, result and cost, and the name among the filters."""
    document = house["openapi"]
    assert document["paths"]["/count"]["post"]["operationId"] == "count"
    assert document["paths"]["/validate/count"]["post"]["operationId"] == "validate_count"
    assert {"ToyRequest", "ToyResult", "ToyCost", "CountValidation"} <= set(document["components"]["schemas"])
    assert "Numbers in their order." in json.dumps(document["tags"])
    filters = document["paths"]["/jobs"]["get"]["parameters"]
    assert '"count"' in json.dumps(next(item for item in filters if item["name"] == "operation"))


def test_the_api_checks_it(house: dict[str, Any]) -> None:
    """What its request says of itself is what the API answers."""
    assert (house["valid"]["operation"], house["valid"]["cost"]) == ("count", {"core_s": 3e-3})
    (fault,) = house["refused"]["errors"]
    assert (fault["code"], fault["pointer"]) == ("unlucky", "/count_to")


def test_its_job_ends(house: dict[str, Any]) -> None:
    """Posted, it is run by a worker, listed with its summary, and leaves result and files."""
    assert house["accepted"] == 202
    assert house["job"]["status"] == "succeeded"
    assert house["job"]["request"]["count_to"] == 3
    assert house["result"] == {"counted": [1, 2, 3]}
    assert house["files"] == ["result.json"]
    assert house["listed"] == 1


def test_the_page_knows_it(house: dict[str, Any]) -> None:
    """Its name stands in the page's list, with what it does in the help."""
    assert 'data-operations="identify study simulate optimize export count"' in house["page"]
    assert "<dt>count</dt><dd>Counts to a number.</dd>" in house["page"]


def test_the_command_has_it(house: dict[str, Any]) -> None:
    """A command with its field as an option runs it in this process and refuses what the request refuses."""
    assert "Count to a number." in house["help"][1]
    assert "--count-to" in house["own_help"][1]
    assert "Where to stop." in house["own_help"][1]
    code, output = house["here"]
    assert code == 0, output
    assert '"counted"' in output
    code, output = house["wrong"]
    assert code == 3
    assert "given by --count-to 4" in output
