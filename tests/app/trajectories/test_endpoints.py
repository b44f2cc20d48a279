"""Laws of the endpoints of trajectories."""

from __future__ import annotations

import httpx
import pytest

from tests.app.request_documents import EXAMPLES, channel_columns, sample_document
from tests.app.running_service import RunningService

NAME = "train_rate_0.8"


def upload(service: RunningService, content: bytes, filename: str, **fields: str) -> httpx.Response:
    """Upload a file as a form."""
    return service.client.post("/trajectories", files={"file": (filename, content)}, data=fields)


def test_upload_reads_back_as_sent(any_service: RunningService) -> None:
    """A CSV file and the same flight as JSON read back alike, to the last digit."""
    as_file = upload(any_service, (EXAMPLES / f"{NAME}.csv").read_bytes(), f"{NAME}.csv")
    columns = {key: value for key, value in sample_document(NAME).items() if key not in ("name", "role")}
    columns |= channel_columns(NAME)
    as_json = any_service.client.post("/trajectories", json={"name": NAME, **columns})
    for answer in (as_file, as_json):
        assert answer.status_code == 201
        summary = answer.json()
        assert (summary["name"], summary["rows"]) == (NAME, 175)
        back = any_service.client.get(answer.headers["location"]).json()
        assert back == {**summary, **columns}


def test_name_comes_from_the_form_or_the_file(service: RunningService) -> None:
    """The form's name wins; a file's name is made plain."""
    content = (EXAMPLES / f"{NAME}.csv").read_bytes()
    assert upload(service, content, "x.csv", name="mine").json()["name"] == "mine"
    assert upload(service, content, "../my flight (1).csv").json()["name"] == "my-flight--1-"
    assert upload(service, content, "x.csv", name="../mine").json()["errors"][0]["pointer"] == "/name"


@pytest.mark.parametrize("filename", ["flight.xlsx", "flight.csv.gz", "flight.zip", "flight.h5"])
def test_other_formats_are_refused_by_name(service: RunningService, filename: str) -> None:
    """A format that is not read gets 415 with those that are."""
    answer = upload(service, b"PAR1", filename)
    assert (answer.status_code, answer.json()["code"]) == (415, "unsupported_media_type")
    assert "CSV" in answer.json()["hint"]


@pytest.mark.parametrize(
    ("content", "pointer"),
    [
        (b"t,sweep_left,sweep_right,phi,theta,psi\n" + b"0,0,0,0,0,0\n" * 5, "/file/time_s/1"),
        (b"t,sweep_left,sweep_right,phi,theta,psi\n0,0,0,0,0,0\n", "/file"),
        (b"t,sweep_left,sweep_right,phi,theta,psi\n0,0,0,0,x,0\n", "/file/0/theta"),
        (b"t,sweep_left,sweep_right,phi,theta,psi\n0,0,0,0,0\n", "/file/0"),
        (
            b"t,sweep_left,sweep_right,phi,theta,psi\n"
            + b"".join(b"%d,0,0,0,5000,0\n" % i for i in range(5)),
            "/file/0/theta_rad",
        ),
        (b"\xff\xfe\x00\x01", "/file"),
    ],
)
def test_bad_flights_are_refused_by_place(service: RunningService, content: bytes, pointer: str) -> None:
    """Row and column of what is wrong are named."""
    answer = upload(service, content, "x.csv")
    assert answer.status_code == 422, answer.text
    assert answer.json()["errors"][0]["pointer"] == pointer


def test_odd_forms_are_refused(service: RunningService) -> None:
    """A form without a file, with unknown parts, or broken gets a problem that says what to send."""
    client = service.client
    content = (EXAMPLES / f"{NAME}.csv").read_bytes()
    assert client.post("/trajectories", files={"name": (None, "x")}).json()["errors"] == []
    assert client.post("/trajectories", files={"name": (None, "x")}).json()["pointer"] == "/file"
    assert upload(service, content, "x.csv", colour="red").json()["pointer"] == "/colour"
    broken = {"Content-Type": "multipart/form-data; boundary=x"}
    assert client.post("/trajectories", content=b"--y nonsense", headers=broken).status_code == 400
    two = [("file", ("a.csv", content)), ("file", ("b.csv", content))]
    assert client.post("/trajectories", files=two).status_code == 400
    assert (
        client.post("/trajectories", content=content, headers={"Content-Type": "text/csv"}).status_code == 415
    )


def test_json_faults_are_named(service: RunningService) -> None:
    """A bad JSON flight gets pointers from the root of the document."""
    document = {key: value for key, value in sample_document(NAME).items() if key != "role"}
    document["phi_rad"] = document["phi_rad"][:-1]
    assert service.client.post("/trajectories", json=document).json()["pointer"] == "/phi_rad"
    del document["phi_rad"]
    assert service.client.post("/trajectories", json=document).json()["pointer"] == "/phi_rad"
