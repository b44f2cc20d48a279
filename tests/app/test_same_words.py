"""The service and the library judge one request alike, and in the same words."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from morphcore import load_trajectory
from morphcore.errors import InvalidInput
from morphdata.base import Document
from morphdata.samplefiles.fault import as_sentence
from morphdata.samples import InlineSample
from tests.app.calls import changed, fault, post
from tests.app.request_documents import identify_document, sample_document
from tests.app.running_service import RunningService

NAME = "train_rate_0.8"
COLUMNS = ("t", "sweep_left", "sweep_right", "phi", "theta", "psi")
BAD: dict[str, tuple[str, Any]] = {
    "degrees": ("theta_rad", np.rad2deg),
    "milliseconds": ("time_s", lambda times: 1000.0 * times),
    "no angle at all": ("psi_rad", lambda angles: 2000.0 + angles),
    "time that falls": ("time_s", lambda times: np.where(np.arange(times.size) == 19, 0.0, times)),
}


def spoiled(bad: str) -> dict[str, Any]:
    """An example flight that is wrong in one column."""
    document = sample_document(NAME)
    column, change = BAD[bad]
    return {**document, column: change(np.array(document[column])).tolist()}


def as_csv(document: dict[str, Any]) -> str:
    """The file that holds the same flight, its titles without units."""
    stream = io.StringIO()
    writer = csv.writer(stream)
    writer.writerow(COLUMNS)
    named = ["time_s" if name == "t" else f"{name}_rad" for name in COLUMNS]
    writer.writerows(zip(*(document[name] for name in named), strict=True))
    return stream.getvalue()


@pytest.mark.parametrize("bad", BAD)
def test_a_flight_is_refused_in_the_librarys_words(service: RunningService, bad: str, tmp_path: Any) -> None:
    """Inline in a request, uploaded as JSON and uploaded as a file: what the library says of the same."""
    document = spoiled(bad)
    with pytest.raises(InvalidInput) as inline:
        InlineSample.parse(document, "/samples/2")
    said = inline.value.message, inline.value.hint
    requested = changed(identify_document(), "/samples/2", document)
    found = fault(post(service, "/identify", requested))
    assert (found["detail"], found["hint"], found["pointer"]) == (*said, inline.value.pointer)
    plain = {name: value for name, value in document.items() if name != "role"}
    uploaded = fault(post(service, "/trajectories", plain))
    assert (uploaded["detail"], uploaded["hint"]) == said

    path = tmp_path / "flight.csv"
    path.write_text(as_csv(document))
    with pytest.raises(InvalidInput) as read:
        load_trajectory(path)
    form = {"file": (path.name, path.read_bytes())}
    sent = service.client.post("/trajectories", files=form).json()["errors"][0]
    assert read.value.message.endswith(f": {sent['detail'][0].lower()}{sent['detail'][1:-1]}")
    assert as_sentence(read.value.hint) == sent["hint"]


def test_time_since_an_epoch_is_read_by_the_service(service: RunningService) -> None:
    """Milliseconds since 1970 in a file, seconds since 1970 inline: the flight counts from its first row."""
    document = sample_document(NAME)
    rows = as_csv(document).splitlines()[1:]
    begin = 1_714_564_800_000
    file = "\n".join(
        ["t_ms," + ",".join(COLUMNS[1:])]
        + [f"{begin + 10 * i},{row.split(',', 1)[1]}" for i, row in enumerate(rows)]
    )
    answer = service.client.post("/trajectories", files={"file": ("x.csv", file.encode())})
    assert answer.status_code == 201, answer.text
    times = service.client.get(answer.headers["location"]).json()["time_s"]
    assert times == pytest.approx([0.01 * i for i in range(len(rows))], rel=1e-12)
    inline = {**document, "time_s": [1e-3 * begin + time for time in document["time_s"]]}
    del inline["role"]
    answer = service.client.post("/trajectories", json=inline)
    assert answer.json()["duration_s"] == pytest.approx(document["time_s"][-1], abs=1e-6)


def strict_models(kind: type[Document] = Document) -> Iterator[type[Document]]:
    """Every model of a document that clients send."""
    for model in kind.__subclasses__():
        yield model
        yield from strict_models(model)


def alternatives(schema: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """What a value may be instead of another, choices within choices included."""
    yield schema
    for each in (*schema.get("anyOf", ()), *schema.get("oneOf", ())):
        yield from alternatives(each)


def whole_fields() -> list[tuple[type[Document], str, bool]]:
    """Every field that the JSON schema calls an integer, or a list of such."""
    from app.main import create_app  # noqa: F401 - loads every model

    found = []
    for model in set(strict_models()):
        for name, schema in model.model_json_schema()["properties"].items():
            kinds = {each.get("type") for each in alternatives(schema)}
            for each in alternatives(schema):
                kinds |= {f"array of {item.get('type')}" for item in alternatives(each.get("items", {}))}
            if kinds & {"integer", "array of integer"} and "number" not in kinds:
                found.append((model, name, "array of integer" in kinds))
    return sorted(found, key=lambda item: (item[0].__name__, item[1]))


def faults_at(model: type[Document], name: str, value: Any) -> set[str]:
    """Kinds of faults that a model finds in one field; the others are left out."""
    try:
        model.model_validate({name: value})
    except ValidationError as error:
        return {item["type"] for item in error.errors() if item["loc"][0] == name}
    return set()


@pytest.mark.parametrize(("model", "name", "listed"), whole_fields(), ids=str)
def test_a_whole_number_may_have_a_point(model: type[Document], name: str, listed: bool) -> None:  # noqa: FBT001
    """3.0 is an integer of JSON Schema; 3.5, true and a text are none."""
    for value, whole in ((5, True), (5.0, True), (3.5, False), (True, False), ("3", False)):
        found = faults_at(model, name, [value] if listed else value)
        assert ("int_type" not in found) is whole, (value, found)


def test_the_walk_finds_the_whole_numbers() -> None:
    """Of every request some are among them."""
    names = {name for _, name, _ in whole_fields()}
    assert names >= {
        "links_per_wing",
        "seed",
        "particles",
        "generations",
        "chordwise",
        "priority",
        "elements",
    }
