"""The OpenAPI document: what FastAPI makes of the routes, made exact. ``python -m app.openapi`` writes it."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi

from app.errors import (
    CrossSiteRequest,
    DatabaseAway,
    MissingScope,
    StorageFull,
    TooManyRefusals,
    Unauthorized,
    WrongHost,
)
from app.http.problems import MEDIA_TYPE, documented
from app.trajectories.endpoints import FORM_SCHEMA
from app.trajectories.schemas import TrajectoryUpload
from app.webhooks.endpoints import messages
from morphdata.operations import OPERATIONS
from morphdata.version import VERSION

DOCUMENT = Path(__file__).parent.parent / "docs" / "openapi.json"
PROBLEM = "#/components/schemas/Problem"
PROBLEM_CONTENT = {MEDIA_TYPE: {"schema": {"$ref": PROBLEM}}}
_AUTHENTICATE = {"WWW-Authenticate": {"description": "How, and for what.", "schema": {"type": "string"}}}
_RETRY_AFTER = {
    "Retry-After": {"description": "Seconds to wait before retrying.", "schema": {"type": "string"}}
}
REFUSAL_HEADERS: dict[int | str, dict[str, Any]] = {
    401: _AUTHENTICATE,
    403: _AUTHENTICATE,
    421: {},
    429: _RETRY_AFTER,
}
WITHOUT_DATABASE = frozenset({"/livez"})
DESCRIPTION = """Fast equivalent models of sweep-morphing flexible aircraft, identified from sample flights.

Long work is a job: the POST answers `202` with a job at once; follow it by `GET /jobs/{id}`
(`Prefer: wait=30`), by its events, or on the page at `/`. Units are SI and radians, and stand in the names of
the fields. Every error is a problem document (RFC 9457) with a stable `code`, a `pointer` to the field and a
`hint`.

A service beyond its own machine demands an API key: `Authorization: Bearer mid_...`. Each operation names the
scope that the key must have; `GET /me` tells what yours has.
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
        _add_outages(document)
        _add_refusals(document)
        _name_problem_media_type(document)
        _add_upload_schemas(document)
        app.openapi_schema = document
    return app.openapi_schema


def _add_outages(document: dict[str, Any]) -> None:
    """Whatever asks the database can meet one that is away or full."""
    entry = documented(DatabaseAway, StorageFull)[DatabaseAway.status]
    response = {
        "description": entry["description"],
        "headers": {
            "Retry-After": {"description": "When to repeat the request, s.", "schema": {"type": "string"}}
        },
        "content": {"application/json": {"schema": {"$ref": PROBLEM}}},
    }
    for path, operations in document["paths"].items():
        if path not in WITHOUT_DATABASE:
            for operation in operations.values():
                known = operation["responses"].setdefault(str(DatabaseAway.status), dict(response))
                if known["description"] != response["description"]:  # the route has a reason of its own
                    known["description"] += f"; {response['description']}"
                    known["headers"] = response["headers"]


def _add_refusals(document: dict[str, Any]) -> None:
    """Document what the gate answers before a route is reached: the same for all of them."""
    strangers = documented(CrossSiteRequest, WrongHost)
    callers = documented(Unauthorized, MissingScope, CrossSiteRequest, WrongHost, TooManyRefusals)
    for operations in document["paths"].values():
        for operation in operations.values():
            for status, told in (callers if "security" in operation else strangers).items():
                known = operation["responses"].setdefault(str(status), {"description": ""})
                known.setdefault("content", PROBLEM_CONTENT)
                known.setdefault("headers", REFUSAL_HEADERS[status])
                texts = (known["description"], told["description"])
                known["description"] = "; ".join(dict.fromkeys(filter(None, texts)))


def _name_problem_media_type(document: dict[str, Any]) -> None:
    """Errors are ``application/problem+json``, not ``application/json``."""
    for operations in document["paths"].values():
        for operation in operations.values():
            for response in operation["responses"].values():
                content = response.get("content", {})
                plain = content.get("application/json", {}).get("schema", {})
                if plain.get("$ref") == PROBLEM:
                    response["content"] = {MEDIA_TYPE: content["application/json"]}


def _add_upload_schemas(document: dict[str, Any]) -> None:
    """Add the two bodies of POST /trajectories, which FastAPI does not see."""
    schemas = document["components"]["schemas"]
    schemas["TrajectoryFile"] = FORM_SCHEMA
    schemas["TrajectoryUpload"] = TrajectoryUpload.model_json_schema(
        ref_template="#/components/schemas/{model}"
    )


def document_text() -> str:
    """Return the document as it is committed."""
    from app.main import routed_app

    document = openapi_document(routed_app())
    # the version comes from the installation; the committed document must not change by it
    document["info"]["version"] = "1"
    return json.dumps(document, indent=2, ensure_ascii=False, sort_keys=True) + "\n"


if __name__ == "__main__":
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else DOCUMENT
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_text(document_text(), encoding="utf-8")
