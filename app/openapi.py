"""The OpenAPI document: FastAPI's, with corrections and additions. ``python -m app.openapi`` writes it."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi
from pydantic import BaseModel
from pydantic.json_schema import JsonSchemaMode, models_json_schema

from app.errors import (
    CrossSiteRequest,
    DatabaseAway,
    MissingScope,
    ServiceError,
    StorageFull,
    TooManyRefusals,
    Unauthorized,
    WrongHost,
)
from app.http.problems import documented
from app.schemas.problem import Problem
from app.trajectories.endpoints import FORM_SCHEMA
from app.trajectories.schemas import TrajectoryUpload
from app.webhooks.endpoints import messages
from morphdata.operations import OPERATIONS
from morphdata.version import VERSION

DOCUMENT = Path(__file__).parent.parent / "docs" / "openapi.json"
SCHEMA_REF = "#/components/schemas/{model}"
AUTHENTICATE = {"WWW-Authenticate": {"description": "How, and for what.", "schema": {"type": "string"}}}
RETRY_AFTER = {
    "Retry-After": {"description": "Seconds to wait before retrying.", "schema": {"type": "string"}}
}
HEADERS: dict[int | str, dict[str, Any]] = {
    401: AUTHENTICATE,
    403: AUTHENTICATE,
    421: {},
    429: RETRY_AFTER,
    503: RETRY_AFTER,
}
WITHOUT_DATABASE = frozenset({"/livez"})
DESCRIPTION = """Fast equivalent models of sweep-morphing flexible aircraft, identified from sample flights.

Long work is a job: the POST answers `202` with a job at once; follow it by `GET /jobs/{id}` (`Prefer:
wait=30`), by its events, or on the page at `/`. Units are SI and radians, and are part of the field names.
Every error is a problem document (RFC 9457) with a stable `code`, a `pointer` to the field and a `hint`.

A service reachable from other machines requires an API key: `Authorization: Bearer mid_...`. Each operation
names the scope that the key must have; `GET /me` shows the scopes of yours.
"""
TAGS = [
    *({"name": operation.name, "description": operation.subject} for operation in OPERATIONS),
    {"name": "jobs", "description": "Jobs: state, events, results."},
    {"name": "trajectories", "description": "Sample flights as files."},
    {"name": "models", "description": "Identified models."},
    {"name": "webhooks", "description": "Messages to your URL when jobs end."},
    {"name": "keys", "description": "The caller's identity, scopes and quotas."},
    {"name": "health", "description": "For machines."},
]


def openapi_document(app: FastAPI) -> dict[str, Any]:
    """Return the document of `app`, made once."""
    if app.openapi_schema is None:
        document = get_openapi(
            title="MorphID",
            version=VERSION,
            summary="Equivalent models of sweep-morphing aircraft from sample flights",
            description=DESCRIPTION,
            routes=app.routes,
            webhooks=messages.routes,
            tags=TAGS,
            license_info={"name": "Apache-2.0", "identifier": "Apache-2.0"},
        )
        _add_shared_errors(document)
        _add_schemas(document)
        app.openapi_schema = document
    return app.openapi_schema


def _add_shared_errors(document: dict[str, Any]) -> None:
    """Document the gate's responses, and those for a database that is unavailable or full."""
    for path, operations in document["paths"].items():
        outages = () if path in WITHOUT_DATABASE else (DatabaseAway, StorageFull)
        for operation in operations.values():
            errors: list[type[ServiceError]] = [CrossSiteRequest, WrongHost, *outages]
            if "security" in operation:
                errors = [Unauthorized, MissingScope, *errors, TooManyRefusals]
            for status, shared in documented(*errors).items():
                own = operation["responses"].setdefault(str(status), {"content": shared["content"]})
                own.setdefault("headers", HEADERS[status])
                texts = (own.get("description"), shared["description"])
                own["description"] = "; ".join(filter(None, texts))


def _add_schemas(document: dict[str, Any]) -> None:
    """Add problem documents and the two bodies of POST /trajectories, which FastAPI does not see."""
    models: list[tuple[type[BaseModel], JsonSchemaMode]] = [
        (Problem, "serialization"),
        (TrajectoryUpload, "validation"),
    ]
    _, schemas = models_json_schema(models, ref_template=SCHEMA_REF)
    document["components"]["schemas"] |= {**schemas["$defs"], "TrajectoryFile": FORM_SCHEMA}


def document_text() -> str:
    """Return the document in its committed form."""
    from app.main import routed_app

    document = openapi_document(routed_app())
    # the version comes from the installation and must not change the committed document
    document["info"]["version"] = "1"
    return json.dumps(document, indent=2, ensure_ascii=False, sort_keys=True) + "\n"


if __name__ == "__main__":
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else DOCUMENT
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_text(document_text(), encoding="utf-8")
