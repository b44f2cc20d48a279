"""A format is one function and what documents say of it: it arrives in API, page, command and a job."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from morphdata.formats import ExportFormat

if TYPE_CHECKING:  # it reads the list of the formats
    from morphcore.export.formats import ExportedModel

ROOT = Path(__file__).resolve().parents[2]

HEAVY = ExportFormat(
    "weights", "Masses of the links, a line each.", "text/tab-separated-values", ".tsv",
    "tests.house.test_toy_export:write",
)  # fmt: skip


def write(exported: ExportedModel) -> bytes:
    """Write the masses of the links, kg."""
    return "".join(f"{mass:.6g}\n" for mass in exported.tables["links"]["mass_kg"]).encode()


# in a process of its own, for documents read their list when they are imported
HOUSE_WITH_A_TOY = """
import json, sys
from morphdata.formats import FORMATS
from tests.house.test_toy_export import HEAVY

FORMATS.append(HEAVY)

from pathlib import Path
from typer.testing import CliRunner
from app.settings import Settings
from morphcore import export, load_aircraft, load_flight
from morphid.main import app
from tests.app.models.test_export import identified
from tests.app.running_service import DEAD_BROKER, running_service
from tests.morphid.command_lines import EXAMPLES, command, parameters_file
from tests.worker.operations.jobs_of_the_library import RealWorker, parameters

def shown(*words):
    ended = CliRunner().invoke(app, list(words), env={"COLUMNS": "200"})
    return [ended.exit_code, ended.output]

place = Path(sys.argv[1])
vehicle = [load_aircraft(EXAMPLES / "aircraft.json"), load_flight(EXAMPLES / "flight.json")]
settings = Settings(database_url=f"sqlite:///{place}/s.sqlite3", broker_url=DEAD_BROKER)
with running_service(settings) as service:
    client = service.client
    address = f"/models/{identified(service)}/export"
    asked = client.get(address, params={"format": "weights"}, headers={"Prefer": "wait=0"})
    RealWorker(service.database).run()
    answer = client.get(address, params={"format": "weights"})
    files = client.get(f"{asked.headers['location']}/artifacts").json()["artifacts"]
    found = {
        "openapi": client.get("/openapi.json").json(),
        "page": client.get("/").text,
        "accepted": asked.status_code,
        "files": [item["name"] for item in files],
        "answer": [answer.status_code, answer.headers["content-type"], answer.headers["content-disposition"],
                   answer.text],
        "help": shown("export", "--help"),
        "here": shown(*command("export", "--parameters", parameters_file(place), "--format", "weights",
                               "--out", str(place / "out.tsv"))),
        "written": (place / "out.tsv").read_text(),
        "library": export(parameters(), *vehicle, "weights", place / "library.tsv").read_text(),
    }
print("FOUND" + json.dumps(found))
"""


@pytest.fixture(scope="module")
def house(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What the house with a toy format shows and does."""
    ended = subprocess.run(
        [sys.executable, "-c", HOUSE_WITH_A_TOY, str(tmp_path_factory.mktemp("toy"))],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert ended.returncode == 0, ended.stderr
    found: dict[str, Any] = json.loads(ended.stdout.partition("FOUND")[2])
    return found


def test_the_api_offers_it(house: dict[str, Any]) -> None:
    """OpenAPI has it among the formats of a request and of a model, and its media type among the answers."""
    document = house["openapi"]
    request = document["components"]["schemas"]["ExportRequest"]["properties"]["format"]
    assert "weights" in request["enum"]
    call = document["paths"]["/models/{model_id}/export"]["get"]
    (choice,) = (item for item in call["parameters"] if item["name"] == "format")
    assert "weights" in choice["schema"]["enum"]
    assert "text/tab-separated-values" in call["responses"]["200"]["content"]
    assert "Masses of the links, a line each." in call["description"]


def test_its_job_ends_and_the_model_has_the_file(house: dict[str, Any]) -> None:
    """The first call starts a job, the next one has its file, under the model's name."""
    assert house["accepted"] == 202
    assert sorted(house["files"]) == ["model.tsv", "result.json"]
    status, kind, place, text = house["answer"]
    assert (status, kind.partition(";")[0]) == (200, "text/tab-separated-values")
    assert place.startswith('attachment; filename="model_')
    assert place.endswith('.tsv"')
    assert text == "22.5\n" * 4  # four halves of wings of 45 kg


def test_the_page_and_the_command_know_it(house: dict[str, Any]) -> None:
    """It stands on the page and in the command's help; command and library write what the service does."""
    assert 'data-formats="npz mat json weights"' in house["page"]
    assert "<dt>weights</dt><dd>Masses of the links, a line each.</dd>" in house["page"]
    assert "weights" in house["help"][1]
    code, output = house["here"]
    assert code == 0, output
    assert len(house["written"].splitlines()) == 4
    assert house["library"] == house["answer"][3]
