"""Columns of drives survive upload and reading back, and reach the jobs of the aircraft that has them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sqlalchemy import update

from app.documents import packed
from app.jobs import store
from app.tables import trajectories
from morphdata.identify import EXAMPLE_REQUEST
from morphdata.samples import EXAMPLE_SAMPLE
from tests.app.calls import fault, post
from tests.app.running_service import RunningService
from tests.app.trajectories.test_endpoints import upload
from tests.morphdata.samplefiles.test_matlab_hdf5 import COLUMNS, as_matlab
from tests.morphdata.samplefiles.test_ulog_file import EULER, log
from tests.morphdata.test_schedules import aircraft

T = [0.0, 0.01, 0.02, 0.03]
HEAD = "t,phi,theta,psi"
ROWS = [f"{t},0,0.06,0" for t in T]


def flight(*columns: str, **angles: list[Any]) -> bytes:
    """A file with these further columns."""
    rows = [
        ",".join([row, *map(str, cells)])
        for row, cells in zip(ROWS, zip(*angles.values(), strict=True), strict=True)
    ]
    return "\n".join([",".join([HEAD, *angles, *columns]), *rows]).encode()


def request(trajectory_id: str, *axes: str) -> dict[str, Any]:
    """An identification with an uploaded sample."""
    return {**EXAMPLE_REQUEST, "aircraft": aircraft(*axes), "samples": [{"trajectory_id": trajectory_id}]}


def stored(service: RunningService, document: dict[str, Any]) -> dict[str, Any]:
    """Post an identification and give what the worker reads of it."""
    answer = post(service, "/identify", document)
    assert answer.status_code == 202, answer.text
    with service.database.read() as session:
        return store.load_request(session, answer.json()["id"])


def uploaded(service: RunningService, content: bytes) -> tuple[str, dict[str, Any]]:
    """The id of an uploaded file, and what reads back."""
    answer = upload(service, content, "flight.csv")
    assert answer.status_code == 201, answer.text
    return answer.json()["id"], service.client.get(answer.headers["location"]).json()


def test_a_drive_survives_upload_reading_back_and_identification(any_service: RunningService) -> None:
    """Fold in degrees and a throttle: both read back in rad, and the fold alone reaches the job."""
    content = flight(fold_left_deg=[0, 0, 1, 2], fold_right_deg=[0, 0, 1, 3], throttle=[1, 1, 1, 1])
    name, back = uploaded(any_service, content)
    np.testing.assert_allclose(back["fold_right_rad"], np.deg2rad([0, 0, 1, 3]), rtol=1e-14)
    assert back["throttle_rad"] == [1.0] * 4
    assert "sweep_left_rad" not in back
    (sample,) = stored(any_service, request(name, "x"))["samples"]
    assert sample["fold_left_rad"] == back["fold_left_rad"]
    assert "throttle_rad" not in sample
    again = any_service.client.post(
        "/trajectories",
        json={k: v for k, v in back.items() if k.endswith(("_rad", "_s")) and k != "duration_s"},
    )
    assert again.status_code == 201, again.text


@pytest.mark.parametrize(
    ("angles", "axes", "code", "words"),
    [
        ({"flap": T}, ("x",), "no_drive", "fold_left"),
        ({"fold_left": T}, ("x",), "missing", "fold_right"),
        ({"sweep_left": T, "sweep_right": T}, ("x", "y"), "ambiguous_drive", "incidence_right"),
        ({"sweep": T, "fold": [0, 0, "x", 0]}, ("z", "x"), "unreadable_column", "Repair"),
    ],
)
def test_what_does_not_move_the_aircraft_is_refused_at_the_sample(
    service: RunningService, angles: dict[str, Any], axes: tuple[str, ...], code: str, words: str
) -> None:
    """Once the aircraft is known; the pointer is the id's, and the hint holds the way out."""
    name, _ = uploaded(service, flight(**angles))
    found, *_ = fault(service.client.post("/identify", json=request(name, *axes)))["errors"]
    assert (found["code"], found["pointer"]) == (code, "/samples/0/trajectory_id")
    assert words in found["hint"]


