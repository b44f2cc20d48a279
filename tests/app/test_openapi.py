"""Laws of the OpenAPI document."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from app.main import routed_app
from app.openapi import DOCUMENT, document_text
from tests.app.request_documents import identify_document

Document = dict[str, Any]


@pytest.fixture(scope="module")
def document() -> Document:
    """The document as it is committed."""
    parsed: Document = json.loads(DOCUMENT.read_text(encoding="utf-8"))
    return parsed


def operations(document: Document) -> list[Document]:
    """Every operation of the document."""
    return [operation for path in document["paths"].values() for operation in path.values()]


def test_committed_document_is_the_services() -> None:
    """docs/openapi.json is what the code says; ``python -m app.openapi`` writes it anew."""
    assert DOCUMENT.read_text(encoding="utf-8") == document_text()


def test_operations_have_stable_names(document: Document) -> None:
    """Every operation has a unique, plain operation id, a summary and a description."""
    names = [operation["operationId"] for operation in operations(document)]
    assert len(set(names)) == len(names)
    assert all(name.isidentifier() and name.islower() for name in names)
    assert all(operation["summary"] and operation["description"] for operation in operations(document))


def test_errors_are_problem_documents(document: Document) -> None:
    """Every documented error is a problem document, but for the two health answers."""
    for operation in operations(document):
        for status, response in operation["responses"].items():
            if status >= "400" and operation["operationId"] != "get_readiness":
                assert list(response["content"]) == ["application/problem+json"], operation["operationId"]
                assert response["description"]


def test_every_route_is_documented(document: Document) -> None:
    """No route of the API is missing from the document but the pages."""
    paths = {getattr(route, "path", "") for route in routed_app().routes}
    assert {"/identify", "/jobs/{job_id}/events", "/trajectories"} <= set(document["paths"])
    assert paths - set(document["paths"]) <= {"/", "/docs", "/openapi.json", "/static", "/static/swagger", ""}


def test_example_is_valid_by_the_document(document: Document) -> None:
    """The example flights are valid by the published schema, which refuses an unknown field."""
    schema = {"$ref": "#/components/schemas/IdentifyRequest", "components": document["components"]}
    validator = pytest.importorskip("jsonschema_rs").validator_for(schema)
    request = identify_document()
    validator.validate(request)
    for example in document["components"]["schemas"]["IdentifyRequest"]["examples"]:
        validator.validate(example)
    assert not validator.is_valid({**request, "unknown": 1})


def test_client_generates_without_a_warning(tmp_path: Path) -> None:
    """openapi-python-client makes a client of the document and has nothing to complain about."""
    binaries = Path(sys.executable).parent
    subprocess.run(
        [
            binaries / "openapi-python-client",
            "generate",
            "--path",
            DOCUMENT,
            "--fail-on-warning",
            "--meta",
            "none",
        ],
        cwd=tmp_path,
        check=True,
        capture_output=True,
        env={"PATH": f"{binaries}:/usr/bin:/bin", "HOME": str(tmp_path)},
    )
    made = {path.stem for path in tmp_path.rglob("api/*/*.py")}
    assert {"identify", "get_job", "get_job_result", "upload_trajectory", "list_models"} <= made
