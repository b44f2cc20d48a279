"""Laws of the OpenAPI document."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from app.main import routed_app
from app.openapi import DOCUMENT, document_text
from tests.app.request_documents import (
    EXPORT_RESULT,
    OPTIMIZE_RESULT,
    RESULT,
    SIMULATE_RESULT,
    STUDY_RESULT,
    export_document,
    identify_document,
    optimize_document,
    simulate_document,
    study_document,
)

Document = dict[str, Any]

REQUESTS = [
    ("IdentifyRequest", identify_document),
    ("StudyRequest", study_document),
    ("SimulateRequest", simulate_document),
    ("OptimizeRequest", optimize_document),
    ("ExportRequest", export_document),
]
RESULTS = [RESULT, STUDY_RESULT, SIMULATE_RESULT, OPTIMIZE_RESULT, EXPORT_RESULT]


@pytest.fixture(scope="module")
def document() -> Document:
    """The document as it is committed."""
    parsed: Document = json.loads(DOCUMENT.read_text(encoding="utf-8"))
    return parsed


def operations(document: Document) -> list[Document]:
    """Every operation of the document."""
    return [operation for path in document["paths"].values() for operation in path.values()]


def test_committed_document_is_the_services() -> None:
    """docs/openapi.json is what the code says; ``python -m app.openapi`` regenerates it."""
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
    assert {"/identify", "/optimize", "/jobs/{job_id}/events", "/trajectories"} <= set(document["paths"])
    assert paths - set(document["paths"]) <= {"/", "/docs", "/openapi.json", "/static", "/static/swagger", ""}


@pytest.mark.parametrize(("name", "request_document"), REQUESTS, ids=[name for name, _ in REQUESTS])
def test_examples_are_valid_by_the_document(
    document: Document, name: str, request_document: Callable[[], Document]
) -> None:
    """Examples and the tests' requests are valid by the published schema, which refuses unknown fields."""
    schema = {"$ref": f"#/components/schemas/{name}", "components": document["components"]}
    validator = pytest.importorskip("jsonschema_rs").validator_for(schema)
    request = request_document()
    validator.validate(request)
    assert document["components"]["schemas"][name]["examples"]
    for example in document["components"]["schemas"][name]["examples"]:
        validator.validate(example)
    assert not validator.is_valid({**request, "unknown": 1})


@pytest.mark.parametrize("result", RESULTS)
def test_results_are_valid_by_the_document(document: Document, result: Document) -> None:
    """A result of each operation is valid by the published answer, and by one of its forms alone."""
    answer = document["paths"]["/jobs/{job_id}/result"]["get"]["responses"]["200"]
    forms = answer["content"]["application/json"]["schema"]["anyOf"]
    fits = [
        pytest.importorskip("jsonschema_rs")
        .validator_for({**form, "components": document["components"]})
        .is_valid(result)
        for form in forms
    ]
    assert (len(fits), sum(fits)) == (len(RESULTS), 1)


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
    assert {"identify", "study", "simulate", "optimize", "export", "export_model"} <= made
    assert {"get_job", "get_job_result", "upload_trajectory", "list_models"} <= made
