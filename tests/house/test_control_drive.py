"""A control surface is one entry in an aircraft document: it flies, is measured, identified and optimised."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from app.settings import Settings
from morphid.main import app
from tests.aero.controlled import tailed
from tests.app.running_service import DEAD_BROKER, running_service
from tests.worker.operations.jobs_of_the_library import COARSE, RealWorker

Document = dict[str, Any]
RUNNER = CliRunner()
PULL = {"kind": "constant_rate", "final_rad": -0.03, "duration_s": 0.2, "start_s": 0.1, "ramp_s": 0.05}
VEHICLE = {
    "aircraft": tailed(flexible=True, hinged=True),
    "flight": {"airspeed_m_s": 20.0, "air_density_kg_m3": 1.225},
}


@pytest.fixture(scope="module")
def house(tmp_path_factory: pytest.TempPathFactory) -> Document:
    """What the service makes of it: a flight, that flight as an uploaded sample in degrees, and a morph."""
    database = tmp_path_factory.mktemp("control") / "service.sqlite3"
    settings = Settings(database_url=f"sqlite:///{database}", broker_url=DEAD_BROKER)
    with running_service(settings) as service:
        worker = RealWorker(service.database)

        def done(operation: str, **request: Any) -> tuple[Document, dict[str, bytes]]:
            answer = service.client.post(f"/{operation}", json={**VEHICLE, **request})
            assert answer.status_code == 202, answer.text
            worker.run()
            name = answer.json()["id"]
            assert worker.job(name).status == "succeeded", worker.job(name).error
            return worker.result(name), worker.files(name)

        model = {"kind": "flexible", "elements": 2, "step_s": 0.004, "lattice": COARSE}
        flown = done("simulate", model=model, schedules={"elevator": PULL}, duration_s=0.6)
        content = in_degrees(flown[1]["flight.csv"])
        uploaded = service.client.post("/trajectories", files={"file": ("pulled.csv", content)}).json()
        identified = done(
            "identify",
            samples=[{"trajectory_id": uploaded["id"]}],
            model={"links_per_wing": 2, "lattice": COARSE},
            search={"method": "pso", "particles": 4, "generations": 2, "seed": 1},
        )
        found = {"parameters": identified[0]["model"], "lattice": COARSE}
        morph = {"drive": "elevator", "final_rad": -0.03, "duration_s": 0.6, "knots": 3, "settle_s": 0.1}
        morphed = done(
            "optimize", model=found, morph=morph, limits={"max_rate_rad_s": 0.2}, verify="none",
            search={"particles": 4, "generations": 2, "seed": 1},
        )  # fmt: skip
        unknown = {**VEHICLE, "model": model, "schedules": {"rudder": PULL}, "duration_s": 0.6}
        refused = service.client.post("/validate/simulate", json=unknown)
        return {
            "flown": flown, "content": content, "identified": identified, "morphed": morphed,
            "refused": refused.json()["errors"],
        }  # fmt: skip


def in_degrees(table: bytes) -> bytes:
    """A flight's CSV with one column for both elevators, in degrees, and without the other drives."""
    rows = list(csv.DictReader(io.StringIO(table.decode())))
    out = io.StringIO()
    writer = csv.DictWriter(out, ["t", "elevator_deg", "phi", "theta", "psi"], extrasaction="ignore")
    writer.writeheader()
    for row in rows:
        writer.writerow(row | {"elevator_deg": np.rad2deg(float(row["elevator_left"]))})
    return out.getvalue().encode()


def test_it_flies_and_has_its_columns(house: Document) -> None:
    """Both sides follow the word's schedule; what nobody moves rests, and the picture shows it."""
    result, files = house["flown"]
    flown = result["trajectory"]
    assert flown["elevator_left_rad"] == flown["elevator_right_rad"]
    assert min(flown["elevator_left_rad"]) == pytest.approx(PULL["final_rad"])
    assert np.ptp(flown["aileron_left_rad"]) == np.ptp(flown["sweep_left_rad"]) == 0.0
    assert flown["theta_rad"][-1] - flown["theta_rad"][0] > 1e-2
    assert b"elevator" in files["flight.svg"]


def test_it_is_measured_and_identified(house: Document) -> None:
    """A column in degrees moves both elevators of an uploaded sample."""
    result, files = house["identified"]
    fit = result["fit"][0]
    assert fit["sample"] == "pulled"
    assert fit["J_identified"] < fit["J_rigid"]
    assert "elevator_rad" in files["curves_pulled.csv"].decode().split("\n")[0]


def test_it_is_optimised_by_its_name(house: Document) -> None:
    """The result says what moves."""
    result, _ = house["morphed"]
    assert result["schedule"]["drive"] == "elevator"
    assert set(result["drives"]) == {"elevator_left", "elevator_right"}


def test_what_the_aircraft_lacks_is_refused_with_what_it_has(house: Document) -> None:
    """The hint lists the drives, hinges and controls."""
    (error,) = house["refused"]
    assert error["pointer"] == "/schedules/rudder"
    for name in ("elevator_left", "aileron_right", "sweep_left"):
        assert name in error["hint"]


def test_the_command_knows_it(house: Document, tmp_path: Path) -> None:
    """By --drive and by a table in degrees."""
    for name, document in VEHICLE.items():
        (tmp_path / f"{name}.json").write_text(json.dumps(document))
    (tmp_path / "pulled.csv").write_bytes(house["content"])
    vehicle_words = [f"--{name}={tmp_path / name}.json" for name in VEHICLE]
    for words in (
        ("--rate=0.1", "--final=-0.03", "--drive=elevator"),
        ("--schedule", tmp_path / "pulled.csv"),
    ):
        out = tmp_path / "flown.csv"
        ended = RUNNER.invoke(
            app,
            [
                "simulate",
                *vehicle_words,
                *map(str, words),
                "--chordwise=1",
                "--spanwise=4",
                "--out",
                str(out),
            ],
        )
        assert ended.exit_code == 0, ended.output
        rows = list(csv.DictReader(io.StringIO(out.read_text())))
        assert float(rows[-1]["elevator_right"]) == pytest.approx(-0.03, abs=1e-6)
        assert float(rows[-1]["sweep_left"]) == 0.0