def test_a_column_that_cannot_be_read_is_reported_and_harms_no_other_aircraft(
    service: RunningService,
) -> None:
    """The flight says why; whoever does not fold is not concerned."""
    name, back = uploaded(service, flight(sweep=T, fold=[0, 0, "x", 0]))
    assert "not a finite number" in back["unreadable"]["fold"]
    assert service.client.post("/validate/identify", json=request(name, "z")).status_code == 200


def test_flights_of_before_are_read(any_service: RunningService) -> None:
    """A row with the six columns that every upload had: read back, and taken for an identification."""
    name, _ = uploaded(any_service, flight(sweep=T))
    columns = {field: EXAMPLE_SAMPLE[field] for field in EXAMPLE_SAMPLE if field.endswith(("_s", "_rad"))}
    with any_service.database.write() as session:
        session.execute(
            update(trajectories).where(trajectories.c.id == name).values(document=packed(columns))
        )
    back = any_service.client.get(f"/trajectories/{name}").json()
    assert {field: back[field] for field in columns} == columns
    for axes in (("z",), ("x",)):
        (sample,) = stored(any_service, request(name, *axes))["samples"]
        assert sample["sweep_left_rad"] == columns["sweep_left_rad"]


def test_json_without_a_drive_is_refused(service: RunningService) -> None:
    """As a file is."""
    columns = dict.fromkeys(("time_s", "phi_rad", "theta_rad", "psi_rad"), T)
    (found,) = fault(service.client.post("/trajectories", json=columns))["errors"]
    assert (found["code"], found["pointer"]) == ("missing", "/sweep_left_rad")
    assert "fold_left_rad" in found["hint"]


def test_channels_survive_upload_reading_back_and_identification(any_service: RunningService) -> None:
    """In SI units, with null where a cell is empty, from a file and as JSON alike."""
    content = flight(sweep=T, q_deg_s=[1, "", 2, 3], tip_right_z_mm=[1, 2, 3, 4], nz=["x"] * 4)
    name, back = uploaded(any_service, content)
    assert back["q_rad_s"][1] is None
    np.testing.assert_allclose([back["q_rad_s"][row] for row in (0, 2, 3)], np.deg2rad([1, 2, 3]))
    np.testing.assert_allclose(back["tip_right_z_m"], [1e-3, 2e-3, 3e-3, 4e-3])
    assert "nz" not in back
    assert "nz is 'x', not a finite number" in back["unreadable"]["nz"]
    (sample,) = stored(any_service, request(name, "z"))["samples"]
    assert {field: sample[field] for field in ("q_rad_s", "tip_right_z_m")} == {
        field: back[field] for field in ("q_rad_s", "tip_right_z_m")
    }
    columns = {field: values for field, values in back.items() if isinstance(values, list)}
    again = any_service.client.post("/trajectories", json=columns | {"p_deg_s": [0, None, 90, 180]})
    assert again.status_code == 201, again.text
    read = any_service.client.get(again.headers["location"]).json()
    assert read["p_rad_s"] == [0.0, None, np.pi / 2, np.pi]
    assert {field: read[field] for field in columns} == columns


def test_odd_names_of_channels_harm_nothing(service: RunningService) -> None:
    """A surface's name as long as one may be, and what is no name of a column."""
    long = f"tip_z_{'x' * 150}"
    _, back = uploaded(service, flight(**{"sweep": T, long: ["?"] * 4, "tip_z_<b>": T, "tip_z_ü": ["?"] * 4}))
    assert "not a finite number" in back["unreadable"][long]
    assert not [name for name in back if "<" in name or "ü" in name]


