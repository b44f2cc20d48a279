"""A drive is one entry in an aircraft document: it flies, is measured, identified, optimised and shown."""

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
from tests.app.running_service import DEAD_BROKER, running_service
from tests.worker.operations.jobs_of_the_library import COARSE, MORPH, RealWorker, parameters, vehicle

Document = dict[str, Any]
RUNNER = CliRunner()
AXES = {"right": [-0.6, 0.0, 0.8], "left": [0.6, 0.0, 0.8]}  # mirror images: neither sweep nor fold
KNOWN = {"parameters": parameters(), "lattice": COARSE}


def cant() -> Document:
    """The example aircraft, whose wings have a second hinge."""
    document = vehicle()["aircraft"]
    for wing in document["surfaces"]:
        hinge = wing.pop("hinge")
        entry = {
            "name": "cant",
            "axis": AXES[wing["side"]],
            "position_m": hinge["position_m"],
            "max_rad": 0.8,
        }
        wing["hinges"] = [hinge, entry]
    return {**vehicle(), "aircraft": document}


@pytest.fixture(scope="module")
def house(tmp_path_factory: pytest.TempPathFactory) -> Document:
    """What the service makes of it: a flight, that flight as an uploaded sample in degrees, and a morph."""
    database = tmp_path_factory.mktemp("toy") / "service.sqlite3"
    settings = Settings(database_url=f"sqlite:///{database}", broker_url=DEAD_BROKER)
    with running_service(settings) as service:
        worker = RealWorker(service.database)

        def done(operation: str, **request: Any) -> tuple[Document, dict[str, bytes]]:
            answer = service.client.post(f"/{operation}", json={**cant(), **request})
            assert answer.status_code == 202, answer.text
            worker.run()
            name = answer.json()["id"]
            assert worker.job(name).status == "succeeded", worker.job(name).error
            return worker.result(name), worker.files(name)

        model = {"kind": "equivalent", **KNOWN}
        flown = done("simulate", model=model, schedules={"cant": MORPH}, duration_s=0.6)
        content = in_degrees(flown[1]["flight.csv"])
        uploaded = service.client.post("/trajectories", files={"file": ("canted.csv", content)}).json()
        sample = {"trajectory_id": uploaded["id"]}
        search = {"method": "pso", "particles": 4, "generations": 2, "seed": 1}
        identified = done(
            "identify", samples=[sample], model={"links_per_wing": 2, "lattice": COARSE}, search=search
        )
        morph = {"drive": "cant", "final_rad": 0.3, "duration_s": 0.6, "knots": 3, "settle_s": 0.1}
        morphed = done(
            "optimize", model=KNOWN, morph=morph, limits={"max_rate_rad_s": 1.2}, verify="none",
            search={"particles": 4, "generations": 2, "seed": 1},
        )  # fmt: skip
        unnamed = {name: value for name, value in morph.items() if name != "drive"}
        refused = service.client.post("/validate/optimize", json={**cant(), "model": KNOWN, "morph": unnamed})
        return {
            "flown": flown, "content": content, "identified": identified, "morphed": morphed,
            "back": service.client.get(f"/trajectories/{uploaded['id']}").json(),
            "refused": refused.json()["errors"],
        }  # fmt: skip


def in_degrees(table: bytes) -> bytes:
    """A flight's CSV with the hinge's columns in degrees, and without the other drives, which are at rest."""
    rows = list(csv.DictReader(io.StringIO(table.decode())))
    out = io.StringIO()
    titles = ["t", "cant_left_deg", "cant_right_deg", "phi", "theta", "psi"]
    writer = csv.DictWriter(out, titles, extrasaction="ignore")
    writer.writeheader()
    for row in rows:
        degrees = {f"cant_{side}_deg": np.rad2deg(float(row[f"cant_{side}"])) for side in ("left", "right")}
        writer.writerow(row | degrees)
    return out.getvalue().encode()


def test_it_flies_and_has_its_columns(house: Document) -> None:
    """Both sides follow the schedule, in JSON and CSV; what nobody moves rests, and the picture shows it."""
    result, files = house["flown"]
    flown = result["trajectory"]
    assert flown["cant_left_rad"] == flown["cant_right_rad"]
    assert max(flown["cant_left_rad"]) == pytest.approx(MORPH["final_rad"])
    assert np.ptp(flown["sweep_left_rad"]) == 0.0
    assert np.ptp(flown["theta_rad"]) > 1e-4
    assert {"cant_left", "cant_right", "sweep_left"} <= set(
        files["flight.csv"].decode().split("\n")[0].split(",")
    )
    assert b"cant" in files["flight.svg"]


def test_it_is_measured_in_degrees_and_identified(house: Document) -> None:
    """An uploaded sample reads back in rad; the search flies it, and the curves have its columns."""
    flown, (result, files) = house["flown"][0]["trajectory"], house["identified"]
    np.testing.assert_allclose(house["back"]["cant_left_rad"], flown["cant_left_rad"], atol=1e-8)
    assert result["fit"][0]["sample"] == "canted"
    assert result["fit"][0]["J_identified"] is not None
    assert result["fit"][0]["J_identified"] < result["fit"][0]["J_rigid"]
    assert "cant_left_rad" in files["curves_canted.csv"].decode().split("\n")[0]
    assert b"cant" in files["attitude_canted.svg"]


def test_it_is_optimised_by_its_name(house: Document) -> None:
    """The result says what morphs, and its table is a schedule; without the name both are offered."""
    result, files = house["morphed"]
    assert result["schedule"]["drive"] == "cant"
    assert result["schedule"]["knot_angle_rad"] == result["schedule"]["knot_sweep_rad"]
    assert files["schedule.csv"].decode().split("\n")[0] == "t,cant_left,cant_right"
    (fault,) = house["refused"]
    assert (fault["code"], fault["pointer"]) == ("missing", "/morph/drive")
    assert "sweep, cant for both sides" in fault["hint"]


def test_the_command_knows_it(house: Document, tmp_path: Path) -> None:
    """By --drive and by a table in degrees; a table of other columns is refused with the names to use."""
    (tmp_path / "aircraft.json").write_text(json.dumps(cant()["aircraft"]))
    (tmp_path / "flight.json").write_text(json.dumps(cant()["flight"]))
    (tmp_path / "canted.csv").write_bytes(house["content"])
    (tmp_path / "other.csv").write_bytes(house["content"].replace(b"cant", b"kant"))
    vehicle_words = [f"--{name}={tmp_path / name}.json" for name in ("aircraft", "flight")]

    def run(*words: Any) -> Any:
        return RUNNER.invoke(
            app, ["simulate", *vehicle_words, *map(str, words), "--chordwise=1", "--spanwise=4"]
        )

    for words in (("--rate=1", "--final=0.4", "--drive=cant"), ("--schedule", tmp_path / "canted.csv")):
        out = tmp_path / "flown.csv"
        ended = run(*words, "--out", out)
        assert ended.exit_code == 0, ended.output
        rows = list(csv.DictReader(io.StringIO(out.read_text())))
        assert float(rows[-1]["cant_left"]) == pytest.approx(0.4, abs=1e-6)
        assert float(rows[-1]["sweep_left"]) == 0.0
    ended = run("--schedule", tmp_path / "other.csv")
    assert ended.exit_code == 3
    assert "kant_left, kant_right" in ended.output.replace("\n", " ")
    assert "cant_right" in ended.output
    ended = run("--rate=1", "--final=0.4")
    assert ended.exit_code == 3
    assert "does not say which drive moves" in ended.output.replace("\n", " ")