def test_what_is_declared_about_a_file_counts(any_service: RunningService) -> None:
    """Axes, a numbered quaternion, columns with a scale, a window of time: as the library reads them."""
    half = 0.5**0.5
    rows = "\n".join(f"{t},{half},0,0,{half},{1000 + 100 * t},{t}" for t in (0, 1, 2, 3, 4))
    said = {"earth": "ENU", "body": "FLU", "quaternion": "wxyz", "between": "[1, 3]"}
    said["columns"] = '{"sweep_deg": "servo*0.1-100"}'
    answer = upload(any_service, f"t,q0,q1,q2,q3,servo,vx\n{rows}".encode(), "flight.csv", **said)
    assert answer.status_code == 201, answer.text
    back = any_service.client.get(answer.headers["location"]).json()
    assert back["time_s"] == [1.0, 2.0, 3.0]
    np.testing.assert_allclose(back["psi_rad"], 0.0, atol=1e-15)  # its x axis points to y: north
    np.testing.assert_allclose(back["sweep_rad"], np.deg2rad([10.0, 20.0, 30.0]))
    assert back["vy_m_s"] == [1.0, 2.0, 3.0]
    (sample,) = stored(any_service, request(answer.json()["id"], "z"))["samples"]
    assert sample["sweep_rad"] == back["sweep_rad"]


@pytest.mark.parametrize(
    ("parts", "pointer"),
    [
        ({"earth": "north"}, "/earth"),
        ({"quaternion": "zyxw"}, "/quaternion"),
        ({"columns": "sweep=servo"}, "/columns"),
        ({"columns": '{"sweep": 5}'}, "/columns/sweep"),
        ({"columns": '{"2nd": "servo"}'}, "/columns/2nd"),
        ({"columns": '{"sweep": "servo"}'}, "/file"),
        ({"between": "[3, 1]"}, "/between"),
        ({"between": "{}"}, "/between"),
    ],
)
def test_odd_declarations_are_refused_by_their_part(
    service: RunningService, parts: dict[str, str], pointer: str
) -> None:
    """Before the file is read, or because it lacks what was declared."""
    answer = upload(service, flight(sweep=T), "flight.csv", **parts)
    assert fault(answer)["pointer"] == pointer


def test_samples_inline_in_other_axes_reach_the_job(service: RunningService) -> None:
    """A quaternion, checked like angles; JSON uploads read back turned."""
    columns = {"time_s": T, "sweep_rad": T, "frames": {"earth": "ENU", "body": "FLU"}, "vx_m_s": T}
    columns |= {"qw": [0.5**0.5] * 4, "qx": [0.0] * 4, "qy": [0.0] * 4, "qz": [0.5**0.5] * 4}
    answer = service.client.post("/trajectories", json=columns)
    assert answer.status_code == 201, answer.text
    back = service.client.get(answer.headers["location"]).json()
    np.testing.assert_allclose(back["psi_rad"], 0.0, atol=1e-15)
    assert back["vy_m_s"] == T
    assert not {"qw", "frames"} & set(back)
    inline = {**EXAMPLE_REQUEST, "samples": [{"name": "a", **columns}]}
    assert service.client.post("/validate/identify", json=inline).status_code == 200
    inline["samples"][0]["qw"] = [1.0] * 4
    (found,) = fault(service.client.post("/validate/identify", json=inline))["errors"]
    assert (found["code"], found["pointer"]) == ("no_rotation", "/samples/0/qw/0")


def test_logs_and_hdf5_are_read_by_the_service(service: RunningService, tmp_path: Path) -> None:
    """In the confined process, with their libraries."""
    as_matlab(tmp_path / "a.mat", COLUMNS, "flight")
    answer = upload(service, (tmp_path / "a.mat").read_bytes(), "a.mat")
    assert answer.status_code == 201, answer.text
    assert answer.json()["rows"] == 50
    columns = '{"sweep_deg": "actuator_outputs.output[0]*0.09-135"}'
    answer = upload(service, log(), "a.ulg", columns=columns)
    assert answer.status_code == 201, answer.text
    back = service.client.get(answer.headers["location"]).json()
    np.testing.assert_allclose(back["theta_rad"], EULER[:, 1], atol=1e-6)
    assert len(back["p_rad_s"]) == len(EULER)
    assert fault(upload(service, log(), "a.ulg"))["errors"][0]["code"] == "missing"
